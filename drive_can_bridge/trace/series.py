# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The values of a trace as columns of a table, and as curves."""

from array import array
from collections.abc import Iterable, Sequence
import csv
import math
from typing import Any, TextIO

from drive_can_bridge.core.configuration import BridgeConfiguration, DriveConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.observer import Direction, Telegram, Verdict

#: shortest stretch of time of a curve in s, and how many there are at most: a picture has fewer
#: columns of pixels
_STRETCH = 0.001
_STRETCHES_MAX = 4096
#: the words of a family that has its control built in
_BUILT_IN = (('control_word', Direction.REQUEST), ('status_word', Direction.RESPONSE))
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


class Plotter:
    """
    Collects curves for a picture.

    :param wanted: ``DRIVE.NAME``; none: the actual values of all drives.
    :raises DriveCanError: a name that no drive has, or too many of them.
    """

    def __init__(self, configuration: BridgeConfiguration, wanted: Sequence[str]) -> None:
        self._curves: dict[tuple[str, str], Curve] = {}
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
        unit = parameter.unit if parameter is not None else ''
        self._curves[drive.name, name] = Curve(f'{drive.name}.{name}', unit)

    def __call__(self, bus: str, telegram: Telegram) -> None:
        """Take a telegram."""
        if self._start != self._start:      # NaN
            self._start = telegram.time
        if not telegram.raws or telegram.verdict not in _VALID:
            return
        for parameter, raw in zip(telegram.parameters, telegram.raws):
            curve = self._curves.get((telegram.drive, parameter.name))
            if curve is not None:
                curve.add(telegram.time - self._start, float(parameter.value_from_raw(raw)))

    def draw(self, path: str) -> None:
        """
        Write the picture: a panel for each unit.

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
        if not panels:
            raise DriveCanError('nothing to plot: none of these values is in the trace')
        figure, axes = pyplot.subplots(len(panels), 1, sharex=True, squeeze=False,
                                       figsize=(12, 1.5 + 2.2 * len(panels)),
                                       constrained_layout=True)
        for axis, (unit, curves) in zip(axes[:, 0], panels.items()):
            for curve in curves:
                axis.plot(*curve.points(), label=curve.name, linewidth=1.0,
                          drawstyle='steps-post')
            axis.set_ylabel(unit or '–')
            axis.grid(visible=True, alpha=0.3)
            axis.legend(loc='upper right', fontsize='small')
        axes[-1, 0].set_xlabel('s since the trace began')
        figure.savefig(path)
        pyplot.close(figure)
