# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A whole page, as large as the terminal: header, what was chosen, and the keys that mean something.

Every part is told how many lines it may have. Drives come first; then what is not well, the buses,
and as much of the log as there is room for.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rich.console import Group, RenderableType
from rich.layout import Layout
from rich.table import Table
from rich.text import Text

from drive_can_bridge.core.words import counted
from drive_can_bridge.monitor.hints import hints
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Snapshot
from drive_can_bridge.monitor.summary import in_order, silence, Tone
from drive_can_bridge.view import detail
from drive_can_bridge.view.keys import Choice, HINTS, Page
from drive_can_bridge.view.overview import advice_lines, bus_lines, drives_table
from drive_can_bridge.view.parts import (
    clock, DIM, flow, Lines, log_lines, section, TONE_STYLES, wrapped,
)

#: from here on there is room for frames
_BOXED = (100, 30)
#: from here on a drive and its exchange stand side by side
_WIDE = 110
_LOG_MIN = 3


@dataclass(frozen=True, slots=True)
class Setting:
    """
    What surrounds a page.

    :param title: what this is.
    :param place: where it looks, ``ROS domain 0, on this machine only``.
    :param namespace: that it is limited to, or ''.
    :param environment: command that lets another terminal see the same; may be ''.
    """

    title: str = 'drive_can monitor'
    place: str = ''
    namespace: str = ''
    environment: str = ''


class _Frame:
    """Sections one below the other, until the page is full."""

    def __init__(self, width: int, height: int) -> None:
        self.boxed = width >= _BOXED[0] and height >= _BOXED[1]
        self.width, self.left = width, height
        self.parts: list[Layout] = []

    @property
    def overhead(self) -> int:
        """Lines that a section has beside its body."""
        return 2 if self.boxed else 1

    @property
    def inner(self) -> int:
        """Columns that a body has."""
        return self.width - 4 if self.boxed else self.width

    def bare(self, body: RenderableType) -> None:
        """Add one line without a title."""
        self.parts.append(Layout(body, size=1))
        self.left -= 1

    def lines(self, body: Lines) -> None:
        """Add lines without a title."""
        for line in body[:self.left]:
            self.bare(line)

    def add(self, title: str, body: Sequence[RenderableType], lines: int) -> None:
        """Add a section whose body has so many lines, if only a part of it fits."""
        lines = min(lines, self.left - self.overhead)
        if lines > 0:
            self.parts.append(Layout(section(title, body, boxed=self.boxed),
                                     size=lines + self.overhead))
            self.left -= lines + self.overhead

    def fill(self, title: str, body: Callable[[int], Sequence[RenderableType]]) -> None:
        """Give a section all that is left; ``body`` is told how much that is."""
        lines = self.left - self.overhead
        if lines > 0:
            self.add(title, body(lines), lines)


def page(snapshot: Snapshot, choice: Choice, setting: Setting, *, width: int, height: int,
         notice: str = '') -> RenderableType:
    """
    Compose the page that was chosen, so many columns wide and lines high.

    :param notice: to be said in the last line, instead of the keys.
    """
    choice = choice.among([drive.name for drive in in_order(snapshot.drives)])
    frame = _Frame(width, height - 1)
    frame.bare(_header(snapshot, setting, width))
    for text in silence(snapshot, clock):
        frame.lines(wrapped(text, width, 'bold white on red'))
    drive = snapshot.drive(choice.drive or '')
    if choice.page is Page.HELP:
        _help(frame, drive, setting)
    elif choice.page is Page.LOG:
        _log(frame, snapshot, choice)
    elif drive is None:
        _nobody(frame, snapshot, setting)
    elif choice.page is Page.DRIVE:
        _drive(frame, snapshot, drive)
    else:
        _drives(frame, snapshot, choice)
    if frame.left > 0:
        frame.parts.append(Layout(' ', size=frame.left))
    frame.parts.append(Layout(Text(notice, no_wrap=True, style='bold') if notice
                              else _keys(choice.page, width), size=1))
    root = Layout()
    root.split_column(*frame.parts)
    return root


def closely(choice: Choice) -> str | None:
    """Return the drive that is looked at closely, if one is."""
    return choice.drive if choice.page is Page.DRIVE else None


def _header(snapshot: Snapshot, setting: Setting, width: int) -> Text:
    header = Text(setting.title, style='bold', no_wrap=True)
    bridges, drives = len(snapshot.bridges), len(snapshot.drives)
    right = clock(snapshot.at)
    who = (f'{counted(drives, "drive", "drives")}, {counted(bridges, "bridge", "bridges")}'
           if bridges else 'no bridge yet')
    namespace = f'below {setting.namespace}' if setting.namespace else ''
    for words in (who, setting.place, namespace):
        if words and header.cell_len + len(words) + 5 + len(right) <= width:
            header.append('   ').append(words, style=f'not bold {DIM}')
    header.append(' ' * max(1, width - header.cell_len - len(right)))
    return header.append(right, style=f'not bold {DIM}')


def _keys(shown: Page, width: int) -> Text:
    """Return the last line; what does not fit is left out before its end: q stays."""
    hints = [Text(key, style='bold').append(f' {meaning}', style=f'not bold {DIM}')
             for key, meaning in HINTS[shown]]
    while sum(hint.cell_len + 2 for hint in hints) - 2 > width and len(hints) > 1:
        hints.pop(-2)
    line = Text('  ', no_wrap=True).join(hints)
    line.truncate(width)
    return line


