# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The exchange of protocols without a cyclic service: rounds of reads, one a period, as samples.

Families whose drives answer single requests only (``datamodel_standard``, ``canopen_pkw``) read
everything in ``cyclic_response`` once a period, in as few reads as possible. Which reads those are
is decided here; how one is made, the family says. A complete round is a sample, and finds a drive
that was offline; one with a read that nobody answered is missed. One with a read that the drive
refused is neither: there is no complete sample. What is written: :mod:`.acyclic_output`.
"""

from collections.abc import Container, Generator, Iterable, Sequence
import math
from typing import Any, NamedTuple, Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import ProcessDataReceived
from drive_can_bridge.core.messages import NOTHING
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.channel import Channel, Priority
from drive_can_bridge.protocols.exchange_book import ExchangeBook
from drive_can_bridge.protocols.timing_advice import TimingAdvice

#: s by which sums of times are wrong
TOLERANCE = 1e-6
#: s that a drive is given for each request of a round, beside the time of the frames
REQUEST_TIME = 0.001


class Chunk(NamedTuple):
    """
    What a parameter takes, and what one read asks for.

    :param address: number of the first word.
    :param size: consecutive words; of a parameter: 1, or 2 for 32 bits.
    """

    address: int
    size: int = 1

    @property
    def addresses(self) -> range:
        """The number of each word."""
        return range(self.address, self.address + self.size)


def plan_reads(wanted: Iterable[Chunk], size: int, *, known: Container[int] = ()) -> list[Chunk]:
    """
    Cover parameters by as few reads as possible.

    Each read begins where the first uncovered parameter begins and reaches as far as it can: no
    other choice of intervals of a fixed length needs fewer.

    :param size: words that a read can bring.
    :param known: addresses that may be read although nobody wants them, in order to bridge a gap.
        An address that the drive does not know would cost the whole read.

    >>> plan_reads([Chunk(212), Chunk(209), Chunk(210)], 4, known={211})
    [Chunk(address=209, size=4)]
    >>> plan_reads([Chunk(212), Chunk(209), Chunk(210)], 4)
    [Chunk(address=209, size=2), Chunk(address=212, size=1)]
    """
    chunks: list[Chunk] = []
    for chunk in sorted(set(wanted)):
        end = chunk.address + chunk.size
        if chunks:
            address, length = chunks[-1]
            reached = address + length
            if end <= reached:
                continue
            if end - address <= size and all(
                    gap in known for gap in range(reached, chunk.address)):
                chunks[-1] = Chunk(address, end - address)
                continue
        chunks.append(chunk)
    return chunks


def round_time(frame_bits: Iterable[int], requests: int, bitrate: int) -> float:
    """
    Return how long a round takes at worst, in s.

    :param frame_bits: length of every frame of the round with maximal stuffing.
    :param requests: reads and writes.
    """
    return sum(frame_bits) / bitrate + requests * REQUEST_TIME


#: of a round, in the order of samples; None: of what was refused
Raws = Sequence[int | None]


class Polled(Protocol):
    """What a family does for its rounds: its session."""

    @property
    def present(self) -> bool:
        """A drive is there, should it answer."""

    def read_round(self) -> Generator[Any, Any, Raws | None]:
        """
        Read all of ``cyclic_response`` once.

        :return: None in place of a value that is refused; None alone: a read was not answered.
        """

    def round_found(self, now: float) -> None:
        """Handle a drive that was offline and has answered a round."""

    def round_answered(self, raws: Raws, now: float, *, found: bool) -> None:
        """
        Handle a round before it becomes a sample.

        :param found: the drive was found by it.
        """


class PolledExchange:
    """
    The rounds of one drive.

    :ivar timer: when the next round is due.
    :ivar reading: a round is under way.
    :ivar timing: says what would have held.
    :ivar received_at: when the last answer was received.
    """

    def __init__(self, session: Session, rounds: Polled, channel: Channel[Any, Any]) -> None:
        self._session, self._rounds = session, rounds
        self._channel = channel
        self._book = ExchangeBook(session.configuration, session.statistics)
        self.timing = TimingAdvice(session.configuration, session.report)
        self._void = False  # this round began before the process stood still
        self.timer = self._book.timer
        self.reading = False
        self.received_at = -math.inf

    @property
    def silent(self) -> bool:
        """The last round was missed."""
        return self._book.missed_in_row > 0

    def begin(self, now: float) -> None:
        """Begin a round; none is under way."""
        self._book.begin(now)
        self.reading, self._void = True, False
        self._channel.run(self._rounds.read_round(), self._ended, now)

    def wait(self, now: float, patience: float) -> None:
        """Count a period in which the round under way has not ended; it has so many s."""
        self.timer.begun(now)
        if now - self._book.began_at > patience:
            self._miss(now)

    def forget(self) -> None:
        """Count what is missed from 0 again."""
        self._book.missed_in_row = 0

    def disregard(self) -> None:
        """Record that the round under way, if any, does not count."""
        self._void = self.reading

    def cancel(self) -> None:
        """Leave the round that is under way alone."""
        self._channel.cancel(Priority.OWN)
        self.reading = False

    def stop(self) -> None:
        """Begin no further round; that under way is cancelled with others."""
        self.timer.stop()
        self.reading = False

    def _ended(self, raws: Raws | None) -> None:
        now, session = self._channel.now, self._session
        self.reading = False
        if self._void:
            return
        if raws is None:
            self._miss(now)
            return
        self.forget()
        self.timing.came(self.received_at)
        fresh = not session.online
        if fresh:
            if not self._rounds.present:
                return
            session.interlock.measured(raws)     # before anything is written
            self._rounds.round_found(now)
        self._rounds.round_answered(raws, now, found=fresh)
        session.interlock.measured(raws)
        sample = tuple(raw for raw in raws if raw is not None)
        if len(sample) == len(raws):
            self._book.answered(self.received_at)
            session.report.note(ProcessDataReceived(sample, self.received_at))
        elif session.fault_watch is not None:
            session.fault_watch.sampled(raws, now)

    def _miss(self, now: float) -> None:
        session, limit = self._session, self._session.configuration.missed_limit
        too_many = self._book.missed()
        if too_many and session.online:
            self.timing.lost(self._book.answered_at)
        session.exchange_missed(sentences.no_round(limit) if too_many else NOTHING, now)
