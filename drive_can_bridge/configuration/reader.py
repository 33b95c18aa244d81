# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
YAML text to plain data with line numbers, under the rules of ROS parameters.

PyYAML's event stream is used instead of its loaders: rcl works on the same events, and only they
tell lines, quotes, tags and duplicate keys. Everything wrong is noted and reading goes on, so that
one run finds all problems; only broken YAML syntax ends it.
"""

from collections.abc import Iterator
from enum import Enum
from typing import Any

import yaml

from drive_can_bridge.configuration.problems import describe_type, Path, Problem, show, Tree
from drive_can_bridge.configuration.scalars import read_scalar, Scalar

# libyaml, which rcl uses as well, where PyYAML was built with it.
_LOADER = getattr(yaml, 'CLoader', yaml.Loader)

_DEPTH_MAX = 32
_OPENED = ('while scanning a quoted scalar', 'while parsing a flow')
#: how the problem of a key that stands twice begins
DUPLICATE = 'duplicate key'
#: stands for a value that could not be read
UNREADABLE = object()

_NO_VALUE = 'no value{}, allowed is a value, or [] for an empty list'
_ALIAS = 'an alias{}, allowed is the value itself'


class Rules(Enum):
    """What a mapping may contain."""

    #: below ``ros__parameters``: what rcl refuses or garbles is a problem
    PARAMETERS = 'parameters'
    #: a profile, which rcl never sees
    PROFILE = 'profile'


class BrokenYaml(Exception):
    """The text is not YAML from here on."""

    def __init__(self, line: int, message: str) -> None:
        super().__init__(message)
        self.line = line


class Events:
    """The events of a YAML text, with one event of preview."""

    def __init__(self, data: bytes) -> None:
        self._source: Iterator[Any] = iter(())
        self._line = 1
        try:
            self._source = yaml.parse(data, Loader=_LOADER)
        except (yaml.YAMLError, ValueError, OverflowError) as error:
            raise self._broken(error) from None
        self.head: Any = self._pull()

    def _pull(self) -> Any:
        try:
            return next(self._source, None)
        except (yaml.YAMLError, ValueError, OverflowError) as error:
            raise self._broken(error) from None

    def _broken(self, error: Exception) -> BrokenYaml:
        mark = getattr(error, 'problem_mark', None)
        if str(getattr(error, 'context', '')).startswith(_OPENED):
            # What was never closed is noticed much later; the beginning is the line to look at.
            mark = getattr(error, 'context_mark', None) or mark
        line = mark.line + 1 if mark is not None else self._line
        what = getattr(error, 'problem', None) or getattr(error, 'reason', None)
        return BrokenYaml(line, f'not valid YAML: {what or "unreadable"}')

    def take(self) -> Any:
        """Return the current event and step to the next."""
        event = self.head
        if event.start_mark is not None:
            self._line = event.start_mark.line + 1
        self.head = self._pull()
        return event

    @property
    def line(self) -> int:
        """Line of the current event, counted from 1."""
        mark = self.head.start_mark
        return self._line if mark is None else int(mark.line) + 1

    def at(self, kind: str) -> bool:
        """Tell whether the current event is a ``<kind>Event`` (or the text is over)."""
        return self.head is None or type(self.head).__name__ == kind + 'Event'

    def skip(self) -> None:
        """Step over a whole node."""
        depth = 0
        while self.head is not None:
            name = type(self.take()).__name__
            depth += name.endswith('StartEvent') - name.endswith('EndEvent')
            if depth <= 0:
                return


class TreeReader:
    """Read one mapping, with everything below it, into a :class:`Tree`."""

    def __init__(self, events: Events, file: str, rules: Rules) -> None:
        self.tree = Tree({}, file)
        self.problems: list[Problem] = []
        #: what spoils this mapping only, and not the whole file
        self.garbled: list[Problem] = []
        self._events = events
        self._rules = rules
        self._why = ' (rcl refuses the file)' if rules is Rules.PARAMETERS else ''

    def read(self) -> None:
        """Read the mapping that the events stand at."""
        self.tree.lines[()] = self._events.line
        self._mapping((), self.tree.data)

    def note(self, path: Path, message: str, *, at: Path | None = None) -> None:
        """Note a problem; the value at ``path`` is not to be used."""
        self.problems.append(self.tree.problem(path, message, at=at))
        self.tree.damaged.add(path)

    def _mapping(self, path: Path, target: dict[str, Any]) -> int:
        """Read a mapping into ``target`` and return how many keys it has."""
        events = self._events
        events.take()
        count = 0
        while not events.at('MappingEnd'):
            count += 1
            line = events.line
            key = self._key(path)
            if key is None:
                events.skip()
                continue
            here = (*path, key)
            first = self.tree.lines.get(here)
            if first is not None:
                self.garbled.append(self.tree.problem(
                    here, f'{DUPLICATE}, allowed is one (the first is in line {first})',
                )._replace(line=line))
                events.skip()
                continue
            self.tree.lines[here] = line
            if '.' in key and self._rules is Rules.PARAMETERS and not _dots_allowed(here):
                self.garbled.append(self.tree.problem(
                    here, 'a key with dots, allowed are nested keys'))
                self.tree.incomplete.add(path)
                events.skip()
                continue
            value = self._value(here)
            if value is not UNREADABLE:
                target[key] = value
        events.take()
        return count

    def _key(self, path: Path) -> str | None:
        """Read a key; None after noting why there is none."""
        events = self._events
        line = events.line
        if not events.at('Scalar'):
            kind = 'an alias' if events.at('Alias') else 'a list or mapping'
            events.skip()
            problem = f'{kind} as a key, allowed is a name'
        else:
            text = str(events.take().value)
            if text and '\0' not in text:
                return text
            problem = 'an empty key, allowed is a name' if not text else \
                'a key with a NUL character, allowed is a name'
        self.problems.append(self.tree.problem(path, problem)._replace(line=line))
        self.tree.incomplete.add(path)
        return None

    def _value(self, path: Path) -> Any:
        events = self._events
        if events.at('Scalar'):
            scalar = self._scalar(path)
            return UNREADABLE if scalar is None else scalar
        if events.at('SequenceStart'):
            return self._list(path)
        if events.at('MappingStart'):
            if len(path) >= _DEPTH_MAX:
                self.note(path, f'nested too deep, allowed are {_DEPTH_MAX} levels')
                events.skip()
                return UNREADABLE
            value: dict[str, Any] = {}
            if not self._mapping(path, value) and self._rules is Rules.PARAMETERS:
                self.note(path, 'an empty mapping (rcl garbles what follows), allowed is to leave '
                                'the key out')
                return UNREADABLE
            return value
        self.note(path, _ALIAS.format(self._why))
        events.skip()
        return UNREADABLE

    def _scalar(self, path: Path) -> Scalar | None:
        """Read a scalar; None after noting why it has no value."""
        event = self._events.take()
        quoted = event.style in ("'", '"')
        if not event.value and not quoted:
            self.note(path, _NO_VALUE.format(self._why))
            return None
        if '\0' in event.value:
            self.note(path, 'a NUL character, allowed is text without')
            return None
        return read_scalar(event.value, quoted=quoted, tag=event.tag)

    def _list(self, path: Path) -> Any:
        events = self._events
        events.take()
        items: list[Scalar] = []
        useless = False
        while not events.at('SequenceEnd'):
            here = (*path, len(items))
            self.tree.lines[here] = events.line
            item = self._scalar(here) if events.at('Scalar') else None
            if item is None:
                useless = True
                if events.at('Alias'):
                    self.note(path, _ALIAS.format(self._why), at=here)
                    events.skip()
                elif events.at('SequenceStart') or events.at('MappingStart'):
                    self.note(path, 'a list or mapping in a list, allowed are plain values',
                              at=here)
                    events.skip()
                continue
            if items and type(item) is not type(items[0]) and self._rules is Rules.PARAMETERS:
                useless = True
                self.note(path, f'{show(item)} is {describe_type(item)} in a list that began with '
                                f'{describe_type(items[0])} (rcl refuses the file), allowed are '
                                f'values of one type', at=here)
                continue
            items.append(item)
        events.take()
        return UNREADABLE if useless else items


def _dots_allowed(path: Path) -> bool:
    """Tell whether ROS itself reads the key: topic names in QoS overrides may have dots."""
    return str(path[0]).split('.')[0] == 'qos_overrides'