def _nobody(frame: _Frame, snapshot: Snapshot, setting: Setting) -> None:
    """Say what is looked for, and how to make it appear."""
    where = f' below {setting.namespace}' if setting.namespace else ''
    if snapshot.bridges:
        names = ', '.join(bridge.name for bridge in snapshot.bridges)
        told = wrapped(f'{names}: no drives', frame.inner)
    else:
        told = wrapped(f'No bridge{where} yet. Looking for one in {setting.place or "ROS"}: '
                       f'whatever publishes /diagnostics as a drive_can_bridge does.',
                       frame.inner)
        told += [Text(), Text('To start one, in another terminal:')]
        commands = [setting.environment] if setting.environment else []
        commands.append('ros2 run drive_can_bridge drive_can_bridge --ros-args '
                        '--params-file FILE')
        for command in commands:
            told += wrapped(command, frame.inner, 'bold')
        told += [Text(), Text('It appears here by itself.')]
    frame.add('bridges', told, len(told))
    _rest(frame, snapshot)


def _drives(frame: _Frame, snapshot: Snapshot, choice: Choice) -> None:
    advice = advice_lines(snapshot, frame.inner)
    buses = min(len(snapshot.buses), 4)
    room = frame.left - buses - 2 * frame.overhead
    height = room - _LOG_MIN - frame.overhead - (
        min(len(advice), 6) + frame.overhead if advice else 0)
    if height <= len(snapshot.drives):      # then without the log, and what to do in short
        advice = advice_lines(snapshot, frame.inner, brief=True)
        height = room - (min(len(advice), 4) + frame.overhead if advice else 0)
    # on the smallest terminals the drives take what they need
    table, lines, title = drives_table(
        snapshot.drives, choice.drive, width=frame.inner,
        height=max(height, min(6, frame.left - frame.overhead)))
    frame.add(title, [table], lines)
    if advice:
        room = frame.left - frame.overhead - min(buses, frame.left) - frame.overhead
        shown = _cut(advice, max(4, room - _LOG_MIN))
        frame.add('what to do', shown, len(shown))
    _rest(frame, snapshot)


def _rest(frame: _Frame, snapshot: Snapshot) -> None:
    if snapshot.buses:
        buses = bus_lines(snapshot.buses, frame.inner, 4)
        frame.add('bus' if len(snapshot.buses) == 1 else 'buses', buses, len(buses))
    frame.fill('log', lambda lines: log_lines(snapshot.log, frame.inner, lines))


def _cut(lines: Lines, height: int) -> Lines:
    if len(lines) <= height:
        return lines
    return [*lines[:height - 1], Text('… and more: a higher terminal shows it', style=DIM)]


def _drive(frame: _Frame, snapshot: Snapshot, drive: DriveSnapshot) -> None:
    identity = detail.identity_lines(drive, frame.inner)
    frame.add(f'drive {drive.label}', identity, len(identity))
    wide = frame.width >= _WIDE
    half = (frame.inner - 3) // 2 if wide else frame.inner
    left = detail.value_lines(drive, half)
    bits = detail.bit_lines(drive, half)
    if wide and bits:
        left += [Text(), Text('bits', style=DIM), *bits]
    right = detail.exchange_lines(drive, half)
    if wide:
        grid = Table.grid(padding=(0, 3, 0, 0))
        grid.add_column(width=half)
        grid.add_column(width=half)
        grid.add_row(Group(*left), Group(*right))
        frame.add('values, and how the exchange goes', [grid], max(len(left), len(right)))
    else:
        frame.add('values', left, len(left))
        if bits:
            frame.add('bits', bits, len(bits))
        frame.add('exchange', right, len(right))
    told = [line for line in snapshot.log if line.text.startswith(
        f'{drive.name.rpartition("/")[2]}: ')]
    frame.fill('log of this drive', lambda lines: log_lines(told, frame.inner, lines))


def _log(frame: _Frame, snapshot: Snapshot, choice: Choice) -> None:
    def body(lines: int) -> Lines:
        everything = log_lines(snapshot.log, frame.inner, len(snapshot.log) * 8 + lines)
        screen = min(choice.screen, max(0, len(everything) - 1) // lines)
        end = len(everything) - screen * lines
        return everything[max(0, end - lines):end]
    frame.fill('log, the newest below', body)


def _help(frame: _Frame, drive: DriveSnapshot | None, setting: Setting) -> None:
    legend = flow([Text('● ', style=TONE_STYLES[tone]).append(tone.value, style='not bold')
                   for tone in Tone], frame.inner, 3)
    frame.add('colours', legend, len(legend))
    told: Lines = []
    for command, meaning in hints(drive, setting.environment):
        told.append(Text(f'# {meaning}', style=DIM))
        told += wrapped(command, frame.inner, 'bold')
    frame.add('from another terminal', told, len(told))
    meanings = [
        ('↑ ↓ j k', 'mark another drive'), ('⏎ →', 'the marked drive in detail'),
        ('l', 'the log'), ('space b', 'further, and back'), ('esc ←', 'back'), ('q', 'quit')]
    keys = [Text(f'{key:10}', style='bold').append(meaning, style='not bold')
            for key, meaning in meanings]
    frame.add('keys', keys, len(keys))
