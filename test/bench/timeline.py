# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated time: all timers of a session, answers that take a while, and what users do."""

from collections.abc import Callable
from functools import partial
import heapq
from itertools import count
from typing import Protocol

from conversation import Conversation

#: steps of a while: what takes more does not end
STEPS_MAX = 20_000


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


class Timeline:
    """
    A conversation in which everything happens at its own time.

    :param answer: makes of a frame sent how many s later the drive says what; None: nothing. May
        be replaced at any time.
    :ivar log: what was sent, and when.
    """

    def __init__(self, talk: Conversation,
                 answer: Callable[[str], tuple[float, str] | None]) -> None:
        self.talk = talk
        self.answer = answer
        self.log: list[tuple[float, str]] = []
        self._coming = Coming()

    def plan(self, at: float, step: Callable[[float], list[str]]) -> None:
        """Have something happen: (now) -> what was sent."""
        self._coming.plan(round(at, 6), lambda: self.took(step(self.talk.now)))

    def took(self, sent: list[str]) -> None:
        """Have the drive hear what was sent just now."""
        now = self.talk.now
        for text in sent:
            self.log.append((round(now, 6), text))
            answer = self.answer(text)
            if answer is not None:
                delay, reply = answer
                self.plan(now + delay, partial(self.talk.hears, reply))

    def live(self, end: float) -> None:
        """Let time pass; what is on its way at the end arrives later."""
        talk = self.talk
        self._coming.live(talk, end, due=talk.session.next_timer,
                          timers=lambda: self.took(talk.at(talk.now)))

    def when(self, *texts: str) -> list[float]:
        """Return when any of these frames was sent."""
        return [at for at, text in self.log if text in texts]
