# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Find the bridge's parameters in a ROS parameter file.

A file may serve many nodes: ``NODE: {ros__parameters: …}``, the node name possibly split over
nested namespaces. ``validate`` and ``simulate`` use the one section that holds ``buses``, and
like rcl all others for the same node, such as ``/**``: the last in the file counts. What makes rcl
refuse the whole file counts in every section, what only garbles parameters counts in ours.
"""

from collections.abc import Iterable
from pathlib import Path as FilePath
import re
from typing import Any, NamedTuple

from drive_can_bridge.configuration.problems import Path, Problem, Tree
from drive_can_bridge.configuration.schema import definition
from drive_can_bridge.configuration.yaml_nodes import (
    BrokenYaml, NodeKind, read_documents, Rules, TreeReader, YamlNode)
from drive_can_bridge.core import complaints
from drive_can_bridge.core.complaints import suggestion
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.text import nearest

PARAMETERS_KEY = 'ros__parameters'
#: distinguishes the section of a bridge from those of other nodes
MARK = 'buses'
#: keys that hold entries by name, and the key of one of them
_OURS = {'buses': 'bus', 'drives': 'drive'}
#: keys that show a profile, which is no file for nodes
_PROFILE_KEYS = {'protocols', 'parameters'}
#: how much a key has to look like that to be a slip of the pen, and no namespace
_SLIP = 0.75
#: the node that a section with wildcards is meant for, where it leaves the name open
_NODE = 'drive_can_bridge'

_TOKEN = re.compile(r'[A-Za-z_][A-Za-z0-9_]*|\*\*?', re.ASCII)


class NodeSection(NamedTuple):
    """
    The parameters of one node name; the tree has the problems that only they have.

    :param refused: what rcl refuses, or what makes it garble what follows.
    :param twice: keys that stand twice.
    """

    name: str
    tree: Tree
    refused: list[Problem]
    twice: list[Problem]


class _FileReader:
    """
    Reads all sections of a parameter file, and records what rcl refuses.

    :raises OSError: the file cannot be read.
    """

    def __init__(self, path: FilePath) -> None:
        self.sections: list[NodeSection] = []
        self.problems: list[Problem] = []
        self.twice: list[Problem] = []      # of them, and of the sections: keys that stand twice
        self.broken = False
        self._file = str(path)
        self._lines: dict[Path, int] = {}
        try:
            documents = read_documents(path)
        except BrokenYaml as error:
            self.broken = True
            self._note(error.line, (), error.why)
            return
        for _, root in documents:
            if _PROFILE_KEYS <= {key.text for key, _ in root.pairs}:
                # a line for everything in it would not help
                self._note(root.line, (), complaints.is_profile(entry=PARAMETERS_KEY))
            elif root.kind is NodeKind.MAPPING:
                self._names(root, ())
            else:
                self._note(root.line, (), complaints.no_mapping(entry=PARAMETERS_KEY))

    def sections_with(self, key: str) -> list[NodeSection]:
        """Return the sections that have a key, or one that begins with it and a dot."""
        return [section for section in self.sections if any(
            str(place[0]).split('.')[0] == key for place in section.tree.lines if place)]

    def _note(self, line: int, path: Path, message: Sentence) -> None:
        self.problems.append(Problem(self._file, line, '/'.join(map(str, path)) or 'yaml',
                                     message))

    def _names(self, node: YamlNode, path: Path) -> None:
        """Read a mapping above ``ros__parameters``: its keys are node names or namespaces."""
        if path and _lacks_parameters(node):
            first, _ = next(iter(node.pairs))
            self._note(first.line, (PARAMETERS_KEY,), complaints.parameters_missing(
                section='/'.join(map(str, path))))
            return
        has_parameters = False
        for key, value in node.pairs:
            if key.kind is not NodeKind.SCALAR or not key.text:
                self._note(key.line, path, complaints.key_no_node_name())
                continue
            here = (*path, key.text)
            if has_parameters:
                self._note(key.line, here, complaints.beside_parameters(entry=PARAMETERS_KEY))
            if here in self._lines:
                self._note(key.line, here, complaints.duplicate_key(first=self._lines[here]))
                self.twice.append(self.problems[-1])
                continue
            self._lines[here] = key.line
            if key.text == PARAMETERS_KEY:
                has_parameters = True
                self._parameters(value, path, key.line)
            elif key.text.startswith(PARAMETERS_KEY) or path and nearest(
                    key.text, [PARAMETERS_KEY], cutoff=_SLIP) is not None:
                # rcl compares the beginning only, and would take a longer one for the real one
                self._note(key.line, here, complaints.misspelt(allowed=PARAMETERS_KEY))
            elif not path and key.text in _OURS:
                self._note(key.line, here, complaints.without_head(entry=PARAMETERS_KEY))
            elif value.kind is NodeKind.MAPPING:
                self._names(value, here)
            else:
                hint = suggestion(key.text, [PARAMETERS_KEY]) if path else \
                    complaints.allowed_below(entry=PARAMETERS_KEY)
                self._note(key.line, here, complaints.no_mapping_refused(hint=hint))

    def _parameters(self, node: YamlNode, path: Path, line: int) -> None:
        name = ''
        for part in map(str, path):
            name += part if not name or name.endswith('/') else f'/{part}'
        if not path:
            self._note(line, (PARAMETERS_KEY,), complaints.no_node_name_above(
                entry=PARAMETERS_KEY))
        elif not all(map(_TOKEN.fullmatch, name.removeprefix('/').split('/'))):
            self._note(line, path, complaints.no_node_name(name=name))
        if node.kind is not NodeKind.MAPPING:
            self._note(line, (*path, PARAMETERS_KEY), complaints.no_parameters())
            return
        reader = TreeReader(self._file, Rules.PARAMETERS, {
            (name,): definition(kind)['properties'] for name, kind in _OURS.items()})
        reader.read(node)
        self.sections.append(NodeSection(name, reader.tree, reader.refused, reader.twice))
        self.problems.extend(reader.refused)


def _lacks_parameters(node: YamlNode) -> bool:
    """Return whether our keys stand in a section where ``ros__parameters`` should be."""
    return any(key.text in _OURS and not _has_parameters(value)
               for key, value in node.pairs) and not _has_parameters(node)


def _has_parameters(node: YamlNode) -> bool:
    """Return whether ``ros__parameters``, or what is like it, is a key of a node."""
    return node.kind is NodeKind.MAPPING and any(
        nearest(key.text or '', [PARAMETERS_KEY], cutoff=_SLIP) is not None
        for key, _ in node.pairs)


def read_sections(path: FilePath) -> tuple[list[NodeSection], list[Problem]]:
    """
    Read the sections of all nodes, and what makes rcl refuse the file.

    :raises OSError: the file cannot be read.
    """
    reader = _FileReader(path)
    return reader.sections, reader.problems


def unseen_problems(paths: Iterable[FilePath], node: str,
                    ) -> tuple[list[Problem], list[Problem]]:
    """
    Return what rcl does silently to the parameters of a node.

    Of duplicate keys it uses the last, and what follows an empty mapping it puts into
    that: a node that only sees the result cannot notice.

    :param node: full name of the node.
    :return: duplicate keys; and what makes all that the node sees doubtful. Nothing of a file that
        is gone since: launch removes those that it wrote.
    """
    found: list[Problem] = []
    garbled: list[Problem] = []
    for path in paths:
        try:
            reader = _FileReader(path)
        except OSError:
            continue
        for section in reader.sections:
            if _is_for(section.name, node):
                found += section.twice
                garbled += section.refused
        found += [problem for problem in reader.twice if _is_for(problem.key, node)]
    return found, garbled


def directory_that_sets(paths: Iterable[FilePath], node: str, key: Path,
                        value: object) -> FilePath | None:
    """
    Return the directory of the last file that sets a key of a node to a value; None: none does.

    :param node: full name of the node.
    """
    for path in reversed(list(paths)):
        try:
            sections = _FileReader(path).sections
        except OSError:
            continue
        for section in sections:
            found: Any = section.tree.data if _is_for(section.name, node) else None
            for part in key:
                found = found.get(part) if isinstance(found, dict) else None
            if found == value:
                return path.absolute().parent
    return None


def _is_for(section: str, node: str) -> bool:
    """Return whether a section is for a node: ``*`` is one token, ``**`` are any."""
    # several in a row are one: tried in all ways, they would take for ever
    section = re.sub(r'(/\*\*)+', '/**', f'/{section.removeprefix("/")}')
    pattern = re.escape(section)
    pattern = pattern.replace(r'/\*\*', '(/[^/]+)*').replace(r'\*', '[^/]+')
    return re.fullmatch(pattern, node) is not None


def read_parameter_file(path: FilePath) -> tuple[Tree | None, list[Problem]]:
    """
    Read the bridge's section of a parameter file.

    :return: the section's tree, or None where there is not exactly one; and what is wrong, which
        a tree has, too.
    :raises OSError: the file cannot be read.
    """
    reader = _FileReader(path)
    problems = reader.problems
    if reader.broken:
        return None, problems
    # one with drives, but without buses, is meant for us, too: its faults can be reported
    ours = reader.sections_with(MARK) or reader.sections_with('drives')
    if len(ours) == 1:
        tree = _as_rcl_merges(reader.sections, ours[0])
        tree.problems[:0] = problems
        if ours[0].name.rpartition('/')[2] not in (_NODE, '*', '**'):
            tree.warnings.append(Problem(
                str(path), tree.line(()), ours[0].name, complaints.other_node_name(usual=_NODE)))
        return tree, tree.problems
    for section in ours:
        problems.extend(section.tree.problems)
    for section in ours[1:]:
        problems.append(Problem(
            str(path), section.tree.line((MARK,)), MARK, complaints.second_section(
                section=section.name, first=ours[0].name)))
    if not problems:
        names = ', '.join(section.name for section in reader.sections)
        problems.append(Problem(str(path), 1, MARK, (
            complaints.no_section_of(names=names) if names else complaints.no_section())))
    return None, problems


def _as_rcl_merges(sections: Iterable[NodeSection], own: NodeSection) -> Tree:
    """
    Return what the node of a section gets from all sections of a file.

    Those that are for it in other namespaces give a warning: where it will run is unknown here.
    """
    node = _some_node(own.name)
    together: dict[str, list[Tree]] = {}     # rcl keeps a name at its first place
    elsewhere: list[Problem] = []
    for name, tree, *_ in sections:
        other = _some_node(name)
        if _is_for(name, node):
            together.setdefault(name, []).append(tree)
        elif _is_for(own.name, other) and other.rpartition('/')[2] == node.rpartition('/')[2]:
            elsewhere.append(Problem(tree.file, tree.line(()), name, complaints.other_namespace(
                node=node)))
    merged, *later = (tree for found in together.values() for tree in found)
    for tree in later:
        _lay_over(merged, tree)
    merged.warnings.extend(elsewhere)
    return merged


def _some_node(section: str) -> str:
    """Return the full name of a node that a section is for, in the root namespace if it can be."""
    *above, name = section.removeprefix('/').split('/')
    return ''.join(f'/{_some_token(token)}' for token in (
        *(token for token in above if token != '**'), name))


def _some_token(pattern: str) -> str:
    return _NODE if _is_for(pattern, f'/{_NODE}') else pattern.replace('*', 'x')


def _lay_over(below: Tree, above: Tree) -> None:
    """Merge the parameters of a section over those of an earlier one."""
    def lay(path: Path, under: dict[str, Any], over: dict[str, Any]) -> None:
        for key, value in over.items():
            there, here = under.get(key), (*path, key)
            if isinstance(there, dict) and isinstance(value, dict):
                lay(here, there, value)
            elif key in under and isinstance(there, dict) != isinstance(value, dict):
                # rcl keeps both
                below.wrong(here, complaints.value_and_keys())
            else:
                under[key] = value

    below.lines.update(above.lines)
    below.damaged.update(above.damaged)
    below.incomplete.update(above.incomplete)
    below.problems.extend(above.problems)
    lay((), below.data, above.data)
