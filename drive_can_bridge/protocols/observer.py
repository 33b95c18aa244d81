# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watching a conversation: frames and their times in, telegrams out.

A session talks to its drive; an *observer* only listens, to both sides alike, and says what each
frame means: whose it is, which values it carries, what it answers, and what was never answered. It
takes frames without knowing who sent them: every family tells requests from responses by their
identifiers. Like sessions, observers have no clock: time is an argument, so that a trace of last
week is read like the bus of this moment. Exchanges, misses and latencies are counted by the rules
of the sessions, so that both can be compared.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from enum import Enum
import math
from typing import Generic, NamedTuple, TypeVar

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.statistics import Statistic

#: s for which an answer that did not come in time is still known to be one
LATE_TIME = 10.0
#: s by which a recorded distance may fall short of a prescribed one: stamps are not exact
STAMP_TOLERANCE = 0.002

Handler = Callable[[bytes, float], None]


class Direction(Enum):
    """Who speaks; the value is what a line of text shows."""

    REQUEST = '>'
    RESPONSE = '<'
    NEITHER = '-'


class Kind(Enum):
    """What a telegram is for."""

    CYCLIC = 'cyclic'           # the exchange, emulated ones included
    PARAMETER = 'parameter'     # everything else about parameters
    NETWORK = 'network'         # NMT, heartbeats, emergencies
    OTHER = 'other'             # of no drive that anybody knows


class Verdict(Enum):
    """Whether all is well with a telegram."""

    NORMAL = 'normal'
    REFUSED = 'refused'
    LATE = 'late'
    LOST = 'lost'
    UNASKED = 'unasked'
    MALFORMED = 'malformed'
    SUSPICIOUS = 'suspicious'


class Telegram(NamedTuple):
    """
    What a frame means, or that one is missing.

    :param time: of the frame; of a missing one: when it was given up.
    :param drive: name of the drive; '' for frames of no drive in particular.
    :param title: what it is: ``cyclic request``, ``read``.
    :param parameters: what it carries; ``raws`` are their raw integers. More parameters than
        integers are asked for, not told.
    :param remark: anything else, in words.
    :param latency: s since the request that it answers; NaN where there is none.
    """

    time: float
    drive: str
    direction: Direction
    kind: Kind
    title: str
    parameters: Sequence[Parameter] = ()
    raws: Sequence[int] = ()
    verdict: Verdict = Verdict.NORMAL
    remark: str = ''
    latency: float = math.nan


Emit = Callable[[Telegram], None]
_NORMAL = Verdict.NORMAL


@dataclass
class Observed:
    """
    What was counted of one drive. Times in s.

    :ivar exchanges: complete exchanges; polled families: complete rounds.
    :ivar missed: exchanges without an answer in time.
    :ivar period: from one exchange to the next.
    :ivar latency: from request to response; polled families: of a whole round.
    :ivar requests: reads and writes of parameters, those of rounds left out.
    :ivar unanswered: those of them that nobody answered although somebody should.
    :ivar refused: requests that the drive refused, those of rounds included.
    :ivar late: answers that came after their time.
    :ivar unasked: answers that nobody asked for.
    :ivar malformed: frames on the drive's identifiers that make no sense.
    :ivar fast_writes: EEPROM writes that came too soon after the one before.
    """

    exchanges: int = 0
    missed: int = 0
    requests: int = 0
    unanswered: int = 0
    refused: int = 0
    late: int = 0
    unasked: int = 0
    malformed: int = 0
    fast_writes: int = 0
    period: Statistic = field(default_factory=Statistic)
    latency: Statistic = field(default_factory=Statistic)


class DriveObserver(ABC):
    """
    Watches one drive.

    :ivar deadline: when :meth:`expire` has something to do; infinity: never.
    """

    def __init__(self, name: str, emit: Emit) -> None:
        self.name = name
        self.observed = Observed()
        self.deadline = math.inf
        self._emit = emit

    @abstractmethod
    def handler(self, identifier: int, extended: bool) -> Handler | None:
        """Return what takes the data and time of frames with this identifier; None: not ours."""

    @abstractmethod
    def expire(self, now: float) -> None:
        """Give up what was not answered until ``now``."""

    def _tell(self, now: float, direction: Direction, kind: Kind, title: str,
              parameters: Sequence[Parameter] = (), raws: Sequence[int] = (), *,
              verdict: Verdict = _NORMAL, remark: str = '',
              latency: float = math.nan) -> None:
        """Emit a telegram, and count what is wrong with it."""
        if verdict is not _NORMAL:
            observed = self.observed
            if verdict is Verdict.REFUSED:
                observed.refused += 1
            elif verdict is Verdict.LATE:
                observed.late += 1
            elif verdict is Verdict.UNASKED:
                observed.unasked += 1
            elif verdict is Verdict.MALFORMED:
                observed.malformed += 1
        self._emit(Telegram(now, self.name, direction, kind, title, parameters, raws, verdict,
                            remark, latency))


