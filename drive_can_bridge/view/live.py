# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The live view: whole pages, as large as the terminal, and the loop of polls, drawing and keys.

A page has a header, all drives or one in detail, the keys. Every part is given how many lines it
may have. Drives come first; then problems, the buses, and as much of the log as there is
room for.

Ctrl-Z gives the terminal back until the process is continued, unless another part handles
SIGTSTP. A terminal that accepts nothing (Ctrl-S) is drawn on when it does again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
import math
import os
import select
import signal
import sys
import termios
import time
from types import FrameType
from typing import Any

from rich.console import Console, ConsoleDimensions, Group, RenderableType
from rich.layout import Layout
from rich.live import Live
from rich.table import Table
from rich.text import Text

from drive_can_bridge.clock import Clock, time_of_day
from drive_can_bridge.core.text import counted
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Level, ModelSource, Snapshot, Times
from drive_can_bridge.monitor.summary import in_order, silence, Tone, tone_of
from drive_can_bridge.view.parts import (
    advice_lines, bus_lines, DIM, drives_table, flow, lamps, Lines, log_lines, milliseconds,
    section, state, TONE_STYLES, ValueColumns, wrapped)


class Page(Enum):
    """The pages."""

    DRIVES = 'drives'
    DRIVE = 'drive'
    HELP = 'help'


class Key(Enum):
    """The keys with a meaning."""

    UP = 'up'
    DOWN = 'down'
    OPEN = 'open'
    BACK = 'back'
    HELP = 'help'
    QUIT = 'quit'


#: what terminals send
_SEQUENCES = {
    '\x1b[A': Key.UP, '\x1bOA': Key.UP, 'k': Key.UP, '\x1b[Z': Key.UP,
    '\x1b[B': Key.DOWN, '\x1bOB': Key.DOWN, 'j': Key.DOWN, '\t': Key.DOWN,
    '\r': Key.OPEN, '\n': Key.OPEN, '\x1b[C': Key.OPEN, '\x1bOC': Key.OPEN,
    '\x1b': Key.BACK, '\x7f': Key.BACK, '\x08': Key.BACK, '\x1b[D': Key.BACK,
    '\x1bOD': Key.BACK, '?': Key.HELP, 'q': Key.QUIT, 'Q': Key.QUIT,
}
_LONGEST = max(map(len, _SEQUENCES))

#: the last line: what may be pressed here
HINTS: dict[Page, tuple[tuple[str, str], ...]] = {
    Page.DRIVES: (('↑↓', 'drive'), ('⏎', 'in detail'), ('?', 'help'), ('q', 'quit')),
    Page.DRIVE: (('↑↓', 'drive'), ('esc', 'back'), ('?', 'help'), ('q', 'quit')),
    Page.HELP: (('esc', 'back'), ('q', 'quit')),
}


def keys_in(text: str) -> list[Key]:
    """Return the keys in what was typed; keys without a meaning are left out."""
    found = []
    while text:
        for length in range(min(_LONGEST, len(text)), 0, -1):
            key = _SEQUENCES.get(text[:length])
            if key is not None and (key is not Key.BACK or length > 1 or not _unknown(text)):
                found.append(key)
                break
        else:
            length = _unknown(text) or 1
        text = text[length:]
    return found


def _unknown(text: str) -> int:
    """Return the length of an unknown escape sequence; 0: it is none."""
    if text[:2] not in ('\x1b[', '\x1bO'):
        return 0
    end = next((place for place in range(2, len(text)) if '@' <= text[place] <= '~'), None)
    return len(text) if end is None else end + 1


