# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The exchange of protocols that have no cyclic service: a round of reads, and writes on change.

Families whose drives answer single requests only (``datamodel_standard``, ``canopen_pkw``)
emulate the exchange: once a period they read everything in ``cyclic_response``, in as few reads
as possible, and publish it together; what is in ``cyclic_request`` they write when it changes and
again after ``refresh_interval``. What to read and when to write is decided here; how, in the
families.
"""

from collections.abc import Container, Iterable, Sequence
import math
from typing import NamedTuple

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


class WriteSchedule:
    """
    Which setpoints have to be written: those that changed, and those not written for a while.

    Values are looked at when a frame is made, not when it becomes due: the newest one wins.

    :param count: number of setpoints.
    :param refresh: s after which an unchanged one is written again; 0: never.
    """

    def __init__(self, count: int, refresh: float) -> None:
        self._refresh = refresh
        self._written: list[int | None] = [None] * count
        self._written_at = [-math.inf] * count
        self._due: list[int] = []

    def forget(self) -> None:
        """Record that nothing is known of the drive: everything is due at the next look."""
        self._written = [None] * len(self._written)
        self._due.clear()

    def look(self, raws: Sequence[int], now: float, *,
             hold: Container[int | None] = ()) -> None:
        """
        Find out what is due, once a period.

        :param raws: what the setpoints are now.
        :param hold: indices of those that are not to be written now.
        """
        if hold:
            self._due = [index for index in self._due if index not in hold]
        for index, raw in enumerate(raws):
            if index not in self._due and index not in hold and (
                    raw != self._written[index]
                    or 0.0 < self._refresh <= now - self._written_at[index] + TOLERANCE):
                self._due.append(index)

    def order(self, index: int, *, first: bool) -> None:
        """Let a setpoint go before all others, if it is due, or behind them."""
        if index in self._due:
            self._due.remove(index)
            self._due.insert(0 if first else len(self._due), index)

    @property
    def waiting(self) -> int:
        """How many are due."""
        return len(self._due)

    def next(self) -> int:
        """Return the index of the setpoint to be written next, which is due no more."""
        return self._due.pop(0)

    def written(self, index: int, raw: int, now: float) -> None:
        """Record what the drive was told (and, where it acknowledges, has confirmed)."""
        self._written[index] = raw
        self._written_at[index] = now
        if index in self._due:
            self._due.remove(index)

    def failed(self, index: int) -> None:
        """Record that nobody knows what the drive has: it is due at the next look."""
        self._written[index] = None
