# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The PKW mailbox: requests and responses as words and as bytes.

Source: "PKW objects" (Oggetti PKW) of the TeSys T LTMR CANopen guide. A request is the content of
the objects 3000h.01h and .02h, mapped in the device's receive PDO4; the response is 3000h.03h and
.04h, mapped in its transmit PDO4. Both have four words:

====== ========================================= ==============================================
word   request                                   response
====== ========================================= ==============================================
1      register number, or CANopen index         the same
2      bit 15 toggle, bits 14..8 function code,  the same; 4Eh instead of the function code
       bits 7..0 sub-index (0: by register)      when the request is refused
3, 4   what is written; 0 otherwise              what was read; the SDO abort code of a refusal
====== ========================================= ==============================================

================ ==== =================================================================
function         code
================ ==== =================================================================
(none)           00h  starts nothing; is answered with function 00h
read register    25h  one register, 26h two adjacent registers
write register   2Ah  one register, 2Bh two adjacent registers
read object      35h  one register by CANopen index and sub-index, 36h two of them
write object     3Ah  one register by CANopen index and sub-index, 3Bh two of them
detected error   4Eh  responses only
================ ==== =================================================================

Word 3 belongs to the addressed register, word 4 to the next one. (The guide's table of responses
by CANopen address prints 55h for the first function and the names of the functions by register;
the request table and the echo rule say 35h.)

The rules of the mailbox: only a *change* of the function byte (toggle and code together) starts a
request, unless its code is 00h. A response belongs to a request when toggle, function (or 4Eh),
word 1 and sub-index are the same. What unused words hold is not documented: they are sent as 0 and
ignored when received.

The guide does not print the place of the bytes in the PDO. CANopen sends integers low byte first,
so ``word_le`` is what is to be expected; the other two layouts are for devices or gateways that
surprise:

================= ===============================================================
layout            bytes 0 to 7 (f: toggle and function, s: sub-index)
================= ===============================================================
``word_le``       1 low, 1 high, s, f, 3 low, 3 high, 4 low, 4 high
``dword_swapped`` s, f, 1 low, 1 high, 4 low, 4 high, 3 low, 3 high
``word_be``       1 high, 1 low, f, s, 3 high, 3 low, 4 high, 4 low
================= ===============================================================

