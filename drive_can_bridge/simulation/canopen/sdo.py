# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
An SDO server (CiA 301): reads of any length, writes in one frame or, where wanted, by segments.

Block transfer is refused.
"""

from typing import Protocol

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.protocols.canopen import abort_codes, sdo
from drive_can_bridge.protocols.canopen.sdo import Kind, Message
from drive_can_bridge.protocols.telegrams import Direction
from drive_can_bridge.simulation.plant import Refusal
from drive_can_bridge.simulation.registers import Refused

#: bytes that a segmented write may have
WRITE_MAX = 1024
TYPE_TOO_LONG, TYPE_TOO_SHORT = 0x06070012, 0x06070013
#: abort codes of what registers refuse
CODES = {
    Refusal.READ_ONLY: abort_codes.WRITE_OF_READ_ONLY,
    Refusal.OUT_OF_RANGE: abort_codes.VALUE_OUT_OF_RANGE,
    Refusal.CROSSED: 0x06090036,
    Refusal.FORBIDDEN: abort_codes.DEVICE_STATE,
    Refusal.TOO_EARLY: abort_codes.DEVICE_STATE,
}


class Objects(Protocol):
    """An object dictionary. Reading and writing raise :class:`Refused`, with SDO abort codes."""

    def read_object(self, index: int, subindex: int) -> bytes:
        """Return the content of an object."""

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object."""


class SdoServer:
    """
    Answers the requests of one client.

    :param segmented_writes: takes them.
    """

    def __init__(self, objects: Objects, *, segmented_writes: bool = False) -> None:
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
        except Refused as error:
            self.reset()
            answer = Message(Kind.ABORT, self._place, number=error.code)
        return None if answer is None else sdo.encode(answer)

    def _serve(self, request: bytes) -> Message | None:
        try:
            kind, place, data, number, toggle, last = sdo.decode(Direction.REQUEST, request)
        except RemoteProtocolError:
            self._place = int.from_bytes(request[1:3], 'little'), request[3]
            raise Refused(abort_codes.UNKNOWN_COMMAND) from None
        if place is None:
            under_way = self._rest if kind is Kind.SEGMENT_WANTED else self._written is not None
            if not under_way:
                raise Refused(abort_codes.UNKNOWN_COMMAND)
            if toggle != self._toggle:
                raise Refused(abort_codes.TOGGLE_NOT_ALTERNATED)
            self._toggle ^= sdo.TOGGLE
            return self._next_segment(toggle) if kind is Kind.SEGMENT_WANTED else (
                self._take_segment(data, toggle, last))
        self.reset()
        if kind is Kind.ABORT:
            return None
        self._place = place
        if kind is Kind.UPLOAD:
            return self._upload(self._objects.read_object(*place))
        if kind is Kind.DOWNLOAD:
            self._objects.write_object(*place, data)
        elif self._segmented_writes:
            self._written, self._toggle, self._announced = b'', 0, number
        else:
            raise Refused(abort_codes.UNKNOWN_COMMAND)
        return Message(Kind.DOWNLOADED, place)

    def _take_segment(self, data: bytes, toggle: int, last: bool) -> Message:
        data = self._written = (self._written or b'') + data
        if len(data) > (self._announced or WRITE_MAX):
            raise Refused(TYPE_TOO_LONG)
        if last:
            if len(data) < self._announced:
                raise Refused(TYPE_TOO_SHORT)
            self.reset()
            self._objects.write_object(*self._place, data)
        return Message(Kind.SEGMENT_TAKEN, None, toggle=toggle)

    def _upload(self, data: bytes) -> Message:
        if len(data) <= sdo.EXPEDITED_MAX:
            return Message(Kind.UPLOADED, self._place, data)
        self._rest, self._toggle = data, 0
        return Message(Kind.UPLOAD_BEGUN, self._place, number=len(data))

    def _next_segment(self, toggle: int) -> Message:
        segment, self._rest = self._rest[:sdo.SEGMENT_MAX], self._rest[sdo.SEGMENT_MAX:]
        return Message(Kind.SEGMENT, None, segment, toggle=toggle, last=not self._rest)


def checked_length(data: bytes, length: int) -> bytes:
    """
    Return the data if they have the length of their object.

    :raises Refused: too long or too short.
    """
    if len(data) != length:
        raise Refused(TYPE_TOO_LONG if len(data) > length else TYPE_TOO_SHORT)
    return data
