# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watching a conversation: frames and their times in, telegrams out.

A session talks to its drive; an *observer* only listens, to both sides alike, and says what each
frame means: whose it is, which values it carries, what it answers, and what was never answered. It
takes frames without knowing who sent them: every family tells requests from responses by their
identifiers. Like sessions, observers have no clock: time is an argument, so that a trace of last
week is read like the bus of this moment. Exchanges, misses and latencies are counted by the rules
of the sessions, so that both can be compared: what waits for answers are the watches of
:mod:`.pairing`, of which an observer has those that its family needs.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from enum import Enum
import math
from typing import NamedTuple, Protocol, TypeVar

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.statistics import Statistic
from drive_can_bridge.protocols.telegrams import Direction

T = TypeVar('T')
KeyT = TypeVar('KeyT')
Handler = Callable[[bytes, float], None]


class TelegramKind(Enum):
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
    kind: TelegramKind
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


class AnswerExpiry(Protocol):
    """Something of a drive that waits for answers."""

    def expire(self, now: float) -> float:
        """Give up what was not answered until ``now``; return when to look again."""


class DriveObserver:
    """
    Watches one drive.

    :param extended: its identifiers have 29 bits.
    :ivar emit: takes every telegram.
    :ivar handlers: what takes frames, by their identifier.
    :ivar remote_handlers: what takes remote frames, of 11 bits.
    :ivar watches: what waits for answers; the first are given up first.
    :ivar deadline: when :meth:`expire` has something to do; infinity: never.
    """

    def __init__(self, name: str, emit: Emit, *, extended: bool = False) -> None:
        self.name = name
        self.handlers: dict[int, Handler] = {}
        self.remote_handlers: dict[int, Handler] = {}
        self.observed = Observed()
        self.watches: list[AnswerExpiry] = []
        self.deadline = math.inf
        self.emit = emit
        self._extended = extended

    def handler(self, identifier: int, extended: bool) -> Handler | None:
        """Return what takes the data and time of frames with this identifier; None: not ours."""
        return self.handlers.get(identifier) if extended == self._extended else None

    def expire(self, now: float) -> None:
        """Give up what was not answered until ``now``."""
        self.deadline = min([watch.expire(now) for watch in self.watches], default=math.inf)

    def due(self, when: float) -> None:
        """See to it that :meth:`expire` is called by then."""
        if when < self.deadline:
            self.deadline = when

    def report(self, now: float, direction: Direction, kind: TelegramKind, title: str,
             parameters: Sequence[Parameter] = (), raws: Sequence[int] = (), *,
             verdict: Verdict = _NORMAL, remark: str = '', latency: float = math.nan) -> None:
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
        self.emit(Telegram(now, self.name, direction, kind, title, parameters, raws, verdict,
                           remark, latency))

    def decoded(self, decode: Callable[[bytes], T], data: bytes, now: float,
                direction: Direction, kind: TelegramKind, title: str) -> T | None:
        """Return what data mean to ``decode``; None: nothing, which was reported."""
        try:
            return decode(data)
        except (RemoteProtocolError, ValueError) as error:  # ValueError: of an enum
            self.report(now, direction, kind, title, verdict=Verdict.MALFORMED, remark=str(error))
            return None

    def listen(self, identifier: int, direction: Direction, kind: TelegramKind, title: str,
             decode: Callable[[bytes], T], take: Callable[[T, float], None]) -> None:
        """
        Listen to frames with an identifier.

        :param title: what one is called that makes no sense to ``decode``.
        :param take: takes what the others mean, and their time.
        """
        def handler(data: bytes, now: float) -> None:
            meaning = self.decoded(decode, data, now, direction, kind, title)
            if meaning is not None:
                take(meaning, now)
        self.handlers[identifier] = handler


def raws_of(parameters: Sequence[Parameter], words: Sequence[int]) -> list[int]:
    """Return the raw integers that words on the wire are."""
    return [parameter.raw_from_word(word) for parameter, word in zip(parameters, words)]


def listed_by(parameters: Iterable[Parameter], place: Callable[[Parameter], KeyT | None],
              ) -> dict[KeyT, Parameter]:
    """Return parameters by where they stand; of two in one place, the first one listed."""
    return {key: parameter for parameter in reversed(list(parameters))
            if (key := place(parameter)) is not None}