@dataclass(frozen=True, slots=True)
class Choice:
    """
    What the user has chosen.

    :param drive: full name of the drive that is marked, or shown; None before there is any.
    """

    page: Page = Page.DRIVES
    drive: str | None = None

    def among(self, drives: Sequence[str]) -> 'Choice':
        """Return the same for these drives: one that is gone cannot be chosen."""
        if self.drive in drives or (self.drive is None and not drives):
            return self
        return replace(self, drive=drives[0] if drives else None)

    def press(self, key: Key, drives: Sequence[str]) -> 'Choice':
        """Return the choice after a key."""
        if key in (Key.UP, Key.DOWN):
            if self.drive not in drives:
                return self.among(drives)
            step = 1 if key is Key.DOWN else -1
            place = (drives.index(self.drive) + step) % len(drives)
            return replace(self, drive=drives[place])
        if key is Key.HELP and self.page is not Page.HELP:
            return replace(self, page=Page.HELP)
        return replace(self, page=Page.DRIVE if key is Key.OPEN else Page.DRIVES)


_TREND_MAX = 60
#: of diagnostics, what is shown in other words
_TOLD = {'state', 'exchanges', 'missed_exchanges', 'command_age_s', 'control_state',
         *(f'{name}_{kind}_ms' for name in ('latency', 'period_error')
           for kind in ('mean', 'p99', 'max'))}
#: in keys of what is bad
_BAD = ('error', 'failed', 'refused', 'rejected')


def identity_lines(drive: DriveSnapshot, width: int) -> Lines:
    """Return lines with a drive's name, state, place, and what to do."""
    place = drive.place
    words = [Text(drive.name, style='bold'), state(drive)]
    if drive.control:
        words.append(Text(drive.control))
    if place.bus:
        words.append(Text(f'bus {place.bus}, station {place.station}'))
        words.append(Text(place.protocol, style=DIM))
    if not math.isnan(place.period):
        words.append(Text(f'every {1e3 * place.period:g} ms', style=DIM))
    words.append(Text(f'by {drive.bridge}', style=DIM))
    lines = flow(words, width, 3)
    if drive.level is not Level.OK:
        lines += wrapped(drive.advice, width, TONE_STYLES[tone_of(drive)])
    return lines


def value_lines(drive: DriveSnapshot, width: int) -> Lines:
    """Return setpoints and actual values with their trends."""
    columns = ValueColumns([*drive.setpoints, *drive.values])
    trend = min(_TREND_MAX, width - columns.width - 2)
    trend = trend if trend >= 8 else 0
    lines: Lines = []
    for heading, items in (('setpoint, as sent', drive.setpoints), ('actual value', drive.values)):
        if items:
            lines.append(Text(heading, style=DIM))
            lines += [columns.line(item, trend) for item in items]
    return lines or [Text('no sample yet', style=DIM)]


def bit_lines(drive: DriveSnapshot, width: int) -> Lines:
    """Return the bits of all words."""
    several = len(drive.bits) > 1
    lines: Lines = []
    for parameter in drive.bits:
        if several:
            lines.append(Text(parameter, style=DIM))
        lines += lamps({bit.name: bit.state for bit in drive.bits_of(parameter)}, width)
    return lines


def exchange_lines(drive: DriveSnapshot, width: int) -> Lines:
    """Return how the exchange goes, and the other facts of diagnostics."""
    lines = [
        Text(f'{drive.rate:.1f} exchanges/s, {drive.exchanges} in all, ').append(
            f'{drive.missed} missed', style='bold yellow' if drive.missed else ''),
        *_facts(drive, width, bad=True),
        _times('period error', drive.period_error), _times('latency', drive.latency)]
    if not math.isnan(drive.command_age):
        lines.append(Text(f'last command {drive.command_age:.1f} s ago'))
    return lines + _facts(drive, width, bad=False)


def _facts(drive: DriveSnapshot, width: int, *, bad: bool) -> Lines:
    """Return facts without a line of their own: the bad ones, or the others."""
    lines: Lines = []
    for key, value in drive.facts.items():
        if key in _TOLD or value in ('', '0') or bad != any(word in key for word in _BAD):
            continue
        label = key.replace('_', ' ')
        text = wrapped(f'{label}: {value}', width)
        text[0].stylize('bold yellow' if bad else DIM, 0, len(label) + 1)
        lines += text
    return lines


