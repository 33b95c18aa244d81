# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The loop of all tests in simulated time: timers, and what arrives between them."""

from collections.abc import Callable
import heapq
from itertools import count
from typing import Protocol

#: steps of a while: what takes more does not end
STEPS_MAX = 100_000


class Timed(Protocol):
    """What has a time of its own (s)."""

    now: float


class Coming:
    """What is on its way: what happens, and when."""

    def __init__(self) -> None:
        self._steps: list[tuple[float, int, Callable[[], object]]] = []
        self._number = count()

    def __bool__(self) -> bool:
        return bool(self._steps)

    def plan(self, at: float, step: Callable[[], object]) -> None:
        heapq.heappush(self._steps, (at, next(self._number), step))

    def clear(self) -> None:
        self._steps.clear()

    def arrives(self) -> None:
        """Let the first of it happen, whatever the time is."""
        heapq.heappop(self._steps)[2]()

    def live(self, of: Timed, end: float, *, due: Callable[[], float],
             timers: Callable[[], object], then: Callable[[], object] = lambda: None) -> None:
        """
        Let time pass: what arrives goes before timers of the same moment.

        :param of: has the time; what is on its way at the end arrives later.
        :param due: says when the next timer is due, which ``timers`` then serves.
        :param then: called behind everything that happens.
        """
        for _ in range(STEPS_MAX):
            timer_at = max(of.now, due())
            if self._steps and self._steps[0][0] <= min(timer_at, end):
                of.now = max(of.now, self._steps[0][0])
                self.arrives()
            elif timer_at <= end:
                of.now = timer_at
                timers()
            else:
                return
            then()
        raise AssertionError('a timer is never done')
