# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a round of a DataModel drive with 11-bit identifiers reads, and how long it takes."""

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.protocols.datamodel.standard import SLOTS
from drive_can_bridge.protocols.polling import Chunk, Place, plan_reads, round_time

#: worst-case stuffing, eight bytes, 11-bit identifier, with the interframe space
FRAME_BITS = 135


def places(drive: DriveConfiguration) -> list[Place]:
    """Return where the parameters of ``cyclic_response`` stand, as numbers on the wire."""
    offset: int = drive.options.parameter_offset
    return [Place((parameter.number or 0) + offset) for parameter in drive.cyclic_response]


def reads(drive: DriveConfiguration) -> list[Chunk]:
    """
    Return the reads of a round.

    Gaps are bridged over parameters that the profile lists: about others nobody knows whether the
    drive has them, and it answers a read as a whole or not at all.
    """
    offset: int = drive.options.parameter_offset
    known = {parameter.number + offset for parameter in drive.profile.parameters.values()
             if parameter.number is not None and parameter.readable}
    return plan_reads(places(drive), SLOTS, known=known)


def frames(drive: DriveConfiguration) -> int:
    """Return the number of frames of a period in which every setpoint changes."""
    return 2 * len(reads(drive)) + len(drive.cyclic_request)


def shortest_period(drive: DriveConfiguration, bitrate: int) -> float:
    """Return the time of such a period at worst, in s."""
    requests = len(reads(drive)) + len(drive.cyclic_request)
    return round_time([FRAME_BITS] * frames(drive), requests, bitrate)
