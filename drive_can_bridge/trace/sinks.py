# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Sinks for the telegrams of a trace: lines of text, JSON, columns of a table, curves.

.. code-block:: text

    12.340512 +0.020 main conveyor > cyclic request: speed_setpoint 500.0 rpm, torque_limit 90.0 %
    12.341310 +0.020 main conveyor < cyclic response: actual_speed 498.2 rpm [0.8 ms]
    12.380512 +0.040 main conveyor < cyclic response: LOST: no answer in 20 ms

First the time since the trace began, then that since the last telegram of the same kind; at the
end, in brackets, the time that an answer took.
"""

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
import csv
from enum import Enum
from fnmatch import fnmatchcase
import json
import math
from typing import Any, NamedTuple, TextIO

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import (
    BridgeConfiguration, DriveConfiguration, JointConfiguration)
from drive_can_bridge.core.continuous import ContinuousPosition
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.observer import Telegram, TelegramKind, Verdict
from drive_can_bridge.protocols.telegrams import Direction

#: digits behind the point that a scale may ask for
_DIGITS_MAX = 6

Format = Callable[[int], str]


def _format_of(parameter: Parameter) -> Format:
    """Return the function that formats raw integers of a parameter with name, value and unit."""
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
    """Return the digits behind the point that distinguish one step from the next."""
    if step == 0.0 or float(step).is_integer():
        return 0
    digits = max(0, math.ceil(-math.log10(abs(step)) - 1e-9))
    most = min(digits + 1, _DIGITS_MAX)     # of a step like 50/16384 all of them are too many
    while digits < most and not math.isclose(round(step, digits), step, rel_tol=1e-2):
        digits += 1
    return min(digits, most)


def _bits_text(parameter: Parameter, raw: int) -> str:
    names = ', '.join(name for name, bit in parameter.bits if raw >> bit & 1)
    width = parameter.type.bits // 4
    return f'{raw & (1 << parameter.type.bits) - 1:0{width}X}h' + (f' ({names})' if names else '')


_NORMAL = Verdict.NORMAL
_NEITHER, _REQUEST = Direction.NEITHER, Direction.REQUEST
_OTHER = TelegramKind.OTHER
#: telegrams of different kinds whose last time is remembered
_KINDS_MAX = 20_000


class Only(Enum):
    """The choices of ``--only``."""

    PARAMETERS = 'parameters'
    ERRORS = 'errors'
    CHANGES = 'changes'


class Selection:
    """
    Chooses telegrams.

    :param drives: shell patterns; none: all, and telegrams of no drive, too.
    :param only: nothing: everything.
    """

    def __init__(self, drives: list[str], only: set[Only]) -> None:
        self._patterns = drives
        self._only = only
        self._wanted: dict[str, bool] = {}
        self._last: dict[tuple[str, str, Direction, str], Any] = {}

    @property
    def takes_all(self) -> bool:
        """Whether nothing is left out."""
        return not (self._patterns or self._only)

    def names(self, drive: str) -> bool:
        """Return whether the drive passes the filter."""
        wanted = self._wanted.get(drive)
        if wanted is None:
            wanted = self._wanted[drive] = not self._patterns or any(
                fnmatchcase(drive, pattern) for pattern in self._patterns)
        return wanted

    def takes(self, bus: str, telegram: Telegram) -> bool:
        """Return whether a telegram passes the filter."""
        if self._patterns and not self.names(telegram.drive):
            return False
        only = self._only
        if not only:
            return True
        return (Only.ERRORS in only and telegram.verdict is not _NORMAL
                or Only.PARAMETERS in only and telegram.kind is TelegramKind.PARAMETER
                or Only.CHANGES in only and self._changed(bus, telegram))

    def _changed(self, bus: str, telegram: Telegram) -> bool:
        """Return whether a telegram differs from the last of its kind."""
        key = bus, telegram.drive, telegram.direction, telegram.title
        if telegram.kind is TelegramKind.OTHER:
            identifier, _, _ = telegram.remark.partition('#')
            key = bus, identifier, telegram.direction, telegram.title
        elif telegram.kind not in (TelegramKind.CYCLIC, TelegramKind.NETWORK):
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


class _TitleRow:
    """What all telegrams of one title of a drive have in common."""

    __slots__ = ('formats', 'head', 'last', 'parameters')

    def __init__(self, head: str, last: float) -> None:
        self.head = head
        self.last = last
        self.parameters: Sequence[Parameter] = ()
        self.formats: list[Format] = []


class LineWriter:
    """
    Writes a line for each telegram that passes the filter.

    :param write: writes the line with its end.
    :param as_json: a JSON document a line.
    """

    def __init__(self, write: Callable[[str], object], selection: Selection, *,
                 as_json: bool = False) -> None:
        self._write = write
        self._takes = None if selection.takes_all else selection.takes
        # by identity: the hash of a parameter takes longer than the rest; the reference keeps it
        self._formats: dict[int, tuple[Parameter, Format]] = {}
        self._start = math.nan
        self._rows: dict[tuple[str, str, str, bool], _TitleRow] = {}
        self._line = self._document if as_json else self._text

    def __call__(self, bus: str, telegram: Telegram) -> None:
        """Write a telegram, if it passes the filter."""
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
                row.formats = [self._format(parameter) for parameter in parameters]
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

    def _format(self, parameter: Parameter) -> Format:
        """Return what is the same for all values of a parameter, computed once."""
        known = self._formats.get(id(parameter))
        if known is not None:
            return known[1]
        chosen = _format_of(parameter)
        if parameter.listed:    # others are made for one telegram
            self._formats[id(parameter)] = parameter, chosen
        return chosen

    def _new_row(self, key: tuple[str, str, str, bool], telegram: Telegram) -> _TitleRow:
        bus, drive, _, _ = key
        arrow = '' if telegram.direction is _NEITHER else f' {telegram.direction.value}'
        head = f'{bus}{" " if drive else ""}{drive}{arrow} '
        if telegram.title:
            head += f'{telegram.title}: '
        if len(self._rows) >= _KINDS_MAX:
            self._rows.clear()
        row = self._rows[key] = _TitleRow(head, telegram.time)
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


# -- columns and curves ---------------------------------------------------------------------------

#: shortest stretch of time of a curve in s, and how many there are at most: a picture has fewer
#: columns of pixels
_STRETCH = 0.001
_STRETCHES_MAX = 4096
#: the words of a family that has its control built in
_BUILT_IN = (('control_word', Direction.REQUEST), ('status_word', Direction.RESPONSE))
#: the bit of a status word that reports a fault
FAULT = 'fault'
#: height of a lane of bits, of 1
LANE = 0.8
#: marks of a drive that are shown
_MARKS_MAX = 10_000
_VALID = (Verdict.NORMAL, Verdict.LATE, Verdict.SUSPICIOUS)

Column = tuple[str, str, Direction]


def columns(drive: DriveConfiguration) -> dict[Column, str]:
    """
    Return the values of a drive that a table has, and the names of the columns.

    Those of the exchange: setpoints as sent, control word, actual values, status word.
    """
    wanted: list[tuple[str, Direction]] = []
    if FAMILIES[drive.protocol].control_built_in:
        wanted += _BUILT_IN
    elif drive.profile.control is not None:
        table = drive.profile.control
        wanted.append((table.parameter, Direction.REQUEST))
        if table.status_parameter is not None:
            wanted.append((table.status_parameter, Direction.RESPONSE))
    wanted += [(parameter.name, Direction.REQUEST) for parameter in drive.cyclic_request]
    wanted += [(parameter.name, Direction.RESPONSE) for parameter in drive.cyclic_response]
    names = [name for name, _ in dict.fromkeys(wanted)]
    return {(drive.name, name, direction): f'{drive.name}/{name}' if names.count(name) == 1
            else f'{drive.name}/{name} ({"sent" if direction is Direction.REQUEST else "received"}'
                 f')' for name, direction in dict.fromkeys(wanted)}


class TableWriter:
    """
    Writes values as comma separated columns: PlotJuggler, pandas and spreadsheets open that.

    A line for each telegram with values; cells of values that it lacks are empty.
    """

    def __init__(self, stream: TextIO, drives: Iterable[DriveConfiguration]) -> None:
        self._writer = csv.writer(stream, lineterminator='\n')
        self._places: dict[Column, int] = {}
        heading = ['time']
        for drive in drives:
            for column, name in columns(drive).items():
                self._places[column] = len(heading)
                heading.append(name)
        self._width = len(heading)
        self._start = math.nan
        self._writer.writerow(heading)

    def __call__(self, bus: str, telegram: Telegram) -> None:
        """Write a telegram's values."""
        if self._start != self._start:      # NaN
            self._start = telegram.time
        if not telegram.raws or telegram.verdict not in _VALID:
            return
        row: list[Any] | None = None
        for parameter, raw in zip(telegram.parameters, telegram.raws):
            place = self._places.get((telegram.drive, parameter.name, telegram.direction))
            if place is not None:
                if row is None:
                    row = [''] * self._width
                    row[0] = f'{telegram.time - self._start:.6f}'
                row[place] = _number(parameter, raw)
        if row is not None:
            self._writer.writerow(row)


