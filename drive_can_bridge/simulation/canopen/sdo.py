# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
An SDO server (CiA 301): reads of any length, writes in one frame or, where wanted, by segments.

Block transfer is refused.
"""

from typing import Protocol

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.protocols.canopen.sdo import SdoCommand, SdoMessage
from drive_can_bridge.protocols.telegrams import Direction
from drive_can_bridge.simulation.registers import AccessRefused, Registers, WriteRefusal

TOO_HIGH, TOO_LOW = 0x06090031, 0x06090032

#: index and sub-index
Place = tuple[int, int]
#: bytes that a segmented write may have
WRITE_MAX = 1024
TYPE_TOO_LONG, TYPE_TOO_SHORT = 0x06070012, 0x06070013
#: abort codes of what registers refuse
CODES = {
    WriteRefusal.READ_ONLY: sdo.WRITE_OF_READ_ONLY,
    WriteRefusal.OUT_OF_RANGE: sdo.VALUE_OUT_OF_RANGE,
    WriteRefusal.FORBIDDEN: sdo.DEVICE_STATE,
}


def bytes_of(parameter: Parameter) -> int:
    """Return how many bytes an object has; a BOOLEAN is one."""
    return 1 if parameter.type is ParameterType.BOOL else parameter.type.bits // 8


class Absent:
    """
    Objects that were removed from a node.

    :ivar places: index and sub-index; None: all of the index.
    """

    def __init__(self) -> None:
        self.places: frozenset[tuple[int, int | None]] = frozenset()

    def __contains__(self, place: Place) -> bool:
        return place in self.places or (place[0], None) in self.places

    def check(self, index: int, subindex: int) -> None:
        """
        Check that an object exists.

        :raises AccessRefused: it was removed.
        """
        if (index, subindex) in self:
            raise AccessRefused(sdo.NO_SUCH_OBJECT)


class ObjectDictionary:
    """
    Registers with an index. Without an entry of its own, sub-index 0 is the number of them.

    :ivar cells: parameters by index and sub-index.
    """

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self.cells: dict[Place, Parameter] = {
            (each.index, each.subindex or 0): each
            for each in registers.parameters.values() if each.index is not None}
        self._counts = {index: subindex for index, subindex in sorted(self.cells)
                        if (index, 0) not in self.cells}

    def name_of(self, raw: Parameter) -> str | None:
        cell = self.cells.get((raw.index or 0, raw.subindex or 0))
        return None if cell is None else cell.name

    def read_object(self, index: int, subindex: int) -> bytes:
        if subindex == 0 and index in self._counts:
            return bytes((self._counts[index],))
        cell = self.find(index, subindex)
        if not cell.readable:
            raise AccessRefused(sdo.READ_OF_WRITE_ONLY)
        return self.content(cell)

    def content(self, cell: Parameter) -> bytes:
        """Return the content of an object, as on the wire."""
        word = cell.word_from_raw(self._registers.raw(cell.name))
        return word.to_bytes(cell.type.bits // 8, 'little')[:bytes_of(cell)]

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        if subindex == 0 and index in self._counts:
            raise AccessRefused(sdo.WRITE_OF_READ_ONLY)
        cell = self.find(index, subindex)
        raw = cell.raw_from_word(int.from_bytes(checked_length(data, bytes_of(cell)), 'little'))
        refusal = self._registers.refusal({cell.name: raw})
        if refusal is WriteRefusal.OUT_OF_RANGE:
            low, high = cell.raw_limits
            raise AccessRefused(TOO_HIGH if raw > high else TOO_LOW if raw < low else
                                sdo.VALUE_OUT_OF_RANGE)
        if refusal is not None:
            raise AccessRefused(CODES[refusal])
        self._registers.write(cell.name, raw)

    def raw(self, index: int, subindex: int = 0) -> int:
        """Return the raw integer of an existing object."""
        return self._registers.raw(self.cells[index, subindex].name)

    def find(self, index: int, subindex: int) -> Parameter:
        """
        Return an object.

        :raises AccessRefused: there is none.
        """
        cell = self.cells.get((index, subindex))
        if cell is None:
            raise AccessRefused(sdo.NO_SUCH_SUBINDEX if any(
                place[0] == index for place in self.cells) else sdo.NO_SUCH_OBJECT)
        return cell


class ServedObjects(Protocol):
    """An object dictionary. Access raises :class:`AccessRefused`, with SDO abort codes."""

    def read_object(self, index: int, subindex: int) -> bytes:
        """Return the content of an object."""

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object."""


