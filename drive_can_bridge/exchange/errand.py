# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Something done again and again, by whichever exchange is awake when it is due.

A thread of its own costs a wake-up each time, asks for the interpreter beside threads that need
it, and finds its caches cold: together more than what it does. The timer threads of busy buses are
awake all the time, and those of idle ones have the time to wake up for it.
"""

from collections.abc import Callable
import math
import threading

#: share of a period by which it may come before its time, where a thread is awake just then
EARLY = 0.1


class Errand:
    """
    Calls ``action`` with the time, once a period. No thread waits for another one's call.

    :param action: must not raise; whichever thread calls it has no lock of an exchange.
    """

    def __init__(self, action: Callable[[float], None]) -> None:
        self._action = action
        self._period = math.inf
        self._due = math.inf
        self._from = math.inf   # it may come a little before its time
        self._taken = threading.Lock()

    def begin(self, period: float, now: float) -> None:
        """Have it done every ``period`` s from now on, for the first time after one."""
        with self._taken:
            self._period = period
            self._plan(now + period)

    def end(self) -> None:
        """Have it done no more, and wait for a call that is under way."""
        with self._taken:
            self._due = self._from = math.inf

    def run(self, now: float) -> float:
        """Do it if it is due; return when to call next."""
        if now < self._from:
            return self._due
        if not self._taken.acquire(blocking=False):     # another exchange is at it
            return now + self._period
        try:
            if now >= self._from:
                due = self._due + self._period
                self._plan(due if due > now else now + self._period)    # never twice to catch up
                self._action(now)
            return self._due
        finally:
            self._taken.release()

    def _plan(self, due: float) -> None:
        self._due = due
        self._from = due - EARLY * self._period
