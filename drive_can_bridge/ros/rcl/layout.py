# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How messages lie in memory: what is too long in one is found, and cut, before Python reads it.

Making a Python message of one in C keeps the interpreter: 0.2 s for a million names, and
cycles wait. No honest request has texts or lists of such length. The layout follows
from the definition of a message as the C compiler has it (rosidl_generator_c, ``struct.h``):
strings and sequences are an address, a length and a capacity.
"""

import ctypes
from functools import cache
from importlib import import_module
import re
import struct
from typing import Any, NamedTuple

from drive_can_bridge.ros.rcl.unfit import Unfit

#: entries of a list that are read, and bytes of a text (257 characters of four bytes)
ENTRIES_MAX, BYTES_MAX = 1000, 1028
_FLAT = {'boolean': '?', 'octet': 'B', 'byte': 'B', 'char': 'B', 'uint8': 'B', 'int8': 'b',
         'uint16': 'H', 'int16': 'h', 'uint32': 'I', 'int32': 'i', 'uint64': 'Q', 'int64': 'q',
         'float': 'f', 'double': 'd'}
_WORD = ctypes.sizeof(ctypes.c_void_p)
_WORD_CODE = {4: 'I', 8: 'Q'}[_WORD]
_SEQUENCE_SIZE = 3 * _WORD
_SEQUENCE = re.compile(r'sequence<(.+?)(?:, \d+)?>')


class MessageLayout(NamedTuple):
    """
    The strings and sequences of a message, its parts' among them.

    :ivar size: bytes of it in a sequence.
    :ivar lists: reads address and length of each.
    :ivar entries: where each of them begins, and the layout of its entries; None: it is a text.
    """

    size: int
    alignment: int
    lists: struct.Struct
    entries: tuple[tuple[int, 'MessageLayout | None'], ...]


@cache
def layout_of(kind: Any) -> MessageLayout:
    """
    Return the layout of a type of messages.

    :raises Unfit: it has a type that no message of ours has.
    """
    parts: list[tuple[int, MessageLayout | None]] = []
    end, alignment = 0, 1
    for text in kind.get_fields_and_field_types().values():
        size, needs, inside = _field(text)
        end += -end % needs
        parts.extend((end + offset, entries) for offset, entries in inside)
        end, alignment = end + size, max(alignment, needs)
    return _layout(end + -end % alignment, alignment, parts)


def _layout(size: int, alignment: int,
            parts: list[tuple[int, MessageLayout | None]]) -> MessageLayout:
    code, at = '=', 0
    for offset, _ in parts:
        code += f'{offset - at}x2{_WORD_CODE}'
        at = offset + 2 * _WORD
    return MessageLayout(size, alignment, struct.Struct(f'{code}{size - at}x'), tuple(parts))


def _field(text: str) -> tuple[int, int, list[tuple[int, MessageLayout | None]]]:
    """Return size, alignment, and the strings and sequences of a field."""
    if text in _FLAT:
        size = struct.calcsize(_FLAT[text])
        return size, size, []
    if text.startswith('string'):
        return _SEQUENCE_SIZE, _WORD, [(0, None)]
    sequence = _SEQUENCE.fullmatch(text)
    if sequence is not None:
        return _SEQUENCE_SIZE, _WORD, [(0, _layout(*_field(sequence[1])))]
    package, _, name = text.partition('/')
    try:
        found = layout_of(getattr(import_module(f'{package}.msg'), name))
    except (ImportError, AttributeError, TypeError):    # TypeError: of no package
        raise Unfit(f'fields of type {text}') from None
    return found.size, found.alignment, list(found.entries)


def cut(address: int, layout: MessageLayout) -> int:
    """
    Cut what is too long in a message.

    :return: how many entries the longest list of it had, if that was cut; else 0.
    """
    return _cut(address, 1, layout)


def _cut(address: int, count: int, layout: MessageLayout) -> int:
    longest = 0
    if not layout.entries:
        return 0
    for place, found in enumerate(layout.lists.iter_unpack(
            ctypes.string_at(address, count * layout.size))):
        for (offset, entries), data, length in zip(layout.entries, found[::2], found[1::2]):
            if entries is None:
                if length > BYTES_MAX:
                    ctypes.memset(data + BYTES_MAX, 0, 1)   # as C ends texts
                continue
            if length > ENTRIES_MAX:
                longest = max(longest, length)
                ctypes.c_size_t.from_address(
                    address + place * layout.size + offset + _WORD).value = length = 1
            if length:
                _cut(data, length, entries)
    return longest
