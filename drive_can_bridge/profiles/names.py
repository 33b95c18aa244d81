# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Names for parameters, made from free text by the rules of docs/profiles.md.

Units that a joint converts get the spelling of :mod:`drive_can_bridge.core.configuration`, a few
others the usual one; every other unit stays as it was written. What is written is read alike by
rcl and by any YAML parser, and the same table always gives the same text.

Numbers as manuals write them: decimal commas, grouped thousands, hexadecimal. ``1.000`` is one or
a thousand. The rest of the same table settles that: a single ``0,5`` makes the comma the decimal
sign (:func:`decimal_sign`). Else such a number is refused rather than guessed.
"""

from collections.abc import Iterable, Mapping
import re
import textwrap
from typing import Any, NamedTuple
import unicodedata

from drive_can_bridge.configuration.profile_check import RAW_NAME, RESERVED
from drive_can_bridge.configuration.scalars import read_scalar
from drive_can_bridge.core import command_sentences

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
#: scale and unit in brackets; and units that are something else as well
_STEP = re.compile(r'(?:\s*(?=\[)|\s+(?=\())([\[(])\s*([^\[\]()]{1,20})[\])]\s*$')
_OTHER_WORDS = ('min', 'rev', 'inc', 'sec')
_LETTERS = str.maketrans({
    'ä': 'ae', 'ö': 'oe', 'ü': 'ue', 'Ä': 'Ae', 'Ö': 'Oe', 'Ü': 'Ue', 'ß': 'ss', 'ẞ': 'SS',
    'æ': 'ae', 'Æ': 'Ae', 'ø': 'oe', 'Ø': 'Oe', 'å': 'aa', 'Å': 'Aa', 'œ': 'oe', 'Œ': 'Oe',
    'ł': 'l', 'Ł': 'L', 'ı': 'i', 'µ': 'micro', '²': '2', '³': '3',
    **dict.fromkeys("'’`´", '')})
_BOUNDARY = re.compile(r'(?<=[a-z0-9])(?=[A-Z][a-z])|(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])')


class Unusable(ValueError):
    """A cell or key has no usable value; the text says why."""


def one_line(text: str) -> str:
    """Return a text without line breaks, control characters and superfluous space."""
    if not text.isprintable():
        text = ''.join(each if each.isprintable() else ' ' for each in text)
    return ' '.join(text.split())


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
        elif len(part) <= _ROOM:
            lines.append(part)
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


def split_step(text: str) -> tuple[str, float, str]:
    """
    Separate a text from what a step is worth in brackets at its end: ``[0.1 Hz]``, ``(ms)``.

    Round brackets hold other things, too (``Phase (W)``, ``Speed (min)``, ``Overload (60 s)``):
    what may be one of them is none.

    :return: the text, scale, unit; 1 and '' where there is none.

    >>> split_step('Ramp [0.1 s]'), split_step('Phase (W)')
    (('Ramp', 0.1, 's'), ('Phase (W)', 1.0, ''))
    """
    match = _STEP.search(text)
    if match is None or not text[:match.start()].strip():
        return text, 1.0, ''
    try:
        number, behind = factor(match[2], '.')
    except Unusable:
        return text, 1.0, ''
    found = known_unit(behind) or ''
    whole = number <= 1.0 or f'{number:e}'.startswith('1.000000e')
    plain = match[1] == '[' or number < 1.0 or number == 1.0 and (
        len(behind) > 1 or behind in 's%\N{DEGREE SIGN}') and behind.lower() not in _OTHER_WORDS
    return (text[:match.start()].strip(), number, found) if (
        found and 1e-9 <= number <= 1e4 and whole and plain) else (text, 1.0, '')


def name_of(text: str, address: str = '', taken: frozenset[str] = frozenset()) -> str:
    """
    Return the name for a text.

    :param address: digits and ``_``, for texts of which nothing is left.
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


# -- numbers --------------------------------------------------------------------------------------

_HEXADECIMAL = re.compile(
    r"([+-]?)(?:(?:0x|16#|\$|&h|h')([0-9a-f]{1,8})'?|([0-9a-f]{1,8}) ?(?:h|hex))", re.IGNORECASE)
_DIGITS = re.compile(r'[0-9a-f]{1,8}', re.IGNORECASE)
#: sign, digits, exponent, and what follows them: a unit perhaps
_NUMBER = re.compile(r'([+-]? ?)([0-9.,]*[0-9])((?:[eE][+-]?[0-9]{1,3})?)(.*)', re.DOTALL)
_GROUPED = re.compile(r'[1-9][0-9]{0,2}(?:[.,][0-9]{3})+')
_BETWEEN = re.compile(
    r'\s*(?:\.\.\.?|…|÷|~|\bbis\b|\bto\b|\ba\b|\s-\s|–|—|(?<=[0-9])-(?=[-+0-9]))\s*',
    re.IGNORECASE)
_DASHES = str.maketrans(dict.fromkeys('\u2212\u2010\u2011\uff0d', '-'))
_SPACES = re.compile("(?<=[0-9])[\\s'’](?=[0-9]{3}(?![0-9]))")
_OTHER = {',': '.', '.': ','}


class Measure(NamedTuple):
    """A number with the unit that stands behind it, '' for none."""

    number: float
    unit: str


