# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The page: drives, buses, what to type elsewhere, the log. Fits whatever terminal there is.

The drives come first: they get the most telling layout that leaves room for a few lines of the
rest, and are cut short only where not even one line each fits.
"""

from collections.abc import Sequence
import re
import time

from rich.text import Text

from drive_can_bridge.ros.demo import drive_lines
from drive_can_bridge.ros.demo.cells import DIM, Lines
from drive_can_bridge.ros.demo.hints import Hint
from drive_can_bridge.ros.demo.log_lines import LogLine
from drive_can_bridge.ros.demo.snapshot import BusSnapshot, give_way, Snapshot

#: lines that a more telling layout of the drives leaves for hints and log, headings included
_REST_MIN = 8
_LOG_MIN = 4
#: from here on there is room for empty lines between the sections
_AIRY = 34
_BUSES_MAX = 4
_LOAD_WIDTH = 12
#: column at which the comments on hints end
_MEANINGS_END = 120
_LEVEL_STYLES = {'WARN': 'bold yellow', 'ERROR': 'bold red', 'FATAL': 'bold white on red',
                 'DEBUG': DIM}
#: the log of these needs no name: it is what the view is about
_KNOWN_LOGGERS = ('', 'drive_can_bridge', 'demo')
_WORD = re.compile(r"'[^']*'|\S+")


def page(snapshot: Snapshot, *, hints: Sequence[Hint], log: Sequence[LogLine], place: str,
         width: int, height: int) -> Lines:
    """
    Compose the page.

    :param place: where the demo can be seen, in words.
    :return: at most ``height`` lines of at most ``width`` columns.
    """
    airy = height >= _AIRY
    lines = [_header(snapshot, place, width)]
    buses = _buses(snapshot.buses, width)
    lines += _drives(snapshot, width, height - len(lines) - len(buses) - 2 * airy, airy=airy)
    lines += [Text()] * airy + buses + [Text()] * airy
    rest = height - len(lines)
    give_way()
    told = _hints(hints, width, rest - 1 - _LOG_MIN)
    if len(told) > 1:
        lines += [_rule('from a second terminal', width), *told] + [Text()] * airy
    rest = height - len(lines)
    if rest > 1:
        lines += [_rule('log', width, 'Ctrl-C ends'), *_log(log, width, rest - 1)]
    give_way()
    for line in lines:
        line.rstrip()
        line.truncate(width, overflow='ellipsis')
    return lines[:height]


def _header(snapshot: Snapshot, place: str, width: int) -> Text:
    count = len(snapshot.drives)
    header = Text().append(' drive_can demo', style='bold')
    right = f'up {_clock(snapshot.uptime)}   cpu {100 * snapshot.processor:3.0f} % '
    for piece in (place, f'{count} simulated drive{"s" * (count != 1)}'):
        if header.cell_len + len(piece) + 5 + len(right) <= width:
            header.append(f'   {piece}', style=DIM)
    header.append(' ' * max(1, width - header.cell_len - len(right)))
    return header.append(right, style=DIM)


def _drives(snapshot: Snapshot, width: int, height: int, *, airy: bool) -> Lines:
    drives = snapshot.drives
    layouts: list[drive_lines.Layout] = [
        drive_lines.paragraphs, drive_lines.digest, drive_lines.summary]
    if drive_lines.table_width(drives) <= width:
        layouts.insert(0, drive_lines.table)
    for layout in layouts:
        heading, blocks = layout(drives, width)
        between = [_rule('', width)] if airy and len(blocks[0] if blocks else ()) > 1 else []
        lines = [*([Text()] * airy), *heading]
        for position, block in enumerate(blocks):
            lines += [*(between if position else ()), *block]
        if len(lines) + _REST_MIN <= height:
            return lines
    if len(lines) <= height:
        return lines
    heading, blocks = drive_lines.summary(drives, width)
    shown = max(1, height - 2)
    left_out = len(blocks) - shown
    return [*heading, *(block[0] for block in blocks[:shown]),
            Text(f' … and {left_out} more: a higher terminal shows them', style=DIM)]


def _buses(buses: Sequence[BusSnapshot], width: int) -> Lines:
    names = max([len(bus.name) for bus in buses] + [0])
    lines = []
    for bus in buses[:_BUSES_MAX]:
        up = bus.state == 'up'
        line = Text(f' bus {bus.name:{names}}  ').append(
            f'{bus.state:6}', style='bold green' if up else 'bold red')
        line.append(f'  load {bus.load:5.1f} % ')
        if width >= 100:
            filled = min(_LOAD_WIDTH, round(_LOAD_WIDTH * bus.load / 100))
            line.append('█' * filled, style='cyan' if bus.load <= 70 else 'bold yellow')
            line.append('░' * (_LOAD_WIDTH - filled), style=DIM)
            line.append(f' of {bus.bitrate / 1000:g} kbit/s', style=DIM)
        for number, what in ((bus.frames_sent, 'sent'), (bus.frames_received, 'received'),
                             (bus.frames_rejected, 'rejected')):
            line.append(f'{number:>8}').append(f' {what}', style=DIM)
        if width >= 100:
            line.append(f'   {bus.interface}', style=DIM)
        lines.append(line)
    if len(buses) > _BUSES_MAX:
        lines.append(Text(f' … and {len(buses) - _BUSES_MAX} more', style=DIM))
    return lines


def _hints(hints: Sequence[Hint], width: int, height: int) -> Lines:
    """Write as many hints as fit; what is too wide goes on behind a backslash, as in a shell."""
    end = min(width, _MEANINGS_END)
    lines: Lines = []
    for hint in hints:
        folded = _fold(hint.command, width)
        if len(lines) + len(folded) > height:
            break
        space = end - 1 - len(folded[0].plain) - len(hint.meaning)
        if len(folded) == 1 and space >= 5:
            folded[0].append(f'{"# ":>{space}}{hint.meaning}', style=DIM)
        lines += folded
    return lines


def _fold(command: str, width: int) -> Lines:
    lines, line = [], ' '
    for word in _WORD.findall(command):
        # room for ' \\' behind it
        if line.strip() and len(command) >= width and len(line) + len(word) + 2 > width:
            lines.append(f'{line}\\')
            line = '     '
        line += f'{word} '
    return [Text(text.rstrip() if text.endswith(' ') else text) for text in (*lines, line)]


def _log(log: Sequence[LogLine], width: int, height: int) -> Lines:
    lines: Lines = []
    for entry in reversed(log):
        if len(lines) >= height:
            break
        lines = _log_entry(entry, width) + lines
    return lines[-height:]


def _log_entry(entry: LogLine, width: int) -> Lines:
    stamp = time.strftime('%H:%M:%S', time.localtime(entry.at))
    start = Text(f' {stamp} ', style=DIM)
    if entry.level in _LEVEL_STYLES:
        start.append(f'{entry.level} ', style=_LEVEL_STYLES[entry.level])
    name = '' if entry.logger in _KNOWN_LOGGERS else f'{entry.logger}: '
    room = max(10, width - start.cell_len)
    texts, line = [], name
    for word in re.findall(r'\S+\s*', entry.text):
        if line.strip() and len(line) + len(word.rstrip()) > room:
            texts.append(line)
            line = ''
        line += word
    return [(start.copy() if position == 0 else Text(' ' * start.cell_len)).append_text(Text(text))
            for position, text in enumerate([*texts, line])]


def _rule(title: str, width: int, end: str = '') -> Text:
    left = f'── {title} ' if title else ''
    right = f' {end} ──' if end else ''
    return Text(f'{left:─<{max(0, width - len(right))}}{right}', style=DIM)


def _clock(seconds: float) -> str:
    minutes, second = divmod(int(seconds), 60)
    hour, minute = divmod(minutes, 60)
    return f'{hour}:{minute:02}:{second:02}'
