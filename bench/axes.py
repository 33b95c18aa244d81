# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Servo axes of CiA 402 for the benches: as ``drives.py``, by SDO, NMT and PDOs at SYNC.

Their mapping is fixed: RPDO 1 is control word and target position, TPDO 1 status word, actual
position and actual torque.
"""

from collections.abc import Sequence
import struct

from drives import CAN_FRAME, Drives, main

SYNC = 0x080
RPDO, TPDO, SDO_REQUEST, SDO_RESPONSE = 0x200, 0x180, 0x600, 0x580
UPLOAD, UPLOADED, DOWNLOADED = 0x40, 0x43, 0x60
#: status word by control word
STATES = {0x06: 0x0231, 0x07: 0x0233, 0x0F: 0x1237}
#: of an axis that has just got power
READY = 0x0250
#: 6041h, 6061h in csp, and 6502h with all modes
OBJECTS = {0x6041: READY, 0x6061: 8, 0x6502: 0x3FF}


class Axes(Drives):
    """All axes of the bus."""

    def __init__(self, wire: float = 0.0) -> None:
        super().__init__(wire)
        self._told: dict[int, tuple[int, int]] = {}
        self._round: list[int] = []

    def answers(self, frame: bytes) -> Sequence[bytes]:
        """Return what the axes answer to a frame."""
        identifier, _, data = CAN_FRAME.unpack(frame)
        kind, station = identifier & 0x780, identifier & 0x7F
        if identifier == SYNC:
            axes, self._round = self._round, []
            return [self._pdo(axis) for axis in axes]
        if kind == RPDO:
            self._told[station] = struct.unpack_from('<Hi', data)
            self._round.append(station)
            now = self.asked(station)
            if self._told[station][0] & 0xF == 0xF:
                self._enabled.add(station)
            elif station in self._enabled:
                self._enabled.discard(station)
                self._stops.append(now)
        elif kind == SDO_REQUEST:
            command, index, subindex = struct.unpack_from('<BHB', data)
            value = OBJECTS.get(index, 0) if command == UPLOAD else 0
            return (CAN_FRAME.pack(SDO_RESPONSE + station, 8, struct.pack(
                '<BHBI', UPLOADED if command == UPLOAD else DOWNLOADED, index, subindex, value)),)
        return ()

    def _pdo(self, station: int) -> bytes:
        word, position = self._told[station]
        return CAN_FRAME.pack(TPDO + station, 8, struct.pack(
            '<Hih', STATES.get(word & 0xFF, READY), position, 1))


if __name__ == '__main__':
    main(Axes)
