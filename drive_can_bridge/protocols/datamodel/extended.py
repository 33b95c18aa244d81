# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The telegrams of the DataModel protocol with 29-bit identifiers: bytes to values and back.

Process data, the words of a cyclic telegram, are packed in :mod:`.process_words`.

Source: chapter CANbus of the drive manual, section "Protocollo CAN con ID ESTESO" (the pages carry
no numbers). Identifier:

====== ======= ========= ==================================================================
field  bits    mask      meaning
====== ======= ========= ==================================================================
DIR    28      10000000h 0 master to drive (request), 1 drive to master (response)
A      27..21  0FE00000h station number
W      20      00100000h 1 cyclic telegram or acyclic write, 0 acyclic read
P      19..4   000FFFF0h first parameter number; FFFFh in cyclic telegrams
N      3..0    0000000Fh number of consecutive parameters, 1..4; 0 in cyclic telegrams
====== ======= ========= ==================================================================

Payload of every telegram that carries values: up to four 16-bit words, high byte first, word 0 in
BYTE0 and BYTE1 (the manual prints BYTE7 in the leftmost column). Requests always have eight bytes,
unused ones 00h. A read request carries eight 00h bytes. Writes are never acknowledged.

What the manual does not define is refused: N = 0 or N > 4 in acyclic telegrams (a write of "no
parameters at FFFFh" would *be* a cyclic request), windows that run past FFFFh, W = 1 from a drive
other than the cyclic pattern. No write begins at FFFFh, to keep clear of the cyclic pattern.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import struct
from typing import Union

from drive_can_bridge.core import frame_sentences, sentences
from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError, Unasked
from drive_can_bridge.core.frame import Frame

DIR = 0x10000000
STATION_MASK = 0x0FE00000
STATION_SHIFT = 21
W = 0x00100000
PARAMETER_MASK = 0x000FFFF0
PARAMETER_SHIFT = 4
COUNT_MASK = 0x0000000F
#: W, P and N of the cyclic telegrams
CYCLIC = 0x001FFFF0
CYCLIC_PARAMETER = 0xFFFF

STATION_MAX = 127
SLOTS = 4
PAYLOAD = 8
WORDS = [struct.Struct(f'>{count}H') for count in range(SLOTS + 1)]
PADDING = [bytes(PAYLOAD - 2 * count) for count in range(SLOTS + 1)]


@dataclass(frozen=True)
class CyclicRequest:
    """Values for the parameters named by the drive's request map. The drive answers at once."""

    words: tuple[int, ...]


@dataclass(frozen=True)
class CyclicResponse:
    """Values of the parameters named by the drive's response map."""

    words: tuple[int, ...]


@dataclass(frozen=True)
class WriteTelegram:
    """Write 1 to 4 consecutive parameters, with 11 bits one. The drive never answers."""

    number: int
    words: tuple[int, ...]


@dataclass(frozen=True)
class ReadTelegram:
    """Ask for 1 to 4 consecutive parameters."""

    number: int
    count: int


@dataclass(frozen=True)
class ReadResponse:
    """The answer to a read request; repeats its station, number and count."""

    number: int
    words: tuple[int, ...]


Telegram = Union[CyclicRequest, CyclicResponse, WriteTelegram, ReadTelegram, ReadResponse]


def station_of(identifier: int) -> int:
    """Return the station whose telegrams have this identifier."""
    return (identifier & STATION_MASK) >> STATION_SHIFT


# -- encoding -------------------------------------------------------------------------------------


def encode_write(station: int, number: int, words: Sequence[int]) -> Frame:
    """
    Encode an acyclic write of consecutive parameters.

    :raises LocalProtocolError: no word, more than four, the window or a word out of range.
    """
    identifier = _acyclic_identifier(station, number, len(words))
    if number == CYCLIC_PARAMETER:
        raise LocalProtocolError('parameter 65535 is not written: its number marks cyclic frames')
    return Frame(identifier | W, pack_words(words), True)


def encode_read_request(station: int, number: int, count: int) -> Frame:
    """Encode a read request for ``count`` consecutive parameters."""
    return Frame(_acyclic_identifier(station, number, count), bytes(PAYLOAD), True)


def encode_answer(request: int, words: Sequence[int]) -> Frame:
    """
    Encode the response to a request, cyclic or not; it repeats the identifier.

    :param request: identifier of the request.
    :raises LocalProtocolError: more than four words, or a word out of range.
    """
    return Frame(request | DIR, pack_words(words), True)


def cyclic_request_identifier(station: int) -> int:
    """Return the identifier of a station's cyclic request; the response has DIR set as well."""
    _check_station(station)
    return station << STATION_SHIFT | CYCLIC


def check_window(number: int, count: int) -> None:
    """
    Check which parameters a frame is to be about.

    :raises LocalProtocolError: none or more than four, or some of them cannot exist.
    """
    if not 1 <= count <= SLOTS:
        raise LocalProtocolError(f'{count} parameters in one frame: 1 to {SLOTS} are possible')
    if number < 0 or number + count - 1 > 0xFFFF:
        raise LocalProtocolError(f'parameters {number} to {number + count - 1} are not all within '
                                 f'0 to 65535')


def pack_words(words: Sequence[int]) -> bytes:
    """Pack up to four unsigned words, high byte first, padded with 00h to eight bytes."""
    count = len(words)
    if count > SLOTS:
        raise LocalProtocolError(f'{count} words do not fit a frame: at most {SLOTS}')
    try:
        return WORDS[count].pack(*words) + PADDING[count]
    except struct.error:
        raise LocalProtocolError(f'{list(words)}: every word must be 0 to 65535') from None


# -- decoding -------------------------------------------------------------------------------------


def decode(frame: Frame, *, count: int = SLOTS, strict: bool = False) -> Telegram:
    """
    Decode any telegram of the protocol.

    :param count: how many words of a cyclic telegram are mapped; the rest is undetermined and
        left out (up to the first 0 of the map, see :func:`.options.effective`).
    :param strict: accept only frames of eight bytes. Otherwise a shorter frame will do as long as
        it holds every word that is needed.
    :raises RemoteProtocolError: not a telegram of this protocol, or too short.
    """
    identifier, data, extended = frame
    if not extended:
        raise RemoteProtocolError(frame_sentences.not_29_bit(frame))
    response = bool(identifier & DIR)
    if identifier & CYCLIC == CYCLIC and not identifier & COUNT_MASK:
        words = unpack_words(data, count, strict=strict)
        return CyclicResponse(words) if response else CyclicRequest(words)
    number = (identifier & PARAMETER_MASK) >> PARAMETER_SHIFT
    length = identifier & COUNT_MASK
    check_received(frame, number, length)
    if identifier & W:
        if response:
            raise RemoteProtocolError(frame_sentences.write_acknowledged(frame))
        return WriteTelegram(number, unpack_words(data, length, strict=strict))
    if response:
        return ReadResponse(number, unpack_words(data, length, strict=strict))
    return ReadTelegram(number, length)


def check_received(frame: Frame, number: int, count: int) -> None:
    """
    Check which parameters a frame is about.

    :raises RemoteProtocolError: none or more than four, or some of them cannot exist.
    """
    if not 1 <= count <= SLOTS:
        raise RemoteProtocolError(frame_sentences.count_impossible(frame, count, SLOTS))
    if number + count - 1 > 0xFFFF:
        raise RemoteProtocolError(
            frame_sentences.numbers_past_end(frame, number, number + count - 1))


def decode_answer(frame: Frame, station: int, question: tuple[int, int] | None, *,
                  strict: bool = False) -> tuple[int, ...]:
    """
    Decode the answer to a read request.

    :param question: number and count that were asked for; None: nothing was.
    :return: the words.
    :raises RemoteProtocolError: malformed, or of another station.
    :raises Unasked: anything else.
    """
    telegram = decode(frame, strict=strict)
    if station_of(frame.identifier) != station:
        raise RemoteProtocolError(frame_sentences.not_from_station(frame, station))
    if not isinstance(telegram, ReadResponse) or (
            (telegram.number, len(telegram.words)) != question):
        raise Unasked(sentences.nobody_asked(frame))
    return telegram.words


def unpack_words(data: bytes, count: int, *, strict: bool = False) -> tuple[int, ...]:
    """
    Unpack the first ``count`` words of a payload.

    :raises RemoteProtocolError: too short, or not eight bytes although ``strict``.
    """
    if len(data) < 2 * count:
        raise RemoteProtocolError(frame_sentences.words_missing(len(data), count))
    if strict and len(data) != PAYLOAD:
        raise RemoteProtocolError(frame_sentences.length_differs(len(data), PAYLOAD))
    return WORDS[count].unpack_from(data)


def _acyclic_identifier(station: int, number: int, count: int) -> int:
    _check_station(station)
    check_window(number, count)
    return station << STATION_SHIFT | number << PARAMETER_SHIFT | count


def _check_station(station: int) -> None:
    if not 0 <= station <= STATION_MAX:
        raise LocalProtocolError(f'station {station} does not fit 7 bits: 0 to {STATION_MAX}')


class ExtendedAcyclicCodec:
    """
    The acyclic frames of one station.

    :param strict: as for :func:`decode`.
    """

    together = SLOTS

    def __init__(self, station: int, strict: bool) -> None:
        self.station, self.strict = station, strict

    def encode_read(self, number: int, count: int) -> Frame:
        """Encode a read of consecutive parameters."""
        return encode_read_request(self.station, number, count)

    def encode_write(self, number: int, words: Sequence[int]) -> Frame:
        """Encode a write of up to four consecutive parameters."""
        return encode_write(self.station, number, words)

    def decode(self, frame: Frame, asked: tuple[int, int] | None) -> tuple[int, ...]:
        """Decode an answer; see :func:`decode_answer`."""
        return decode_answer(frame, self.station, asked, strict=self.strict)
