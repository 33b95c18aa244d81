# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How rcl reads a scalar of a parameter file.

rcl compares a scalar with a list of words, then tries C's ``strtoll`` with base 0, then
``strtod``; what is left is a string. So ``y`` is a bool, ``010`` is 8, ``08`` is 8.0, ``1_000``,
``null`` and ``1e400`` are strings, ``inf`` is a number. Quotes or the tag ``!!str`` make a string;
every other tag is ignored. A test compares this with the real parser.
"""

import math
import re
import sys
from typing import Union

Scalar = Union[bool, int, float, str]

STRING_TAG = 'tag:yaml.org,2002:str'

_WORDS: dict[str, bool] = {
    **dict.fromkeys(('Y', 'y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'),
                    True),
    **dict.fromkeys(('N', 'n', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'),
                    False),
}

#: YAML's own spellings, which strtod does not know
_YAML_FLOATS: dict[str, float] = {
    **dict.fromkeys(('.nan', '.NaN', '.NAN'), math.nan),
    **dict.fromkeys(('.inf', '.Inf', '.INF', '+.inf', '+.Inf', '+.INF'), math.inf),
    **dict.fromkeys(('-.inf', '-.Inf', '-.INF'), -math.inf),
}

# What C's isspace skips in front of a number.
_SPACE = r'[ \t\n\v\f\r]*'
_INTEGER = re.compile(
    _SPACE + r'([+-]?)(?:0[xX]([0-9a-fA-F]+)|0([0-7]*)|([1-9][0-9]*))', re.ASCII)
_DECIMAL = re.compile(
    _SPACE + r'[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?', re.ASCII)
_HEXADECIMAL = re.compile(
    _SPACE + r'[+-]?0[xX](?:[0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)(?:[pP][+-]?[0-9]+)?',
    re.ASCII)
_SPECIAL = re.compile(_SPACE + r'([+-]?)(inf|infinity|nan(?:\([0-9a-z_]*\))?)',
                      re.ASCII | re.IGNORECASE)

_INT64_MIN, _INT64_MAX = -(1 << 63), (1 << 63) - 1
# Longer digit strings overflow int64 anyway; this only spares the conversion.
_DIGITS_MAX = 64


def read_scalar(text: str, *, quoted: bool = False, tag: str | None = None) -> Scalar:
    """
    Return the value as which rcl reads a scalar.

    :param text: the scalar after YAML's own unescaping and folding.
    :param quoted: single or double quoted; block scalars count as plain.
    :param tag: resolved tag, or None.
    """
    if quoted or tag == STRING_TAG:
        return text
    if text in _WORDS:
        return _WORDS[text]
    for read in (_integer, _float):
        number = read(text)
        if number is not None:
            return number
    return text


def _integer(text: str) -> int | None:
    """Return ``strtoll(text, &end, 0)``, if it reads the whole text without overflow."""
    match = _INTEGER.fullmatch(text)
    if match is None or len(text.lstrip(' \t\n\v\f\r+-0')) > _DIGITS_MAX:
        return None
    sign, hexadecimal, octal, decimal = match.groups()
    if hexadecimal is not None:
        value = int(hexadecimal, 16)
    elif decimal is not None:
        value = int(decimal)
    else:
        value = int(octal or '0', 8)
    if sign == '-':
        value = -value
    return value if _INT64_MIN <= value <= _INT64_MAX else None


def _float(text: str) -> float | None:
    """Return the result of ``strtod``, if it reads the whole text without over- or underflow."""
    if text in _YAML_FLOATS:
        return _YAML_FLOATS[text]
    special = _SPECIAL.fullmatch(text)
    if special is not None:
        value = math.inf if special.group(2)[0] in 'iI' else math.nan
        return -value if special.group(1) == '-' else value
    stripped = text.lstrip(' \t\n\v\f\r')
    if _DECIMAL.fullmatch(text):
        value = float(stripped)
        zero = not re.split('[eE]', stripped)[0].strip('+-.0')
        smallest = sys.float_info.min
    elif _HEXADECIMAL.fullmatch(text):
        try:
            value = float.fromhex(stripped)
        except OverflowError:
            return None
        zero = not re.split('[pP]', stripped)[0].strip('+-.0xX')
        smallest = math.ulp(0.0)
    else:
        return None
    # strtod reports a range error for what overflows, and for what loses digits near zero, which
    # binary fractions need not do.
    if math.isinf(value) or (not zero and abs(value) < smallest):
        return None
    return value
