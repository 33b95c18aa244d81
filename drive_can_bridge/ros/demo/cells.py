# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The pieces of which the view shows a drive.

Widths follow from the longest names and the longest possible values, never from those of the
moment: a column that moves cannot be read.
"""

from collections.abc import Iterable, Sequence
import math

from rich.text import Text

from drive_can_bridge.core.session import DriveState
from drive_can_bridge.ros.demo.snapshot import Bits, DriveSnapshot, Shown, Times

DIM = 'bright_black'
STATE_STYLES = {
    DriveState.ONLINE: 'bold green', DriveState.NOT_ARMED: 'bold yellow',
    DriveState.OFFLINE: 'bold red', DriveState.MAPPING_DIFFERS: 'bold red',
    DriveState.FAULT: 'bold white on red',
}
STATE_WIDTH = max(len(state.value) for state in DriveState)
#: heading of the column of setpoints
SETPOINTS = 'setpoint, as sent'
_NO_VALUE = '–'
_BARS = '▁▂▃▄▅▆▇█'
#: columns of lamps that stay together
_LAMPS_WIDTH = 60

Lines = list[Text]


def column_widths(drives: Sequence[DriveSnapshot]) -> tuple[int, int, int]:
    """Return the widths of what a drive is, of its setpoints and of its values."""
    # a space before, and two for the lamp before the state
    first = max([1 + max(len(drive.name), len(drive.place), 2 + STATE_WIDTH)
                 for drive in drives] + [17])
    widths = []
    for kind in ('setpoints', 'values'):
        names, numbers, units = _widths(drives, kind)
        widths.append(max(names + 1 + numbers + 1 + units, len(SETPOINTS)))
    return first, widths[0], widths[1]


def _widths(drives: Iterable[DriveSnapshot], kind: str) -> tuple[int, int, int]:
    """Return the widths of names, numbers and units of a column."""
    shown = [item for drive in drives for item in getattr(drive, kind)]
    return (max([len(item.name) for item in shown] + [0]),
            max([item.width for item in shown] + [0]),
            max([len(item.unit) for item in shown] + [0]))


def identity_cell(drive: DriveSnapshot) -> Lines:
    """Say who it is, how it is, and where."""
    style = STATE_STYLES[drive.state]
    lines = [Text(f' {drive.name}', style='bold'),
             Text(' ').append('● ' if drive.answering else '○ ', style=style).append(
                 drive.state.value, style=style)]
    if drive.control:
        lines.append(Text(f' {drive.control}'))
    lines.append(Text(f' {drive.place}', style=DIM))
    return lines


def values_cell(items: Sequence[Shown], drives: Sequence[DriveSnapshot], kind: str) -> Lines:
    """
    Put values one below the other, in columns that all drives share.

    :param kind: ``setpoints`` or ``values``.
    """
    names, numbers, _ = _widths(drives, kind)
    return [Text(f'{item.name:{names}} ').append(
        f'{item.text or _NO_VALUE:>{numbers}}', style=_number_style(item)).append(
            f' {item.unit}', style=DIM) for item in items]


def _number_style(item: Shown) -> str:
    return 'bold cyan' if item.text and item.strong else DIM


def exchange_cell(drive: DriveSnapshot) -> Lines:
    """Say how the exchange goes."""
    missed = Text(f'{"missed":14}').append(
        f'{drive.missed:7}', style='bold yellow' if drive.missed else '')
    return [Text(f'{"rate":14}{drive.rate:7.1f}').append(' /s', style=DIM), missed,
            _numbers('period error', drive.period_error), _numbers('latency', drive.latency)]


def exchange_width() -> int:
    """Return the columns that :func:`exchange_cell` takes."""
    return _numbers('', Times()).cell_len


def _numbers(label: str, times: Times) -> Text:
    return Text(f'{label:14}{milliseconds(times.mean):>7} {milliseconds(times.p99):>7}').append(
        ' ms', style=DIM)


def milliseconds(seconds: float) -> str:
    """Write a time that may be unknown."""
    if math.isnan(seconds):
        return _NO_VALUE
    number = 1e3 * seconds
    return f'{number:.2f}' if number < 99.995 else f'{number:.0f}'


def lamps(bits: Iterable[Bits], width: int) -> Lines:
    """Put all bits one behind the other, a lamp before each."""
    lines: Lines = []
    for parameter in bits:
        line = Text()
        for name, state in parameter.states:
            lamp = Text('● ' if state else '○ ', style='bold green' if state else DIM)
            if state and name in ('fault', 'warning'):
                lamp.stylize('bold red' if name == 'fault' else 'bold yellow')
            lamp.append(name, style='' if state else DIM)
            if line and line.cell_len + 2 + lamp.cell_len > width:
                lines.append(line)
                line = Text()
            line.append('  ' if line else '').append_text(lamp)
        lines.append(line)
    return lines


def piece(item: Shown) -> Text:
    """Write a value with room for the longest one."""
    return Text(f'{item.name} ').append(
        f'{item.text or _NO_VALUE:>{item.width}}', style=_number_style(item)).append(
            f' {item.unit}' if item.unit else '', style=DIM)


def current_pieces(drive: DriveSnapshot) -> Lines:
    """Return the values of a drive as pieces; bits that have names stand for their word."""
    named = {bits.parameter for bits in drive.bits}
    return [*(piece(item) for item in drive.values if item.name not in named),
            *(line for bits in drive.bits for line in lamps([bits], _LAMPS_WIDTH))]


def trend_cell(drive: DriveSnapshot, width: int) -> Lines:
    """Draw the last values, two lines high, and say what they are."""
    trend = drive.trend
    samples = trend.samples[-width:]
    if not samples:
        return []
    low, high = min(0.0, *samples), max(0.0, *samples)
    upper, lower = '', ''
    for sample in samples:
        level = round((sample - low) / (high - low) * (2 * len(_BARS) - 1)) if high > low else 0
        upper += _BARS[level - len(_BARS)] if level >= len(_BARS) else ' '
        lower += _BARS[min(level, len(_BARS) - 1)]
    legend = f'{trend.name}, {low:.0f} to {high:.0f} {trend.unit}'
    return [Text(f'{text:>{width}}', style=style)
            for text, style in ((upper, 'cyan'), (lower, 'cyan'), (legend[:width], DIM))]


def wrapped(text: str, width: int) -> Lines:
    """Write advice."""
    lines, line = [], ''
    for word in text.split():
        if line and len(line) + 1 + len(word) > width:
            lines.append(Text(line, style='red'))
            line = ''
        line += f' {word}' if line else word
    return [*lines, Text(line, style='red')]
