# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What observers watch: cycles, questions, the pace of EEPROM writes."""

from collections.abc import Callable, Hashable
import math
from typing import Generic, TypeVar

from drive_can_bridge.protocols.observer import DriveObserver, Kind, Verdict
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
About = TypeVar('About')


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
        """Take a request; the one before is missed if it was not answered."""
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
        """Count an answer; return what it is, and s since the request (NaN: nobody asked)."""
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
        """Give up a request that was not answered until ``now``; return when to look again."""
        due = self._asked + self._patience
        if due <= now:
            self._miss(due)
        return due if due > now else math.inf   # NaN: nothing is under way

    def _miss(self, now: float) -> None:
        self._observer.tell(now, Direction.RESPONSE, Kind.CYCLIC, 'cyclic response',
                            verdict=Verdict.LOST,
                            remark=f'no answer in {1e3 * (now - self._asked):.0f} ms')
        self._asked = math.nan
        self._stale = True
        self._observed.missed += 1


class Questions(Generic[Key, About]):
    """
    Requests under way, by what their answers will say.

    What is answered so early in a trace that it may have been asked before is no surprise.

    :param timeout: s that an answer may take.
    :param unanswered: takes what was not answered, what it was about, and when it should have
        been.
    :ivar about: what there is to know about requests, answered or not; the newest is the last.
    """

    def __init__(self, observer: DriveObserver, timeout: float,
                 unanswered: Callable[[Key, About, float], None]) -> None:
        self.about: dict[Key, About] = {}
        self._observer = observer
        self._timeout = timeout
        self._unanswered = unanswered
        self._certain_from = math.nan
        self._open: dict[Key, float] = {}       # key -> when it was asked
        self._given_up: dict[Key, float] = {}   # key -> when it was asked
        observer.watches.append(self)

    def ask(self, key: Key, about: About, now: float) -> None:
        """Record a request; one that is repeated waits anew."""
        self.note(key, about, now)
        due = now + self._timeout
        if self._certain_from != self._certain_from:    # NaN
            self._certain_from = due
        self._open.pop(key, None)
        self._open[key] = now
        self._observer.due(due)

    def note(self, key: Key, about: About, now: float) -> None:
        """Remember a request that starts nothing: an answer is that to one before."""
        self.about.pop(key, None)
        self.about[key] = about
        while len(self.about) > REMEMBERED and (
                oldest := next(iter(self.about))) not in self._open:
            del self.about[oldest]

    def answer(self, key: Key, now: float) -> tuple[Verdict, float]:
        """Return what an answer is, and s since it was asked for (NaN: it was not)."""
        asked = self._open.pop(key, None)
        if asked is not None:
            return Verdict.NORMAL, now - asked
        late = self._given_up.pop(key, None)
        if late is not None and now - late <= LATE_TIME:
            return Verdict.LATE, now - late
        if self._certain_from != self._certain_from:    # NaN
            self._certain_from = now + self._timeout
        return Verdict.NORMAL if now < self._certain_from else Verdict.UNASKED, math.nan

    def expire(self, now: float) -> float:
        """Give up what is overdue; return when to look again."""
        while self._open:
            key, asked = next(iter(self._open.items()))     # the oldest: all have the same time
            due = asked + self._timeout
            if due > now:
                return due
            del self._open[key]
            self._given_up[key] = asked
            self._unanswered(key, self.about[key], due)
            if len(self._given_up) > 64:
                self._given_up = {key: at for key, at in self._given_up.items()
                                  if now - at <= LATE_TIME}
        return math.inf


class WriteGap:
    """Watches the time between EEPROM writes of one drive; ``gap`` s are prescribed."""

    def __init__(self, gap: float) -> None:
        self._gap = gap
        self._last = -math.inf

    def written(self, now: float) -> str:
        """Take an EEPROM write; return what is wrong with its time, '' nothing."""
        distance, self._last = now - self._last, now
        if distance >= self._gap - STAMP_TOLERANCE:
            return ''
        return (f'EEPROM write {1e3 * distance:.1f} ms after the last, the drive wants '
                f'{1e3 * self._gap:g} ms')
