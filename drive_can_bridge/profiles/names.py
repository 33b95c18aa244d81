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

Units that a joint converts get the spelling of :mod:`drive_can_bridge.core.units`, a few others
the usual one; every other unit stays as it was written.

What is written here is read alike by the bridge (which follows rcl's rules for scalars) and by
any YAML parser, and one and the same table always gives one and the same text.
"""

from collections.abc import Iterable, Mapping
import re
import textwrap
from typing import Any
import unicodedata

from drive_can_bridge.configuration.profile_check import RAW_NAME, RESERVED
from drive_can_bridge.configuration.yaml_nodes import read_scalar

WIDTH = 99
#: keys of an entry, in the order in which they are written; each group begins a line
_GROUPS = (
    ('number', 'index', 'subindex', 'type', 'scale', 'offset', 'unit', 'access', 'storage',
     'minimum', 'maximum', 'neutral', 'neutral_from', 'limit', 'arming_tolerance', 'word_order',
     'protected'),
    ('description',), ('bits',), ('values',), ('source', 'verified', 'open'))
_ROOM = WIDTH - 6
#: keeps name and value of a bit on one line
_TIED = ':\N{NO-BREAK SPACE}'
_UNQUOTED = re.compile(r'[A-Za-z](?:[A-Za-z0-9_./() %-]*[A-Za-z0-9_/)%])?', re.ASCII)
#: plain words that some YAML parser takes for something else than text
YAML_WORDS = frozenset('null true false yes no on off y n nan inf infinity'.split())
LENGTH_MAX = 60

#: spelling in the profile, then others, without case and spaces
_UNITS = """
rpm r/min rev/min 1/min min-1 min^-1 min⁻¹ u/min umin upm umdr/min umdr./min giri/min giri/minuto
rpm tr/min
rad/s rad/sec
deg/s °/s grad/s gradi/s
deg ° grad gradi degree degrees
rev umdr umdr. umdrehungen umdrehung giri turns revolutions
degC °c ℃ grdc gradc gradcelsius celsius
% percent prozent percento
Hz hertz
s sec sec. sek sek. seconds sekunden secondi
ms msec millisekunden
us µs μs
min min. minuten minutes minuti
h std std. hours stunden ore
V volt
A ampere amp
W watt
ohm ω
inc ink inkr inkremente increments counts
rpm/s 1/min/s
"""
#: those that need no other spelling
_PLAIN = 'rad kHz mV mA kW kWh kVA kvar kg mm m m/s mm/s bar Hz/s V/Hz'
_SPELLINGS = {other.lower(): words.split()[0] for words in (
    *_UNITS.strip().splitlines(), *_PLAIN.split()) for other in words.split()}
#: where upper and lower case matter: newton metres are no nanometres
_EXACT = {'Nm': 'N m', 'N·m': 'N m', 'N*m': 'N m', 'Ω': 'ohm', 'kΩ': 'kohm', 'mΩ': 'mohm',
          **{each: each for each in ('N m', 'N', 'kN', 'K', 'F', 'H', 'mH')}}
_NO_UNIT = frozenset('- -- – — / 1 n/a na none ohne keine nessuna [-] (-)'.split()) | {''}
#: a unit at the end: in brackets, behind a comma or "in", or a sign
_ENDS = (re.compile(r'\s*[\[(]([^\[\]()]{1,20})[\])]\s*$'),
         re.compile(r'(?:,|\s/|\bin)\s*([^\s,]{1,12})\s*$', re.IGNORECASE),
         re.compile(r'\s*(°\s?C|℃|°|%)\s*$'))
_LETTERS = str.maketrans({
    'ä': 'ae', 'ö': 'oe', 'ü': 'ue', 'Ä': 'Ae', 'Ö': 'Oe', 'Ü': 'Ue', 'ß': 'ss', 'ẞ': 'SS',
    'æ': 'ae', 'Æ': 'Ae', 'ø': 'oe', 'Ø': 'Oe', 'å': 'aa', 'Å': 'Aa', 'œ': 'oe', 'Œ': 'Oe',
    'ł': 'l', 'Ł': 'L', 'ı': 'i', 'µ': 'micro', '²': '2', '³': '3',
    **dict.fromkeys("'’`´", '')})
_BOUNDARY = re.compile(r'(?<=[a-z0-9])(?=[A-Z][a-z])|(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])')


def one_line(text: str) -> str:
    """Return a text without line breaks, control characters and superfluous space."""
    return ' '.join(''.join(each if each.isprintable() else ' ' for each in text).split())


def scalar(value: Any) -> str:
    """Write a scalar as YAML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        if value.is_integer() and abs(value) < 1e15:
            return str(int(value))
        mantissa, mark, exponent = repr(value).partition('e')
        # YAML 1.1 wants a point in front of an exponent
        return repr(value) if not mark or '.' in mantissa else f'{mantissa}.0e{exponent}'
    if isinstance(value, int):
        return str(value)
    text = one_line(str(value))
    plain = (_UNQUOTED.fullmatch(text) and text.lower() not in YAML_WORDS
             and read_scalar(text) == text)
    return text if plain else "'" + text.replace("'", "''") + "'"


def entry_lines(name: str, entry: Mapping[str, Any], remarks: Iterable[str] = ()) -> list[str]:
    """
    Write an entry of the table: facts, description, bits, trust, a line or more each.

    :param remarks: written above it as comments.
    """
    texts = {key: '{' + ', '.join(f'{each}: {scalar(what)}' for each, what in value.items()) + '}'
             if isinstance(value, Mapping) else scalar(value) for key, value in entry.items()}
    if 'index' in entry:    # as CANopen writes them
        texts['index'] = f'0x{entry["index"]:04X}'
        texts['subindex'] = f'0x{entry.get("subindex", 0):02X}'
    body = [line for keys in _GROUPS
            for line in _packed([f'{key}: {texts[key]},' for key in keys if key in texts])]
    body = '\n     '.join(body).removesuffix(',').split('\n')
    head = [line for remark in remarks for line in comment(remark, indent='  ')]
    if len(body) == 1:
        return [*head, f'  {name}: {{{body[0]}}}']
    return [*head, f'  {name}:', f'    {{{body[0]}', *body[1:-1], f'{body[-1]}}}']


def _packed(parts: list[str]) -> list[str]:
    """Fill lines with parts; a part that is longer than a line is broken at a space."""
    lines: list[str] = []
    for part in parts:
        if lines and len(lines[-1]) + 1 + len(part) <= _ROOM:
            lines[-1] += f' {part}'
        else:  # what YAML folds back into a space
            pairs = part.replace(': ', _TIED) if '{' in part else part
            lines += [line.replace(_TIED, ': ') for line in textwrap.wrap(
                pairs, _ROOM, subsequent_indent='  ', break_long_words=False,
                break_on_hyphens=False)]
    return lines


def comment(text: str, indent: str = '') -> list[str]:
    """Write a text as comment lines."""
    return textwrap.wrap(one_line(text), WIDTH, initial_indent=f'{indent}# ',
                         subsequent_indent=f'{indent}# ', break_long_words=False,
                         break_on_hyphens=False) or [f'{indent}#']


def block(key: object, value: Any, indent: str = '') -> list[str]:
    """Write nested mappings as YAML, a line a value."""
    if not isinstance(value, Mapping):
        return [f'{indent}{key}: {scalar(value)}']
    lines = [line for name, each in value.items() for line in block(name, each, f'{indent}  ')]
    return [f'{indent}{key}:', *lines, *[''] * (not indent)]


def known_unit(text: str) -> str | None:
    """Return the profile's spelling of a unit; None: it is not known as one."""
    plain = one_line(text).strip('[]() ')
    return _EXACT.get(plain) or _SPELLINGS.get(plain.lower().replace(' ', ''))


def unit(text: str) -> str:
    """Return the unit of a cell as it goes into the profile; '' for none."""
    plain = one_line(text)
    if plain.lower() in _NO_UNIT:
        return ''
    return known_unit(plain) or plain.strip('[]() ')


def split_unit(text: str) -> tuple[str, str]:
    """
    Separate a text from the unit at its end.

    >>> split_unit('Ramp time [s]'), split_unit('Position (set 2)')
    (('Ramp time', 's'), ('Position (set 2)', ''))
    """
    for pattern in _ENDS:
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
    name = '_'.join(_words(split_unit(text)[0]))
    if len(name) > LENGTH_MAX:
        cut = name[:LENGTH_MAX + 1]
        name = cut.rpartition('_')[0] or cut[:LENGTH_MAX]
    if not name or not name[0].isalpha():
        name = '_'.join(filter(None, ('parameter', name or address)))
    if name in RESERVED | taken | YAML_WORDS or RAW_NAME.fullmatch(name):
        name += '_value'
    return name


def _words(text: str) -> list[str]:
    plain = ''
    for part in unicodedata.normalize('NFKD', unicodedata.normalize('NFC', text).translate(
            _LETTERS)):
        if part.isascii():
            plain += part
        elif unicodedata.category(part) != 'Mn':
            words = unicodedata.name(part, '').split()
            plain += f' {words[3].lower() if words[:1] == ["GREEK"] and len(words) > 3 else ""} '
    return re.findall('[a-z0-9]+', _BOUNDARY.sub(' ', plain).lower())


def unique(names: Iterable[tuple[str, str]]) -> list[str]:
    """
    Make names unique.

    :param names: (name, address), lowest address first; addresses are digits and ``_``.
    """
    made: dict[str, None] = {}
    for name, address in names:
        # addresses are unique per number and sub-index; a name may end like one by chance
        while name in made:
            name = f'{name}_{address or "2"}'
        made[name] = None
    return list(made)
