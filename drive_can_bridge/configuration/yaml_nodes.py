# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
YAML files as nodes with lines.

Nodes are put together from PyYAML's event stream, on which rcl works as well: only there can be
seen what rcl refuses (PyYAML's composer follows aliases and refuses anchors that stand twice).
It takes no recursion, so that no nesting of a file ends in the depths of the C stack.
"""

from collections.abc import Iterator
from enum import Enum
from pathlib import Path as FilePath
import re
from typing import NamedTuple

import yaml

from drive_can_bridge.configuration.regular_file import read_regular
from drive_can_bridge.configuration.scalars import read_scalar, Scalar

# libyaml, which rcl uses as well, where PyYAML was built with it.
_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)

#: of what is read at all, in MiB and in levels
SIZE_MAX = 4
DEPTH_MAX = 32
_TOO_DEEP = f'nested too deep, allowed are {DEPTH_MAX} levels'
#: what is noticed to be wrong much later: where it begins is the line to look at
_OPENED = ('while scanning a quoted scalar', 'while parsing a flow', 'while scanning a simple key')


class BrokenYaml(Exception):
    """The text is not YAML from here on."""

    def __init__(self, line: int, message: str) -> None:
        super().__init__(message)
        self.line = line


class Kind(Enum):
    """What a node is."""

    SCALAR = 'scalar'
    LIST = 'list'
    MAPPING = 'mapping'
    ALIAS = 'alias'


class Node(NamedTuple):
    """
    A part of a YAML text.

    :param line: where it begins, counted from 1.
    :param items: of a list; of a mapping its keys and values in turn.
    :param text: of a scalar, without quotes.
    """

    kind: Kind
    line: int
    items: list['Node']
    text: str = ''
    quoted: bool = False
    tag: str | None = None

    @property
    def scalar(self) -> Scalar:
        """The value of a scalar, as rcl reads it."""
        return read_scalar(self.text, quoted=self.quoted, tag=self.tag)

    @property
    def pairs(self) -> Iterator[tuple['Node', 'Node']]:
        """Keys and values of a mapping."""
        return zip(self.items[::2], self.items[1::2])


class Document(NamedTuple):
    """One of the documents of a file: where it begins, and what it holds."""

    line: int
    root: Node


def read_documents(path: FilePath) -> list[Document]:
    """
    Read a YAML file.

    :raises OSError: it cannot be read, is no file, or is too large.
    :raises BrokenYaml: it is no YAML.
    """
    return _documents(read_regular(path, SIZE_MAX))


def _documents(data: bytes) -> list[Document]:
    starts: list[int] = []
    roots: list[Node] = []
    # the lists that nodes are added to: that of the documents, and those of all open nodes
    growing = [roots]
    line = 1
    try:
        for event in yaml.parse(data, Loader=_LOADER):
            line = event.start_mark.line + 1 if event.start_mark else line
            if isinstance(event, yaml.ScalarEvent):
                growing[-1].append(Node(Kind.SCALAR, line, [], event.value,
                                        event.style in ("'", '"'), event.tag))
            elif isinstance(event, yaml.AliasEvent):
                growing[-1].append(Node(Kind.ALIAS, line, []))
            elif isinstance(event, yaml.CollectionStartEvent):
                kind = Kind.LIST if isinstance(event, yaml.SequenceStartEvent) else Kind.MAPPING
                node = Node(kind, line, [])
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
    indentation = re.match(rb'\s*', b''.join(data.splitlines()[line - 1:line]))
    if indentation is not None and b'\t' in indentation[0]:
        return BrokenYaml(line, 'a tab in the indentation, allowed are spaces')
    what = getattr(error, 'problem', None) or getattr(error, 'reason', None) or 'unreadable'
    if 'nesting' in what:   # libyaml has a limit of its own since PyYAML 6.0.4
        return BrokenYaml(line, _TOO_DEEP)
    if context.startswith('while parsing a block mapping'):
        what += ' (no key above it is indented like it: is one missing?)'
    return BrokenYaml(line, f'not valid YAML: {what}')
