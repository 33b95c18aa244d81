# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The log of the process, caught before it reaches the terminal that shows the view.

ROS, DDS and C libraries write to descriptor 2 and not to ``sys.stderr``; so the descriptor is
what is turned away, into a pipe that a thread of its own reads. Nobody who logs ever waits for
the view.
"""

from collections import deque
from dataclasses import dataclass
import os
import re
import sys
import threading
import time

#: lines kept
_KEPT = 500
_ESCAPES = re.compile(r'\x1b\[[0-9;?]*[ -/]*[@-~]')
_UNPRINTABLE = re.compile(r'[\x00-\x08\x0b-\x1f\x7f]')
#: the default of RCUTILS_CONSOLE_OUTPUT_FORMAT
_ROS_LINE = re.compile(r'\[(DEBUG|INFO|WARN|ERROR|FATAL)\] \[(\d+\.\d+)\] \[([^]]*)\]: (.*)')


@dataclass(frozen=True)
class LogLine:
    """
    One line of the log.

    :param at: s since the epoch.
    :param level: as ROS names it; '' for a line that did not come from ROS.
    :param logger: who said it.
    """

    at: float
    level: str
    logger: str
    text: str


def parse(line: str) -> LogLine:
    """Take a line apart; whatever is not in the format of ROS is text."""
    line = _UNPRINTABLE.sub('', _ESCAPES.sub('', line)).expandtabs(4)
    match = _ROS_LINE.fullmatch(line)
    if match is None:
        return LogLine(time.time(), '', '', line)
    level, at, logger, text = match.groups()
    return LogLine(float(at), level, logger, text)


class LogCapture:
    """
    Turns standard error into a list of lines, until closed.

    Where standard error is no terminal (``2>FILE``), it gets everything all the same.
    """

    def __init__(self) -> None:
        self._lines: deque[LogLine] = deque(maxlen=_KEPT)
        sys.stderr.flush()
        self._original = os.dup(2)
        self._passed_on = not os.isatty(self._original)
        reading, writing = os.pipe()
        os.dup2(writing, 2)
        os.close(writing)
        self._thread = threading.Thread(target=self._run, args=(reading,), name='log lines',
                                        daemon=True)
        self._thread.start()

    @property
    def lines(self) -> list[LogLine]:
        """The newest lines, oldest first."""
        return list(self._lines)

    def close(self) -> None:
        """Give standard error back. Harmless when repeated."""
        if self._original < 0:
            return
        sys.stderr.flush()
        # the last writing end of the pipe: its reader comes to the end
        os.dup2(self._original, 2)
        self._thread.join(timeout=1.0)
        original, self._original = self._original, -1
        os.close(original)

    def repeat(self) -> None:
        """Write the lines that the terminal did not get. After ``close``."""
        if not self._passed_on:
            for line in self.lines:
                print(f'[{line.level}] {line.text}' if line.level else line.text,
                      file=sys.stderr)

    def _run(self, reading: int) -> None:
        rest = b''
        while True:
            data = os.read(reading, 65536)
            if not data:
                break
            if self._passed_on:
                self._pass_on(data)
            *lines, rest = (rest + data).split(b'\n')
            self._lines.extend(parse(line.decode(errors='replace')) for line in lines)
        os.close(reading)
        if rest:
            self._lines.append(parse(rest.decode(errors='replace')))

    def _pass_on(self, data: bytes) -> None:
        try:
            os.write(self._original, data)
        except OSError:  # whoever read it has gone
            self._passed_on = False
