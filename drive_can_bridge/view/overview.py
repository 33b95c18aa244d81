# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
All drives at a glance.

They get the most telling table that leaves room for the rest of the page: everything in columns,
or one line each; and where not even that fits, as many as fit around the one that is marked.
"""

from collections.abc import Iterable, Sequence
import math

from rich.table import Table
from rich.text import Text

from drive_can_bridge.monitor.snapshot import (
    BusSnapshot, DriveSnapshot, Level, Shown, Snapshot, UNKNOWN,
)
from drive_can_bridge.monitor.summary import counts_in_words, in_order, principal, troubles
from drive_can_bridge.view.parts import (
    DIM, GAP, LEVEL_STYLES, Lines, milliseconds, NO_VALUE, plain_table, spark, state, times,
    TONE_STYLES, ValueColumns, wrapped,
)

#: longest state that a drive has
_STATE = 2 + len('mapping differs')
_TREND_MIN, _TREND_MAX = 8, 30
_EXCHANGE_WIDTH = 28
_LOAD_WIDTH = 12
#: %, above which a bus is never OK
LOAD_WARNING = 70.0


def drives_table(drives: Sequence[DriveSnapshot], marked: str | None, *, width: int, height: int,
                 ) -> tuple[Table, int, str]:
    """
    Return the drives as a table, its height, and which of them it shows, in words.

    :param height: at most.
    """
    drives = in_order(drives)
    full, told = _FullTable(drives, width), counts_in_words(drives)
    if full.fits(height):
        return full.table(drives, marked), full.height, told
    shown = max(1, height - 1)
    if len(drives) <= shown:
        return _line_table(drives, drives, marked, width), len(drives) + 1, told
    place = next((number for number, drive in enumerate(drives) if drive.name == marked), 0)
    first = min(max(0, place - shown // 2), len(drives) - shown)
    return (_line_table(drives, drives[first:first + shown], marked, width), shown + 1,
            f'{first + 1} to {first + shown} of {told}')


def _mark(drive: DriveSnapshot, marked: str | None) -> Text:
    return Text('▸ ' if drive.name == marked else '  ', style='bold cyan').append(
        drive.label, style='bold')


class _FullTable:
    """Everything of every drive, in columns of several lines."""

    def __init__(self, drives: Sequence[DriveSnapshot], width: int) -> None:
        self._setpoints = ValueColumns(item for drive in drives for item in drive.setpoints)
        self._values = ValueColumns(item for drive in drives for item in drive.values)
        self._first = max([len(drive.label) for drive in drives] + [_STATE]) + 2
        need = self._first + GAP + self._values.width
        if self._setpoints.width:
            need += self._setpoints.width + GAP
        self._too_wide = need > width
        left = width - need - GAP
        # where there is room for one of them only, a trend tells more
        self._exchange = left >= _TREND_MIN + GAP + _EXCHANGE_WIDTH
        left -= (GAP + _EXCHANGE_WIDTH) * self._exchange
        self._trend = min(left, _TREND_MAX) if left >= _TREND_MIN else 0
        self.height = 1 + sum(self._lines(drive) for drive in drives) + max(0, len(drives) - 1)

    def fits(self, height: int) -> bool:
        return self.height <= height and not self._too_wide

    def _lines(self, drive: DriveSnapshot) -> int:
        return max(3 + self._exchange, len(drive.setpoints), len(drive.values))

    def table(self, drives: Sequence[DriveSnapshot], marked: str | None) -> Table:
        table = plain_table()
        table.add_column('  drive', width=self._first, no_wrap=True)
        if self._setpoints.width:
            table.add_column('setpoint, as sent', width=self._setpoints.width, no_wrap=True)
        trend = GAP + self._trend if self._trend else 0
        table.add_column('actual value', width=self._values.width + trend, no_wrap=True)
        if self._exchange:
            table.add_column(f'{"exchange":14}{"mean":>5}{"p99":>9}', width=_EXCHANGE_WIDTH,
                             no_wrap=True)
        for number, drive in enumerate(drives):
            if number:
                table.add_row()
            cells = [_identity(drive, marked)]
            if self._setpoints.width:
                cells.append(_stack(self._setpoints.line(item) for item in drive.setpoints))
            cells.append(_stack(self._values.line(item, self._trend) for item in drive.values))
            if self._exchange:
                cells.append(_exchange(drive))
            table.add_row(*cells)
        return table


def _stack(lines: Iterable[Text]) -> Text:
    return Text('\n').join(lines)


def _identity(drive: DriveSnapshot, marked: str | None) -> Text:
    below = drive.control or f'{drive.rate:.1f} /s'
    return _stack([_mark(drive, marked), Text('  ').append_text(state(drive)),
                   Text(f'  {below}', style=DIM)])


def _exchange(drive: DriveSnapshot) -> Text:
    missed = Text(f'{"missed":12}{drive.missed:7}', style='bold yellow' if drive.missed else '')
    return _stack([
        Text(f'{"rate":12}{drive.rate:7.1f}').append(' /s', style=DIM), missed,
        *(Text(f'{label:12}{milliseconds(found.mean):>7} {milliseconds(found.p99):>8}')
          for label, found in (('period error', drive.period_error),
                               ('latency, ms', drive.latency)))])


def _line_table(all_drives: Sequence[DriveSnapshot], drives: Sequence[DriveSnapshot],
                marked: str | None, width: int) -> Table:
    """One line for each drive; columns that do not fit are left out, the least telling first."""
    setpoints = {drive.name: principal(drive.setpoints) for drive in all_drives}
    values = {drive.name: principal(drive.values) for drive in all_drives}
    first = max(len(drive.label) for drive in all_drives) + 2
    sent = ValueColumns(item for item in setpoints.values() if item)
    actual = ValueColumns(item for item in values.values() if item)
    left = width - first - GAP - _STATE
    wanted = {'sent': sent.width - sent.name, 'actual': actual.width - actual.name, 'rate': 6,
              'trend': _TREND_MIN, 'missed': 6, 'name': actual.name, 'period': 14, 'latency': 14}
    widths = {}
    for key, columns in wanted.items():
        if columns and left >= columns + GAP:
            widths[key] = columns
            left -= columns + GAP
    if 'trend' in widths:
        more = min(max(0, left), _TREND_MAX - _TREND_MIN)
        widths['trend'] += more
    table = plain_table()
    table.add_column('  drive', width=first, no_wrap=True)
    table.add_column('  state', width=_STATE, no_wrap=True)
    headings = {'sent': 'setpoint', 'name': 'actual', 'actual': 'value', 'trend': 'trend',
                'rate': 'rate/s', 'missed': 'missed', 'period': 'period err, ms',
                'latency': 'latency, ms'}
    if 'name' not in widths:
        headings['actual'] = 'actual'
    shown = [key for key in headings if key in widths]
    for key in shown:
        numeric = key in ('rate', 'missed', 'period', 'latency', 'sent', 'actual')
        table.add_column(headings[key], width=widths[key], no_wrap=True,
                         justify='right' if numeric else 'left')
    for drive in drives:
        value = values[drive.name]
        cells = {
            'sent': _cell(sent, setpoints[drive.name]), 'actual': _cell(actual, value),
            'name': Text(value.name if value else '', style=DIM),
            'trend': spark(value.points if value else (), widths.get('trend', 1)),
            'rate': Text(f'{drive.rate:.1f}'),
            'missed': Text(str(drive.missed), style='bold yellow' if drive.missed else ''),
            'period': Text(times(drive.period_error)), 'latency': Text(times(drive.latency))}
        table.add_row(_mark(drive, marked), state(drive), *(cells[key] for key in shown))
    return table


def _cell(columns: ValueColumns, item: Shown | None) -> Text:
    return columns.short(item) if item else Text(NO_VALUE, style=DIM)


def advice_lines(snapshot: Snapshot, width: int, *, brief: bool = False) -> Lines:
    """
    Say what is not well, and what to do.

    :param brief: in a line for each trouble.
    """
    lines: Lines = []
    for trouble in troubles(snapshot):
        style = TONE_STYLES[trouble.tone]
        text = wrapped(f'{trouble.who}{trouble.text}', width - 2)
        if brief and len(text) > 1:
            text = [Text(f'{trouble.who}{trouble.text}'[:width - 3] + '…')]
        text[0].stylize(style, 0, len(trouble.who))
        lines += [Text('! ' if place == 0 else '  ', style=style).append_text(line)
                  for place, line in enumerate(text)]
    return lines


def bus_lines(buses: Sequence[BusSnapshot], width: int, height: int) -> Lines:
    """Write a line for each bus."""
    label = max((len(bus.label) for bus in buses), default=0)
    name = max((len(bus.state) for bus in buses), default=0)
    lines = []
    for bus in buses[:height]:
        line = Text(f'{bus.label:{label}}  ', no_wrap=True).append(
            f'{bus.state:{name}}', style=LEVEL_STYLES[bus.level])
        if bus.state == UNKNOWN:
            lines.append(line.append(f'  {bus.message}', style=DIM))
            continue
        load = 0.0 if math.isnan(bus.load) else bus.load
        line.append(f'  load {load:5.1f} % ')
        if width >= 80:
            filled = min(_LOAD_WIDTH, max(0, round(_LOAD_WIDTH * load / 100)))
            line.append('█' * filled, style='cyan' if load <= LOAD_WARNING else 'bold yellow')
            line.append('░' * (_LOAD_WIDTH - filled), style=DIM)
        for number, what in ((bus.sent, 'sent/s'), (bus.received, 'received/s')):
            line.append(f'  {number:6.0f}').append(f' {what}', style=DIM)
        for count, what in ((bus.rejected, 'rejected'), (bus.errors, 'errors')):
            line.append(f'  {count:3}', style='bold yellow' if count else '').append(
                f' {what}', style=DIM)
        if bus.level is Level.OK:
            line.append(f'  {bus.message}', style=DIM)
        line.truncate(width, overflow='ellipsis')
        lines.append(line)
    if len(buses) > height > 0:
        lines[-1] = Text(f'… and {len(buses) - height + 1} more buses', style=DIM)
    return lines
