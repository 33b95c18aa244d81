# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The values of a trace as columns of a table, and as curves."""

from array import array
from collections.abc import Iterable, Sequence
import csv
import math
from typing import Any, NamedTuple, TextIO

from drive_can_bridge.core.configuration import BridgeConfiguration, DriveConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.observer import Telegram, Verdict
from drive_can_bridge.protocols.telegrams import Direction

#: shortest stretch of time of a curve in s, and how many there are at most: a picture has fewer
#: columns of pixels
_STRETCH = 0.001
_STRETCHES_MAX = 4096
#: the words of a family that has its control built in
_BUILT_IN = (('control_word', Direction.REQUEST), ('status_word', Direction.RESPONSE))
#: the bit of a status word that says that there is a fault
FAULT = 'fault'
#: height of a lane of bits, of 1
LANE = 0.8
#: marks of a drive that are shown
_MARKS_MAX = 10_000
_VALID = (Verdict.NORMAL, Verdict.LATE, Verdict.SUSPICIOUS)

Column = tuple[str, str, Direction]


def columns(drive: DriveConfiguration) -> dict[Column, str]:
    """
    Return the values of a drive that a table has, and what the columns are called.

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

    A line for each telegram that carries values; cells of values that it does not carry are empty.
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
        """Take a telegram."""
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
        """Take a point."""
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


class Lanes(NamedTuple):
    """
    A word of named bits: a lane each, from the bottom, in which a set bit is high.

    :param bits: name and place.
    """

    name: str
    bits: tuple[tuple[str, int], ...]
    curves: tuple[Curve, ...]

    def add(self, time: float, raw: int) -> None:
        """Take a word."""
        for lane, ((_, bit), curve) in enumerate(zip(self.bits, self.curves)):
            curve.add(time, lane + LANE * (raw >> bit & 1))


class Marks:
    """What went wrong with a drive: when answers were missing, from when to when a fault was."""

    def __init__(self) -> None:
        self.lost: list[float] = []
        self.faults: list[tuple[float, float]] = []
        self._since = self._last = math.nan

    def add(self, time: float, telegram: Telegram) -> None:
        """Take a telegram."""
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


class Plotter:
    """
    Collects curves for a picture.

    :param wanted: ``DRIVE.NAME``; none: the actual values of all drives.
    :raises DriveCanError: a name that no drive has, or too many of them.
    """

    def __init__(self, configuration: BridgeConfiguration, wanted: Sequence[str]) -> None:
        self._curves: dict[tuple[str, str], Curve] = {}
        self._lanes: dict[tuple[str, str], Lanes] = {}
        self._marks: dict[str, Marks] = {}
        self._start = math.nan
        for text in wanted:
            drive_name, _, name = text.partition('.')
            drive = configuration.drives.get(drive_name)
            if drive is None:
                raise DriveCanError(f"--plot {text}: no drive '{drive_name}'; drives: "
                                    f'{", ".join(configuration.drives) or "none"}')
            known = {**drive.profile.parameters, **{name: None for _, name, _ in columns(drive)}}
            if name not in known:
                raise DriveCanError(f"--plot {text}: {drive_name} has no '{name}'")
            self._add(drive, name)
        if not wanted:
            for drive in configuration.drives.values():
                for parameter in drive.cyclic_response:
                    self._add(drive, parameter.name)

    def _add(self, drive: DriveConfiguration, name: str) -> None:
        parameter = drive.profile.parameters.get(name)
        self._marks.setdefault(drive.name, Marks())
        unit = parameter.unit if parameter is not None else ''
        self._curves[drive.name, name] = Curve(f'{drive.name}.{name}', unit)

    def __call__(self, bus: str, telegram: Telegram) -> None:
        """Take a telegram."""
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
            curve = self._curves.get((telegram.drive, parameter.name))
            if curve is not None:
                curve.add(telegram.time - self._start, float(parameter.value_from_raw(raw)))

    def _lanes_of(self, place: tuple[str, str], parameter: Parameter) -> Lanes:
        lanes = self._lanes.get(place)
        if lanes is None:
            lanes = self._lanes[place] = Lanes(
                '.'.join(place), parameter.bits, tuple(Curve(name) for name, _ in parameter.bits))
        return lanes

    def draw(self, path: str) -> None:
        """
        Write the picture: a panel for each unit, and one with lanes for each word of named bits.

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
            raise DriveCanError('nothing to plot: none of these values is in the trace')
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
        axes[-1, 0].set_xlabel('s since the trace began')
        figure.savefig(path)
        pyplot.close(figure)

    def _mark(self, axis: Any) -> None:
        """Show what went wrong: a red tick for each missing answer, red ground for a fault."""
        lost = [time for marks in self._marks.values() for time in marks.lost]
        axis.plot(lost, [0.02] * len(lost), '|', color='tab:red', markersize=9,
                  transform=axis.get_xaxis_transform())
        for marks in self._marks.values():
            for begin, end in marks.faults:
                axis.axvspan(begin, end, color='tab:red', alpha=0.12, linewidth=0)
