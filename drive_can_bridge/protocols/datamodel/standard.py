# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The telegrams of the DataModel protocol with 11-bit identifiers: bytes to values and back.

Source: chapter CANbus of the drive manual, sections "Protocollo CAN con ID STANDARD", "Lettura di
parametri" and "Scrittura di un parametro" (the pages carry no numbers). Identifiers are *sums*:

======== ============================================== ==================
request  CanStdRxIDbase + CanBusAddress (Rx: the drive) 3F0h + 1 = 3F1h
response CanStdTxIDbase + CanBusAddress                 7F0h + 1 = 7F1h
======== ============================================== ==================

A sum over 7FFh is refused, never masked: 800h would become 000h, the highest priority of the bus.

Payload; words have their **low byte first**, unlike in the 29-bit protocol:

====  ============ ============= ===========
byte  read request read response write
====  ============ ============= ===========
0     03h          word 0 low    06h
1     number low   word 0 high   number low
2     number high  word 1 low    number high
3     count 1..4   word 1 high   value low
4     00h          word 2 low    value high
5     00h          word 2 high   00h
6     00h          word 3 low    00h
7     00h          word 3 high   00h
====  ============ ============= ===========

The response names neither number nor count: the asker has to remember, and may have one read
outstanding per station. Words beyond the count are undefined. Writes carry one parameter and are
never acknowledged.
"""

from collections.abc import Sequence
import struct

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.core.frame import Frame, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.protocols.datamodel.extended import (
    check_received, check_window, ReadTelegram, WriteTelegram)

REQUEST_ID_BASE = 0x3F0
RESPONSE_ID_BASE = 0x7F0
READ = 3
WRITE = 6
SLOTS = 4
PAYLOAD = 8

_READ_REQUEST = struct.Struct('<BHB4x')
_WRITE = struct.Struct('<BHH3x')
_WORDS = [struct.Struct(f'<{count}H') for count in range(SLOTS + 1)]


def identifier(base: int, station: int) -> int:
    """
    Return the identifier of a station: base + address.

    :raises LocalProtocolError: the sum does not fit 11 bits.
    """
    total = base + station
    if not (base >= 0 and station >= 0 and total <= STANDARD_IDENTIFIER_MAX):
        raise LocalProtocolError(
            f'identifier {base:X}h + {station} = {total:X}h does not fit 11 bits: at most 7FFh')
    return total


# -- encoding -------------------------------------------------------------------------------------


def encode_read_request(request_identifier: int, number: int, count: int) -> Frame:
    """Encode a read request for ``count`` consecutive parameters."""
    check_window(number, count)
    return Frame(request_identifier, _READ_REQUEST.pack(READ, number, count), False)


def encode_write(request_identifier: int, number: int, word: int) -> Frame:
    """Encode the write of one parameter."""
    if not 0 <= number <= 0xFFFF:
        raise LocalProtocolError(f'parameter {number} is not within 0 to 65535')
    if not 0 <= word <= 0xFFFF:
        raise LocalProtocolError(f'{word}: a word must be 0 to 65535')
    return Frame(request_identifier, _WRITE.pack(WRITE, number, word), False)


def encode_read_response(response_identifier: int, words: Sequence[int]) -> Frame:
    """Encode a read response (the drive's side)."""
    if not 1 <= len(words) <= SLOTS:
        raise LocalProtocolError(f'{len(words)} words in one frame: 1 to {SLOTS} are possible')
    try:
        data = _WORDS[len(words)].pack(*words)
    except struct.error:
        raise LocalProtocolError(f'{list(words)}: every word must be 0 to 65535') from None
    return Frame(response_identifier, data.ljust(PAYLOAD, b'\0'), False)


# -- decoding -------------------------------------------------------------------------------------


def decode_request(frame: Frame) -> ReadTelegram | WriteTelegram:
    """
    Decode what the master sends (the drive's side).

    :raises RemoteProtocolError: not a request of this protocol.
    """
    if frame.extended:
        raise RemoteProtocolError(frame_sentences.not_11_bit(frame))
    data = frame.data
    if len(data) != PAYLOAD:
        raise RemoteProtocolError(frame_sentences.length_differs(len(data), PAYLOAD, frame))
    if data[0] == WRITE:
        _, number, word = _WRITE.unpack(data)
        return WriteTelegram(number, (word,))
    if data[0] != READ:
        raise RemoteProtocolError(frame_sentences.unknown_function(frame, data[0], READ, WRITE))
    _, number, count = _READ_REQUEST.unpack(data)
    check_received(frame, number, count)
    return ReadTelegram(number, count)


def decode_read_response(frame: Frame, count: int, *, strict: bool = False) -> tuple[int, ...]:
    """
    Decode a read response.

    :param count: how many parameters were asked for.
    :param strict: accept only frames of eight bytes.
    :raises RemoteProtocolError: wrong frame format, too short, or not eight bytes while strict.
    """
    if frame.extended:
        raise RemoteProtocolError(frame_sentences.not_11_bit(frame))
    length = len(frame.data)
    if length < 2 * count:
        raise RemoteProtocolError(frame_sentences.words_missing(length, count, frame))
    if strict and length != PAYLOAD:
        raise RemoteProtocolError(frame_sentences.length_differs(length, PAYLOAD, frame))
    return _WORDS[count].unpack_from(frame.data)


class StandardAcyclicCodec:
    """
    The frames of one station.

    :param request: identifier of what it is asked.
    :param strict: as for :func:`decode_read_response`.
    """

    together = 1

    def __init__(self, request: int, strict: bool) -> None:
        self.request, self.strict = request, strict

    def encode_read(self, number: int, count: int) -> Frame:
        """Encode a read of consecutive parameters."""
        return encode_read_request(self.request, number, count)

    def encode_write(self, number: int, words: Sequence[int]) -> Frame:
        """Encode a write of one parameter."""
        word, = words
        return encode_write(self.request, number, word)

    def decode(self, frame: Frame, asked: tuple[int, int] | None) -> tuple[int, ...]:
        """Decode an answer, which does not say what it answers."""
        return decode_read_response(frame, asked[1] if asked else 0, strict=self.strict)
