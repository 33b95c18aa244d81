# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Numbers as manuals write them: decimal commas, grouped thousands, hexadecimal.

``1.000`` is one or a thousand. The rest of the same table decides that: a single ``0,5`` makes the
comma the decimal sign (:func:`decimal_sign`). Else such a number is refused rather than guessed.
"""

from collections.abc import Iterable
import re
from typing import NamedTuple

from drive_can_bridge.core import command_sentences
from drive_can_bridge.profiles.units import known_unit


class Unusable(ValueError):
    """A cell or key has no usable value; the text has the reason."""


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
#: scale and unit in brackets; and units that are something else as well
_STEP = re.compile(r'(?:\s*(?=\[)|\s+(?=\())([\[(])\s*([^\[\]()]{1,20})[\])]\s*$')
_OTHER_WORDS = ('min', 'rev', 'inc', 'sec')


class Measure(NamedTuple):
    """A number with the unit behind it, '' for none."""

    number: float
    unit: str


def _tidy(text: str) -> str:
    text = ' '.join(text.translate(_DASHES).split())
    return _SPACES.sub('', re.sub('^[–—](?=[0-9])', '-', text))


def rounded(value: float) -> float:
    """
    Return a product without binary noise: 0.1, not 0.1000000000000002.

    :raises Unusable: no profile can hold it.
    """
    if value and not 1e-15 <= abs(value) <= 1e15:    # nan, too
        raise Unusable(f'{value:g} is too {"small" if abs(value) < 1 else "large"}')
    return float(f'{value:.12g}')


def decimal_sign(texts: Iterable[str]) -> str:
    """Return the decimal sign by all cells that may hold numbers; '': unknown."""
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
    """Return whether digits can only be hexadecimal: ``1F``, but neither ``10`` nor ``10h``."""
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


def split_step(text: str) -> tuple[str, float, str]:
    """
    Separate a text from the step in brackets at its end: ``[0.1 Hz]``, ``(ms)``.

    Round brackets hold other things, too (``Phase (W)``, ``Speed (min)``, ``Overload (60 s)``):
    what may be one of them is no step.

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
