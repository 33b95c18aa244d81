# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The whole terminal, for as long as the view is shown.

Lines that have not changed are not written again: nothing flickers, and a view of a quiet bridge
costs next to nothing, on the near side of an ssh connection and on the far one.
"""

from collections.abc import Sequence
import os
import select
import signal
import sys
import termios
from types import FrameType
from typing import Any

from rich.console import Console
from rich.text import Text

from drive_can_bridge.ros.demo.snapshot import give_way

_ENTER = '\x1b[?1049h\x1b[?25l\x1b[2J'
# cleared first: terminals that were resized meanwhile may mix the two screens
_LEAVE = '\x1b[2J\x1b[?25h\x1b[?1049l'
_ERASE_LINE = '\x1b[K'
_ERASE_ALL = '\x1b[2J'
#: s to wait for a terminal that takes nothing (Ctrl-S) before it is left as it is
_PATIENCE = 0.2


class Screen:
    """
    Draws pages of lines on standard output, which has to be a terminal.

    Ctrl-Z gives the terminal back until the process is continued.
    """

    def __init__(self) -> None:
        self._fd = sys.stdout.fileno()
        self._console = Console()
        self._drawn: list[Text] = []
        self._size = (0, 0)
        self._shown = False
        self._suspend_asked = False
        self._settings: list[Any] | None = None
        self._old_handler: Any = None

    @property
    def size(self) -> tuple[int, int]:
        """Columns and lines, at this moment."""
        columns, lines = os.get_terminal_size(self._fd)
        return (columns or 80, lines or 24)

    def open(self) -> None:
        """Take the terminal."""
        self._enter()
        self._old_handler = signal.signal(signal.SIGTSTP, self._ask_to_suspend)

    def close(self) -> None:
        """Give the terminal back as it was. Harmless when repeated."""
        if self._old_handler is not None:
            signal.signal(signal.SIGTSTP, self._old_handler)
            self._old_handler = None
        self._leave()

    def draw(self, lines: Sequence[Text]) -> None:
        """Show a page: one text per line, none wider than the terminal."""
        if self._suspend_asked:
            self._suspend()
        if not self._shown or not self._writable(0.0):
            return
        size = self.size
        output = []
        if size != self._size:
            self._size, self._drawn = size, []
            output.append(_ERASE_ALL)
        columns, rows = size
        for row, line in enumerate(lines[:rows]):
            if row < len(self._drawn) and _same(self._drawn[row], line):
                continue
            give_way()
            with self._console.capture() as captured:
                self._console.print(line, end='', no_wrap=True, overflow='crop', width=columns)
            # erased first: behind a line that is full, the cursor still stands on its last column
            output.append(f'\x1b[{row + 1};1H{_ERASE_LINE}{captured.get()}')
        for row in range(len(lines), len(self._drawn)):
            output.append(f'\x1b[{row + 1};1H{_ERASE_LINE}')
        self._drawn = list(lines[:rows])
        self._write(''.join(output))

    # -- inside -----------------------------------------------------------------------------------

    def _enter(self) -> None:
        self._size, self._drawn = (0, 0), []
        self._settings = self._silence_keyboard()
        self._shown = True
        self._write(_ENTER)

    def _leave(self) -> None:
        if not self._shown:
            return
        self._shown = False
        if self._writable(_PATIENCE):
            self._write(_LEAVE)
        if self._settings is not None:
            termios.tcsetattr(self._fd, termios.TCSANOW, self._settings)
            self._settings = None

    def _silence_keyboard(self) -> list[Any] | None:
        """Keep what is typed from appearing in the view; Ctrl-C and the like still work."""
        try:
            settings = termios.tcgetattr(self._fd)
            changed = [*settings[:3], settings[3] & ~termios.ECHO, *settings[4:]]
            termios.tcsetattr(self._fd, termios.TCSANOW, changed)
        except termios.error:
            return None
        return settings

    def _ask_to_suspend(self, _: int, __: FrameType | None) -> None:
        # no more than that: the main thread may be anywhere, and CPython's SimpleQueue.get() waits
        # for ever when a handler takes longer than the time-out that it interrupts
        self._suspend_asked = True

    def _suspend(self) -> None:
        self._suspend_asked = False
        self._leave()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)
        # continued
        signal.signal(signal.SIGTSTP, self._ask_to_suspend)
        self._enter()

    def _writable(self, timeout: float) -> bool:
        return bool(select.select([], [self._fd], [], timeout)[1])

    def _write(self, text: str) -> None:
        data = text.encode(self._console.encoding, 'replace')
        while data:
            try:
                data = data[os.write(self._fd, data):]
            except BlockingIOError:
                if not self._writable(_PATIENCE):
                    return
            except OSError:  # the terminal has gone; SIGHUP is on its way
                return


def _same(one: Text, other: Text) -> bool:
    # equality of texts does not look at the style of the whole
    return one == other and one.style == other.style