def _times(label: str, found: Times) -> Text:
    return Text(f'{label:12} {milliseconds(found.mean)} ms mean, {milliseconds(found.p99)} p99, '
                f'{milliseconds(found.maximum)} max')


#: from here on there is room for frames
_BOXED = (100, 30)
#: from here on a drive and its exchange stand side by side
_WIDE = 110
_LOG_MIN = 3


@dataclass(frozen=True, slots=True)
class ViewSetting:
    """
    What surrounds a page.

    :param title: of the page.
    :param place: where bridges are searched for, ``ROS domain 0, on this machine only``.
    :param namespace: that it is limited to, or ''.
    :param environment: commands for another terminal to see the same.
    :param bridge: command that starts one; '': one is being started.
    :param elsewhere: where other bridges run that are not seen here, and what to do; or ''.
    """

    title: str = 'drive_can monitor'
    place: str = ''
    namespace: str = ''
    environment: tuple[str, ...] = ()
    bridge: str = 'ros2 run drive_can_bridge drive_can_bridge'
    elsewhere: str = ''


class _Frame:
    """Sections one below the other, until the page is full."""

    def __init__(self, width: int, height: int) -> None:
        self.boxed = width >= _BOXED[0] and height >= _BOXED[1]
        self.width, self.left = width, height
        self.parts: list[Layout] = []

    @property
    def overhead(self) -> int:
        """The lines that a section has beside its body."""
        return 2 if self.boxed else 1

    @property
    def inner(self) -> int:
        """The columns of a body."""
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
        """Add a section with all that is left; ``body`` gets the number of lines."""
        lines = self.left - self.overhead
        if lines > 0:
            self.add(title, body(lines), lines)


def page(snapshot: Snapshot, choice: Choice, setting: ViewSetting, *, width: int, height: int,
         notice: str = '') -> RenderableType:
    """
    Compose the page that was chosen, so many columns wide and lines high.

    :param notice: shown in the last line, instead of the keys.
    """
    choice = choice.among([drive.name for drive in in_order(snapshot.drives)])
    frame = _Frame(width, height - 1)
    frame.bare(_header(snapshot, setting, width))
    for text in silence(snapshot, time_of_day):
        frame.lines(wrapped(text, width, 'bold white on red'))
    drive = snapshot.drive(choice.drive or '')
    if choice.page is Page.HELP:
        told = help_lines(drive, setting, frame.inner)
        frame.add('help', told, len(told))
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


def help_lines(drive: DriveSnapshot | None, setting: ViewSetting, width: int) -> Lines:
    """Return commands for the marked drive in other terminals, and the meaning of the colours."""
    name = drive.name if drive is not None else 'DRIVE'
    lines: Lines = [Text('in another terminal', style=DIM)]
    for command in setting.environment:
        lines += wrapped(command, width, 'bold')
    controlled = drive is None or bool(drive.control)
    for command, what in (
            (f'drive_can read {name}', 'its parameters'),
            (f'drive_can write {name} NAME=VALUE', 'one of them, written and looked at again'),
            *([(f'drive_can enable {name}', 'or says what is missing')] if controlled else []),
            (f'drive_can jog {name} VALUE', 'a setpoint for 2 s, then neutral'),
            (f'drive_can stop {name}', 'this one'),
            ('drive_can stop', 'all drives, in every ROS domain of this computer, at once')):
        lines += flow([Text(command, style='bold'), Text(what, style=DIM)], width, 2)
    lines += [Text(), Text('states', style=DIM)]
    for tone, what in ((Tone.OK, 'enabled and armed, or online'), (Tone.OFF, 'disabled'),
                       (Tone.WARN, 'not armed, or a warning'),
                       (Tone.ERROR, 'fault, offline, or not seen'),
                       (Tone.UNKNOWN, 'its bridge is silent')):
        lines.append(Text('● ', style=TONE_STYLES[tone]).append(what, style='not bold'))
    return lines


