# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
YAML files as nodes with lines.

Nodes are put together from PyYAML's event stream, on which rcl works as well: only there can be
seen what rcl refuses (PyYAML's composer follows aliases and refuses anchors that stand twice).
It takes no recursion, so that no nesting of a file ends in the depths of the C stack.
"""

from errno import EFBIG, EINVAL
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import yaml

from drive_can_bridge.configuration.scalars import read_scalar, Scalar

# libyaml, which rcl uses as well, where PyYAML was built with it.
_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)

#: of what is read at all, in MiB and in levels
SIZE_MAX = 4
DEPTH_MAX = 32
_OPENED = ('while scanning a quoted scalar', 'while parsing a flow')


class BrokenYaml(Exception):
    """The text is not YAML from here on."""

    def __init__(self, line: int, message: str) -> None:
        super().__init__(message)
        self.line = line


class Node(NamedTuple):
    """
    A scalar, list, mapping or alias.

    :param event: the event it begins with.
    :param items: of a list; of a mapping its keys and values in turn.
    """

    event: Any
    items: list['Node']

    @property
    def line(self) -> int:
        """Line of its beginning, counted from 1."""
        return int(self.event.start_mark.line) + 1

    @property
    def is_scalar(self) -> bool:
        """A single value, which may be empty."""
        return isinstance(self.event, yaml.ScalarEvent)

    @property
    def is_list(self) -> bool:
        """A sequence, in YAML's words."""
        return isinstance(self.event, yaml.SequenceStartEvent)

    @property
    def is_mapping(self) -> bool:
        """Keys with values."""
        return isinstance(self.event, yaml.MappingStartEvent)

    @property
    def is_alias(self) -> bool:
        """A name that stands for another node."""
        return isinstance(self.event, yaml.AliasEvent)

    @property
    def text(self) -> str:
        """A scalar as it is written, without quotes."""
        return str(self.event.value)

    @property
    def is_empty(self) -> bool:
        """A scalar that is not there: ``key:`` and no more."""
        return not self.event.value and self.event.style not in ("'", '"')

    @property
    def scalar(self) -> Scalar:
        """The value of a scalar, as rcl reads it."""
        return read_scalar(self.text, quoted=self.event.style in ("'", '"'), tag=self.event.tag)

    @property
    def pairs(self) -> list[tuple['Node', 'Node']]:
        """Keys and values of a mapping."""
        return list(zip(self.items[::2], self.items[1::2]))


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
    if not path.is_file() and not path.is_dir() and path.exists():  # a pipe may keep us waiting
        raise OSError(EINVAL, 'not a regular file, allowed is one', str(path))
    with path.open('rb') as file:
        data = file.read((SIZE_MAX << 20) + 1)
    if len(data) > SIZE_MAX << 20:
        raise OSError(EFBIG, f'too large, allowed are {SIZE_MAX} MiB', str(path))
    return _documents(data)


def _documents(data: bytes) -> list[Document]:
    starts: list[int] = []
    roots: list[Node] = []
    #: the lists to which nodes are added, from the documents down to the innermost node
    open_lists = [roots]
    line = 1
    try:
        for event in yaml.parse(data, Loader=_LOADER):
            if isinstance(event, yaml.NodeEvent):
                node = Node(event, [])
                line = node.line
                open_lists[-1].append(node)
                if isinstance(event, yaml.CollectionStartEvent):
                    open_lists.append(node.items)
                    if len(open_lists) > DEPTH_MAX + 1:
                        raise BrokenYaml(line, f'nested too deep, allowed are {DEPTH_MAX} levels')
            elif isinstance(event, yaml.CollectionEndEvent):
                open_lists.pop()
            elif isinstance(event, yaml.DocumentStartEvent):
                starts.append(event.start_mark.line + 1)
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise _broken(error, line) from None
    return list(map(Document, starts, roots))


def _broken(error: Exception, line: int) -> BrokenYaml:
    mark = getattr(error, 'problem_mark', None)
    if str(getattr(error, 'context', '')).startswith(_OPENED):
        # What was never closed is noticed much later; the beginning is the line to look at.
        mark = getattr(error, 'context_mark', None) or mark
    line = mark.line + 1 if mark is not None else line
    what = getattr(error, 'problem', None) or getattr(error, 'reason', None)
    return BrokenYaml(line, f'not valid YAML: {what or "unreadable"}')
