# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated time: all timers of a session, answers that take a while, and what users do."""

from collections.abc import Callable
from functools import partial
import heapq
from itertools import count

from conversation import Conversation


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
        self._coming: list[tuple[float, int, Callable[[float], list[str]]]] = []
        self._number = count()

    def plan(self, at: float, step: Callable[[float], list[str]]) -> None:
        """Have something happen: (now) -> what was sent."""
        heapq.heappush(self._coming, (round(at, 6), next(self._number), step))

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
        while True:
            due = max(self.talk.now, self.talk.session.next_timer())
            if self._coming and self._coming[0][0] <= min(due, end):
                at, _, step = heapq.heappop(self._coming)
                self.took(step(at))
            elif due <= end:
                self.took(self.talk.at(due))
            else:
                return

    def when(self, *texts: str) -> list[float]:
        """Return when any of these frames was sent."""
        return [at for at, text in self.log if text in texts]
