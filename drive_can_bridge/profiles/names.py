# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Names for parameters, made from free text by the rules of docs/profiles.md.

The same table always gives the same names.
"""

from collections.abc import Iterable
import re
import unicodedata

from drive_can_bridge.configuration.profile_check import RAW_NAME, RESERVED
from drive_can_bridge.profiles.numbers import split_step
from drive_can_bridge.profiles.units import split_unit
from drive_can_bridge.profiles.yaml_text import YAML_WORDS

LENGTH_MAX = 60
_LETTERS = str.maketrans({
    'ä': 'ae', 'ö': 'oe', 'ü': 'ue', 'Ä': 'Ae', 'Ö': 'Oe', 'Ü': 'Ue', 'ß': 'ss', 'ẞ': 'SS',
    'æ': 'ae', 'Æ': 'Ae', 'ø': 'oe', 'Ø': 'Oe', 'å': 'aa', 'Å': 'Aa', 'œ': 'oe', 'Œ': 'Oe',
    'ł': 'l', 'Ł': 'L', 'ı': 'i', 'µ': 'micro', '²': '2', '³': '3',
    **dict.fromkeys("'’`´", '')})
_BOUNDARY = re.compile(r'(?<=[a-z0-9])(?=[A-Z][a-z])|(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])')


def name_of(text: str, address: str = '', taken: frozenset[str] = frozenset()) -> str:
    """
    Return the name for a text.

    :param address: digits and ``_``, for texts that leave no name.
    :param taken: further names that cannot be used.

    >>> name_of('Beschleunigungszeit (Rampe 1) [s]')
    'beschleunigungszeit_rampe_1'
    """
    name = '_'.join(plain_words(split_unit(split_step(text)[0])[0]))
    if len(name) > LENGTH_MAX:
        cut = name[:LENGTH_MAX + 1]
        name = cut.rpartition('_')[0] or cut[:LENGTH_MAX]
    if not name or not name[0].isalpha():
        name = '_'.join(filter(None, ('parameter', name or address)))
    if name in RESERVED | taken | YAML_WORDS or RAW_NAME.fullmatch(name):
        name += '_value'
    return name


def plain_words(text: str) -> list[str]:
    """Return the words of a text in small letters of ASCII."""
    text = unicodedata.normalize('NFC', text).translate(_LETTERS)
    if not text.isascii():
        text = ''.join(map(_in_ascii, unicodedata.normalize('NFKD', text)))
    return re.findall('[a-z0-9]+', _BOUNDARY.sub(' ', text).lower())


def _in_ascii(part: str) -> str:
    if part.isascii():
        return part
    if unicodedata.category(part) == 'Mn':
        return ''
    words = unicodedata.name(part, '').split()
    return f' {words[3].lower() if words[:1] == ["GREEK"] and len(words) > 3 else ""} '


def unique(names: Iterable[tuple[str, str]]) -> list[str]:
    """
    Return the names, made unique.

    :param names: (name, address), lowest address first; addresses are digits and ``_``.
    """
    made: dict[str, None] = {}
    for name, address in names:
        # addresses are unique per number and sub-index; a name may end like one by chance
        while name in made:
            name = f'{name}_{address or "2"}'
        made[name] = None
    return list(made)


# -- numbers --------------------------------------------------------------------------------------
