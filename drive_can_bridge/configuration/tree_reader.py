# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From the nodes of a YAML mapping to plain data with lines, under the rules of ROS parameters.

Everything wrong is noted and reading goes on, so that one run finds all problems.
"""

from enum import Enum
from typing import Any

from drive_can_bridge.configuration.problems import Path, Problem, Tree
from drive_can_bridge.configuration.yaml_nodes import Kind, Node
from drive_can_bridge.core.words import describe_type, show

#: how the problem of a key that stands twice begins
DUPLICATE = 'duplicate key'
#: stands for a value that could not be read
_UNREADABLE = object()


class Rules(Enum):
    """What a mapping may contain."""

    #: below ``ros__parameters``: what rcl refuses or garbles is a problem
    PARAMETERS = 'parameters'
    #: a profile, which rcl never sees
    PROFILE = 'profile'


class TreeReader:
    """
    Read one mapping, with everything below it, into a :class:`Tree`.

    What spoils this mapping only is noted in the tree.

    :ivar refused: what spoils the whole file.
    """

    def __init__(self, file: str, rules: Rules) -> None:
        self.tree = Tree({}, file)
        self.refused: list[Problem] = []
        self._parameters = rules is Rules.PARAMETERS
        self._why = ' (rcl refuses the file)' if self._parameters else ''

    def read(self, node: Node) -> None:
        """Read a mapping."""
        self.tree.lines[()] = node.line
        self._mapping(node, (), self.tree.data)

    def _note(self, path: Path, message: str, *, at: Path | None = None) -> None:
        """Note a problem; the value at ``path`` is not to be used."""
        self.refused.append(self.tree.problem(path, message, at=at))
        self.tree.damaged.add(path)

    def _mapping(self, node: Node, path: Path, target: dict[str, Any]) -> None:
        lines = self.tree.lines
        for key, value in node.pairs:
            problem = _key_problem(key)
            if problem:
                self.refused.append(self.tree.problem(path, problem)._replace(line=key.line))
                self.tree.incomplete.add(path)
                continue
            here = (*path, key.text)
            if here in lines:
                self.tree.problems.append(self.tree.problem(
                    here, f'{DUPLICATE}, allowed is one (the first is in line {lines[here]})',
                )._replace(line=key.line))
                continue
            lines[here] = key.line
            # ROS itself reads topic names in QoS overrides, which may have dots.
            if self._parameters and '.' in key.text \
                    and str(here[0]).split('.')[0] != 'qos_overrides':
                self.tree.wrong(here, 'a key with dots, allowed are nested keys')
                self.tree.incomplete.add(path)
                continue
            read = self._value(value, here)
            if read is not _UNREADABLE:
                target[key.text] = read

    def _value(self, node: Node, path: Path) -> Any:
        if node.kind is Kind.SCALAR:
            return self._scalar(node, path)
        if node.kind is Kind.LIST:
            return self._list(node, path)
        if node.kind is Kind.ALIAS:
            self._note(path, f'an alias{self._why}, allowed is the value itself')
        elif self._parameters and not node.items:
            self._note(path, 'an empty mapping (rcl garbles what follows), allowed is to leave '
                             'the key out')
        else:
            value: dict[str, Any] = {}
            self._mapping(node, path, value)
            return value
        return _UNREADABLE

    def _scalar(self, node: Node, path: Path) -> Any:
        if not node.text and not node.quoted:
            self._note(path, f'no value{self._why}, allowed is a value, or [] for an empty list')
        elif '\0' in node.text:
            self._note(path, 'a NUL character, allowed is text without')
        else:
            return node.scalar
        return _UNREADABLE

    def _list(self, node: Node, path: Path) -> Any:
        items: list[Any] = []
        for item in node.items:
            here = (*path, len(items))
            self.tree.lines[here] = item.line
            plain = item.kind is Kind.SCALAR
            value = self._scalar(item, here) if plain else _UNREADABLE
            if item.kind is Kind.ALIAS:
                self._note(path, f'an alias{self._why}, allowed is the value itself', at=here)
            elif not plain:
                self._note(path, 'a list or mapping in a list, allowed are plain values', at=here)
            elif value is _UNREADABLE:
                self.tree.damaged.add(path)
            elif self._parameters and items and type(value) is not type(items[0]):
                self._note(path, f'{show(value)} is {describe_type(value)} in a list that began '
                                 f'with {describe_type(items[0])} (rcl refuses the file), allowed '
                                 'are values of one type', at=here)
            else:
                items.append(value)
        return _UNREADABLE if path in self.tree.damaged else items


def _key_problem(key: Node) -> str:
    """Say why a key cannot be one; '' if it can."""
    if key.kind is not Kind.SCALAR:
        kind = 'an alias' if key.kind is Kind.ALIAS else 'a list or mapping'
        return f'{kind} as a key, allowed is a name'
    if not key.text:
        return 'an empty key, allowed is a name'
    return 'a key with a NUL character, allowed is a name' if '\0' in key.text else ''
