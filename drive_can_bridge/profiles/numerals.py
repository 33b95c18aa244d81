# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Numbers as manuals write them: decimal commas, grouped thousands, hexadecimal in many spellings.

``1.000`` is one or a thousand, depending on who wrote it. What settles that is the rest of the
same table: a single ``0,5`` makes the comma the decimal sign (:func:`decimal_sign`). Where nothing
does, such a number is refused rather than guessed.
"""

from collections.abc import Iterable
from enum import Enum
import re
from typing import NamedTuple

from drive_can_bridge.profiles.errors import Unusable
from drive_can_bridge.profiles.units import known_unit

_HEXADECIMAL = re.compile(
    r"(?:0x|16#|\$|&h|h')([0-9a-f]{1,8})'?|([0-9a-f]{1,8})\s*(?:h|hex)", re.IGNORECASE)
_DIGITS = re.compile(r'[0-9a-f]{1,8}', re.IGNORECASE)
_INTEGER = re.compile(r'[0-9]{1,10}')
#: a number and what follows it, a unit perhaps
_LEADING = re.compile(r'([+-]?\s?[0-9.,]*[0-9](?:[eE][+-]?[0-9]{1,3})?)(.*)', re.DOTALL)
_PLAIN = re.compile(r'[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?')
_GROUPED = re.compile(r'[1-9][0-9]{0,2}(?:[.,][0-9]{3})+')
_SEPARATOR = re.compile(
    r'\s*(?:\.\.\.?|…|÷|~|\bbis\b|\bto\b|\ba\b|\bfino a\b|\s-\s|–|—)\s*', re.IGNORECASE)
_DASHES = str.maketrans(dict.fromkeys('\u2212\u2010\u2011\uff0d', '-'))
_SPACES = re.compile("(?<=[0-9])[\\s'’](?=[0-9]{3}(?![0-9]))")


class DecimalSign(Enum):
    """What separates the fraction in the numbers of a table."""

    POINT = '.'
    COMMA = ','
    UNKNOWN = '?'


class Measure(NamedTuple):
    """A number with the unit that stands behind it, '' for none."""

    number: float
    unit: str


def _tidy(text: str) -> str:
    text = ' '.join(text.translate(_DASHES).split())
    if text[:1] in '–—' and text[1:2].isdigit():
        text = f'-{text[1:]}'
    return _SPACES.sub('', text)


def decimal_sign(texts: Iterable[str]) -> DecimalSign:
    """Find out what separates the fraction, from all cells of a table that may hold numbers."""
    found: set[DecimalSign] = set()
    for text in texts:
        for token in re.findall(r'[0-9]+(?:[.,][0-9]+)+', _tidy(text)):
            if '..' not in token:
                found |= _evidence(token)
    return found.pop() if len(found) == 1 else DecimalSign.UNKNOWN


def _evidence(token: str) -> set[DecimalSign]:
    signs = re.sub('[0-9]', '', token)
    if len(set(signs)) == 2:
        return {DecimalSign(signs[-1])}
    if len(signs) > 1:  # 1.234.567, or a version number
        other = {',': DecimalSign.POINT, '.': DecimalSign.COMMA}[signs[0]]
        return {other} if _GROUPED.fullmatch(token) else set()
    return set() if _GROUPED.fullmatch(token) else {DecimalSign(signs)}


def integer(text: str, *, hexadecimal: bool = False) -> int:
    """
    Read a whole number without sign.

    :param hexadecimal: digits without a mark are hexadecimal.
    :raises Unusable: it is none.
    """
    tidy = _tidy(text)
    match = _HEXADECIMAL.fullmatch(tidy)
    if match is not None:
        return int(match[1] or match[2], 16)
    if hexadecimal and _DIGITS.fullmatch(tidy):
        return int(tidy, 16)
    # what a spreadsheet makes of whole numbers
    plain = re.sub(r'[.,]0+$', '', tidy)
    if _INTEGER.fullmatch(plain) and plain.isascii():
        return int(plain)
    raise Unusable(f"'{text}' is no number")


def is_hexadecimal_only(text: str) -> bool:
    """Tell whether digits can only be hexadecimal: ``1F``, but neither ``10`` nor ``10h``."""
    tidy = _tidy(text)
    return bool(_DIGITS.fullmatch(tidy)) and not tidy.isdecimal()


def measure(text: str, sign: DecimalSign) -> Measure:
    """
    Read a number with its unit: ``0,01 s``, ``1 000``, ``0x3FF``, ``-5``.

    :raises Unusable: there is no number, or it may be one of two.
    """
    tidy = _tidy(text)
    match = _HEXADECIMAL.fullmatch(tidy.lstrip('+-'))
    if match is not None:
        number = int(match[1] or match[2], 16)
        return Measure(-number if tidy.startswith('-') else number, '')
    match = _LEADING.fullmatch(tidy)
    if match is None:
        raise Unusable(f"'{text}' is no number")
    return Measure(_number(match[1].replace(' ', ''), sign, text), match[2].strip())


def _number(token: str, sign: DecimalSign, text: str) -> float:
    body = re.split('[eE]', token)[0].lstrip('+-')
    signs = re.sub('[0-9]', '', body)
    if signs:
        grouped = _GROUPED.fullmatch(body)
        if len(set(signs)) == 2:
            whole, _, fraction = body.rpartition(signs[-1])
            fits = signs.count(signs[-1]) == 1 and _GROUPED.fullmatch(whole)
            plain = f'{re.sub("[.,]", "", whole)}.{fraction}' if fits else ''
        elif len(signs) > 1:
            plain = re.sub('[.,]', '', body) if grouped else ''
        elif not grouped or signs == sign.value:
            plain = body.replace(',', '.')
        elif sign is DecimalSign.UNKNOWN:
            small, large = body.replace(',', '.'), re.sub('[.,]', '', body)
            raise Unusable(f"'{text}' may be {float(small):g} or {large}: say which with "
                           '--decimal')
        else:
            plain = re.sub('[.,]', '', body)
        token = token.replace(body, plain) if plain else 'x'
    if not _PLAIN.fullmatch(token) or not token.isascii():
        raise Unusable(f"'{text}' is no number")
    number = float(token)
    if abs(number) > 1e15:
        raise Unusable(f"'{text}' is too large")
    return number


def interval(text: str, sign: DecimalSign) -> tuple[Measure, Measure]:
    """
    Read a range: ``0 … 100 %``, ``-10 bis +10``, ``0-50``.

    :raises Unusable: it is none.
    """
    tidy = _tidy(text)
    parts = _SEPARATOR.split(tidy.removeprefix('da '))
    if len(parts) != 2:
        match = re.fullmatch(r'([+-]?[0-9.,]+)-([+-]?[0-9.,]+[^0-9]*)', tidy)
        parts = [match[1], match[2]] if match else []
    if len(parts) != 2:
        raise Unusable(f"'{text}' is no range")
    return measure(parts[0], sign), measure(parts[1], sign)


def factor(text: str, sign: DecimalSign) -> Measure:
    """
    Read a scale: ``0,01 s``, ``1/10``, ``x 0.1``, ``10^-2``.

    :raises Unusable: it is none, or zero.
    """
    tidy = _tidy(text).lstrip('xX×*· ')
    if known_unit(tidy):
        return Measure(1.0, tidy)
    power = re.fullmatch(r'10\^?([+-][0-9]{1,2})(.*)|10\^([0-9]{1,2})(.*)', tidy)
    fraction = re.fullmatch(r'([0-9.,]+)\s?[/:]\s?([0-9.,]*[0-9])(.*)', tidy)
    if power is not None:
        exponent, rest = power[1] or power[3], power[2] or power[4] or ''
        found = Measure(float(f'1e{int(exponent)}'), rest.strip())
    elif fraction is not None:
        below = _number(fraction[2], sign, text)
        if not below:
            raise Unusable(f"'{text}' divides by zero")
        found = Measure(_number(fraction[1], sign, text) / below, fraction[3].strip())
    else:
        found = measure(tidy, sign)
    if not found.number:
        raise Unusable(f"'{text}' is no scale: 0")
    return found
