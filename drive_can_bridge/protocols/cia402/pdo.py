# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
PDOs of a drive: which parameters travel in which, how they are described to it, and their bytes.

An entry of a mapping (1600h, 1A00h + number - 1) is index << 16 | sub-index << 8 | bits; the
objects follow each other in the PDO, the first in the lowest byte, low byte first. The COB-ID
(1400h, 1800h + number - 1, sub-index 1) has 11 bits of identifier; bit 31 says that the PDO does
not exist, bit 30 that it takes no remote frames, bit 29 that the identifier has 29 bits.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
import struct

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.cia402.states import CONTROL_PARAMETER, STATUS_PARAMETER

PDO_MAX, LENGTH_MAX, ENTRIES_MAX = 4, 8, 8
#: identifier of RPDO and TPDO 1, plus the node; the next ones 100h further each
RPDO_BASE, TPDO_BASE, PDO_STEP = 0x200, 0x180, 0x100
#: of PDO 1: its communication parameters, and its mapping
RPDO_COMMUNICATION, TPDO_COMMUNICATION, MAPPING_OFFSET = 0x1400, 0x1800, 0x200
COB_ID, TRANSMISSION, INHIBIT_TIME, EVENT_TIMER = 1, 2, 3, 5
INVALID, NO_REMOTE, LONG_IDENTIFIER = 1 << 31, 1 << 30, 1 << 29
SYNCHRONOUS, EVENT_PROFILE, EVENT_MAKER = 1, 255, 254
#: of the length in an entry, as some drives read it back: what it maps is signed
SIGNED_LENGTH = 0x80
#: what says how a drive exchanges: identifiers and mapping of PDOs, SYNC, heartbeats,
#: interpolation time
_MAPS = frozenset((*range(0x1400, 0x1C00), 0x1005, 0x1006, 0x1016, 0x1017, 0x60C2))
#: bytes of a number -> its code for struct, without and with sign
_CODES = {1: 'Bb', 2: 'Hh', 4: 'Ii'}


def width(parameter: Parameter) -> int:
    """Return how many bytes a parameter takes in the drive; a BOOLEAN is one."""
    return 1 if parameter.type is ParameterType.BOOL else parameter.type.bits // 8


def is_map(index: int) -> bool:
    """Return whether an object is a mapping parameter."""
    return index in _MAPS


def mapping_entry(index: int, subindex: int, length: int) -> int:
    """
    Encode an entry of a mapping.

    :param length: in bytes.

    >>> f'{mapping_entry(0x6064, 0, 4):08X}'
    '60640020'
    """
    return index << 16 | subindex << 8 | 8 * length


def entry_text(entry: int) -> str:
    """
    Write an entry of a mapping for people.

    >>> entry_text(0x60640020)
    '6064h.00h 32 bits'
    """
    return f'{entry >> 16:04X}h.{entry >> 8 & 0xFF:02X}h {entry & 0xFF} bits'


def same_mapping(found: Sequence[int], wanted: Sequence[int]) -> bool:
    """
    Return whether entries that were read mean those that are wanted.

    Some drives set bit 7 of the length of what is signed, and some have a fixed number of entries,
    with empty ones behind those in use.

    >>> same_mapping([0x604000A0, 0, 0], [0x60400020])
    True
    """
    used = list(found)
    while len(used) > len(wanted) and not used[-1]:
        used.pop()
    return [entry & ~SIGNED_LENGTH for entry in used] == list(wanted)


def distribute(lengths: Sequence[int]) -> list[list[int]]:
    """
    Fill PDOs in order, without tearing an entry.

    :param lengths: bytes of each entry.
    :return: for each PDO the places of its entries.
    """
    pdos: list[list[int]] = []
    room = 0
    for place, length in enumerate(lengths):
        if length > room:
            pdos.append([])
            room = LENGTH_MAX
        pdos[-1].append(place)
        room -= length
    return pdos


@dataclass(frozen=True)
class Pdo:
    """
    One PDO as it shall be.

    :param number: 1 to 4.
    :param identifier: on the bus.
    :param communication: index of its communication parameters; its mapping is 200h further.
    :param parameters: in it, in order.
    """

    number: int
    identifier: int
    communication: int
    parameters: tuple[Parameter, ...]

    @cached_property
    def _layout(self) -> struct.Struct:
        return struct.Struct('<' + ''.join(
            _CODES[width(each)][each.type.signed] for each in self.parameters))

    @property
    def length(self) -> int:
        """How many bytes it has."""
        return self._layout.size

    @property
    def entries(self) -> tuple[int, ...]:
        """Its mapping."""
        return tuple(mapping_entry(each.index or 0, each.subindex or 0, width(each))
                     for each in self.parameters)

    def pack(self, raws: Sequence[int]) -> bytes:
        """Return the bytes of raw integers."""
        return self._layout.pack(*raws)

    def unpack(self, data: bytes) -> tuple[int, ...]:
        """
        Return the raw integers in it.

        :raises RemoteProtocolError: it is shorter than its mapping; longer is no harm.
        """
        try:
            return self._layout.unpack_from(data)
        except struct.error:
            raise RemoteProtocolError(frame_sentences.telegram_length(
                f'PDO {self.number}', len(data), self.length)) from None

    def part(self, data: bytes) -> tuple[int, ...]:
        """Return the raw integers that are there of one that is too short."""
        lengths = [width(each) for each in self.parameters]
        whole = sum(sum(lengths[:count + 1]) <= len(data) for count in range(len(lengths)))
        return self._layout.unpack(data.ljust(self.length, b'\0'))[:whole]


def request_pdos(drive: DriveConfiguration) -> list[Pdo]:
    """Return the RPDOs of a drive: the control word, then its setpoints."""
    return receive_pdos(drive.station, drive.options.request_pdos,
                        (CONTROL_PARAMETER, *drive.cyclic_request))


def response_pdos(drive: DriveConfiguration) -> list[Pdo]:
    """Return the TPDOs of a drive: the status word, then its actual values."""
    return transmit_pdos(drive.station, drive.options.response_pdos,
                         (STATUS_PARAMETER, *drive.cyclic_response))


def receive_pdos(node: int, numbers: Sequence[int],
                 parameters: Sequence[Parameter]) -> list[Pdo]:
    """
    Return the RPDOs that carry parameters to a drive.

    :param numbers: of the PDOs to be filled, in order; none: as many as needed, from 1. Of too
        few of them, the last parameters are left out.
    """
    return _pdos(numbers, parameters, RPDO_BASE + node, RPDO_COMMUNICATION)


def transmit_pdos(node: int, numbers: Sequence[int],
                  parameters: Sequence[Parameter]) -> list[Pdo]:
    """Return the TPDOs that carry parameters from a drive; see :func:`receive_pdos`."""
    return _pdos(numbers, parameters, TPDO_BASE + node, TPDO_COMMUNICATION)


def _pdos(numbers: Sequence[int], parameters: Sequence[Parameter], base: int,
          communication: int) -> list[Pdo]:
    places = distribute([width(each) for each in parameters])
    return [Pdo(number, base + PDO_STEP * (number - 1), communication + number - 1,
                tuple(parameters[place] for place in inside))
            for number, inside in zip(numbers or range(1, PDO_MAX + 1), places)]
