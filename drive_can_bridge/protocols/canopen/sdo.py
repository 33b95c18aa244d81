# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Objects of a CANopen node by SDO (CiA 301): reads of any length, writes of up to four bytes.

The codes with which a node refuses one stand here, too.

The commands are the rows of :class:`SdoCommand`; requests go to 600h + node, responses to
580h + node.
Numbers are sent low byte first. Of the head, byte 0, the bits that a row leaves open say:

====================== =====================================================================
row                    bits
====================== =====================================================================
with index and data    1: data in this frame; 0: their length is told, bits 3 and 2: unused bytes
with index and number  0: the number of bytes to come is told; of an abort: none
segments               4: toggle; bits 3 to 1: unused bytes, bit 0: the last one
====================== =====================================================================
"""

from enum import Enum
from typing import NamedTuple

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.requests import ABSENT_CODES
from drive_can_bridge.protocols.canopen.network import check_node
from drive_can_bridge.protocols.telegrams import Direction, TelegramType

TOGGLE_NOT_ALTERNATED = 0x05030000
UNKNOWN_COMMAND = 0x05040001
READ_OF_WRITE_ONLY = 0x06010001
WRITE_OF_READ_ONLY = 0x06010002
NO_SUCH_OBJECT = 0x06020000
NO_SUCH_SUBINDEX = 0x06090011
#: the refusals that say that there is nothing to be read
ABSENT = ABSENT_CODES
VALUE_OUT_OF_RANGE = 0x06090030
DEVICE_STATE = 0x08000022

TEXTS = {
    0x05030000: 'toggle bit not alternated',
    0x05040000: 'SDO protocol timed out',
    0x05040001: 'unknown command or function code',
    0x05040002: 'invalid block size',
    0x05040003: 'invalid sequence number',
    0x05040004: 'CRC error',
    0x05040005: 'out of memory',
    0x06010000: 'access not supported',
    0x06010001: 'read of a write-only object',
    0x06010002: 'write to a read-only object',
    0x06020000: 'no such register or object',
    0x06040041: 'object cannot be mapped to a PDO',
    0x06040042: 'mapping exceeds the length of the PDO',
    0x06040043: 'parameters are incompatible',
    0x06040047: 'internal incompatibility in the device',
    0x06060000: 'hardware error',
    0x06070010: 'data type or length does not match',
    0x06070012: 'data type does not match, too long',
    0x06070013: 'data type does not match, too short',
    0x06090011: 'no such sub-index',
    0x06090030: 'value out of range',
    0x06090031: 'value too high',
    0x06090032: 'value too low',
    0x06090036: 'maximum is less than minimum',
    0x060A0023: 'resource not available',
    0x08000000: 'general error',
    0x08000020: 'data cannot be transferred or stored',
    0x08000021: 'data cannot be stored because of local control',
    0x08000022: 'data cannot be stored in the present state of the device',
    0x08000023: 'no object dictionary',
    0x08000024: 'no data available',
}


def describe(code: int) -> str:
    """
    Return code and meaning for a user.

    >>> describe(0x06090030)
    '06090030h (value out of range)'
    """
    return f'{code:08X}h ({TEXTS.get(code, "unknown code")})'


REQUEST_BASE = 0x600
RESPONSE_BASE = 0x580
LENGTH = 8
#: data bytes of an answer that names its object, where the device leaves away what is not used
SHORTEST = 4
EXPEDITED_MAX = 4
SEGMENT_MAX = 7
DEVICE_TYPE = 0x1000
IDENTITY = 0x1018
RPDO4 = 0x1403
RPDO4_MAPPING = 0x1603
TOGGLE = 0x10
_SIZED, _LAST = 0x01, 0x01
_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE


class SdoCommand(Enum):
    """Requests of a client and responses of a server; an abort may answer everything."""

    UPLOAD = TelegramType(_REQUEST, 0x40, 0xE0, '<BHB4x', 'head index subindex',
                          'UPLOADED UPLOAD_BEGUN')
    UPLOADED = TelegramType(_RESPONSE, 0x42, 0xE2, '<BHB4s', 'head index subindex data')
    UPLOAD_BEGUN = TelegramType(_RESPONSE, 0x40, 0xE2, '<BHBI', 'head index subindex number')
    SEGMENT_WANTED = TelegramType(_REQUEST, 0x60, 0xE0, '<B7x', 'head', 'SEGMENT')
    SEGMENT = TelegramType(_RESPONSE, 0x00, 0xE0, '<B7s', 'head data')
    DOWNLOAD = TelegramType(_REQUEST, 0x22, 0xE2, '<BHB4s', 'head index subindex data',
                            'DOWNLOADED')
    DOWNLOADED = TelegramType(_RESPONSE, 0x60, 0xE0, '<BHB4x', 'head index subindex')
    DOWNLOAD_BEGUN = TelegramType(_REQUEST, 0x20, 0xE2, '<BHBI', 'head index subindex number',
                                  'DOWNLOADED')
    SEGMENT_SENT = TelegramType(_REQUEST, 0x00, 0xE0, '<B7s', 'head data', 'SEGMENT_TAKEN')
    SEGMENT_TAKEN = TelegramType(_RESPONSE, 0x20, 0xE0, '<B7x', 'head')
    ABORT = TelegramType(Direction.NEITHER, 0x80, 0xFF, '<BHBI', 'head index subindex number')

    def answers(self, request: 'SdoCommand') -> bool:
        """Return whether this says that a request of the same object was carried out."""
        return self.name in request.value.answers.split()


class SdoMessage(NamedTuple):
    """
    A request or a response.

    :param object: index and sub-index; None: a segment does not say.
    :param data: what is read or written, as far as it is in this frame.
    :param number: of an abort: its code; of a transfer that begins: how many bytes follow, 0: not
        told.
    :param toggle: of a segment: its toggle bit, 0 or 10h.
    :param last: no segment follows; with object and data: their length is told.
    """

    kind: SdoCommand
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
    :param absent: it says that it has no such object.
    """

    object: tuple[int, int]
    value: int | None
    absent: bool = False


