# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Find the bridge's parameters in a ROS parameter file.

A file may serve many nodes: ``NODE: {ros__parameters: …}``, the node name possibly split over
nested namespaces. ``validate`` and ``simulate`` have no node name; they take the one section that
holds ``buses``. What makes rcl refuse the whole file counts in every section, what only garbles
parameters counts in ours.
"""

from dataclasses import dataclass
from pathlib import Path as FilePath
import re

from drive_can_bridge.configuration.problems import Path, Problem, show, suggestion, Tree
from drive_can_bridge.configuration.reader import BrokenYaml, DUPLICATE, Events, Rules, TreeReader

PARAMETERS_KEY = 'ros__parameters'
#: tells the section of a bridge from those of other nodes
MARK = 'buses'

_TOKEN = re.compile(r'[A-Za-z_][A-Za-z0-9_]*|\*\*?', re.ASCII)


@dataclass(frozen=True)
class Section:
    """The parameters of one node name."""

    name: str
    tree: Tree
    garbled: list[Problem]


class FileReader:
    """Read all sections of a parameter file, and note what rcl does not take."""

    def __init__(self, file: str) -> None:
        self.sections: list[Section] = []
        self.problems: list[Problem] = []
        self.broken = False
        self._file = file

    def read(self, data: bytes) -> None:
        """Read a whole file. Never raises; see ``problems``."""
        try:
            events = Events(data)
            names: dict[Path, int] = {}
            while events.head is not None:
                if events.at('MappingStart'):
                    self._names(events, (), names)
                elif events.at('Scalar') or events.at('SequenceStart') or events.at('Alias'):
                    self._note(events.line, (), 'no mapping, allowed is '
                                                f'NODE_NAME: {{{PARAMETERS_KEY}: …}}')
                    events.skip()
                else:
                    events.take()
        except BrokenYaml as error:
            self.broken = True
            # what was noted on the way here may only follow from what is broken
            self.problems.clear()
            self._note(error.line, (), str(error))

    def _note(self, line: int, path: Path, message: str) -> None:
        self.problems.append(Problem(self._file, line, '/'.join(map(str, path)) or 'yaml',
                                     message))

    def _names(self, events: Events, path: Path, seen: dict[Path, int]) -> None:
        """Read a mapping above ``ros__parameters``: its keys are node names or namespaces."""
        events.take()
        parameters_line = 0
        while not events.at('MappingEnd'):
            line = events.line
            if not events.at('Scalar') or not events.head.value:
                self._note(line, path, 'a key that is no name, allowed are node names')
                events.skip()
                events.skip()
                continue
            key = str(events.take().value)
            here = (*path, key)
            if parameters_line:
                self._note(line, here, f'stands beside {PARAMETERS_KEY} (rcl refuses or garbles '
                                       'the file), allowed is a section of its own')
            if here in seen:
                self._note(line, here, f'{DUPLICATE}, allowed is one (the first is in line '
                                       f'{seen[here]})')
                events.skip()
                continue
            seen[here] = line
            if key.startswith(PARAMETERS_KEY) and key != PARAMETERS_KEY:
                # rcl compares the beginning only, and would take it for the real one.
                self._note(line, here, f'misspelt, allowed is {PARAMETERS_KEY}')
                events.skip()
            elif key == PARAMETERS_KEY:
                parameters_line = line
                self._parameters(events, path, line)
            elif events.at('MappingStart') and len(path) < 32:
                self._names(events, here, seen)
            else:
                hint = suggestion(key, [PARAMETERS_KEY]) if path else \
                    f'allowed is {PARAMETERS_KEY} below it'
                self._note(line, here, f'no mapping (rcl refuses the file), {hint}')
                events.skip()
        events.take()

    def _parameters(self, events: Events, path: Path, line: int) -> None:
        name = ''
        for part in map(str, path):
            name += part if not name or name.endswith('/') else f'/{part}'
        if not path:
            self._note(line, (PARAMETERS_KEY,), 'no node name above it, allowed is '
                                                f'NODE_NAME: {{{PARAMETERS_KEY}: …}}')
        elif not all(map(_TOKEN.fullmatch, name.removeprefix('/').split('/'))):
            self._note(line, path, f'{show(name)} is no node name (rcl refuses the file), allowed '
                                   'is for example /**/drive_can_bridge')
        if not events.at('MappingStart'):
            self._note(line, (*path, PARAMETERS_KEY), 'no mapping, allowed are parameters')
            events.skip()
            return
        reader = TreeReader(events, self._file, Rules.PARAMETERS)
        try:
            reader.read()
        finally:
            self.sections.append(Section(name, reader.tree, reader.garbled))
            self.problems.extend(reader.problems)


def _sections_with(reader: FileReader, key: str) -> list[Section]:
    return [section for section in reader.sections
            if any(str(place[0]).split('.')[0] == key for place in section.tree.lines if place)]


def section_names(path: FilePath) -> list[str]:
    """
    Return the names of the nodes that a parameter file has sections for.

    :raises OSError: the file cannot be read.
    """
    reader = FileReader(str(path))
    reader.read(path.read_bytes())
    return [section.name for section in reader.sections]


def duplicate_keys(path: FilePath, node: str) -> list[Problem]:
    """
    Look for keys that a parameter file gives twice to a node.

    rcl takes the last of them without a word: a node that only sees what is left cannot tell.

    :param node: full name of the node.
    :return: nothing where the file has gone since: launch removes those that it wrote.
    """
    reader = FileReader(str(path))
    try:
        reader.read(path.read_bytes())
    except OSError:
        return []
    found = [problem for section in reader.sections if _is_for(section.name, node)
             for problem in section.garbled]
    found += [problem for problem in reader.problems if _is_for(problem.key, node)]
    return [problem for problem in found if problem.message.startswith(DUPLICATE)]


def _is_for(section: str, node: str) -> bool:
    """Tell whether rcl takes a section for a node: ``*`` is one token, ``**`` are any."""
    pattern = re.escape(f'/{section.removeprefix("/")}')
    pattern = pattern.replace(r'/\*\*', '(/[^/]+)*').replace(r'\*', '[^/]+')
    return re.fullmatch(pattern, node) is not None


def read_parameter_file(path: FilePath) -> tuple[Tree | None, list[Problem]]:
    """
    Read the bridge's section of a parameter file.

    :return: the section's tree, or None where there is not exactly one; and what is wrong.
    :raises OSError: the file cannot be read.
    """
    file = str(path)
    reader = FileReader(file)
    reader.read(path.read_bytes())
    problems = reader.problems
    if reader.broken:
        return None, problems
    # one with drives, but without buses, is meant for us, too: what is wrong with it can be told
    ours = _sections_with(reader, MARK) or _sections_with(reader, 'drives')
    for section in ours:
        problems.extend(section.garbled)
    if len(ours) == 1:
        return ours[0].tree, problems
    if ours:
        first, *others = ours
        problems.extend(
            Problem(file, section.tree.line((MARK,)), MARK,
                    f'in a second section, {section.name}; allowed is one section that holds it '
                    f'(the first is {first.name})')
            for section in others)
    elif not problems:
        names = ', '.join(section.name for section in reader.sections)
        found = f'; the file has: {names}' if names else ''
        problems.append(Problem(
            file, 1, MARK, 'no section of the file holds it, allowed is one '
                           f'/**/drive_can_bridge: {{{PARAMETERS_KEY}: {{{MARK}: …}}}}{found}'))
    return None, problems
