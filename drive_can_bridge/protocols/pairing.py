# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which answer belongs to which request, for observers of all families.

Answered, late, unasked or missed: :class:`CyclicWatch` says it of a cyclic service,
:class:`PendingRequests` of single reads and writes, the rounds of :class:`RoundWatch` among them.
What a request is about is a *span* of parameters, as the family addresses them.
"""

from collections.abc import Callable, Container, Hashable, Sequence
import math
from typing import Any, Generic, NamedTuple, TypeVar

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.observer import DriveObserver, Observed, TelegramKind, Verdict
from drive_can_bridge.protocols.telegrams import Direction

#: s for which an answer that did not come in time is still known to be one
LATE_TIME = 10.0
#: s by which a recorded distance may fall short of a prescribed one: stamps are not exact
STAMP_TOLERANCE = 0.002
#: periods after which a cyclic request counts as unanswered although no other followed
CYCLES_WAITED = 2.0

#: requests that are remembered after their answers
REMEMBERED = 1024

Key = TypeVar('Key', bound=Hashable)
_TITLES = {True: 'write', False: 'read'}
#: of a request: what it is about, and the raw integers that it carries, if any
Content = tuple[Sequence[Parameter], Sequence[int]]


class CyclicWatch:
    """
    Counts the exchanges of a cyclic service: one request, one answer.

    :param patience: s after which a request counts as unanswered although no other followed: the
        master stopped, and nobody else counts it.
    """

    __slots__ = ('_asked', '_cycle', '_last', '_observed', '_observer', '_patience', '_stale')

    def __init__(self, observer: DriveObserver, patience: float) -> None:
        self._observer = observer
        self._observed = observer.observed
        self._patience = patience
        self._asked = math.nan          # when the request under way was sent
        self._last = -math.inf          # when the last one was, answered or not
        self._cycle = math.nan          # when the last cycle began
        self._stale = False             # one answer too many may come
        observer.watches.append(self)

    def begin_cycle(self, now: float) -> None:
        """Record that a period begins."""
        if self._cycle == self._cycle:      # not NaN
            self._observed.period.add(now - self._cycle)
        self._cycle = now

    def ask(self, now: float, *, begins_cycle: bool = True) -> None:
        """Record a request; the one before is missed if it was not answered."""
        if self._asked == self._asked:      # not NaN
            self._miss(now)
        if begins_cycle:
            self.begin_cycle(now)
        self._asked = self._last = now
        due = now + self._patience
        if due < self._observer.deadline:   # as DriveObserver.due: this is the fast path
            self._observer.deadline = due

    @property
    def asked(self) -> bool:
        """A request is under way."""
        return self._asked == self._asked   # not NaN

    def answer(self, now: float) -> tuple[Verdict, float]:
        """Count an answer; return what it is, and s since the request (NaN: there was none)."""
        asked = self._asked
        if asked == asked:      # not NaN
            self._asked = math.nan
            latency = now - asked
            self._observed.exchanges += 1
            self._observed.latency.add(latency)
            return Verdict.NORMAL, latency
        if self._stale:
            self._stale = False
            return Verdict.LATE, now - self._last
        # where no request was heard yet, it was asked before the trace began
        return Verdict.NORMAL if self._last == -math.inf else Verdict.UNASKED, math.nan

    def expire(self, now: float) -> float:
        """Give up a request whose time is over; return when it will be (infinity: none)."""
        due = self._asked + self._patience
        if due <= now:
            self._miss(due)
        return due if due > now else math.inf   # NaN: nothing is under way

    def _miss(self, now: float) -> None:
        self._observer.report(now, Direction.RESPONSE, TelegramKind.CYCLIC, 'cyclic response',
                            verdict=Verdict.LOST,
                            remark=frame_sentences.unanswered_for(1e3 * (now - self._asked)))
        self._asked = math.nan
        self._stale = True
        self._observed.missed += 1


class AnswerWatch:
    """
    Waits for one answer at a time; nothing is counted.

    :param timeout: s that it may take.
    :param lose: takes the time when none came.
    """

    def __init__(self, observer: DriveObserver, timeout: float,
                 lose: Callable[[float], None]) -> None:
        self._observer = observer
        self._timeout = timeout
        self._lose = lose
        self._asked = math.nan
        observer.watches.append(self)

    def ask(self, now: float) -> None:
        """Record a request; the one before is lost if it was not answered."""
        if self._asked == self._asked:      # not NaN
            self._lose(now)
        self._asked = now
        self._observer.due(now + self._timeout)

    def answer(self, now: float) -> float:
        """Record an answer; return s since the request (NaN: there was none)."""
        latency, self._asked = now - self._asked, math.nan
        return latency

    def expire(self, now: float) -> float:
        """Give up a request whose time is over; return when it will be (infinity: none)."""
        due = self._asked + self._timeout
        if due <= now:
            self._asked = math.nan
            self._lose(due)
        return due if due > now else math.inf   # NaN: nothing is under way


class RequestContent(NamedTuple):
    """
    What a request is about.

    :param title: what the telegram is called; '': read or write.
    """

    span: Any
    writes: bool = False
    kind: TelegramKind = TelegramKind.PARAMETER
    title: str = ''


class PendingRequests(Generic[Key]):
    """
    The requests of one drive, and their answers.

    What is answered so early in a trace that it may have been asked before is no surprise, unless
    the trace holds its request.

    :param timeout: s that an answer may take.
    :param content: (span, words or None) -> the parameters, and what these words are.
    :param plan: the reads of a round, in their order, where the exchange is made of requests.
    :param setpoints: the spans that are written in it.
    :param missing: what an answer is called that does not come; '': read or write.
    :ivar about: what there is to know about requests, answered or not; the newest is the last.
    """

    def __init__(self, observer: DriveObserver, timeout: float,
                 content: Callable[[Any, Sequence[int] | None], Content], *,
                 plan: Sequence[Hashable] = (), setpoints: Container[Hashable] = (),
                 missing: str = '') -> None:
        self.about: dict[Key, RequestContent] = {}
        self.round = RoundWatch(plan, observer.observed)
        self._observer = observer
        self._timeout = timeout
        self._content = content
        self._setpoints = setpoints
        self._missing = missing
        self._certain_from = math.nan
        self._open: dict[Key, float] = {}       # key -> when it was asked
        self._given_up: dict[Key, float] = {}   # key -> when it was asked
        observer.watches.append(self)

    def ask(self, key: Key | None, span: Hashable, now: float,
            words: Sequence[int] | None = None, *, title: str = '', wrong: str = '',
            futile: bool = False) -> None:
        """
        Record a request; one that is repeated waits from now on.

        :param key: what its answer will say; None: there is none to be expected.
        :param words: what is written; None: it is a read.
        :param wrong: what is suspicious about it.
        :param futile: it starts nothing: an answer is that to the one before.
        """
        writes = words is not None
        cyclic = span in self._setpoints if writes else self.round.asked(span, now)
        self._observer.observed.requests += not cyclic
        asked = RequestContent(span, writes,
                               TelegramKind.CYCLIC if cyclic else TelegramKind.PARAMETER, title)
        if key is not None:
            self.about.pop(key, None)
            self.about[key] = asked
            if not futile:
                self._wait(key, now)
            while len(self.about) > REMEMBERED and (
                    oldest := next(iter(self.about))) not in self._open:
                del self.about[oldest]
        self._report(now, Direction.REQUEST, asked, words, remark=wrong,
                   verdict=Verdict.SUSPICIOUS if wrong else Verdict.NORMAL)

    def answer(self, key: Key, asked: RequestContent, now: float, words: Sequence[int] | None, *,
               refusal: str = '', wrong: str = '', remark: str = '',
               parts: Sequence[Hashable] = ()) -> None:
        """
        Count an answer, and report it.

        :param asked: what it is about.
        :param words: what it holds; None: nothing.
        :param refusal: why the drive refuses it; '' if it does not.
        :param wrong: why it does not fit what was asked; '' if it does.
        :param parts: what a round asks for instead of what is refused.
        """
        verdict, latency = self._judge(key, now)
        if verdict is Verdict.NORMAL and not asked.writes:
            self.round.answered(asked.span, now, refused=bool(refusal),
                                parts=parts if refusal else ())
        if refusal or wrong:
            verdict = Verdict.REFUSED if refusal else Verdict.MALFORMED
        self._report(now, Direction.RESPONSE, asked, None if refusal else words, verdict=verdict,
                   remark=refusal or remark or wrong, latency=latency)

    def expire(self, now: float) -> float:
        """Give up what is overdue; return when to look again."""
        while self._open:
            key, asked_at = next(iter(self._open.items()))  # the oldest: all have the same time
            due = asked_at + self._timeout
            if due > now:
                return due
            del self._open[key]
            self._given_up[key] = asked_at
            asked = self.about[key]
            if not asked.writes:
                self.round.failed(asked.span)
            self._observer.observed.unanswered += asked.kind is TelegramKind.PARAMETER
            self._report(due, Direction.RESPONSE, asked._replace(title=self._missing), None,
                       verdict=Verdict.LOST, remark='no answer')
            if len(self._given_up) > 64:
                self._given_up = {key: at for key, at in self._given_up.items()
                                  if now - at <= LATE_TIME}
        return math.inf

    def _wait(self, key: Key, now: float) -> None:
        due = now + self._timeout
        if self._certain_from != self._certain_from:    # NaN
            self._certain_from = due
        self._open.pop(key, None)
        self._open[key] = now
        self._observer.due(due)

    def _judge(self, key: Key, now: float) -> tuple[Verdict, float]:
        """Return what an answer is, and s since it was asked for (NaN: it was not)."""
        asked_at = self._open.pop(key, None)
        if asked_at is not None:
            return Verdict.NORMAL, now - asked_at
        late = self._given_up.pop(key, None)
        if late is not None and now - late <= LATE_TIME:
            return Verdict.LATE, now - late
        if self._certain_from != self._certain_from:    # NaN
            self._certain_from = now + self._timeout
        before = now < self._certain_from and key not in self.about
        return Verdict.NORMAL if before else Verdict.UNASKED, math.nan

    def _report(self, now: float, direction: Direction, asked: RequestContent,
              words: Sequence[int] | None,
              **more: Any) -> None:
        self._observer.report(now, direction, asked.kind, asked.title or _TITLES[asked.writes],
                            *self._content(asked.span, words), **more)


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
        """Record a read; return whether it belongs to a round."""
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
        Record the answer to a read.

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


class WriteGap:
    """Watches the time between EEPROM writes of one drive; ``gap`` s are prescribed."""

    def __init__(self, gap: float) -> None:
        self._gap = gap
        self._last = -math.inf

    def written(self, now: float) -> str:
        """Record an EEPROM write; return what is wrong with its time, '' nothing."""
        distance, self._last = now - self._last, now
        if distance >= self._gap - STAMP_TOLERANCE:
            return ''
        return frame_sentences.eeprom_written_fast(1e3 * distance, 1e3 * self._gap)
