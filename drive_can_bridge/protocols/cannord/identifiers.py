# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The identifiers of the CANnord message objects.

Source: BU 0060, section 4.2.2 "Identifier" (table 8, page 49); the groups from pages 50 and 51.
``A`` is the CANnord address of the inverter (P515, 0 to 255):

================================ ==================== ==================
object                           direction            11-bit identifier
================================ ==================== ==================
process data                     master to inverter   2·A
process data                     inverter to master   2·A + 1
parameter task                   master to inverter   2·A + 512
parameter response               inverter to master   2·A + 513
process data, broadcast to 32    master to inverters  1024 + A div 32
process data, broadcast to all   master to inverters  1032
================================ ==================== ==================

The 29-bit form is the 11-bit identifier followed by 18 zero bits. Which drives of a bus form a
broadcast group is a matter of their configuration.
"""

from collections.abc import Sequence
from enum import Enum

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import LocalProtocolError

ADDRESS_MAX = 255
PARAMETER_BASE = 512
BROADCAST_BASE = 1024
BROADCAST_ALL = 1032
#: addresses that share one group identifier
GROUP_SIZE = 32
#: bits that the 29-bit form appends
EXTENDED_SHIFT = 18


class MessageObject(Enum):
    """The message objects of one inverter; the value is (added to 2·A)."""

    PROCESS_REQUEST = 0
    PROCESS_RESPONSE = 1
    PARAMETER_TASK = PARAMETER_BASE
    PARAMETER_RESPONSE = PARAMETER_BASE + 1


def identifier(kind: MessageObject, address: int, *, extended: bool = False) -> int:
    """
    Return the identifier of a message object of one inverter.

    :raises LocalProtocolError: the address is not 0 to 255.
    """
    _check_address(address)
    return _formed(2 * address + kind.value, extended)


def group_identifier(address: int, *, extended: bool = False) -> int:
    """Return the broadcast identifier of the 32 addresses that ``address`` belongs to."""
    _check_address(address)
    return _formed(BROADCAST_BASE + address // GROUP_SIZE, extended)


def all_identifier(*, extended: bool = False) -> int:
    """Return the broadcast identifier of all inverters."""
    return _formed(BROADCAST_ALL, extended)


def broadcasts(address: int, *, extended: bool = False) -> tuple[int, int]:
    """Return the broadcast identifiers that an inverter may listen to: of its group, of all."""
    return group_identifier(address, extended=extended), all_identifier(extended=extended)


def decode_identifier(value: int) -> tuple[MessageObject, int] | None:
    """Return what 11 bits mean, and the address of the inverter; None: it is none's own."""
    if value >= BROADCAST_BASE:
        return None
    address = value % PARAMETER_BASE // 2
    return MessageObject(value - 2 * address), address


def _formed(short: int, extended: bool) -> int:
    return short << EXTENDED_SHIFT if extended else short


def _check_address(address: int) -> None:
    if not 0 <= address <= ADDRESS_MAX:
        raise LocalProtocolError(f'address {address} is out of range: 0 to {ADDRESS_MAX}')


def broadcast_identifier(drive: DriveConfiguration) -> int | None:
    """Return the broadcast identifier that a drive listens to; None: it has none."""
    kind = drive.options.broadcast
    extended = drive.options.extended_identifiers
    if kind == 'all':
        return all_identifier(extended=extended)
    if kind == 'group':
        return group_identifier(drive.station, extended=extended)
    return None


def groups(drives: Sequence[DriveConfiguration]) -> list[list[DriveConfiguration]]:
    """Return the broadcast groups among the drives of a bus, the leader of each first."""
    found: dict[tuple[int, bool], list[DriveConfiguration]] = {}
    for drive in drives:
        shared = broadcast_identifier(drive)
        if shared is not None:
            key = shared, drive.options.extended_identifiers
            found.setdefault(key, []).append(drive)
    return [sorted(together, key=lambda drive: drive.station) for together in found.values()]
