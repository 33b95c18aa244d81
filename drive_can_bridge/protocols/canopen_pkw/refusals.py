# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The codes with which a device refuses a request, and what they mean.

Source: "PKW objects" of the TeSys T LTMR CANopen guide: words 3 and 4 of a response with function
4Eh hold a code, and the codes are the SDO abort codes of CiA 301. Which word holds the high half
is not documented. No two halves of a listed code are another listed code when they change places,
so that ``auto`` finds out by itself.

The PROFIBUS variants of the same devices refuse with small numbers instead; should one of them
turn up here, its meaning is named as a hint.
"""

from drive_can_bridge.protocols.canopen import abort_codes
from drive_can_bridge.protocols.canopen.abort_codes import TEXTS
from drive_can_bridge.protocols.canopen_pkw.pkw import value_from_words, Words, words_from_value

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
        return abort_codes.describe(code)
    hint = SMALL_TEXTS.get(code, 'unknown there, too')
    return f'{code:08X}h (no SDO abort code; as a PROFIBUS device would mean it: {hint})'
