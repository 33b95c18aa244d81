# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The exchange of protocols that have no cyclic service: rounds of reads.

Families whose drives answer single requests only (``datamodel_standard``, ``canopen_pkw``)
emulate the exchange: once a period they read everything in ``cyclic_response``, in as few reads
as possible, and publish it together. What to read is decided here; how, in the families. What they
write: :mod:`.acyclic_output`.
"""

from collections.abc import Container, Iterable
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
