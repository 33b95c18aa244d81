# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The drives in the view, from a table with everything to one line each."""

from collections.abc import Callable, Iterable, Sequence

from rich.text import Text

from drive_can_bridge.ros.demo.cells import (
    column_widths, current_pieces, DIM, exchange_cell, exchange_width, identity_cell, lamps, Lines,
    milliseconds, piece, SETPOINTS, STATE_STYLES, STATE_WIDTH, trend_cell, values_cell, wrapped,
)
from drive_can_bridge.ros.demo.snapshot import DriveSnapshot, give_way

GAP = '   '
#: between the values of a line that is not a table, and before the line
NARROW_GAP = '  '
#: columns that a trend needs to be worth its place
_TREND_MIN = 20

#: how the drives are shown: (drives, width) -> the heading, and the lines of each drive
Layout = Callable[[Sequence[DriveSnapshot], int], tuple[Lines, list[Lines]]]


def table(drives: Sequence[DriveSnapshot], width: int) -> tuple[Lines, list[Lines]]:
    """Everything, in columns. :func:`table_width` says how wide that is."""
    first, setpoints, values = column_widths(drives)
    exchange = exchange_width()
    trend = width - table_width(drives) - len(GAP)
    heading = _row([(Text(' drive'), first), (Text(SETPOINTS), setpoints),
                    (Text('actual value'), values),
                    (Text(f'{"exchange":14}{"mean":>7}{"p99":>8}'), exchange)])
    if trend >= _TREND_MIN:
        heading.append(GAP + 'trend')
    heading.stylize(DIM)
    blocks = []
    for drive in drives:
        give_way()
        told = (values_cell(drive.values, drives, 'values') if drive.answering
                else wrapped(drive.advice, values))
        columns = [(identity_cell(drive), first),
                   (values_cell(drive.setpoints, drives, 'setpoints'), setpoints),
                   (told, values), (exchange_cell(drive), exchange)]
        block = [_row([(lines[row] if row < len(lines) else Text(), wide)
                       for lines, wide in columns])
                 for row in range(max(len(lines) for lines, _ in columns))]
        if trend >= _TREND_MIN:
            for line, bars in zip(block, trend_cell(drive, trend)):
                line.append(GAP).append_text(bars)
        block += [_row([(Text(), first), (line, line.cell_len)])
                  for line in lamps(drive.bits, width - first - len(GAP))]
        blocks.append(block)
    return [heading], blocks


def table_width(drives: Sequence[DriveSnapshot]) -> int:
    """Return the columns that :func:`table` needs."""
    return sum(column_widths(drives)) + exchange_width() + 3 * len(GAP)


def paragraphs(drives: Sequence[DriveSnapshot], width: int) -> tuple[Lines, list[Lines]]:
    """Everything, on a few lines for each drive."""
    heading, blocks = summary(drives, width)
    for drive, block in zip(drives, blocks):
        give_way()
        block += _flow([piece(item) for item in drive.setpoints], width)
        block += _flow(current_pieces(drive), width) if drive.answering else _told(drive, width)
    return heading, blocks


def digest(drives: Sequence[DriveSnapshot], width: int) -> tuple[Lines, list[Lines]]:
    """Exchange, and as much of the values as a second line takes."""
    heading, blocks = summary(drives, width)
    for drive, block in zip(drives, blocks):
        give_way()
        block += (_flow(current_pieces(drive), width)[:1] if drive.answering
                  else [Text(f'{NARROW_GAP}{drive.advice}', style='red')])
    return heading, blocks


def summary(drives: Sequence[DriveSnapshot], width: int) -> tuple[Lines, list[Lines]]:
    """One line for each drive."""
    first = max([len(drive.name) for drive in drives] + [5])
    heading = Text(f' {"drive":{first}}   {"state":{STATE_WIDTH}}{"rate":>7}{"missed":>8}'
                   f'{"period error":>15}{"latency, ms":>15}', style=DIM)
    blocks = []
    for drive in drives:
        give_way()
        line = Text(' ').append(f'{drive.name:{first}}', style='bold').append('   ')
        line.append(f'{drive.state.value:{STATE_WIDTH}}', style=STATE_STYLES[drive.state])
        line.append(f'{drive.rate:7.1f}').append(
            f'{drive.missed:8}', style='yellow' if drive.missed else '')
        for times in (drive.period_error, drive.latency):
            line.append(f'{milliseconds(times.mean):>8} /{milliseconds(times.p99):>5}')
        blocks.append([line])
    return [heading], blocks


def _row(cells: Sequence[tuple[Text, int]]) -> Text:
    line = Text()
    for position, (text, width) in enumerate(cells):
        cell = text.copy()
        cell.truncate(width, overflow='ellipsis', pad=True)
        line.append(GAP if position else '').append_text(cell)
    return line


def _flow(pieces: Iterable[Text], width: int) -> Lines:
    """Put pieces one behind the other; those with values have room for the longest."""
    lines: Lines = []
    for text in pieces:
        if not lines or lines[-1].cell_len + len(NARROW_GAP) + text.cell_len > width:
            lines.append(Text())
        lines[-1].append(NARROW_GAP).append_text(text)
    return lines


def _told(drive: DriveSnapshot, width: int) -> Lines:
    """Say what to look at where a drive does not answer."""
    return [Text(NARROW_GAP).append_text(line)
            for line in wrapped(drive.advice, width - len(NARROW_GAP))]
