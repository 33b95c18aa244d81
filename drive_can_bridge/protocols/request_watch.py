# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What observers of drives see that are read and written by single requests, rounds among them.

What a request is about is a *span* of parameters, as the family addresses them.
"""

from collections.abc import Callable, Container, Hashable, Sequence
import math
from typing import Any, Generic, NamedTuple

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.observer import (
    Direction, DriveObserver, Kind, Observed, Verdict,
)
from drive_can_bridge.protocols.watches import Key, Questions

_TITLES = {True: 'write', False: 'read'}
#: of a request: what it is about, and the raw integers that it carries, if any
Content = tuple[Sequence[Parameter], Sequence[int]]


class Asked(NamedTuple):
    """What a request is about."""

    span: Any
    writes: bool = False
    kind: Kind = Kind.PARAMETER


class Requests(Generic[Key]):
    """
    The requests of one drive, and their answers.

    :param timeout: s that an answer may take.
    :param content: (span, words or None) -> the parameters, and what these words are.
    :param plan: the reads of a round, in their order, where the exchange is made of requests.
    :param setpoints: the spans that are written in it.
    :ivar about: what there is to know about requests, answered or not; the newest is the last.
    """

    def __init__(self, observer: DriveObserver, timeout: float,
                 content: Callable[[Any, Sequence[int] | None], Content], *,
                 plan: Sequence[Hashable] = (), setpoints: Container[Hashable] = ()) -> None:
        self.round = RoundWatch(plan, observer.observed)
        self._observer = observer
        self._content = content
        self._setpoints = setpoints
        self._questions: Questions[Key, Asked] = Questions(observer, timeout, self._unanswered)
        self.about = self._questions.about

    def ask(self, key: Key | None, span: Hashable, now: float,
            words: Sequence[int] | None = None, *, wrong: str = '', futile: bool = False) -> None:
        """
        Take a request.

        :param key: what its answer will say; None: there is none to be expected.
        :param words: what is written; None: it is a read.
        :param wrong: what is suspicious about it.
        :param futile: it starts nothing: an answer is that to the one before.
        """
        writes = words is not None
        cyclic = span in self._setpoints if writes else self.round.asked(span, now)
        self._observer.observed.requests += not cyclic
        asked = Asked(span, writes, Kind.CYCLIC if cyclic else Kind.PARAMETER)
        if key is not None:
            (self._questions.note if futile else self._questions.ask)(key, asked, now)
        self._tell(now, Direction.REQUEST, asked, words, remark=wrong,
                   verdict=Verdict.SUSPICIOUS if wrong else Verdict.NORMAL)

    def answer(self, key: Key, asked: Asked, now: float, words: Sequence[int], *,
               refusal: str = '', parts: Sequence[Hashable] = ()) -> None:
        """
        Take an answer.

        :param asked: what it is about.
        :param words: what was read.
        :param refusal: why the drive refuses it; '' if it does not.
        :param parts: what a round asks for instead of what is refused.
        """
        verdict, latency = self._questions.answer(key, now)
        span, writes, _ = asked
        if verdict is Verdict.NORMAL and not writes:
            self.round.answered(span, now, refused=bool(refusal), parts=parts if refusal else ())
        self._tell(now, Direction.RESPONSE, asked, None if refusal or writes else words,
                   verdict=Verdict.REFUSED if refusal else verdict, remark=refusal,
                   latency=latency)

    def _tell(self, now: float, direction: Direction, asked: Asked, words: Sequence[int] | None,
              **more: Any) -> None:
        self._observer.tell(now, direction, asked.kind, _TITLES[asked.writes],
                            *self._content(asked.span, words), **more)

    def _unanswered(self, key: Key, asked: Asked, due: float) -> None:
        if not asked.writes:
            self.round.failed(asked.span)
        self._observer.tell_unanswered(due, asked.kind, _TITLES[asked.writes],
                                       self._content(asked.span, None)[0])


class RoundWatch:
    """
    Finds the rounds of a polled drive among its reads.

    :param plan: the reads of a round, in their order.
    :ivar prelude: when something was sent that the next read had to wait for; NaN: nothing was.
    """

    def __init__(self, plan: Sequence[Hashable], observed: Observed) -> None:
        self.plan = list(plan)
        self.prelude = math.nan
        self._observed = observed
        self._next: int | None = None       # read of the round that comes next; None: no round
        self._began = math.nan
        self._incomplete = False

    def asked(self, span: Hashable, now: float) -> bool:
        """Take a read; tell whether it belongs to a round."""
        began, self.prelude = self.prelude, math.nan
        if not self.plan:
            return False
        if self._next is not None and span == self.plan[self._next]:
            return True
        if span != self.plan[0]:
            return False
        if began != began:      # NaN
            began = now
        if self._began == self._began:
            self._observed.period.add(began - self._began)
        self._began = began
        self._next = 0
        self._incomplete = False
        return True

    def answered(self, span: Hashable, now: float, *, refused: bool = False,
                 parts: Sequence[Hashable] = ()) -> None:
        """
        Take the answer to a read.

        :param refused: by a refusal; the round goes on, but brings no complete sample.
        :param parts: what is read instead, from now on.
        """
        if self._next is None or span != self.plan[self._next]:
            return
        if parts:
            self.plan[self._next:self._next + 1] = parts
            return
        self._incomplete = self._incomplete or refused
        self._next += 1
        if self._next == len(self.plan):
            self._next = None
            if not self._incomplete:
                self._observed.exchanges += 1
                self._observed.latency.add(now - self._began)

    def failed(self, span: Hashable) -> None:
        """Record that a read was not answered: the round is missed."""
        if self._next is not None and span == self.plan[self._next]:
            self._next = None
            self._observed.missed += 1
