# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Types, access and storage as manuals call them."""

import re

from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.profiles.errors import Unusable

_TYPES: dict[str, str] = {
    'bool': 'bool|boolean|bit|flag',
    'int16': 'int16|sint16|i16|s16|integer16|short|int|int 16 bit|word signed|signed16|'
             'signed word|signed int|sword|16 bit signed',
    'uint16': 'uint16|u16|unsigned16|word|uint|ushort|unsigned|unsigned word|unsigned int|'
              'unsigned short|16 bit unsigned|bitfield|bitfeld|bitset|bitfield16|enum',
    'int32': 'int32|sint32|i32|s32|integer32|dint|long|signed32|signed long|signed dword|'
             '32 bit signed',
    'uint32': 'uint32|u32|unsigned32|dword|udint|ulong|unsigned32|unsigned long|double word|'
              'doppelwort|unsigned dword|32 bit unsigned',
}
_BY_WORD = {word.replace(' ', ''): name for name, words in _TYPES.items()
            for word in words.split('|')}
#: eight bits fit sixteen where there is no sign
_BYTES = frozenset(('uint8', 'u8', 'byte', 'usint', 'unsigned8', 'uchar'))

_ACCESS: dict[str, str] = {
    'ro': 'ro|r|read|readonly|read-only|read only|lesen|nur lesen|l|lettura|sola lettura|const|'
          'nur lesbar|r-',
    'rw': 'rw|r/w|w/r|wr|rww|rwr|readwrite|read/write|read write|lesen/schreiben|'
          'lesen schreiben|l/s|ls|lettura/scrittura|lettura e scrittura|l e s|schreibbar|r,w',
    'wo': 'wo|w|write|writeonly|write-only|write only|schreiben|nur schreiben|scrittura|'
          'sola scrittura|-w',
}
_ACCESS_BY_WORD = {word: name for name, words in _ACCESS.items() for word in words.split('|')}
_STORAGE: dict[str, str] = {
    'ram': 'ram|volatile|fluechtig|flüchtig|volatile memory|no|nein|n|false|0|temporary|volatil',
    'eeprom': 'eeprom|nvram|flash|nv|non volatile|non-volatile|nonvolatile|nichtfluechtig|'
              'nichtflüchtig|remanent|persistent|persist|yes|ja|si|sì|j|y|true|1|x|permanent|'
              'retain|fram|e2prom|eprom|non volatil',
}
_STORAGE_BY_WORD = {word: name for name, words in _STORAGE.items() for word in words.split('|')}


def type_of(text: str) -> tuple[ParameterType, int | None]:
    """
    Return a type, and the largest raw value where that is less than the type holds.

    :raises Unusable: the bridge has no such type.
    """
    word = re.sub(r'[\s_.-]+|_t$', '', text.strip().casefold())
    if word in _BYTES:
        return ParameterType.UINT16, 255
    name = _BY_WORD.get(word)
    if name is None:
        raise Unusable(f"type '{text}' is none of 16 or 32 bits that is known here")
    return ParameterType(name), None


def access_of(text: str) -> str:
    """
    Return ``ro``, ``rw`` or ``wo``.

    :raises Unusable: it is none of them.
    """
    found = _ACCESS_BY_WORD.get(' '.join(text.casefold().split()))
    if found is None:
        raise Unusable(f"access '{text}' is none of those that are known here")
    return found


def storage_of(text: str) -> str:
    """
    Return ``ram`` or ``eeprom``.

    :raises Unusable: it is none of them.
    """
    found = _STORAGE_BY_WORD.get(' '.join(text.casefold().split()))
    if found is None:
        raise Unusable(f"storage '{text}' is none of those that are known here")
    return found