What words 3 and 4 of a refusal hold are the SDO abort codes of CiA 301. Which word holds the high
half is not documented. No two halves of a listed code are another listed code when they change
places, so that ``auto`` finds out by itself. The PROFIBUS variants of the same devices refuse with
small numbers instead; should one of them turn up here, its meaning is named as a hint.
"""

from dataclasses import dataclass
from enum import Enum, IntEnum
import struct
from typing import Any, NamedTuple

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.protocols.canopen.sdo import TEXTS

PAYLOAD = 8
TOGGLE = 0x80
CODE_MASK = 0x7F
WORD_MAX = 0xFFFF
SUBINDEX_MAX = 0xFF

Words = tuple[int, int]
NO_WORDS: Words = (0, 0)


class PkwLayout(Enum):
    """Where the bytes of the four words stand in the PDO."""

    WORD_LE = 'word_le'
    DWORD_SWAPPED = 'dword_swapped'
    WORD_BE = 'word_be'


#: of each layout: how it packs them, and which of word 1, sub-index, function, words 3 and 4 comes
#: in which place
_PLACES = {
    PkwLayout.WORD_LE: (struct.Struct('<HBBHH'), (0, 1, 2, 3, 4)),
    PkwLayout.DWORD_SWAPPED: (struct.Struct('<BBHHH'), (1, 2, 0, 4, 3)),
    PkwLayout.WORD_BE: (struct.Struct('>HBBHH'), (0, 2, 1, 3, 4)),
}


@dataclass(frozen=True)
class Meaning:
    """What a function code asks for."""

    by_object: bool
    writes: bool
    count: int


class Function(IntEnum):
    """
    The function codes (bits 14..8 of word 2).

    :ivar meaning: by CANopen index, writes, registers; None: it asks for nothing.
    """

    meaning: Meaning | None

    def __new__(cls, code: int, *meaning: Any) -> 'Function':
        row = int.__new__(cls, code)
        row._value_, row.meaning = code, Meaning(*meaning) if meaning else None
        return row

    NONE = 0x00
    READ_REGISTER_16 = 0x25, False, False, 1
    READ_REGISTER_32 = 0x26, False, False, 2
    WRITE_REGISTER_16 = 0x2A, False, True, 1
    WRITE_REGISTER_32 = 0x2B, False, True, 2
    READ_OBJECT_16 = 0x35, True, False, 1
    READ_OBJECT_32 = 0x36, True, False, 2
    WRITE_OBJECT_16 = 0x3A, True, True, 1
    WRITE_OBJECT_32 = 0x3B, True, True, 2
    ERROR = 0x4E


_MEANINGS = {int(code): code.meaning for code in Function if code.meaning}
_FUNCTIONS = {meaning: code for code, meaning in _MEANINGS.items()}


class Address(NamedTuple):
    """
    What a request is about.

    :param word: register number, or CANopen index.
    :param subindex: CANopen sub-index; None: ``word`` is a register number.
    """

    word: int
    subindex: int | None = None

    @property
    def by_object(self) -> bool:
        """Addressed by CANopen index and sub-index."""
        return self.subindex is not None

    @property
    def next(self) -> 'Address':
        """The address of the register behind."""
        if self.subindex is None:
            return Address(self.word + 1)
        return Address(self.word, self.subindex + 1)

    def __str__(self) -> str:
        """Name the address as the manual does: ``register 455``, ``2004h.06h``."""
        if self.subindex is None:
            return f'register {self.word}'
        return f'{self.word:04X}h.{self.subindex:02X}h'


class PkwMessage(NamedTuple):
    """
    The four words of the mailbox, of either direction.

    :param word: word 1.
    :param code: function code, 7 bits; any number when received.
    :param toggle: bit 15 of word 2.
    :param low: bits 7..0 of word 2.
    :param words: words 3 and 4.
    """

    word: int
    code: int
    toggle: bool
    low: int = 0
    words: Words = NO_WORDS

    @property
    def function_byte(self) -> int:
        """Toggle and function code, as they stand in one byte."""
        return self.code | (TOGGLE if self.toggle else 0)

    @property
    def meaning(self) -> Meaning | None:
        """What the function code asks for; None: it is none of the eight."""
        return _MEANINGS.get(self.code)

    @property
    def address(self) -> Address:
        """The address, by the function code; codes that are none of the eight: a register."""
        meaning = self.meaning
        return Address(self.word, self.low if meaning and meaning.by_object else None)

    def __str__(self) -> str:
        """Name the message in short: ``function A5h, register 455``."""
        return f'function {self.function_byte:02X}h, {self.address}'


# -- messages -------------------------------------------------------------------------------------


def read_request(address: Address, count: int, toggle: bool) -> PkwMessage:
    """
    Make the request that reads one register or two adjacent ones.

    :raises LocalProtocolError: the address, or that of the second register, does not exist.
    """
    return _request(address, False, count, toggle, NO_WORDS)


def write_request(address: Address, words: tuple[int, ...], toggle: bool) -> PkwMessage:
    """
    Make the request that writes one register or two adjacent ones.

    :param words: one unsigned word for each register, that of the addressed one first.
    :raises LocalProtocolError: an address or a word is out of range.
    """
    if any(not 0 <= word <= WORD_MAX for word in words):
        raise LocalProtocolError(f'{list(words)}: every word must be 0 to {WORD_MAX}')
    first, second = (*words, 0, 0)[:2]
    return _request(address, True, len(words), toggle, (first, second))


def idle_request(toggle: bool = False) -> PkwMessage:
    """Make the request that starts nothing, so that any function byte may follow."""
    return PkwMessage(0, Function.NONE, toggle)


def response(request: PkwMessage, words: Words = NO_WORDS) -> PkwMessage:
    """Make the device's response to a request; ``words`` are what was read."""
    return request._replace(words=words)


def error_response(request: PkwMessage, words: Words) -> PkwMessage:
    """
    Make the response with which the device refuses a request.

    :param words: the abort code, see :func:`words_from_code`.
    """
    return request._replace(code=int(Function.ERROR), words=words)


def answers(message: PkwMessage, request: PkwMessage) -> bool:
    """Return whether a response, refusals included, belongs to a request."""
    return (message.toggle == request.toggle
            and message.code in (request.code, Function.ERROR)
            and message.word == request.word
            and (not request.address.by_object or message.low == request.low))


