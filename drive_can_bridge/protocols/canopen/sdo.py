# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Objects of a CANopen node by SDO (CiA 301): reads of any length, writes of up to four bytes.

======== =========================================================================================
bytes    request (600h + node), response (580h + node)
======== =========================================================================================
0        upload 40h → 43h, 47h, 4Bh, 4Fh: 4, 3, 2, 1 data bytes, 42h: not told how many; 41h, 40h:
         more than fit, segments follow. Segment 60h, 70h (bit 4: toggle) → bit 4 likewise, bits 3
         to 1: unused bytes, bit 0: the last one. Download 23h, 27h, 2Bh, 2Fh → 60h. 80h: refused,
         or given up by the client
1, 2     index, low byte first; of a segment: data from here on
3        sub-index
4 to 7   data, low byte first; 41h: how many bytes follow; 80h: the abort code
======== =========================================================================================
"""

from enum import Enum
import struct
from typing import NamedTuple

from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.canopen.network import check_node

REQUEST_BASE = 0x600
RESPONSE_BASE = 0x580
LENGTH = 8
EXPEDITED_MAX = 4
UPLOAD = 0x40
DEVICE_TYPE = 0x1000
IDENTITY = 0x1018
RPDO4 = 0x1403
RPDO4_MAPPING = 0x1603
_ABORT = 0x80
_SPECIFIER = 0xE0
_SEGMENT, _DOWNLOAD, _DOWNLOADED = 0x60, 0x20, 0x60
_EXPEDITED, _SIZED, _TOGGLE, _LAST = 0x02, 0x01, 0x10, 0x01
_LAYOUT = struct.Struct('<BHBI')


class Kind(Enum):
    """What a server says."""

    DATA = 'data'
    LONG = 'segments follow'
    SEGMENT = 'segment'
    WRITTEN = 'written'
    ABORT = 'refused'


class Answer(NamedTuple):
    """
    A response of the server.

    :param object: index and sub-index; None: a segment does not say.
    :param data: what was read, as far as it is in this frame.
    :param number: of a refusal: the abort code; of ``LONG``: how many bytes follow, 0: not told.
    :param toggle: of a segment: its toggle bit, 0 or 10h.
    :param last: no segment follows; for ``DATA``: the length was told.
    """

    kind: Kind
    object: tuple[int, int] | None
    data: bytes = b''
    number: int = 0
    toggle: int = 0
    last: bool = True


class Uploaded(NamedTuple):
    """
    An answer to an upload that has to fit one frame.

    :param object: index and sub-index.
    :param value: None where the node refused, or where it takes more than one frame.
    """

    object: tuple[int, int]
    value: int | None


def encode_upload(node: int, index: int, subindex: int) -> Frame:
    """Encode the request to read an object."""
    return _request(node, UPLOAD, index, subindex)


def encode_segment(node: int, toggle: int) -> Frame:
    """
    Encode the request for the next segment.

    :param toggle: 0 for the first one, then 10h and 0 in turns.
    """
    check_node(node)
    return Frame(REQUEST_BASE + node, bytes((_SEGMENT | toggle,)).ljust(LENGTH, b'\0'), False)


def encode_download(node: int, index: int, subindex: int, data: bytes) -> Frame:
    """
    Encode the request to write an object.

    :raises LocalProtocolError: not 1 to 4 bytes.
    """
    if not 1 <= len(data) <= EXPEDITED_MAX:
        raise LocalProtocolError(f'{len(data)} bytes cannot be written: 1 to {EXPEDITED_MAX}')
    head = _DOWNLOAD | EXPEDITED_MAX - len(data) << 2 | _EXPEDITED | _SIZED
    return _request(node, head, index, subindex, int.from_bytes(data, 'little'))


def encode_abort(node: int, index: int, subindex: int, code: int) -> Frame:
    """Encode the end of a transfer that the client gives up."""
    return _request(node, _ABORT, index, subindex, code)


def _request(node: int, head: int, index: int, subindex: int, value: int = 0) -> Frame:
    check_node(node)
    return Frame(REQUEST_BASE + node, _LAYOUT.pack(head, index, subindex, value), False)


def decode_answer(data: bytes, *, segments: bool = False) -> Answer:
    """
    Decode a response.

    :param segments: one is expected: a head of a segment is no other then.
    :raises RemoteProtocolError: it is none, or malformed.
    """
    if len(data) != LENGTH:
        raise RemoteProtocolError(f'SDO with {len(data)} data bytes instead of {LENGTH}')
    head, index, subindex, value = _LAYOUT.unpack(data)
    place = index, subindex
    if head == _ABORT:
        return Answer(Kind.ABORT, place, number=value)
    specifier = head & _SPECIFIER
    if specifier == 0 and segments:
        return Answer(Kind.SEGMENT, None, data[1:LENGTH - (head >> 1 & 0x07)],
                      toggle=head & _TOGGLE, last=bool(head & _LAST))
    if specifier == UPLOAD and head & _EXPEDITED:
        sized = bool(head & _SIZED)
        unused = head >> 2 & 0x03 if sized else 0
        return Answer(Kind.DATA, place, data[4:LENGTH - unused], last=sized)
    if specifier == UPLOAD:
        return Answer(Kind.LONG, place, number=value if head & _SIZED else 0, last=False)
    if specifier == _DOWNLOADED:
        return Answer(Kind.WRITTEN, place)
    raise RemoteProtocolError(f'SDO command {head:02X}h is no answer that was asked for')


def decode_upload(data: bytes) -> Uploaded:
    """
    Decode the answer to an upload that has to fit one frame.

    :raises RemoteProtocolError: it is no answer to an upload.
    """
    answer = decode_answer(data)
    if answer.object is None or answer.kind is Kind.WRITTEN:
        raise RemoteProtocolError(f'SDO command {data[0]:02X}h is no answer to an upload')
    return Uploaded(answer.object, int.from_bytes(answer.data, 'little')
                    if answer.kind is Kind.DATA else None)


class Requested(NamedTuple):
    """
    A request of a client, for who looks on.

    :param object: index and sub-index; None: a segment of the transfer before.
    :param data: what is written; None: it reads.
    :param abort: the code of a transfer given up; None: it is none.
    """

    object: tuple[int, int] | None
    data: bytes | None = None
    abort: int | None = None


def decode_request(data: bytes) -> Requested:
    """
    Decode a request: uploads, downloads in one frame, segments, aborts.

    :raises RemoteProtocolError: it is none of them.
    """
    if len(data) != LENGTH:
        raise RemoteProtocolError(f'SDO with {len(data)} data bytes instead of {LENGTH}')
    head, index, subindex, value = _LAYOUT.unpack(data)
    place, specifier = (index, subindex), head & _SPECIFIER
    if head == _ABORT:
        return Requested(place, abort=value)
    if specifier == UPLOAD:
        return Requested(place)
    if specifier == _DOWNLOAD:
        unused = head >> 2 & 0x03 if head & _SIZED else 0
        return Requested(place, data[4:LENGTH - unused] if head & _EXPEDITED else b'')
    if specifier in (_SEGMENT, 0):
        return Requested(None)
    raise RemoteProtocolError(f'SDO command {head:02X}h is no request that is known here')