def encode(message: SdoMessage) -> bytes:
    """Encode a request or a response, with the length of its data."""
    kind, place, data, number, toggle, last = message
    row = kind.value
    head = row.code | toggle
    if place is None:
        head |= (SEGMENT_MAX - len(data) << 1 | _LAST * last) * ('data' in row.names)
    elif 'data' in row.names:
        head |= EXPEDITED_MAX - len(data) << 2 | _SIZED
    elif number and kind is not SdoCommand.ABORT:
        head |= _SIZED
    index, subindex = place or (0, 0)
    return row.pack({'head': head, 'index': index, 'subindex': subindex, 'data': data,
                     'number': number})


def request(node: int, message: SdoMessage) -> Frame:
    """Encode a request to a node."""
    check_node(node)
    return Frame(REQUEST_BASE + node, encode(message), False)


def encode_upload(node: int, index: int, subindex: int) -> Frame:
    """Encode the request to read an object."""
    return request(node, SdoMessage(SdoCommand.UPLOAD, (index, subindex)))


def encode_download(node: int, index: int, subindex: int, data: bytes) -> Frame:
    """
    Encode the request to write an object.

    :raises LocalProtocolError: not 1 to 4 bytes.
    """
    if not 1 <= len(data) <= EXPEDITED_MAX:
        raise LocalProtocolError(f'{len(data)} bytes cannot be written: 1 to {EXPEDITED_MAX}')
    return request(node, SdoMessage(SdoCommand.DOWNLOAD, (index, subindex), data))


def decode(direction: Direction, data: bytes, *, segments: bool = True) -> SdoMessage:
    """
    Decode a request or a response.

    :param segments: they are expected: else no head is that of one.
    :raises RemoteProtocolError: it is none, or malformed. A response may be shorter than eight
        bytes where it holds what its head promises: some devices leave the rest away.
    """
    head = data[0] if data else 0
    kind = next((kind for kind in SdoCommand if head & kind.value.mask == kind.value.code
                 and kind.value.is_sent_by(direction)
                 and (segments or 'index' in kind.value.names)), None)
    least = LENGTH if kind is None or direction is _REQUEST else _promised(kind, head)
    if not least <= len(data) <= LENGTH:
        raise RemoteProtocolError(frame_sentences.telegram_length('SDO', len(data), least))
    if kind is None:
        raise RemoteProtocolError(
            frame_sentences.sdo_request_unknown(head) if direction is _REQUEST
            else frame_sentences.sdo_answer_unknown(head))
    fields = kind.value.unpack(data.ljust(LENGTH, b'\0'))
    content, number = fields.get('data', b''), fields.get('number', 0)
    if 'index' not in fields:
        if content:
            content = content[:SEGMENT_MAX - (head >> 1 & 0x07)]
        return SdoMessage(kind, None, content, toggle=head & TOGGLE,
                          last=not content or bool(head & _LAST))
    sized = bool(head & _SIZED)
    if content and sized:
        content = content[:EXPEDITED_MAX - (head >> 2 & 0x03)]
    return SdoMessage(kind, (fields['index'], fields['subindex']), content,
                      number if sized or kind is SdoCommand.ABORT else 0,
                      last=sized if content else
                      'number' not in fields or kind is SdoCommand.ABORT)


def _promised(kind: SdoCommand, head: int) -> int:
    """Return how many bytes a response has at least, by its head."""
    if kind is SdoCommand.UPLOADED:
        return LENGTH - (head >> 2 & 0x03 if head & _SIZED else 0)
    if kind is SdoCommand.SEGMENT:
        return LENGTH - (head >> 1 & 0x07)
    if kind is SdoCommand.SEGMENT_TAKEN:
        return 1
    if kind is SdoCommand.DOWNLOADED or kind is SdoCommand.UPLOAD_BEGUN and not head & _SIZED:
        return SHORTEST
    return LENGTH


def decode_upload(data: bytes) -> Uploaded:
    """
    Decode the answer to an upload that has to fit one frame.

    :raises RemoteProtocolError: it is no answer to an upload.
    """
    answer = decode(_RESPONSE, data, segments=False)
    if answer.object is None or answer.kind is SdoCommand.DOWNLOADED:
        raise RemoteProtocolError(frame_sentences.sdo_no_upload(data[0]))
    return Uploaded(answer.object, int.from_bytes(answer.data, 'little')
                    if answer.kind is SdoCommand.UPLOADED else None,
                    answer.kind is SdoCommand.ABORT and answer.number in ABSENT)
