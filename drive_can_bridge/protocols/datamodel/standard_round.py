# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a round of a DataModel drive with 11-bit identifiers reads, and how long it takes."""

import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import worst_bits
from drive_can_bridge.core.messages import NOTHING
from drive_can_bridge.core.process_image import control_word, status_word
from drive_can_bridge.protocols.datamodel.extended import PAYLOAD
from drive_can_bridge.protocols.datamodel.procedures import Numbers
from drive_can_bridge.protocols.datamodel.transactor import (
    ParameterRead, ParameterTransactor, Procedure)
from drive_can_bridge.protocols.polled_exchange import Chunk, Raws, round_time

FRAME_BITS = worst_bits(PAYLOAD, extended=False)


def reads(drive: DriveConfiguration) -> list[Chunk]:
    """
    Return the reads of a round.

    Gaps are bridged over parameters that the profile lists: about others nobody knows whether the
    drive has them, and it answers a read as a whole or not at all.
    """
    numbers = Numbers(drive)
    known = {numbers.number(parameter) for parameter in drive.profile.parameters.values()
             if parameter.number is not None and parameter.readable}
    return numbers.plan([numbers.span(parameter) for parameter in drive.cyclic_response],
                        known=known)


def frames(drive: DriveConfiguration) -> int:
    """Return the number of frames of a period in which every setpoint changes."""
    return 2 * len(reads(drive)) + len(drive.cyclic_request)


def shortest_period(drive: DriveConfiguration, bitrate: int) -> float:
    """
    Return the time of such a period at worst, in s.

    A word that starts the drive is repeated behind a status that was read just now: where that is
    not in the round, and repeated this often, it is one read more.
    """
    requests = len(reads(drive)) + len(drive.cyclic_request)
    shortest = round_time([FRAME_BITS] * frames(drive), requests, bitrate)
    status = status_word(drive)
    if status is None or status in drive.cyclic_response or (
            control_word(drive, controlled=True) not in drive.cyclic_request):
        return shortest
    longer = round_time([FRAME_BITS] * (frames(drive) + 2), requests + 1, bitrate)
    return longer if 0 < drive.options.refresh_interval <= longer else shortest


class StandardRound:
    """
    The rounds of one drive.

    :param status_slot: of the status word in ``cyclic_response``, if it is there.
    :ivar gap: what the last one asked for in vain, though others were answered, in words.
    :ivar status_asked_at: when the status was asked for last.
    """

    def __init__(self, drive: DriveConfiguration, transactor: ParameterTransactor,
                 status_slot: int | None) -> None:
        self.gap = NOTHING
        self.status_asked_at = -math.inf
        self._transactor = transactor
        self._parameters = drive.cyclic_response
        self._numbers = Numbers(drive).numbers(drive.cyclic_response)
        self._reads = reads(drive)
        self._status_read = None if status_slot is None else next(
            chunk for chunk in self._reads if self._numbers[status_slot] in chunk.addresses)

    def read(self) -> Procedure[Raws | None]:
        """Read all; return the raw integers, or None when one read was not answered."""
        found: dict[int, int] = {}
        for chunk in self._reads:
            words = yield ParameterRead(chunk.address, chunk.size, attempts=1)
            if words is None:
                self.gap = (NOTHING if chunk is self._reads[0] else
                            sentences.one_read_unanswered(self._names(chunk)))
                return None
            if chunk is self._status_read:
                self.status_asked_at = self._transactor.asked_at
            found.update(zip(chunk.addresses, words))
        return tuple(parameter.raw_from_word(found[number])
                     for parameter, number in zip(self._parameters, self._numbers))

    def _names(self, chunk: Chunk) -> str:
        """Name what a read is for."""
        return ', '.join(f'{parameter.name} ({parameter.address})'
                         for parameter, number in zip(self._parameters, self._numbers)
                         if number in chunk.addresses)
