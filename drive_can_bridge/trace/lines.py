# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Telegrams as lines of text, and as JSON.

.. code-block:: text

    12.340512 +0.020 main conveyor > cyclic request: speed_setpoint 500.0 rpm, torque_limit 90.0 %
    12.341310 +0.020 main conveyor < cyclic response: actual_speed 498.2 rpm [0.8 ms]
    12.380512 +0.040 main conveyor < cyclic response: LOST: no answer in 20 ms

First the time since the trace began; then that since the last telegram of the same kind: of a
cyclic one its period. At the end, in brackets, what an answer took.

Raw integers as people read them: ``500.0 rpm``, ``0003h (ready, enabled)``.
"""

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from fnmatch import fnmatchcase
import json
import math
from typing import Any

from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.observer import Kind, Telegram, Verdict
from drive_can_bridge.protocols.telegrams import Direction

#: digits behind the point that a scale may ask for
_DIGITS_MAX = 6

Format = Callable[[int], str]


class ValueFormat:
    """Formats values; what is the same for all values of a parameter is found out once."""

    def __init__(self) -> None:
        # by identity: the hash of a parameter takes longer than the rest; the reference keeps it
        self._known: dict[int, tuple[Parameter, Format]] = {}

    def of(self, parameter: Parameter) -> Format:
        """Return what turns raw integers of a parameter into its name, value and unit."""
        known = self._known.get(id(parameter))
        if known is not None:
            return known[1]
        chosen = _format_of(parameter)
        if parameter.listed:    # others are made for one telegram
            self._known[id(parameter)] = parameter, chosen
        return chosen


def _format_of(parameter: Parameter) -> Format:
    name, names = parameter.name, dict(parameter.values)
    if parameter.scaled:
        digits = max(_digits(parameter.scale), _digits(parameter.offset))
        scale, offset = parameter.scale, parameter.offset
        unit = f' {parameter.unit}' if parameter.unit else ''
        if parameter.values:
            return lambda raw: (f'{name} {raw * scale + offset:.{digits}f}{unit}'
                                f'{_named(names, raw)}')
        return lambda raw: f'{name} {raw * scale + offset:.{digits}f}{unit}'
    if parameter.type is ParameterType.BOOL:
        return lambda raw: f'{name} {"true" if raw else "false"}'
    if parameter.bits:
        return lambda raw: f'{name} {_bits_text(parameter, raw)}'
    if parameter.values:
        return lambda raw: f'{name} {raw}{_named(names, raw)}'
    return lambda raw: f'{name} {raw}'


def _named(names: Mapping[int, str], raw: int) -> str:
    return f' {names[raw]}' if raw in names else ''


def _digits(step: float) -> int:
    """Return the digits behind the point that tell one step from the next."""
    if step == 0.0 or float(step).is_integer():
        return 0
    digits = max(0, math.ceil(-math.log10(abs(step)) - 1e-9))
    most = min(digits + 1, _DIGITS_MAX)     # of a step like 50/16384 nobody wants them all
    while digits < most and not math.isclose(round(step, digits), step, rel_tol=1e-2):
        digits += 1
    return min(digits, most)


def _bits_text(parameter: Parameter, raw: int) -> str:
    names = ', '.join(name for name, bit in parameter.bits if raw >> bit & 1)
    width = parameter.type.bits // 4
    return f'{raw & (1 << parameter.type.bits) - 1:0{width}X}h' + (f' ({names})' if names else '')


_NORMAL = Verdict.NORMAL
_NEITHER, _REQUEST = Direction.NEITHER, Direction.REQUEST
_OTHER = Kind.OTHER
#: telegrams of different kinds whose last time is remembered
_KINDS_MAX = 20_000


class Only(Enum):
    """What ``--only`` can ask for."""

    PARAMETERS = 'parameters'
    ERRORS = 'errors'
    CHANGES = 'changes'


class Selection:
    """
    Chooses telegrams.

    :param drives: shell patterns; none: all, and what is of no drive, too.
    :param only: nothing: everything.
    """

    def __init__(self, drives: list[str], only: set[Only]) -> None:
        self._patterns = drives
        self._only = only
        self._wanted: dict[str, bool] = {}
        self._last: dict[tuple[str, str, Direction, str], Any] = {}

    @property
    def takes_all(self) -> bool:
        """Nothing is left out."""
        return not (self._patterns or self._only)

    def names(self, drive: str) -> bool:
        """Tell whether somebody wants to see a drive."""
        wanted = self._wanted.get(drive)
        if wanted is None:
            wanted = self._wanted[drive] = not self._patterns or any(
                fnmatchcase(drive, pattern) for pattern in self._patterns)
        return wanted

    def takes(self, bus: str, telegram: Telegram) -> bool:
        """Tell whether somebody wants to see it."""
        if self._patterns and not self.names(telegram.drive):
            return False
        only = self._only
        if not only:
            return True
        return (Only.ERRORS in only and telegram.verdict is not _NORMAL
                or Only.PARAMETERS in only and telegram.kind is Kind.PARAMETER
                or Only.CHANGES in only and self._changed(bus, telegram))

    def _changed(self, bus: str, telegram: Telegram) -> bool:
        """Tell whether it says anything else than the last of its kind."""
        key = bus, telegram.drive, telegram.direction, telegram.title
        if telegram.kind is Kind.OTHER:
            identifier, _, _ = telegram.remark.partition('#')
            key = bus, identifier, telegram.direction, telegram.title
        elif telegram.kind is not Kind.CYCLIC and telegram.kind is not Kind.NETWORK:
            return False
        elif telegram.title in ('read', 'write'):   # of a round: each parameter for itself
            if telegram.title == 'read' and telegram.direction is Direction.REQUEST:
                return False
            names = ','.join(parameter.name for parameter in telegram.parameters)
            key = bus, telegram.drive, telegram.direction, f'{telegram.title} {names}'
        content = tuple(telegram.raws), telegram.verdict, telegram.remark
        if self._last.get(key) == content:
            return False
        if len(self._last) >= _KINDS_MAX:
            self._last.clear()
        self._last[key] = content
        return True


class _Row:
    """What all telegrams of one title of a drive have in common."""

    __slots__ = ('formats', 'head', 'last', 'parameters')

    def __init__(self, head: str, last: float) -> None:
        self.head = head
        self.last = last
        self.parameters: Sequence[Parameter] = ()
        self.formats: list[Format] = []


class LineWriter:
    """
    Writes a line for each telegram that somebody wants to see.

    :param write: takes the line with its end.
    :param as_json: a JSON document a line.
    """

    def __init__(self, write: Callable[[str], object], selection: Selection, *,
                 as_json: bool = False) -> None:
        self._write = write
        self._takes = None if selection.takes_all else selection.takes
        self._format = ValueFormat()
        self._start = math.nan
        self._rows: dict[tuple[str, str, str, bool], _Row] = {}
        self._line = self._document if as_json else self._text

    def __call__(self, bus: str, telegram: Telegram) -> None:
        """Write it, if it is wanted."""
        if self._start != self._start:      # NaN
            self._start = telegram.time
        if self._takes is None or self._takes(bus, telegram):
            self._write(self._line(bus, telegram))

    def _text(self, bus: str, telegram: Telegram) -> str:
        (time, drive, direction, kind, title, parameters, raws, verdict, remark,
         latency) = telegram
        stray = kind is _OTHER and not title
        key = bus, drive, remark.partition('#')[0] if stray else title, direction is _REQUEST
        row = self._rows.get(key)
        if row is None:
            row = self._new_row(key, telegram)
        since, row.last = time - row.last, time
        begin = f'{time - self._start:.6f} +{since:.3f} {row.head}'
        if stray:
            return f'{begin}{remark}\n'
        if raws:
            if row.parameters is not parameters:
                row.parameters = parameters
                row.formats = [self._format.of(parameter) for parameter in parameters]
            content = ', '.join([shown(raw) for shown, raw in zip(row.formats, raws)])
        else:
            content = ', '.join([parameter.name for parameter in parameters])
        if verdict is not _NORMAL:
            what = verdict.value.upper() + (f': {remark}' if remark else '')
            content = f'{content}: {what}' if content else what
        elif remark:
            content = f'{content} ({remark})' if content else remark
        if latency == latency:      # not NaN
            return f'{begin}{content} [{1e3 * latency:.1f} ms]\n'
        return f'{begin}{content}\n'

    def _new_row(self, key: tuple[str, str, str, bool], telegram: Telegram) -> _Row:
        bus, drive, _, _ = key
        arrow = '' if telegram.direction is _NEITHER else f' {telegram.direction.value}'
        head = f'{bus}{" " if drive else ""}{drive}{arrow} '
        if telegram.title:
            head += f'{telegram.title}: '
        if len(self._rows) >= _KINDS_MAX:
            self._rows.clear()
        row = self._rows[key] = _Row(head, telegram.time)
        return row

    def _document(self, bus: str, telegram: Telegram) -> str:
        document: dict[str, Any] = {
            'time': round(telegram.time - self._start, 6), 'bus': bus,
            'drive': telegram.drive or None, 'direction': telegram.direction.name.lower(),
            'kind': telegram.kind.value, 'title': telegram.title,
            'values': {parameter.name: parameter.value_from_raw(raw) for parameter, raw
                       in zip(telegram.parameters, telegram.raws)},
            'parameters': [parameter.name for parameter in telegram.parameters],
            'verdict': telegram.verdict.value, 'remark': telegram.remark,
            'latency_ms': None if math.isnan(telegram.latency)
            else round(1e3 * telegram.latency, 3)}
        return json.dumps(document, ensure_ascii=False) + '\n'