def closely(choice: Choice) -> str | None:
    """Return the drive in focus, if there is one."""
    return choice.drive if choice.page is Page.DRIVE else None


def _header(snapshot: Snapshot, setting: ViewSetting, width: int) -> Text:
    header = Text(setting.title, style='bold', no_wrap=True)
    bridges, drives = len(snapshot.bridges), len(snapshot.drives)
    right = time_of_day(snapshot.at)
    who = (f'{counted(drives, "drive")}, {counted(bridges, "bridge")}'
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


def _nobody(frame: _Frame, snapshot: Snapshot, setting: ViewSetting) -> None:
    """Show what is searched for, and how to start it."""
    where = f' below {setting.namespace}' if setting.namespace else ''
    if snapshot.bridges:
        names = ', '.join(bridge.name for bridge in snapshot.bridges)
        told = wrapped(f'{names}: no drives', frame.inner)
    else:
        told = wrapped(f'No bridge{where} yet. Looking for one in {setting.place or "ROS"}: '
                       f'whatever publishes /diagnostics as a drive_can_bridge does.',
                       frame.inner)
        if setting.elsewhere:
            told += [Text(), *wrapped(setting.elsewhere, frame.inner, 'bold')]
        if setting.bridge:
            told += [Text(), Text('To start one, in another terminal:')]
            for command in (*setting.environment,
                            f'{setting.bridge} --ros-args --params-file FILE'):
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
    identity = identity_lines(drive, frame.inner)
    frame.add(f'drive {drive.label}', identity, len(identity))
    wide = frame.width >= _WIDE
    half = (frame.inner - 3) // 2 if wide else frame.inner
    left = value_lines(drive, half)
    bits = bit_lines(drive, half)
    if wide and bits:
        left += [Text(), Text('bits', style=DIM), *bits]
    right = exchange_lines(drive, half)
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


# -- in a terminal --------------------------------------------------------------------------------

_CHUNK = 1024
#: s to wait for a terminal that accepts nothing before it is left as it is
_PATIENCE = 0.2


class Screen:
    """
    Standard output, which has to be a terminal, and standard input if it is one.

    Use as a context manager in the main thread.
    """

    def __init__(self) -> None:
        # whatever the terminal cannot write is a question mark, and no reason to end
        sys.stdout.reconfigure(errors='replace')  # type: ignore[union-attr]
        self._console = Console()
        self._live: Live | None = None
        self._out, self._in = sys.stdout.fileno(), sys.stdin.fileno() if sys.stdin else -1
        self._settings: list[Any] | None = None
        self._readable = self._in >= 0 and os.isatty(self._in)
        self._suspend_asked = False
        self._may_suspend = signal.getsignal(signal.SIGTSTP) is signal.SIG_DFL
        self.gone = False

    @property
    def size(self) -> tuple[int, int]:
        """The columns and lines, at this moment."""
        try:
            width, height = os.get_terminal_size(self._out)
        except OSError:  # it is gone
            width = height = 0
        # not the values of COLUMNS and LINES, which may be old
        self._console.size = ConsoleDimensions(max(10, width or 80), max(3, height or 24))
        return self._console.size

    def __enter__(self) -> 'Screen':
        self._enter()
        if self._may_suspend:
            signal.signal(signal.SIGTSTP, self._ask_to_suspend)
        return self

    def __exit__(self, *_: object) -> None:
        if self._may_suspend:
            signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        self._leave()

    def draw(self, shown: RenderableType) -> None:
        """Show a page."""
        if self._live is None or not self._takes(0.0):
            return
        try:
            self._live.update(shown, refresh=True)
        except OSError:  # the terminal is gone; SIGHUP is on its way
            self.gone = True

    def wait(self, timeout: float) -> list[Key]:
        """Wait for keys for ``timeout`` s; handle Ctrl-Z."""
        if self._suspend_asked:
            self._suspend()
        if not self._readable:
            time.sleep(timeout)
            return []
        if not select.select([self._in], [], [], timeout)[0]:
            return []
        try:
            typed = os.read(self._in, _CHUNK)
        except OSError:
            typed = b''
        self._readable = bool(typed)
        return keys_in(typed.decode(errors='replace'))

    # -- inside -----------------------------------------------------------------------------------

    def _enter(self) -> None:
        self._settings = self._quiet_keyboard() if self._readable else None
        self._live = Live(console=self._console, screen=True, auto_refresh=False,
                          redirect_stdout=False, redirect_stderr=False)
        self._live.start()

    def _leave(self) -> None:
        live, self._live = self._live, None
        if live is not None and self._takes(_PATIENCE):
            try:
                live.stop()
            except OSError:
                self.gone = True
        if self._settings is not None:
            try:
                termios.tcsetattr(self._in, termios.TCSANOW, self._settings)
            except termios.error:
                self.gone = True
            self._settings = None

    def _quiet_keyboard(self) -> list[Any] | None:
        """Read keys at once, and without an echo; Ctrl-C and the like still work."""
        try:
            settings = termios.tcgetattr(self._in)
            flags = settings[3] & ~(termios.ECHO | termios.ICANON)
            termios.tcsetattr(self._in, termios.TCSANOW, [*settings[:3], flags, *settings[4:]])
        except termios.error:
            return None
        return settings

    def _ask_to_suspend(self, _: int, __: FrameType | None) -> None:
        # no more than that: the main thread may be in the middle of a page
        self._suspend_asked = True

    def _suspend(self) -> None:
        self._suspend_asked = False
        self._leave()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)
        # continued
        signal.signal(signal.SIGTSTP, self._ask_to_suspend)
        self._enter()

    def _takes(self, timeout: float) -> bool:
        return bool(select.select([], [self._out], [], timeout)[1])


