# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated time: all timers of a session, answers that take a while, and what users do."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import TypeVar

from coming import Coming
from conversation import Conversation

from drive_can_bridge.core.session import Session



PairT = TypeVar('PairT', bound='Pair')


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
        talk.now = max(talk.now, end)

    def stall(self, seconds: float) -> None:
        """Stand still; then the reader goes first, with all that has arrived, and goes on."""
        self.talk.now += seconds
        for _ in range(30):
            if self._coming:
                self._coming.arrives()

    def when(self, *texts: str) -> list[float]:
        """Return when any of these frames was sent."""
        return [at for at, text in self.log if text in texts]


class Pair(ABC):
    """
    A session and the drive at the other end of its bus, which answers at once.

    :cvar DELAY: s between a request and its answer.
    :ivar log: what was sent, and when.
    :ivar deaf: nothing of what the drive is told arrives.
    :ivar mute: nothing of what it says arrives.
    """

    DELAY = 0.0005

    def __init__(self, talk: Conversation) -> None:
        self.talk = talk
        self.now = 10.0
        self.log: list[tuple[float, str]] = []
        self.deaf = self.mute = False

    @property
    def session(self) -> Session:
        return self.talk.session

    @abstractmethod
    def answers(self, sent: str) -> list[str]:
        """Do what the drive does with a frame; return what it answers."""

    def deliver(self, sent: list[str]) -> None:
        for text in sent:
            self.log.append((round(self.now, 6), text))
            answers = [] if self.deaf else self.answers(text)
            for answer in answers if not self.mute else ():
                self.now += self.DELAY
                self.deliver(self.talk.hears(answer, self.now))

    def due(self) -> float:
        """Return when the next timer is due."""
        return self.session.next_timer()

    def timers(self) -> None:
        self.deliver(self.talk.at(self.now))

    def live(self: PairT, duration: float) -> PairT:
        """Let time pass, every timer in time."""
        end = self.now + duration
        Coming().live(self, end, due=self.due, timers=self.timers)
        self.now = max(self.now, end)
        return self

    def activate(self) -> None:
        self.deliver(self.talk.bus_up(self.now))
        self.deliver(self.talk.activate(self.now))

    def ends(self, wait: float | None = None) -> None:
        """Deactivate; it has stopped in time."""
        self.deliver(self.talk.deactivate(self.now))
        self.live(self.session.longest_stop + 0.5 if wait is None else wait)
        assert self.session.stopped

    def commands(self: PairT, *values: float) -> PairT:
        """Give the first setpoint these values, one after the other."""
        for value in values:
            self.talk.commands(0, value, self.now)
        return self
