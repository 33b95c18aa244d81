# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
YAML files as nodes with lines, and from those to plain data, under the rules of ROS parameters.

Nodes are put together from PyYAML's event stream, as rcl does: only there can be seen what rcl
refuses (aliases, duplicate anchors). No recursion: no nesting of a file overflows the
C stack. Everything wrong is recorded and reading goes on.
"""

from collections.abc import Container, Iterator, Mapping
from enum import Enum
from errno import EFBIG, EINVAL
from pathlib import Path as FilePath
import re
from types import MappingProxyType
from typing import Any, NamedTuple

import yaml

from drive_can_bridge.configuration.problems import Path, Problem, Tree
from drive_can_bridge.configuration.scalars import read_scalar, Scalar
from drive_can_bridge.core import complaints
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.text import describe_type


def read_regular(path: FilePath, limit: int) -> bytes:
    """
    Read a file.

    :param limit: MiB that it may have.
    :raises OSError: it cannot be read, is no file, or is too large.
    """
    # a pipe may keep us waiting, a device has no end
    if not path.is_file() and not path.is_dir() and path.exists():
        raise OSError(EINVAL, 'not a regular file, allowed is one', str(path))
    with path.open('rb') as file:
        data = file.read((limit << 20) + 1)
    if len(data) > limit << 20:
        raise OSError(EFBIG, f'too large, allowed are {limit} MiB', str(path))
    return data


# libyaml, which rcl uses as well, where PyYAML was built with it.
_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)

#: of what is read at all, in MiB and in levels
SIZE_MAX = 4
DEPTH_MAX = 32
_TOO_DEEP = complaints.too_deep(levels=DEPTH_MAX)
#: what is noticed to be wrong much later: where it begins is the line to look at
_OPENED = ('while scanning a quoted scalar', 'while parsing a flow', 'while scanning a simple key')

#: keys with a comma between them, as within braces
_TWO_KEYS = re.compile(rb'\s*(- +)?[\w.]+: [^#]*, *[\w.]+:( |$)')


class BrokenYaml(Exception):
    """The text is not YAML from here on."""

    def __init__(self, line: int, why: Sentence) -> None:
        super().__init__(why)
        self.line, self.why = line, why


class NodeKind(Enum):
    """The kinds of nodes."""

    SCALAR = 'scalar'
    LIST = 'list'
    MAPPING = 'mapping'
    ALIAS = 'alias'


class YamlNode(NamedTuple):
    """
    A part of a YAML text.

    :param line: where it begins, counted from 1.
    :param items: of a list; of a mapping its keys and values in turn.
    :param text: of a scalar, without quotes.
    """

    kind: NodeKind
    line: int
    items: list['YamlNode']
    text: str = ''
    quoted: bool = False
    tag: str | None = None

    @property
    def scalar(self) -> Scalar:
        """The value of a scalar, as rcl reads it."""
        return read_scalar(self.text, quoted=self.quoted, tag=self.tag)

    @property
    def pairs(self) -> Iterator[tuple['YamlNode', 'YamlNode']]:
        """Keys and values of a mapping."""
        return zip(self.items[::2], self.items[1::2])


class Document(NamedTuple):
    """One of the documents of a file: where it begins, and what it holds."""

    line: int
    root: YamlNode


def read_documents(path: FilePath) -> list[Document]:
    """
    Read a YAML file.

    :raises OSError: it cannot be read, is no file, or is too large.
    :raises BrokenYaml: it is no YAML.
    """
    return _documents(read_regular(path, SIZE_MAX))


def _documents(data: bytes) -> list[Document]:
    starts: list[int] = []
    roots: list[YamlNode] = []
    # the lists that nodes are added to: that of the documents, and those of all open nodes
    growing = [roots]
    line = 1
    try:
        for event in yaml.parse(data, Loader=_LOADER):
            line = event.start_mark.line + 1 if event.start_mark else line
            if isinstance(event, yaml.ScalarEvent):
                growing[-1].append(YamlNode(NodeKind.SCALAR, line, [], event.value,
                                            event.style in ("'", '"'), event.tag))
            elif isinstance(event, yaml.AliasEvent):
                growing[-1].append(YamlNode(NodeKind.ALIAS, line, []))
            elif isinstance(event, yaml.CollectionStartEvent):
                kind = NodeKind.LIST if isinstance(event,
                                                   yaml.SequenceStartEvent) else NodeKind.MAPPING
                node = YamlNode(kind, line, [])
                growing[-1].append(node)
                growing.append(node.items)
                if len(growing) > DEPTH_MAX + 1:
                    raise BrokenYaml(line, _TOO_DEEP)
            elif isinstance(event, yaml.CollectionEndEvent):
                growing.pop()
            elif isinstance(event, yaml.DocumentStartEvent):
                starts.append(line)
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise _broken(error, line, data) from None
    return list(map(Document, starts, roots))


def _broken(error: Exception, line: int, data: bytes) -> BrokenYaml:
    mark = getattr(error, 'problem_mark', None)
    context = str(getattr(error, 'context', ''))
    if context.startswith(_OPENED):
        mark = getattr(error, 'context_mark', None) or mark
    line = mark.line + 1 if mark is not None else line
    text = b''.join(data.splitlines()[line - 1:line])
    indentation = re.match(rb'\s*', text)
    if indentation is not None and b'\t' in indentation[0]:
        return BrokenYaml(line, complaints.tab())
    what = getattr(error, 'problem', None) or getattr(error, 'reason', None) or 'unreadable'
    if 'nesting' in what:   # libyaml has a limit of its own since PyYAML 6.0.4
        return BrokenYaml(line, _TOO_DEEP)
    if what.startswith('mapping values are not allowed') and _TWO_KEYS.match(text):
        return BrokenYaml(line, complaints.two_keys_in_line())
    if context.startswith('while scanning a quoted scalar'):
        what += ' (a quote is not closed)'
    elif context.startswith('while parsing a flow'):
        what += ' (a bracket is not closed, or a comma is missing)'
    in_mapping = context.startswith('while parsing a block mapping')
    return BrokenYaml(line, complaints.indented_like_no_key(what=what) if in_mapping else
                      complaints.not_yaml(what=what))


#: in place of a value that could not be read
_UNREADABLE = object()


class Rules(Enum):
    """The rules for the contents of a mapping."""

    #: below ``ros__parameters``: what rcl refuses or garbles is a problem
    PARAMETERS = 'parameters'
    #: a profile, which rcl never sees
    PROFILE = 'profile'


class TreeReader:
    """
    Reads one mapping, with everything below it, into a :class:`Tree`.

    What spoils this mapping only is recorded in the tree.

    :param entries: of mappings that hold entries by name, the keys that an entry may have.
    :ivar refused: what spoils the whole file.
    :ivar twice: keys that stand twice, which are among the problems of the tree.
    """

    def __init__(self, file: str, rules: Rules,
                 entries: Mapping[Path, Container[str]] = MappingProxyType({})) -> None:
        self.tree = Tree({}, file)
        self._entries = entries
        self.refused: list[Problem] = []
        self.twice: list[Problem] = []
        self._parameters = rules is Rules.PARAMETERS
        self._why = ' (rcl refuses the file)' if self._parameters else ''

    def read(self, node: YamlNode) -> None:
        """Read a mapping."""
        self.tree.lines[()] = node.line
        self._mapping(node, (), self.tree.data)

    def _note(self, path: Path, message: Sentence, *, at: Path | None = None) -> None:
        """Record a problem; the value at ``path`` is not to be used."""
        self.refused.append(self.tree.problem(path, message, at=at))
        self.tree.damaged.add(path)

    def _mapping(self, node: YamlNode, path: Path, target: dict[str, Any]) -> None:
        lines = self.tree.lines
        for key, value in self._in_place(node, path):
            problem = _key_problem(key)
            if problem:
                self.refused.append(self.tree.problem(path, problem)._replace(line=key.line))
                self.tree.incomplete.add(path)
                continue
            here = (*path, key.text)
            if here in lines:
                self.twice.append(self.tree.problem(
                    here, complaints.duplicate_key(first=lines[here]))._replace(line=key.line))
                self.tree.problems.append(self.twice[-1])
                continue
            lines[here] = key.line
            # ROS itself reads topic names in QoS overrides, which may have dots.
            if self._parameters and '.' in key.text \
                    and str(here[0]).split('.')[0] != 'qos_overrides':
                self.tree.wrong(here, complaints.dots())
                self.tree.incomplete.add(path)
                continue
            read = self._value(value, here)
            if read is not _UNREADABLE:
                target[key.text] = read

    def _in_place(self, node: YamlNode, path: Path) -> Iterator[tuple['YamlNode', 'YamlNode']]:
        """Yield keys and values, without those that were meant to stand below an entry."""
        keys = self._entries.get(path)
        empty: YamlNode | None = None       # an entry without anything below it
        displaced: list[int] = []
        for key, value in (*node.pairs, (_END, _END)):
            if keys is not None and empty is not None and key.text in keys \
                    and value.kind is not NodeKind.MAPPING:
                displaced.append(key.line)
                continue
            if empty is not None:
                here = (*path, empty.text)
                self.tree.lines[here] = empty.line
                self._note(here, complaints.not_below(
                    why=self._why, first=displaced[0], last=displaced[-1]) if displaced
                    else self._no_value(empty.text, path))
                empty, displaced = None, []
            if keys is not None and not _key_problem(key) and _is_empty(value):
                empty = key
            elif key is not _END:
                yield key, value

    def _no_value(self, key: str, path: Path) -> Sentence:
        """Return that a key has no value, and why, where that can be seen."""
        for separator, message in ((':', complaints.no_space), (' ', complaints.no_colon)):
            name, found, value = key.partition(separator)
            if found and value.strip():
                self.tree.incomplete.add(path)
                return message(why=self._why, key=name, value=value.strip())
        return complaints.no_value(why=self._why)

    def _value(self, node: YamlNode, path: Path) -> Any:
        if node.kind is NodeKind.SCALAR:
            return self._scalar(node, path)
        if node.kind is NodeKind.LIST:
            return self._list(node, path)
        if node.kind is NodeKind.ALIAS:
            self._note(path, complaints.alias(why=self._why))
        elif self._parameters and not node.items:
            self._note(path, complaints.garbling_mapping())
        else:
            value: dict[str, Any] = {}
            self._mapping(node, path, value)
            return value
        return _UNREADABLE

    def _scalar(self, node: YamlNode, path: Path) -> Any:
        if _is_empty(node):
            self._note(path, self._no_value(str(path[-1]), path[:-1]))
        elif '\0' in node.text:
            self._note(path, complaints.nul())
        else:
            return node.scalar
        return _UNREADABLE

    def _list(self, node: YamlNode, path: Path) -> Any:
        items: list[Any] = []
        for item in node.items:
            here = (*path, len(items))
            self.tree.lines[here] = item.line
            plain = item.kind is NodeKind.SCALAR
            value = self._scalar(item, here) if plain else _UNREADABLE
            if item.kind is NodeKind.ALIAS:
                self._note(path, complaints.alias(why=self._why), at=here)
            elif not plain:
                self._note(path, complaints.nested_list(), at=here)
            elif value is _UNREADABLE:
                self.tree.damaged.add(path)
            elif self._parameters and items and type(value) is not type(items[0]):
                self._note(path, complaints.mixed_list(
                    value=value, kind=describe_type(value),
                    first=describe_type(items[0])), at=here)
            else:
                items.append(value)
        return _UNREADABLE if path in self.tree.damaged else items


#: after the last key of a mapping
_END = YamlNode(NodeKind.LIST, 0, [])


def _is_empty(node: YamlNode) -> bool:
    return node.kind is NodeKind.SCALAR and not node.text and not node.quoted


def _key_problem(key: YamlNode) -> Sentence:
    """Return why a key is invalid; NOTHING if it is valid."""
    if key.kind is not NodeKind.SCALAR:
        kind = 'an alias' if key.kind is NodeKind.ALIAS else 'a list or mapping'
        return complaints.no_key(kind=kind)
    if not key.text:
        return complaints.empty_key()
    return complaints.key_with_nul() if '\0' in key.text else NOTHING
