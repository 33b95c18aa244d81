# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The loop of the live view: look, draw, listen to the keyboard.

The whole terminal, for as long as the view is shown, and its keyboard.

Ctrl-Z gives the terminal back until the process is continued, unless somebody else looks after
SIGTSTP. A terminal that takes nothing (Ctrl-S) is drawn on when it does again.
"""

from collections.abc import Callable
import os
import select
import signal
import sys
import termios
import time
from types import FrameType
from typing import Any

from rich.console import Console, ConsoleDimensions, RenderableType
from rich.live import Live

from drive_can_bridge.clock import Clock
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import Source
from drive_can_bridge.monitor.summary import in_order
from drive_can_bridge.view.page import Choice, closely, Key, keys_in, page, Setting

_CHUNK = 1024
#: s to wait for a terminal that takes nothing before it is left as it is
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
        """Columns and lines, at this moment."""
        try:
            width, height = os.get_terminal_size(self._out)
        except OSError:  # it has gone
            width = height = 0
        # not what COLUMNS and LINES said once
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

    def draw(self, page: RenderableType) -> None:
        """Show a page."""
        if self._live is None or not self._takes(0.0):
            return
        try:
            self._live.update(page, refresh=True)
        except OSError:  # the terminal has gone; SIGHUP is on its way
            self.gone = True

    def wait(self, timeout: float) -> list[Key]:
        """Wait for keys for as long as ``timeout`` says; obey Ctrl-Z."""
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
        """Get keys at once, and without an echo; Ctrl-C and the like still work."""
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


def show(source: Source, model: Model, setting: Setting, clock: Clock, *,
         ended: Callable[[], bool], quit_code: int, notice: Callable[[], str] = str) -> int:
    """
    Draw until the end, or until the user has enough.

    :param notice: returns what is to be said instead of the keys; '' for nothing.
    :return: 0, or ``quit_code`` after the key that quits.
    """
    choice = Choice()
    with Screen() as screen:
        due = clock.now()
        while not (ended() or screen.gone):
            begun, now = clock.used(), clock.now()
            size = screen.size
            drive = closely(choice)
            source.focus(*([] if drive is None else [drive]))
            source.poll(now)
            snapshot = model.look(now, 1e-9 * clock.stamp())
            drives = [drive.name for drive in in_order(snapshot.drives)]
            choice = choice.among(drives)
            screen.draw(page(snapshot, choice, setting, notice=notice(), width=size[0],
                             height=size[1]))
            cost = (clock.used() - begun) / _FRAME_SHARE
            due = max(due, now) + min(max(FRAME_PERIOD, cost), _FRAME_PERIOD_MAX)
            while True:
                left = max(0.0, due - clock.now())
                for key in screen.wait(min(left, _LOOK_PERIOD)):
                    if key is Key.QUIT:
                        return quit_code
                    choice = choice.press(key, drives)
                    due = now  # a key is to show its effect at once
                if ended() or screen.gone or clock.now() >= due:
                    break
    return 0
