# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parameter frames of CANnord, task and response: bytes to fields and back.

Sources: BU 0060, section 4.2.1 (page 49: always 8 bytes), page 39 (byte order), page 54 (fields,
sub-index, error numbers); task and response identifiers, and the order of the value words, as
other bus manuals of the same inverters print them alike (BU 0050 pages 39 to 42, BU 0090, BU
0220).

===== ======================= ===================================================================
bytes field                   meaning
===== ======================= ===================================================================
0, 1  PKE                     bits 0-10 parameter number, bit 11 unused, bits 12-15 task/response
2, 3  IND                     sub-index in the low byte (``index_byte``), the other byte is 00h
4, 5  PWE1                    high word of the value (``value_order``)
6, 7  PWE2                    low word; words and error numbers are here
===== ======================= ===================================================================

Each field is sent low byte first. A word that is negative has FFFFh in PWE1. Where a drive sends
the halves of a value the other way round, ``value_order: low_first`` makes bytes 4 to 7 a plain
32-bit little-endian number.

The sub-index counts only in the array tasks (6, 7, 8, 11, 12). For a parameter that each parameter
set has of its own it is ``4 · element + set - 1``, otherwise the element.
"""

from dataclasses import dataclass
from enum import IntEnum
import struct

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError

NUMBER_MAX = 0x7FF
INDEX_MAX = 0xFF
LENGTH = 8

_FIELDS = struct.Struct('<HHHH')
_SPONTANEOUS = 0x0800
_IDENTIFIER_SHIFT = 12


class ResponseId(IntEnum):
    """
    Response identifiers, inverter to master.

    :ivar array: it carries the value of an element.
    :ivar double: it carries a double word.
    """

    array: bool
    double: bool

    def __new__(cls, code: int, array: bool = False, double: bool = False) -> 'ResponseId':
        row = int.__new__(cls, code)
        row._value_, row.array, row.double = code, array, double
        return row

    NONE = 0
    WORD = 1, False, False
    DOUBLE = 2, False, True
    ARRAY_WORD = 4, True, False
    ARRAY_DOUBLE = 5, True, True
    ELEMENTS = 6
    REFUSED = 7


class Task(IntEnum):
    """
    Task identifiers, master to inverter. 4, 5, 10 and 15 do not exist.

    :ivar responses: what may follow when it was carried out.
    :ivar persistent: of a write: to the EEPROM, not to RAM only; None: it is none.
    """

    responses: tuple[ResponseId, ...]
    persistent: bool | None

    def __new__(cls, code: int, responses: str = '',
                persistent: bool | None = None) -> 'Task':
        row = int.__new__(cls, code)
        row._value_, row.persistent = code, persistent
        row.responses = tuple(ResponseId[name] for name in responses.split())
        return row

    NONE = 0, 'NONE'
    READ = 1, 'WORD DOUBLE'
    WRITE_WORD = 2, 'WORD', True
    WRITE_DOUBLE = 3, 'DOUBLE', True
    READ_ARRAY = 6, 'ARRAY_WORD ARRAY_DOUBLE'
    WRITE_ARRAY_WORD = 7, 'ARRAY_WORD', True
    WRITE_ARRAY_DOUBLE = 8, 'ARRAY_DOUBLE', True
    READ_ELEMENTS = 9, 'ELEMENTS'
    WRITE_ARRAY_DOUBLE_RAM = 11, 'ARRAY_DOUBLE', False
    WRITE_ARRAY_WORD_RAM = 12, 'ARRAY_WORD', False
    WRITE_DOUBLE_RAM = 13, 'DOUBLE', False
    WRITE_WORD_RAM = 14, 'WORD', False

    @property
    def writes(self) -> bool:
        """It writes a value."""
        return self.persistent is not None

    @property
    def array(self) -> bool:
        """It is about an element."""
        return self.responses[0].array

    @property
    def double(self) -> bool:
        """It carries a double word."""
        return self.writes and self.responses[0].double


#: (array, double word, EEPROM) -> task
WRITE_TASKS = {(task.array, task.double, task.persistent): task for task in Task if task.writes}
_DOUBLE = [response for response in ResponseId if response.double]

#: what the error numbers of a refused task mean
ERRORS: dict[int, str] = {
    0: 'invalid parameter number',
    1: 'parameter value cannot be changed',
    2: 'limit exceeded',
    3: 'wrong sub-index',
    4: 'not an array',
    5: 'invalid data type',
    6: 'only resettable (only 0 may be written)',
    7: 'description element cannot be changed',
    9: 'description data missing',
    201: 'invalid task identifier in the last task',
    202: 'internal response identifier cannot be represented',
}


@dataclass(frozen=True)
class ParameterFrame:
    """
    The fields of a task or a response.

    :param identifier: task or response identifier, 0 to 15; the receiver tells what it means.
    :param number: parameter number, 0 to 2047.
    :param index: sub-index, 0 to 255.
    :param value: 32 bits, unsigned. A word is in the low half, and so is an error number.
    """

    identifier: int
    number: int
    index: int
    value: int

    @property
    def word(self) -> int:
        """The value of a task or response that carries a word: the low half, unsigned."""
        return self.value & 0xFFFF

    @property
    def double(self) -> bool:
        """It is a response that carries a double word."""
        return self.identifier in _DOUBLE

    @property
    def answered(self) -> int:
        """The value of a response: a double word, or else a word."""
        return self.value if self.double else self.word


@dataclass(frozen=True)
class ParameterLayout:
    """
    Where the parts of a parameter frame are.

    :param value_order: ``high_first``: PWE1 is the high word; ``low_first``: the low word.
    :param index_byte: ``low``: the sub-index is in byte 2; ``high``: in byte 3.
    """

    value_order: str = 'high_first'
    index_byte: str = 'low'

    def encode(self, identifier: int, number: int, index: int = 0, value: int = 0) -> bytes:
        """
        Encode a task or a response.

        :param value: -2147483648 to 4294967295. A negative word is given as it is: its sign fills
            the high half. An unsigned word leaves the high half 0.
        :raises LocalProtocolError: a field out of range.
        """
        if not 0 <= identifier <= 0xF:
            raise LocalProtocolError(f'task {identifier} does not fit 4 bits')
        if not 0 <= number <= NUMBER_MAX:
            raise LocalProtocolError(f'parameter {number} is out of range: 0 to {NUMBER_MAX}')
        if not 0 <= index <= INDEX_MAX:
            raise LocalProtocolError(f'sub-index {index} is out of range: 0 to {INDEX_MAX}')
        if not -0x80000000 <= value <= 0xFFFFFFFF:
            raise LocalProtocolError(f'{value} does not fit 32 bits')
        first, second = value >> 16 & 0xFFFF, value & 0xFFFF
        if self.value_order == 'low_first':
            first, second = second, first
        ind = index << 8 if self.index_byte == 'high' else index
        return _FIELDS.pack(identifier << _IDENTIFIER_SHIFT | number, ind, first, second)

    def decode(self, data: bytes) -> ParameterFrame:
        """
        Decode a task or a response.

        The byte of IND that carries no information may be anything.

        :raises RemoteProtocolError: not 8 bytes, or bit 11 of PKE set: spontaneous messages do
            not exist.
        """
        if len(data) != LENGTH:
            raise RemoteProtocolError(frame_sentences.parameter_frame_length(len(data), LENGTH))
        pke, ind, first, second = _FIELDS.unpack(data)
        if pke & _SPONTANEOUS:
            raise RemoteProtocolError(frame_sentences.task_bit_set())
        if self.value_order == 'low_first':
            first, second = second, first
        index = ind >> 8 if self.index_byte == 'high' else ind & INDEX_MAX
        return ParameterFrame(pke >> _IDENTIFIER_SHIFT, pke & NUMBER_MAX, index,
                              first << 16 | second)


def error_text(number: int) -> str:
    """Return what an error number means: ``error 2: limit exceeded``."""
    return f'error {number}: {ERRORS.get(number, "unknown")}'