def _request(address: Address, writes: bool, count: int, toggle: bool, words: Words) -> PkwMessage:
    function = _FUNCTIONS.get(Meaning(address.by_object, writes, count))
    if function is None:
        raise LocalProtocolError(f'{count} registers in one request: 1 or 2 are possible')
    last = address if count == 1 else address.next
    for entry in (address, last):
        if not 0 <= entry.word <= WORD_MAX or not 0 <= (entry.subindex or 0) <= SUBINDEX_MAX:
            raise LocalProtocolError(f'{entry} does not exist: register numbers and indices are '
                                     f'0 to {WORD_MAX}, sub-indices 0 to {SUBINDEX_MAX}')
    return PkwMessage(address.word, function, toggle, address.subindex or 0, words)


# -- bytes ----------------------------------------------------------------------------------------


def encode(message: PkwMessage, layout: PkwLayout) -> bytes:
    """
    Return the eight bytes of a message.

    :raises LocalProtocolError: something does not fit its field.
    """
    packing, places = _PLACES[layout]
    fields = message.word, message.low, message.function_byte, *message.words
    try:
        return packing.pack(*[fields[place] for place in places])
    except struct.error:
        raise LocalProtocolError(f'{message!r} does not fit its words') from None


def decode(data: bytes, layout: PkwLayout) -> PkwMessage:
    """
    Read a message of either direction.

    Any eight bytes are a message; whether it makes sense is for ``meaning`` and :func:`answers`.

    :raises RemoteProtocolError: not eight bytes.
    """
    if len(data) != PAYLOAD:
        raise RemoteProtocolError(frame_sentences.length_differs(len(data), PAYLOAD))
    packing, places = _PLACES[layout]
    _, (word, low, function, third, fourth) = zip(*sorted(zip(places, packing.unpack(data))))
    return PkwMessage(word, function & CODE_MASK, bool(function & TOGGLE), low, (third, fourth))


# -- 32-bit values --------------------------------------------------------------------------------


def value_from_words(words: Words, high_first: bool) -> int:
    """Return the unsigned 32-bit value of two registers, that of the lower number first."""
    first, second = words
    return first << 16 | second if high_first else second << 16 | first


def words_from_value(value: int, high_first: bool) -> Words:
    """Return the two registers of an unsigned 32-bit value, that of the lower number first."""
    high, low = value >> 16 & WORD_MAX, value & WORD_MAX
    return (high, low) if high_first else (low, high)


#: the PROFIBUS variants' own numbers
SMALL_TEXTS = {
    1: 'stack full',
    3: 'register not found',
    4: 'answer delayed',
    7: 'not all registers found',
    8: 'register is read-only',
    10: 'word value too high',
    11: 'word value too low',
    12: 'byte value too high',
    13: 'byte value too low',
    16: 'invalid value',
    20: 'bad answer',
}
SMALL_MAX = 0xFF

_HIGH_HALVES = {code >> 16 for code in TEXTS}


def code_from_words(words: Words, order: str) -> int:
    """
    Return the abort code of a refusal.

    :param words: words 3 and 4.
    :param order: ``low_first`` (word 3 is the low half), ``high_first``, or ``auto``: the order
        that gives a code of the table, else one of its groups, else a small number, else low half
        first, as CANopen sends integers.
    """
    low_first, high_first = value_from_words(words, False), value_from_words(words, True)
    if order == 'low_first':
        return low_first
    if order == 'high_first':
        return high_first
    for plausible in (
            lambda code: code in TEXTS,
            lambda code: code >> 16 in _HIGH_HALVES,
            lambda code: code <= SMALL_MAX):
        for code in (low_first, high_first):
            if plausible(code):
                return code
    return low_first


def words_from_code(code: int, order: str = 'low_first') -> Words:
    """Return words 3 and 4 of a refusal (the device's side); ``auto`` is ``low_first``."""
    return words_from_value(code, order == 'high_first')


def describe(code: int) -> str:
    """Return code and meaning for a user."""
    if code > SMALL_MAX:
        return sdo.describe(code)
    hint = SMALL_TEXTS.get(code, 'unknown there, too')
    return f'{code:08X}h (no SDO abort code; as a PROFIBUS device would mean it: {hint})'
