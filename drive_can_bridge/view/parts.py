# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The pieces of which pages are made.

Widths follow from the longest names and the longest possible values, never from those of the
moment: a column that moves cannot be read.
"""

from collections.abc import Iterable, Mapping, Sequence
import math
import textwrap

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from drive_can_bridge.clock import time_of_day
from drive_can_bridge.monitor.snapshot import (
    BusSnapshot, columns, DriveSnapshot, Level, LogLine, Points, Shown, Snapshot, Times, UNKNOWN,
)
from drive_can_bridge.monitor.summary import (
    counts_in_words, in_order, principal, Tone, tone_of, troubles,
)

DIM = 'bright_black'
NUMBER = 'bold cyan'
LEVEL_STYLES = {Level.OK: 'bold green', Level.WARN: 'bold yellow', Level.ERROR: 'bold red',
                Level.STALE: 'bold red'}
TONE_STYLES = {Tone.OK: 'bold green', Tone.OFF: 'bold', Tone.WARN: 'bold yellow',
               Tone.ERROR: 'bold red', Tone.UNKNOWN: DIM}
_LOG_STYLES = {'WARN': 'bold yellow', 'ERROR': 'bold red', 'FATAL': 'bold white on red'}
#: bits that are no good news, whatever the drive
_ALARMS = {'fault': 'bold red', 'alarm': 'bold red', 'trip': 'bold red', 'warning': 'bold yellow'}
NO_VALUE = '–'
#: between columns, and between texts in a row
GAP = 2
_BARS = '▁▂▃▄▅▆▇█'
#: a trend that spans less than this part of its values is a level line: noise is no news
_FLAT = 0.02
#: s that a trend reaches back
TREND_SPAN = 30.0

Lines = list[Text]
#: longest state that a drive has
_STATE = 2 + len('mapping differs')
#: longest state of a control word, where there is room for it
_CONTROL = len('quick stop active, holds')
_TREND_MIN, _TREND_MAX = 8, 30
_EXCHANGE_WIDTH = 28
_LOAD_WIDTH = 12
#: %, above which a bus is never OK
LOAD_WARNING = 70.0


def section(title: str, body: Sequence[RenderableType], *, boxed: bool) -> RenderableType:
    """Return something under a title, or in a frame: one or two lines more than it has."""
    if boxed:
        return Panel(Group(*body), title=Text(title, style='bold'), title_align='left',
                     border_style=DIM, box=box.ROUNDED, padding=(0, 1))
    return Group(Text(f'── {title} {"─" * 400}', style=DIM, no_wrap=True, overflow='crop'), *body)


def state(drive: DriveSnapshot) -> Text:
    """Return the state in a word, with a lamp."""
    style = TONE_STYLES[tone_of(drive)]
    return Text().append('● ' if drive.online else '○ ', style=style).append(
        drive.state or 'unknown', style=style)


def spark(points: Points, width: int, span: float = TREND_SPAN) -> Text:
    """Return the last values as a line of bars, the newest on the right."""
    found = columns(points, span, width)
    known = [value for value in found if value is not None]
    if not known:
        return Text(' ' * width)
    low, high = min(known), max(known)
    flat = high - low <= _FLAT * max(abs(low), abs(high))
    step = 0.0 if flat else (len(_BARS) - 1) / (high - low)
    return Text(''.join(' ' if value is None else _BARS[round((value - low) * step)]
                        for value in found), style='cyan')


class ValueColumns:
    """
    The widths of name, number and unit of values that stand below each other.

    :param items: all of them.
    """

    def __init__(self, items: Iterable[Shown]) -> None:
        shown = list(items)
        self.name = max((len(item.name) for item in shown), default=0)
        self.number = max((max(item.width, len(item.text)) for item in shown), default=0)
        self.unit = max((len(item.unit) for item in shown), default=0)

    @property
    def width(self) -> int:
        """The columns of a whole line."""
        return self.name + 1 + self.number + 1 + self.unit if self.name else 0

    def line(self, item: Shown, trend: int = 0) -> Text:
        """Return a value, and its trend on so many columns."""
        text = Text(f'{item.name:{self.name}} ').append_text(self.short(item))
        if trend:
            text.append('  ').append_text(spark(item.points, trend))
        return text

    def short(self, item: Shown) -> Text:
        """Return a value without its name."""
        return Text().append(f'{item.text or NO_VALUE:>{self.number}}',
                             style=NUMBER if item.text else DIM).append(
            f' {item.unit:{self.unit}}', style=DIM)


def lamps(bits: Mapping[str, bool], width: int) -> Lines:
    """Return bits one behind the other, a lamp before each."""
    found: Lines = []
    for name, on in bits.items():
        style = _ALARMS.get(name, 'bold green') if on else DIM
        found.append(Text('● ' if on else '○ ', style=style).append(
            name, style=(style if name in _ALARMS else '') if on else DIM))
    return flow(found, width, GAP)


def flow(words: Iterable[Text], width: int, gap: int) -> Lines:
    """Return texts one behind the other, so far apart, as many on a line as fit."""
    lines: Lines = []
    for word in words:
        if lines and lines[-1].cell_len + gap + word.cell_len <= width:
            lines[-1].append(' ' * gap).append_text(word)
        else:
            lines.append(word.copy())
    return lines


def plain_table() -> Table:
    """Return a table without any lines."""
    return Table(box=None, padding=(0, GAP, 0, 0), pad_edge=False, header_style=DIM,
                 show_edge=False)


def wrapped(text: str, width: int, style: str = '') -> Lines:
    """Return a text as lines."""
    return [Text(line, style=style) for line in textwrap.wrap(text, max(10, width))] or [Text()]


def milliseconds(number: float) -> str:
    """Return a time in ms that may be unknown."""
    if math.isnan(number):
        return NO_VALUE
    return f'{number:.2f}' if number < 99.995 else f'{number:.0f}'


def times(found: Times) -> str:
    """Return mean and 99th percentile as text."""
    return f'{milliseconds(found.mean)} / {milliseconds(found.p99)}'


def log_lines(log: Sequence[LogLine], width: int, height: int) -> Lines:
    """Return the newest lines of the log that fit, broken where they are too long."""
    lines: Lines = []
    for entry in reversed(log):
        if len(lines) >= height:
            break
        lines = _log_entry(entry, width) + lines
    return lines[max(0, len(lines) - height):]


def _log_entry(entry: LogLine, width: int) -> Lines:
    start = Text(f'{time_of_day(entry.at)} ', style=DIM)
    if entry.level in _LOG_STYLES:
        start.append(f'{entry.level} ', style=_LOG_STYLES[entry.level])
    indent = start.cell_len
    first, *others = textwrap.wrap(entry.text, max(20, width - indent)) or ['']
    return [start.append(first), *(Text(' ' * indent + text) for text in others)]


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
        # where there is room for one of them only, a trend is more useful
        self._exchange = left >= _TREND_MIN + GAP + _EXCHANGE_WIDTH
        left -= (GAP + _EXCHANGE_WIDTH) * self._exchange
        if any(drive.control for drive in drives):     # a word is more useful than a longer trend
            wanted = max(_CONTROL, *(len(drive.control) for drive in drives)) + 2 - self._first
            widened = max(0, min(wanted, left))
            self._first += widened
            left -= widened
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
            table.add_column('exchange', width=_EXCHANGE_WIDTH, no_wrap=True)
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
    missed = Text(f'{drive.missed} missed', style='bold yellow' if drive.missed else '')
    return _stack([
        Text(f'{drive.rate:.1f}').append(' /s', style=DIM).append(', ').append_text(missed),
        Text(f'{"ms":12}{"mean":>7} {"p99":>8}', style=DIM),
        *(Text(f'{label:12}{milliseconds(found.mean):>7} {milliseconds(found.p99):>8}')
          for label, found in (('period error', drive.period_error),
                               ('latency', drive.latency)))])


def _line_table(all_drives: Sequence[DriveSnapshot], drives: Sequence[DriveSnapshot],
                marked: str | None, width: int) -> Table:
    """Return a line for each drive; columns that do not fit are left out, least useful first."""
    setpoints = {drive.name: principal(drive.setpoints) for drive in all_drives}
    values = {drive.name: principal(drive.values) for drive in all_drives}
    first = max(len(drive.label) for drive in all_drives) + 2
    sent = ValueColumns(item for item in setpoints.values() if item)
    actual = ValueColumns(item for item in values.values() if item)
    left = width - first - GAP - _STATE
    wanted = {'sent': sent.width - sent.name, 'actual': actual.width - actual.name, 'rate': 6,
              'trend': _TREND_MIN, 'missed': 6, 'name': actual.name, 'period': 14, 'latency': 14}
    widths = {}
    for key, needed in wanted.items():
        if needed and left >= needed + GAP:
            widths[key] = needed
            left -= needed + GAP
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
    Return what is not well, and what to do.

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
    """Return a line for each bus."""
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
