# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Names for parameters, made from free text by one rule (docs/profiles.md has it with examples).

1. A unit at the end is dropped: ``Ramp time [s]``, ``Drehzahl in 1/min``.
2. Letters become a to z: umlauts ae, oe, ue, other accents vanish, Greek letters get their names.
3. Words are what letters and digits form; ``RampTime`` is two. They are joined by ``_``.
4. At most 60 characters, cut between words.
5. What cannot be a name gets ``parameter_`` in front (it begins with a digit, or nothing is left:
   then the number follows) or ``_value`` behind (it is taken by the node of the drive, reads as a
   raw parameter, or is a word that YAML takes for something else).
6. Of several equal names the one with the lowest address keeps it; the others get their number
   behind.
"""

from collections.abc import Iterable
import re
import unicodedata

from drive_can_bridge.configuration.profile_check import RAW_NAME, RESERVED
from drive_can_bridge.profiles.text import YAML_WORDS
from drive_can_bridge.profiles.units import known_unit

LENGTH_MAX = 60

_LETTERS = str.maketrans({
    'ä': 'ae', 'ö': 'oe', 'ü': 'ue', 'Ä': 'Ae', 'Ö': 'Oe', 'Ü': 'Ue', 'ß': 'ss', 'ẞ': 'SS',
    'æ': 'ae', 'Æ': 'Ae', 'ø': 'oe', 'Ø': 'Oe', 'å': 'aa', 'Å': 'Aa', 'œ': 'oe', 'Œ': 'Oe',
    'ð': 'd', 'Ð': 'D', 'þ': 'th', 'Þ': 'Th', 'ł': 'l', 'Ł': 'L', 'đ': 'd', 'Đ': 'D',
    'ı': 'i', 'µ': 'micro', '²': '2', '³': '3', "'": '', '’': '', '`': '', '´': '',
})
_BRACKETED = re.compile(r'\s*[\[(]([^\[\]()]{1,20})[\])]\s*$')
_TRAILING = re.compile(r'(?:,|\s/|\bin)\s*([^\s,]{1,12})\s*$', re.IGNORECASE)
_SYMBOL = re.compile(r'\s*(°\s?C|℃|°|%)\s*$')
_BOUNDARY = re.compile(r'(?<=[a-z0-9])(?=[A-Z][a-z])|(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])')


def split_unit(text: str) -> tuple[str, str]:
    """
    Separate a text from the unit at its end.

    >>> split_unit('Ramp time [s]'), split_unit('Position (set 2)')
    (('Ramp time', 's'), ('Position (set 2)', ''))
    """
    for pattern in (_BRACKETED, _TRAILING, _SYMBOL):
        match = pattern.search(text)
        found = known_unit(match[1]) if match else None
        if match and found and text[:match.start()].strip():
            return text[:match.start()].strip(), found
    return text.strip(), ''


def name_of(text: str, address: str = '', taken: frozenset[str] = frozenset()) -> str:
    """
    Return the name for a text.

    :param address: digits and ``_``, for texts of which nothing is left.
    :param taken: further names that cannot be used.

    >>> name_of('Beschleunigungszeit (Rampe 1) [s]')
    'beschleunigungszeit_rampe_1'
    """
    words = _words(split_unit(text)[0])
    name = ''
    for word in words:
        longer = f'{name}_{word}' if name else word
        if len(longer) > LENGTH_MAX:
            break
        name = longer
    if not name:
        name = words[0][:LENGTH_MAX] if words else ''
    if not name or not name[0].isalpha():
        name = '_'.join(part for part in ('parameter', name or address) if part)
    if name in RESERVED | taken | YAML_WORDS or RAW_NAME.fullmatch(name):
        name += '_value'
    return name


def _words(text: str) -> list[str]:
    plain = []
    for letter in unicodedata.normalize('NFC', text).translate(_LETTERS):
        for part in unicodedata.normalize('NFKD', letter):
            if part.isascii():
                plain.append(part)
            elif unicodedata.category(part) == 'Mn':
                continue
            else:
                plain.append(f' {_greek(part)} ')
    return re.findall('[a-z0-9]+', _BOUNDARY.sub(' ', ''.join(plain)).lower())


def _greek(letter: str) -> str:
    """Return the name of a Greek letter; nothing for any other."""
    words = unicodedata.name(letter, '').split()
    return words[3].lower() if words[:1] == ['GREEK'] and len(words) > 3 else ''


def unique(names: Iterable[tuple[str, str]]) -> list[str]:
    """
    Make names unique.

    :param names: (name, address), lowest address first; addresses are digits and ``_``.
    """
    names = list(names)
    taken: set[str] = set()
    made = []
    for name, address in names:
        # addresses are unique per number and sub-index; a name may end like one by chance
        choice = name
        while choice in taken:
            choice = f'{choice}_{address or "2"}'
        taken.add(choice)
        made.append(choice)
    return made