def _number(parameter: Parameter, raw: int) -> str | int:
    value = parameter.value_from_raw(raw)
    return f'{value:.9g}' if isinstance(value, float) else int(value)


class Curve:
    """
    A value over time, in bounded memory: the lowest and the highest of each stretch of time.

    When there are too many stretches, they become twice as long.
    """

    def __init__(self, name: str, unit: str = '') -> None:
        self.name = name
        self.unit = unit
        self._width = _STRETCH
        self._places = array('q')
        # of each stretch: time and value of the lowest point, time and value of the highest
        self._points = (array('d'), array('d'), array('d'), array('d'))

    def add(self, time: float, value: float) -> None:
        """Add a point."""
        self._add(time, value, time, value)
        while len(self._places) > _STRETCHES_MAX:
            self._width *= 2.0
            points = list(zip(*self._points))
            del self._places[:]
            for column in self._points:
                del column[:]
            for point in points:
                self._add(*point)

    def _add(self, low_time: float, low: float, high_time: float, high: float) -> None:
        place = int(low_time // self._width)
        low_times, lows, high_times, highs = self._points
        if self._places and self._places[-1] == place:
            if low < lows[-1]:
                low_times[-1], lows[-1] = low_time, low
            if high > highs[-1]:
                high_times[-1], highs[-1] = high_time, high
            return
        self._places.append(place)
        for column, entry in zip(self._points, (low_time, low, high_time, high)):
            column.append(entry)

    def points(self) -> tuple[list[float], list[float]]:
        """Return times and values."""
        found: list[tuple[float, float]] = []
        for low_time, low, high_time, high in zip(*self._points):
            found += sorted({(low_time, low), (high_time, high)})
        return [time for time, _ in found], [value for _, value in found]


class BitLanes(NamedTuple):
    """
    A word of named bits: a lane each, from the bottom, in which a set bit is high.

    :param bits: name and place.
    """

    name: str
    bits: tuple[tuple[str, int], ...]
    curves: tuple[Curve, ...]

    def add(self, time: float, raw: int) -> None:
        """Add a word."""
        for lane, ((_, bit), curve) in enumerate(zip(self.bits, self.curves)):
            curve.add(time, lane + LANE * (raw >> bit & 1))


class FaultMarks:
    """The faults of a drive: times of missing answers, and periods of faults."""

    def __init__(self) -> None:
        self.lost: list[float] = []
        self.faults: list[tuple[float, float]] = []
        self._since = self._last = math.nan

    def add(self, time: float, telegram: Telegram) -> None:
        """Add a telegram."""
        if telegram.verdict is Verdict.LOST and len(self.lost) < _MARKS_MAX:
            self.lost.append(time)
        for parameter, raw in zip(telegram.parameters, telegram.raws):
            bit = dict(parameter.bits).get(FAULT)
            if bit is not None and telegram.verdict in _VALID:
                self._fault(time, bool(raw >> bit & 1))

    def _fault(self, time: float, there: bool) -> None:
        if self._since == self._since:      # not NaN
            if there:
                self.faults[-1] = self._since, time
                return
            self.faults[-1], self._since = (self._since, time), math.nan
        elif there and len(self.faults) < _MARKS_MAX:
            self._since = time
            self.faults.append((time, time))


class Turning:
    """The position of a ``continuous`` joint: without the wraps of its counter."""

    def __init__(self, drive: DriveConfiguration, joint: JointConfiguration) -> None:
        self._position = ContinuousPosition(joint, drive.cyclic_response)
        #: s without a sample after which its turns are unknown: as for the bridge
        self._lost_after = (drive.missed_limit + 1) * drive.period
        self._last = math.nan

    def take(self, time: float, raw: int) -> int:
        """Return the raw integer without wraps."""
        if time - self._last > self._lost_after:
            self._position.begin_again()
        self._last = time
        return self._position.take(raw)


class Plotter:
    """
    Collects curves for a picture.

    :param wanted: ``DRIVE.NAME``; none: the actual values of ``drives``.
    :raises DriveCanError: a name that no drive has, or too many of them.
    """

    def __init__(self, configuration: BridgeConfiguration, wanted: Sequence[str],
                 drives: Sequence[DriveConfiguration]) -> None:
        self._curves: dict[tuple[str, str], Curve] = {}
        self._lanes: dict[tuple[str, str], BitLanes] = {}
        self._marks: dict[str, FaultMarks] = {}
        self._turning: dict[tuple[str, str], Turning] = {}
        self._start = math.nan
        for text in wanted:
            drive_name, _, name = text.partition('.')
            drive = configuration.drives.get(drive_name)
            if drive is None:
                raise DriveCanError(command_sentences.plot_names_no_drive(
                    text=text, drive=drive_name, drives=', '.join(configuration.drives) or 'none'))
            known = {**drive.profile.parameters, **{name: None for _, name, _ in columns(drive)}}
            if name not in known:
                raise DriveCanError(command_sentences.plot_names_no_value(
                    text=text, drive=drive_name, name=name))
            self._add(drive, name)
        if not wanted:
            for drive in drives:
                for parameter in drive.cyclic_response:
                    self._add(drive, parameter.name)

    def _add(self, drive: DriveConfiguration, name: str) -> None:
        parameter = drive.profile.parameters.get(name)
        self._marks.setdefault(drive.name, FaultMarks())
        unit = parameter.unit if parameter is not None else ''
        self._curves[drive.name, name] = Curve(f'{drive.name}.{name}', unit)
        joint = drive.joint
        if joint is not None and joint.continuous is not False and joint.position == name:
            self._turning[drive.name, name] = Turning(drive, joint)

    def __call__(self, bus: str, telegram: Telegram) -> None:
        """Add a telegram."""
        if self._start != self._start:      # NaN
            self._start = telegram.time
        marks = self._marks.get(telegram.drive)
        if marks is not None:
            marks.add(telegram.time - self._start, telegram)
        if not telegram.raws or telegram.verdict not in _VALID:
            return
        for parameter, raw in zip(telegram.parameters, telegram.raws):
            place = telegram.drive, parameter.name
            if parameter.bits and place in self._curves:
                self._lanes_of(place, parameter).add(telegram.time - self._start, raw)
                continue
            if place in self._curves:
                if place in self._turning:
                    raw = self._turning[place].take(telegram.time, raw)
                self._curves[place].add(telegram.time - self._start,
                                        float(parameter.value_from_raw(raw)))

    def _lanes_of(self, place: tuple[str, str], parameter: Parameter) -> BitLanes:
        lanes = self._lanes.get(place)
        if lanes is None:
            lanes = self._lanes[place] = BitLanes(
                '.'.join(place), parameter.bits, tuple(Curve(name) for name, _ in parameter.bits))
        return lanes

    def draw(self, path: str, title: str = '',
             notes: Sequence[tuple[float, str]] = ()) -> None:
        """
        Write the picture: a panel for each unit, and one with lanes for each word of named bits.

        :param notes: what happened, and when, by the times of the trace's records.
        :raises DriveCanError: nothing to draw.
        :raises ImportError: matplotlib is not installed.
        """
        import matplotlib
        matplotlib.use('Agg')
        from matplotlib import pyplot
        panels: dict[str, list[Curve]] = {}
        for curve in self._curves.values():
            if curve.points()[0]:
                panels.setdefault(curve.unit, []).append(curve)
        if not panels and not self._lanes:
            raise DriveCanError(command_sentences.nothing_to_plot())
        heights = [*([2.2] * len(panels)),
                   *(0.6 + 0.2 * len(lanes.bits) for lanes in self._lanes.values())]
        figure, axes = pyplot.subplots(len(heights), 1, sharex=True, squeeze=False,
                                       figsize=(12, 1.5 + sum(heights)),
                                       height_ratios=heights, constrained_layout=True)
        for axis, (unit, curves) in zip(axes[:, 0], panels.items()):
            for curve in curves:
                axis.plot(*curve.points(), label=curve.name, linewidth=1.0,
                          drawstyle='steps-post')
            axis.set_ylabel(unit or '–')
            axis.grid(visible=True, alpha=0.3)
            axis.legend(loc='upper right', fontsize='small')
        for axis, lanes in zip(axes[len(panels):, 0], self._lanes.values()):
            for lane, curve in enumerate(lanes.curves):
                times, values = curve.points()
                axis.fill_between(times, lane, values, step='post', linewidth=1.0,
                                  color='tab:red' if curve.name == FAULT else 'tab:blue')
            axis.set_yticks([lane + 0.5 * LANE for lane in range(len(lanes.bits))],
                            [name for name, _ in lanes.bits], fontsize='small')
            axis.set_title(lanes.name, loc='left', fontsize='small')
            axis.grid(visible=True, axis='x', alpha=0.3)
        for axis in axes[:, 0]:
            self._mark(axis)
            for at, _ in notes:
                axis.axvline(at - self._start, color='0.4', linewidth=0.8, linestyle=':')
        for place, (at, text) in enumerate(notes):      # in turns, so that none hides the next one
            axes[0, 0].annotate(
                text, (at - self._start, 1.0), xycoords=axes[0, 0].get_xaxis_transform(),
                xytext=(2, 3 + 11 * (place % 2)), textcoords='offset points', fontsize='small')
        self._explain(axes[0, 0])
        if title:
            figure.suptitle(title, fontsize='medium')
        axes[-1, 0].set_xlabel('s since the trace began')
        figure.savefig(path)
        pyplot.close(figure)

    def _explain(self, axis: Any) -> None:
        """Explain the marks in the legend, where there are any."""
        if any(marks.lost for marks in self._marks.values()):
            axis.plot([], [], '|', color='tab:red', markersize=9, label='no answer')
        if any(marks.faults for marks in self._marks.values()):
            axis.fill_between([], [], color='tab:red', alpha=0.12, linewidth=0, label='fault')
        if axis.get_legend_handles_labels()[1]:
            axis.legend(loc='upper right', fontsize='small')

    def _mark(self, axis: Any) -> None:
        """Draw the faults: a red tick for each missing answer, a red background for a fault."""
        lost = [time for marks in self._marks.values() for time in marks.lost]
        axis.plot(lost, [0.02] * len(lost), '|', color='tab:red', markersize=9,
                  transform=axis.get_xaxis_transform())
        for marks in self._marks.values():
            for begin, end in marks.faults:
                axis.axvspan(begin, end, color='tab:red', alpha=0.12, linewidth=0)
