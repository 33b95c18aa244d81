# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Clocks for tests that do with less than the bench of ``clocked/``."""

from collections.abc import Callable

from drive_can_bridge.clock import SteadyClock

#: the clock of this machine
REAL = SteadyClock()


class HandClock(SteadyClock):
    """
    A clock that shows what it is told; whoever waits waits in real time.

    :param now: says what the time is.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        super().__init__()
        self.now = now