class SdoServer:
    """
    Answers the requests of one client.

    :param segmented_writes: accepts them.
    """

    def __init__(self, objects: ServedObjects, *, segmented_writes: bool = False) -> None:
        self._objects = objects
        self._segmented_writes = segmented_writes
        self._place = 0, 0
        self._toggle = 0
        self.reset()

    def reset(self) -> None:
        """Forget the transfer under way."""
        self._rest = b''
        self._written: bytes | None = None      # so far
        self._announced = 0

    def answer(self, request: bytes) -> bytes | None:
        """Return the response to a request; None: there is none."""
        if len(request) != sdo.LENGTH:
            return None
        try:
            answer = self._serve(request)
        except AccessRefused as error:
            self.reset()
            answer = SdoMessage(SdoCommand.ABORT, self._place, number=error.code)
        return None if answer is None else sdo.encode(answer)

    def _serve(self, request: bytes) -> SdoMessage | None:
        try:
            kind, place, data, number, toggle, last = sdo.decode(Direction.REQUEST, request)
        except RemoteProtocolError:
            self._place = int.from_bytes(request[1:3], 'little'), request[3]
            raise AccessRefused(sdo.UNKNOWN_COMMAND) from None
        if place is None:
            under_way = (self._rest if kind is SdoCommand.SEGMENT_WANTED else
                         self._written is not None)
            if not under_way:
                raise AccessRefused(sdo.UNKNOWN_COMMAND)
            if toggle != self._toggle:
                raise AccessRefused(sdo.TOGGLE_NOT_ALTERNATED)
            self._toggle ^= sdo.TOGGLE
            return self._next_segment(toggle) if kind is SdoCommand.SEGMENT_WANTED else (
                self._take_segment(data, toggle, last))
        self.reset()
        if kind is SdoCommand.ABORT:
            return None
        self._place = place
        if kind is SdoCommand.UPLOAD:
            return self._upload(self._objects.read_object(*place))
        if kind is SdoCommand.DOWNLOAD:
            self._objects.write_object(*place, data)
        elif self._segmented_writes:
            self._written, self._toggle, self._announced = b'', 0, number
        else:
            raise AccessRefused(sdo.UNKNOWN_COMMAND)
        return SdoMessage(SdoCommand.DOWNLOADED, place)

    def _take_segment(self, data: bytes, toggle: int, last: bool) -> SdoMessage:
        data = self._written = (self._written or b'') + data
        if len(data) > (self._announced or WRITE_MAX):
            raise AccessRefused(TYPE_TOO_LONG)
        if last:
            if len(data) < self._announced:
                raise AccessRefused(TYPE_TOO_SHORT)
            self.reset()
            self._objects.write_object(*self._place, data)
        return SdoMessage(SdoCommand.SEGMENT_TAKEN, None, toggle=toggle)

    def _upload(self, data: bytes) -> SdoMessage:
        if len(data) <= sdo.EXPEDITED_MAX:
            return SdoMessage(SdoCommand.UPLOADED, self._place, data)
        self._rest, self._toggle = data, 0
        return SdoMessage(SdoCommand.UPLOAD_BEGUN, self._place, number=len(data))

    def _next_segment(self, toggle: int) -> SdoMessage:
        segment, self._rest = self._rest[:sdo.SEGMENT_MAX], self._rest[sdo.SEGMENT_MAX:]
        return SdoMessage(SdoCommand.SEGMENT, None, segment, toggle=toggle, last=not self._rest)


def checked_length(data: bytes, length: int) -> bytes:
    """
    Return the data if they have the length of their object.

    :raises AccessRefused: too long or too short.
    """
    if len(data) != length:
        raise AccessRefused(TYPE_TOO_LONG if len(data) > length else TYPE_TOO_SHORT)
    return data
