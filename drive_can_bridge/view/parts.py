# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The pieces of which pages are made.

Widths follow from the longest names and the longest possible values, never from those of the
moment: a column that moves cannot be read.
"""

from collections.abc import Iterable, Mapping, Sequence
import math
import textwrap
import time

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from drive_can_bridge.monitor.snapshot import (
    columns, DriveSnapshot, Level, LogLine, Points, Shown, Times,
)
from drive_can_bridge.monitor.summary import Tone, tone_of

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
#: between columns, and between what stands one behind the other
GAP = 2
_BARS = '▁▂▃▄▅▆▇█'
#: a trend that spans less than this part of its values is a level line: noise is no news
_FLAT = 0.02
#: s that a trend reaches back
TREND_SPAN = 30.0

Lines = list[Text]


def section(title: str, body: Sequence[RenderableType], *, boxed: bool) -> RenderableType:
    """Put a title above something, or a frame around it: two lines more than it has, or one."""
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
    """Draw the last values in one line, the newest on the right."""
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
        """Columns of a whole line."""
        return self.name + 1 + self.number + 1 + self.unit if self.name else 0

    def line(self, item: Shown, trend: int = 0) -> Text:
        """Write a value, and its trend on so many columns."""
        text = Text(f'{item.name:{self.name}} ').append_text(self.short(item))
        if trend:
            text.append('  ').append_text(spark(item.points, trend))
        return text

    def short(self, item: Shown) -> Text:
        """Write a value without its name."""
        return Text().append(f'{item.text or NO_VALUE:>{self.number}}',
                             style=NUMBER if item.text else DIM).append(
            f' {item.unit:{self.unit}}', style=DIM)


def lamps(bits: Mapping[str, bool], width: int) -> Lines:
    """Put bits one behind the other, a lamp before each."""
    found: Lines = []
    for name, on in bits.items():
        style = _ALARMS.get(name, 'bold green') if on else DIM
        found.append(Text('● ' if on else '○ ', style=style).append(
            name, style=(style if name in _ALARMS else '') if on else DIM))
    return flow(found, width, GAP)


def flow(words: Iterable[Text], width: int, gap: int) -> Lines:
    """Put texts one behind the other, so far apart, as many on a line as fit."""
    lines: Lines = []
    for word in words:
        if lines and lines[-1].cell_len + gap + word.cell_len <= width:
            lines[-1].append(' ' * gap).append_text(word)
        else:
            lines.append(word.copy())
    return lines


def plain_table() -> Table:
    """Make a table without any lines."""
    return Table(box=None, padding=(0, GAP, 0, 0), pad_edge=False, header_style=DIM,
                 show_edge=False)


def wrapped(text: str, width: int, style: str = '') -> Lines:
    """Break a text into lines."""
    return [Text(line, style=style) for line in textwrap.wrap(text, max(10, width))] or [Text()]


def milliseconds(number: float) -> str:
    """Write a time in ms that may be unknown."""
    if math.isnan(number):
        return NO_VALUE
    return f'{number:.2f}' if number < 99.995 else f'{number:.0f}'


def times(found: Times) -> str:
    """Write mean and 99th percentile."""
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
    start = Text(f'{clock(entry.at)} ', style=DIM)
    if entry.level in _LOG_STYLES:
        start.append(f'{entry.level} ', style=_LOG_STYLES[entry.level])
    indent = start.cell_len
    first, *others = textwrap.wrap(entry.text, max(20, width - indent)) or ['']
    return [start.append(first), *(Text(' ' * indent + text) for text in others)]


def clock(at: float) -> str:
    """Write the time of day, where the reader is."""
    return time.strftime('%H:%M:%S', time.localtime(at))
