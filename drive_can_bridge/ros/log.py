# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The log of the bridge, written by a thread of its own.

A line costs tens of microseconds at best, and whatever the file of the log and its subscribers
take at worst. Most of what there is to say is found out with a bus lock held. So one that has a
line puts it into a bounded queue and goes on; what does not fit is counted and said later. How
much drives and buses may say is limited before (:mod:`.log_limit`).
"""

import math
from typing import Any

from drive_can_bridge.clock import Clock, Mailbox
from drive_can_bridge.core.text import printable
from drive_can_bridge.process.standard_outputs import MOMENT, Taking
from drive_can_bridge.ros.log_limit import Level, LogLimit, Speaker

#: lines that may wait
LINES_MAX = 1000

#: in the queue: the thread has to look what there is to be summed up, or to end
_LOOK, _END = (Level.INFO, 'look'), (Level.INFO, 'end')


class Log:
    """
    Passes lines on to a logger of rclpy. From any thread; never waits.

    Whatever a line contains is printable when it arrives there.
    """

    def __init__(self, logger: Any, clock: Clock) -> None:
        self._logger = logger
        self._now = clock.now
        self._lines: Mailbox[tuple[Level, str]] = Mailbox(clock, LINES_MAX)
        self._limit = LogLimit(self._put, self._wake, clock.now)
        self._dropped = 0
        self._closed = False
        self._taking = Taking(clock.now)
        self._thread = clock.worker(self._run, 'log')
        self._thread.start()

    def speaker(self, name: str) -> Speaker:
        """Return the log of a drive or a bus: its lines begin with the name (if there is one)."""
        return self._limit.speaker(name)

    def info(self, text: str) -> None:
        """Log what is as it should be."""
        self._put(Level.INFO, text)

    def warning(self, text: str) -> None:
        """Log what somebody should look at."""
        self._put(Level.WARNING, text)

    def error(self, text: str) -> None:
        """Log what does not work."""
        self._put(Level.ERROR, text)

    def fatal(self, text: str) -> None:
        """Log why the bridge ends."""
        self._put(Level.FATAL, text)

    def close(self) -> None:
        """Write what waits, unless nobody takes it; what comes later is written at once."""
        if self._closed:
            return
        self._limit.sum_up(all_of_it=True)
        self._closed = True
        self._lines.put(_END, always=True)
        while self._thread.is_alive() and not self._taking.nobody:
            self._thread.join(MOMENT)

    def _put(self, level: Level, text: str) -> None:
        if self._closed:
            self._write(level, text)
            return
        if not self._lines.put((level, text)):
            self._dropped += 1

    def _wake(self) -> None:
        self._lines.put(_LOOK)      # full: then the thread is awake

    def _run(self) -> None:
        while True:
            wait = self._limit.wait()
            try:
                line = self._lines.get(math.inf if wait is None else self._now() + wait)
            except TimeoutError:
                line = _LOOK
            if line is not _LOOK and line is not _END:
                with self._taking:
                    self._write(*line)
            self._limit.sum_up()
            if self._dropped and (not self._lines or line is _END):
                dropped, self._dropped = self._dropped, 0
                self._write(Level.WARNING, f'{dropped} lines of the log left out: they came '
                                           f'faster than they could be written')
            if line is _END:
                return

    def _write(self, level: Level, text: str) -> None:
        text = printable(text, None)
        logger = self._logger
        try:
            # a line each: rclpy wants the level of a place in the source not to change
            if level is Level.INFO:
                logger.info(text)
            elif level is Level.WARNING:
                logger.warning(text)
            elif level is Level.ERROR:
                logger.error(text)
            else:
                logger.fatal(text)
        except Exception:  # noqa: BLE001  the context is gone: nobody is left to be told
            pass
