# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Reading objects of a CANopen node by SDO, as far as four bytes (CiA 301: expedited upload).

======== =================================================================
bytes    request (600h + node), response (580h + node)
======== =================================================================
0        40h; 43h, 47h, 4Bh, 4Fh: 4, 3, 2, 1 data bytes, 42h: not told;
         41h: more than fit; 80h: refused
1, 2     index, low byte first
3        sub-index
4 to 7   request: 00h; response: data, low byte first, or the abort code
======== =================================================================
"""

import struct
from typing import NamedTuple

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.canopen.network import check_node

REQUEST_BASE = 0x600
RESPONSE_BASE = 0x580
UPLOAD = 0x40
DEVICE_TYPE = 0x1000
IDENTITY = 0x1018
RPDO4 = 0x1403
RPDO4_MAPPING = 0x1603
_ABORT = 0x80
_SPECIFIER = 0xE0
_LAYOUT = struct.Struct('<BHBI')


class Uploaded(NamedTuple):
    """
    An answer to an upload.

    :param object: index and sub-index.
    :param value: None where the node refused, or where it takes more than one frame.
    """

    object: tuple[int, int]
    value: int | None


def encode_upload(node: int, index: int, subindex: int) -> Frame:
    """Encode the request to read an object."""
    check_node(node)
    return Frame(REQUEST_BASE + node, _LAYOUT.pack(UPLOAD, index, subindex, 0), False)


def decode_upload(data: bytes) -> Uploaded:
    """
    Decode the answer.

    :raises RemoteProtocolError: it is no answer to an upload.
    """
    if len(data) != _LAYOUT.size:
        raise RemoteProtocolError(f'SDO with {len(data)} data bytes instead of {_LAYOUT.size}')
    command, index, subindex, value = _LAYOUT.unpack(data)
    if command == _ABORT or command & (_SPECIFIER | 0x02) == UPLOAD:
        return Uploaded((index, subindex), None)
    if command & _SPECIFIER != UPLOAD:
        raise RemoteProtocolError(f'SDO command {command:02X}h is no answer to an upload')
    return Uploaded((index, subindex), value)