def _tidy(text: str) -> str:
    text = ' '.join(text.translate(_DASHES).split())
    return _SPACES.sub('', re.sub('^[–—](?=[0-9])', '-', text))


def rounded(value: float) -> float:
    """
    Take the binary noise from a product: 0.1, not 0.1000000000000002.

    :raises Unusable: no profile can hold it.
    """
    if value and not 1e-15 <= abs(value) <= 1e15:    # nan, too
        raise Unusable(f'{value:g} is too {"small" if abs(value) < 1 else "large"}')
    return float(f'{value:.12g}')


def decimal_sign(texts: Iterable[str]) -> str:
    """Return what separates the fraction, by all cells that may hold numbers; '': unknown."""
    found = {_sign_of(token) for text in texts
             for token in re.findall(r'[0-9]+(?:[.,][0-9]+)+', _tidy(text))} - {''}
    return found.pop() if len(found) == 1 else ''


def _sign_of(digits: str) -> str:
    """Return the decimal sign that a number must have been written with; '': it may be either."""
    signs = re.sub('[0-9]', '', digits)
    if len(set(signs)) == 2:
        return signs[-1]
    if _GROUPED.fullmatch(digits):
        return _OTHER[signs[0]] if len(signs) > 1 else ''
    return signs if len(signs) == 1 else ''     # 1.2.3 is no number


def _number(digits: str, sign: str, text: str) -> float:
    own = _sign_of(digits) or sign
    if not own and len(re.findall('[.,]', digits)) == 1:
        raise Unusable(command_sentences.decimal_or_grouping(
            text=text, one=float(digits.replace(',', '.')), other=re.sub('[.,]', '', digits)))
    whole, _, fraction = digits.rpartition(own) if own and own in digits else (digits, '', '')
    if _GROUPED.fullmatch(whole):
        whole = whole.replace(_OTHER.get(own, ''), '')
    if re.search('[.,]', whole) or not digits.isascii():
        raise Unusable(command_sentences.no_number(text=text))
    return float(f'{whole or 0}.{fraction or 0}')


def integer(text: str, *, hexadecimal: bool = False) -> int:
    """
    Read a whole number without sign.

    :param hexadecimal: digits without a mark are hexadecimal.
    :raises Unusable: it is none.
    """
    tidy = _tidy(text)
    marked = _HEXADECIMAL.fullmatch(tidy)
    if marked is not None and not marked[1]:
        return int(marked[2] or marked[3], 16)
    if hexadecimal and _DIGITS.fullmatch(tidy):
        return int(tidy, 16)
    plain = re.sub(r'[.,]0+$', '', tidy)    # what a spreadsheet makes of whole numbers
    if re.fullmatch('[0-9]{1,10}', plain):
        return int(plain)
    raise Unusable(command_sentences.no_number(text=text))


def is_hexadecimal_only(text: str) -> bool:
    """Tell whether digits can only be hexadecimal: ``1F``, but neither ``10`` nor ``10h``."""
    return bool(_DIGITS.fullmatch(_tidy(text))) and not _tidy(text).isdecimal()


def measure(text: str, sign: str) -> Measure:
    """
    Read a number with its unit: ``0,01 s``, ``1 000``, ``0x3FF``, ``-5``.

    :param sign: what separates the fraction; '': only what is beyond doubt is read.
    :raises Unusable: there is no number, or it may be one of two.
    """
    tidy = _tidy(text)
    marked = _HEXADECIMAL.fullmatch(tidy)
    if marked is not None:
        return Measure(int(f'{marked[1]}{marked[2] or marked[3]}', 16), '')
    match = _NUMBER.fullmatch(tidy)
    if match is None:
        raise Unusable(command_sentences.no_number(text=text))
    number = _number(match[2], sign, text) * float(f'1{match[3]}')
    return Measure(rounded(-number if '-' in match[1] else number), match[4].strip())


def interval(text: str, sign: str) -> tuple[Measure, Measure]:
    """
    Read a range: ``0 … 100 %``, ``-10 bis +10``, ``0-50``.

    :raises Unusable: it is none.
    """
    parts = _BETWEEN.split(_tidy(text).removeprefix('da '))
    if len(parts) != 2:
        raise Unusable(command_sentences.no_range(text=text))
    return measure(parts[0], sign), measure(parts[1], sign)


def factor(text: str, sign: str) -> Measure:
    """
    Read a scale: ``0,01 s``, ``1/10``, ``x 0.1``, ``10^-2``.

    :raises Unusable: it is none, or zero.
    """
    tidy = re.sub(r'^10(?:\^|(?=-))', '1e', _tidy(text).lstrip('xX×*· '))
    if known_unit(tidy):
        return Measure(1.0, tidy)
    fraction = re.fullmatch(r'([0-9.,]+)\s?[/:]\s?([0-9.,]*[0-9])(.*)', tidy)
    if fraction is None:
        found = measure(tidy, sign)
    else:
        below = _number(fraction[2], sign, text)
        if not below:
            raise Unusable(command_sentences.divides_by_zero(text=text))
        found = Measure(_number(fraction[1], sign, text) / below, fraction[3].strip())
    if not found.number:
        raise Unusable(command_sentences.scale_zero(text=text))
    return found
