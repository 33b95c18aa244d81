# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The CAN data frame, as the protocols see it; a record of a trace, which may be any frame."""

from enum import Enum
from typing import NamedTuple, Union

STANDARD_IDENTIFIER_MAX = 0x7FF
EXTENDED_IDENTIFIER_MAX = 0x1FFFFFFF
#: worst case over no stuff bits: an average frame lies between, this much above the shortest
STUFFING = 1.11


class Frame(NamedTuple):
    """
    A classical CAN data frame with 0 to 8 bytes.

    A named tuple, because one is made for every frame on the bus and tuples are the cheapest
    immutable record that Python has. Remote, error and CAN FD frames never become a ``Frame``:
    the transport sorts them out.

    :param identifier: 11-bit identifier, or 29-bit when ``extended``.
    :param data: payload, BYTE0 first.
    :param extended: the frame format. 29-bit 000003F1h is *not* 11-bit 3F1h.
    """

    identifier: int
    data: bytes
    extended: bool

    def __str__(self) -> str:
        """Write the frame the way candump does: ``003FFFF0#05DC000000000000``."""
        width = 8 if self.extended else 3
        return f'{self.identifier:0{width}X}#{self.data.hex().upper()}'


class Route(NamedTuple):
    """
    A set of identifiers: those whose masked bits equal ``identifier``'s, in one frame format.

    Serves as acceptance filter of the bus and as routing entry to the session of a drive.
    """

    identifier: int
    mask: int
    extended: bool

    @classmethod
    def of(cls, identifier: int, *, extended: bool = False) -> 'Route':
        """Return the route of one identifier."""
        return cls(identifier, EXTENDED_IDENTIFIER_MAX if extended else STANDARD_IDENTIFIER_MAX,
                   extended)

    def matches(self, frame: Frame) -> bool:
        """Return whether this route takes the frame."""
        return (frame.extended == self.extended
                and frame.identifier & self.mask == self.identifier & self.mask)


def bits_on_bus(length: int, extended: bool) -> int:
    """Return a frame's length on the bus without stuff bits, interframe space included."""
    return (67 if extended else 47) + 8 * length


def bits_of_exchange(*, extended: bool) -> float:
    """Return what a request and its answer of eight bytes each take of the bus, in bits."""
    return 2 * STUFFING * bits_on_bus(8, extended)


def worst_bits(length: int, *, extended: bool) -> int:
    """Return the longest that a frame can get by bit stuffing, interframe space included."""
    stuffed = (54 if extended else 34) + 8 * length
    return bits_on_bus(length, extended) + (stuffed - 1) // 4


class RecordKind(Enum):
    """
    The kinds of records.

    A frame that an error has destroyed, and a state in words, are in traces of other makers only.
    """

    DATA = 'data'
    REMOTE = 'remote'
    ERROR = 'error'
    FD = 'fd'
    DESTROYED = 'destroyed'
    STATE = 'state'


class Record(NamedTuple):
    """
    One entry of a trace.

    Unlike a ``Frame`` it may be anything that adapters report: no protocol here has remote or CAN
    FD frames, but they help to find the reason of a failure.

    :param time: s, since 1970 or since the start of the trace.
    :param channel: what the trace calls the bus: a name, a number, or '' where it has none.
    :param identifier: of an error frame: the classes of errors, as in linux/can/error.h; of a
        state: 0 where all is well.
    :param data: of a state: its words.
    :param sent: by the machine that recorded it; None: the trace does not say.
    """

    time: float
    channel: Union[str, int]
    identifier: int
    data: bytes
    extended: bool
    kind: RecordKind = RecordKind.DATA
    sent: bool | None = None


DATA = RecordKind.DATA


def state_record(time: float, channel: str | int, words: str, *, well: bool = False) -> Record:
    """Return an entry with a state of the bus, or of a controller, in words."""
    return Record(time, channel, 0 if well else 1, words.encode(), False, RecordKind.STATE)
