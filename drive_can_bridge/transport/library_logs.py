# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The logs of python-can and other libraries, as limited lines of our own log."""

from collections.abc import Callable
import logging

from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.text import printable

#: lines of libraries that are looked at in a second; the others are counted
LINES_MAX = 100


class LibraryLogs(logging.Handler):
    """
    Handles what libraries log, from :meth:`install` on.

    Without a handler, Python writes it to standard error, as it is and as often as it comes.

    :param say: logs a line under a topic, which is the same for all lines of one place.
    :param now: the steady time.
    """

    def __init__(self, say: Callable[[str, str], object], now: Callable[[], float]) -> None:
        super().__init__(logging.WARNING)
        self._say = say
        self._now = now
        self._since = now()
        self._count = 0

    def install(self) -> None:
        """Install this handler in place of an earlier one."""
        self.take_away()
        logging.getLogger().addHandler(self)
        logging.captureWarnings(True)

    @staticmethod
    def take_away() -> None:
        """Remove the handler."""
        root = logging.getLogger()
        for handler in [each for each in root.handlers if isinstance(each, LibraryLogs)]:
            root.removeHandler(handler)
        logging.captureWarnings(False)

    def emit(self, record: logging.LogRecord) -> None:
        """Handle a line. From any thread; the lock of this handler is held."""
        now = self._now()
        if now - self._since >= 1.0:
            left_out, self._count, self._since = self._count - LINES_MAX, 0, now
            if left_out > 0:
                self._say('left out', bus_sentences.library_lines_left_out(left_out))
        self._count += 1
        if self._count > LINES_MAX:
            return
        try:
            text = record.getMessage()
        except Exception:   # noqa: BLE001  whatever the line was, it must not fail by that
            text = str(record.msg)
        self._say(f'{record.name} {record.lineno}', f'{record.name}: {printable(text)}')


class Few:
    """
    Writes the first lines of each topic, for commands.

    :param write: writes a line.
    """

    #: lines of a topic
    MOST = 3

    def __init__(self, write: Callable[[str], object]) -> None:
        self._write = write
        self._told: dict[str, int] = {}

    def say(self, topic: str, line: str) -> None:
        """Write a line, if it is among the first of its topic."""
        told = self._told[topic] = self._told.get(topic, 0) + 1
        if told < self.MOST:
            self._write(line)
        elif told == self.MOST:
            self._write(bus_sentences.more_not_shown(line))