Key = TypeVar('Key', bound=Hashable)


class Asked(NamedTuple):
    """A request that waits for its answer."""

    at: float
    due: float


class Questions(Generic[Key]):
    """
    Requests under way, by what their answers will say.

    What is answered so early in a trace that it may have been asked before is no surprise.

    :param timeout: s that an answer may take.
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._certain_from = math.nan
        self._open: dict[Key, Asked] = {}
        self._given_up: dict[Key, float] = {}   # key -> when it was asked

    def ask(self, key: Key, now: float) -> None:
        """Take note of a request; one that is repeated waits anew."""
        if self._certain_from != self._certain_from:    # NaN
            self._certain_from = now + self._timeout
        self._open.pop(key, None)
        self._open[key] = Asked(now, now + self._timeout)

    def answer(self, key: Key, now: float) -> tuple[Verdict, float]:
        """Return what an answer is, and s since it was asked for (NaN: it was not)."""
        asked = self._open.pop(key, None)
        if asked is not None:
            return Verdict.NORMAL, now - asked.at
        late = self._given_up.pop(key, None)
        if late is not None and now - late <= LATE_TIME:
            return Verdict.LATE, now - late
        if self._certain_from != self._certain_from:    # NaN
            self._certain_from = now + self._timeout
        return Verdict.NORMAL if now < self._certain_from else Verdict.UNASKED, math.nan

    def overdue(self, now: float) -> list[tuple[Key, float]]:
        """Give up what is overdue; return its keys, and when each should have been answered."""
        found: list[tuple[Key, float]] = []
        for key, asked in self._open.items():   # in the order asked: all have the same time-out
            if asked.due > now:
                break
            found.append((key, asked.due))
            self._given_up[key] = asked.at
        for key, _ in found:
            del self._open[key]
        if found and len(self._given_up) > 64:
            self._given_up = {key: at for key, at in self._given_up.items()
                              if now - at <= LATE_TIME}
        return found

    @property
    def deadline(self) -> float:
        """When something becomes overdue; infinity: nothing is under way."""
        for asked in self._open.values():
            return asked.due
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


class RoundWatch(Generic[Key]):
    """
    Finds the rounds of a polled drive among its reads.

    :param plan: the reads of a round, in their order.
    :ivar prelude: when something was sent that the next read had to wait for; NaN: nothing was.
    """

    def __init__(self, plan: Sequence[Key], observed: Observed) -> None:
        self.plan = list(plan)
        self.prelude = math.nan
        self._observed = observed
        self._next: int | None = None       # read of the round that comes next; None: no round
        self._began = math.nan
        self._incomplete = False

    def asked(self, key: Key, now: float) -> bool:
        """Take a read; tell whether it belongs to a round."""
        began, self.prelude = self.prelude, math.nan
        if not self.plan:
            return False
        if self._next is not None and key == self.plan[self._next]:
            return True
        if key != self.plan[0]:
            return False
        if not math.isnan(self._began):
            self._observed.period.add((began if began == began else now) - self._began)
        self._began = began if began == began else now      # not NaN
        self._next = 0
        self._incomplete = False
        return True

    def answered(self, key: Key, now: float) -> None:
        """Take the answer to a read."""
        if self._next is None or key != self.plan[self._next]:
            return
        self._next += 1
        if self._next == len(self.plan):
            self._next = None
            if not self._incomplete:
                self._observed.exchanges += 1
                self._observed.latency.add(now - self._began)

    def refused(self, key: Key, parts: Sequence[Key], now: float) -> None:
        """
        Take a refusal: the round goes on without; it brings no complete sample.

        :param parts: what is read instead, from now on.
        """
        if self._next is None or key != self.plan[self._next]:
            return
        if parts:
            self.plan[self._next:self._next + 1] = parts
            return
        self._incomplete = True
        self.answered(key, now)

    def failed(self, key: Key) -> None:
        """Take note that a read was not answered: the round is missed."""
        if self._next is not None and key == self.plan[self._next]:
            self._next = None
            self._observed.missed += 1
