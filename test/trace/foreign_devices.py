# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Devices that obey: what each family takes for a command, written from the protocol notes alone.

Independent of the package's codecs and of its simulation. Each device keeps the frames that would
have moved or changed it, whoever sent them and whatever they were meant to be.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from drive_can_bridge.core.frame import Frame


@dataclass
class Device:
    """
    One device on the bus.

    :param obeys: a frame is a command to it.
    :param answers: what it says to a frame, reads included.
    """

    name: str
    obeys: Callable[[Frame], bool]
    answers: Callable[[Frame], Frame | None]
    obeyed: list[Frame] = field(default_factory=list)

    def hear(self, frame: Frame) -> Frame | None:
        """Take a frame."""
        if self.obeys(frame):
            self.obeyed.append(frame)
        return self.answers(frame)


def datamodel_extended(station: int) -> Device:
    """Make a drive that takes cyclic requests and writes: W set, DIR not, its station."""
    def mine(frame: Frame) -> bool:
        return frame.extended and frame.identifier >> 21 == station     # DIR is bit 28: 0

    def answers(frame: Frame) -> Frame | None:
        if not mine(frame) or frame.identifier & 0x00100000 or not 1 <= frame.identifier & 15 <= 4:
            return None
        maps = {122: '0032003300000000', 126: '00D100D200000000'}
        data = maps.get(frame.identifier >> 4 & 0xFFFF, '0001000200030004')
        return Frame(frame.identifier | 0x10000000, bytes.fromhex(data), True)

    return Device(f'datamodel_extended {station}',
                  lambda frame: mine(frame) and bool(frame.identifier & 0x00100000), answers)


def datamodel_standard(station: int) -> Device:
    """Make a drive that takes function 6 on 3F0h + station, eight bytes."""
    def mine(frame: Frame) -> bool:
        return (not frame.extended and frame.identifier == 0x3F0 + station
                and len(frame.data) == 8)

    def answers(frame: Frame) -> Frame | None:
        if mine(frame) and frame.data[0] == 3 and 1 <= frame.data[3] <= 4:
            return Frame(0x7F0 + station, bytes(8), False)
        return None

    return Device(f'datamodel_standard {station}',
                  lambda frame: mine(frame) and frame.data[0] == 6, answers)


def cannord(address: int, *, extended: bool = False) -> Device:
    """Make an inverter that takes process data, broadcasts, and the tasks that write."""
    def short(frame: Frame) -> int | None:
        if frame.extended is not extended:
            return None
        if not extended:
            return frame.identifier
        return None if frame.identifier & 0x3FFFF else frame.identifier >> 18

    def obeys(frame: Frame) -> bool:
        identifier = short(frame)
        if identifier == 512 + 2 * address and len(frame.data) == 8:
            return frame.data[1] >> 4 in (2, 3, 7, 8, 11, 12, 13, 14)
        return len(frame.data) in (4, 5, 8) and identifier in (
            2 * address, 1024 + address // 32, 1032)

    def answers(frame: Frame) -> Frame | None:
        if short(frame) != 512 + 2 * address or len(frame.data) != 8:
            return None
        task, number = frame.data[1] >> 4, frame.data[0] | (frame.data[1] & 7) << 8
        reply = 1 if task == 1 else 7
        data = bytes((number & 0xFF, number >> 8 | reply << 4, 0, 0, 0, 0, 0, 0))
        return Frame(frame.identifier + (1 << 18 if extended else 1), data, extended)

    return Device(f'cannord {address}', obeys, answers)


def canopen(node: int, *, operational: bool = True, sdo: bool = True) -> Device:
    """Make a node that takes NMT commands, SYNC, four receive PDOs, and SDO downloads."""
    def obeys(frame: Frame) -> bool:
        if frame.extended:
            return False
        if frame.identifier == 0x000:
            return True
        if frame.identifier == 0x600 + node and frame.data:
            return frame.data[0] >> 5 in (0, 1)
        return operational and frame.identifier in (
            0x080, *(base + node for base in (0x200, 0x300, 0x400, 0x500)))

    def answers(frame: Frame) -> Frame | None:
        if not sdo or frame.extended or frame.identifier != 0x600 + node or len(frame.data) != 8:
            return None
        if frame.data[0] >> 5 != 2:
            return None
        content = {b'\x00\x10\x00': '43', b'\x18\x10\x01': '43'}.get(frame.data[1:4])
        if content is None:     # no such object
            return Frame(0x580 + node, b'\x80' + frame.data[1:4] + bytes.fromhex('00000206'),
                         False)
        return Frame(0x580 + node, b'\x43' + frame.data[1:4] + bytes(4), False)

    return Device(f'canopen {node}', obeys, answers)


#: one of each that there may be on a bus with 11-bit identifiers of inverters
CROWD = (
    *(datamodel_extended(station) for station in range(128)),
    *(datamodel_standard(station) for station in range(16)),
    *(cannord(address) for address in range(256)),
    *(canopen(node) for node in range(1, 128)),
)