#: s between two pages; longer where drawing one takes more than its share of a processor
FRAME_PERIOD = 0.25
_FRAME_SHARE = 0.04
_FRAME_PERIOD_MAX = 1.0
#: s between two looks whether it has ended, however seldom it is drawn
_LOOK_PERIOD = 0.1


def show(source: ModelSource, model: Model, setting: ViewSetting, steady: Clock, *,
         ended: Callable[[], bool], quit_code: int, notice: Callable[[], str] = str) -> int:
    """
    Draw until the end, or until the user quits.

    :param notice: returns the text in place of the keys; '' for none.
    :return: 0, or ``quit_code`` after the key that quits.
    """
    choice = Choice()
    with Screen() as screen:
        due = steady.now()
        while not (ended() or screen.gone):
            begun, now = steady.used(), steady.now()
            size = screen.size
            drive = closely(choice)
            source.focus(*([] if drive is None else [drive]))
            source.poll(now)
            snapshot = model.look(now, 1e-9 * steady.stamp())
            drives = [drive.name for drive in in_order(snapshot.drives)]
            choice = choice.among(drives)
            screen.draw(page(snapshot, choice, setting, notice=notice(), width=size[0],
                             height=size[1]))
            cost = (steady.used() - begun) / _FRAME_SHARE
            due = max(due, now) + min(max(FRAME_PERIOD, cost), _FRAME_PERIOD_MAX)
            while True:
                left = max(0.0, due - steady.now())
                for key in screen.wait(min(left, _LOOK_PERIOD)):
                    if key is Key.QUIT:
                        return quit_code
                    choice = choice.press(key, drives)
                    due = now  # a key is to show its effect at once
                if ended() or screen.gone or steady.now() >= due:
                    break
    return 0
