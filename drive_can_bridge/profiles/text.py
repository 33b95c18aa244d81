# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The text of a profile file.

What is written here is read alike by the bridge (which follows rcl's rules for scalars) and by
any YAML parser, and one and the same table always gives one and the same text.
"""

from collections.abc import Iterable, Mapping
import re
import textwrap
from typing import Any

from drive_can_bridge.configuration.scalars import read_scalar

WIDTH = 99
#: keys of an entry, in the order in which they are written; each group begins a line
GROUPS = (
    ('number', 'index', 'subindex', 'type', 'scale', 'offset', 'unit', 'access', 'storage',
     'minimum', 'maximum', 'neutral', 'neutral_from', 'limit', 'arming_tolerance', 'word_order',
     'protected'),
    ('description',),
    ('bits',),
    ('values',),
    ('source', 'verified', 'open'),
)
_ROOM = WIDTH - 6
#: keeps name and value of a bit on one line
_TIED = ':\N{NO-BREAK SPACE}'

_PLAIN = re.compile(r'[A-Za-z](?:[A-Za-z0-9_./() %-]*[A-Za-z0-9_/)%])?', re.ASCII)
#: plain words that some YAML parser takes for something else than text
YAML_WORDS = frozenset(('null', 'true', 'false', 'yes', 'no', 'on', 'off', 'y', 'n', 'nan', 'inf',
                    'infinity'))


def one_line(text: str) -> str:
    """Return a text without line breaks, control characters and superfluous space."""
    spaced = ''.join(each if each.isprintable() else ' ' for each in text)
    return ' '.join(spaced.split())


def scalar(value: Any, key: str = '', *, hexadecimal: bool = False) -> str:
    """
    Write a scalar as YAML.

    :param key: index, and the sub-index of an entry with index, are written as CANopen writes
        them.
    """
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, int):
        if hexadecimal and key in ('index', 'subindex'):
            return f'0x{value:04X}' if key == 'index' else f'0x{value:02X}'
        return str(value)
    if isinstance(value, float):
        return _number(value)
    text = one_line(str(value))
    plain = _PLAIN.fullmatch(text) and text.lower() not in YAML_WORDS and read_scalar(text) == text
    return text if plain else "'" + text.replace("'", "''") + "'"


def _number(value: float) -> str:
    if value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    text = repr(value)
    mantissa, mark, exponent = text.partition('e')
    # YAML 1.1 wants a point in front of an exponent
    return text if not mark or '.' in mantissa else f'{mantissa}.0e{exponent}'


def entry_lines(name: str, entry: Mapping[str, Any], remarks: Iterable[str] = ()) -> list[str]:
    """
    Write an entry of the table: facts, description, bits, trust, a line or more each.

    :param remarks: written above it as comments.
    """
    lines = [line for remark in remarks for line in comment(remark, indent='  ')]
    hexadecimal = 'index' in entry
    body: list[str] = []
    for keys in GROUPS:
        parts = [f'{key}: {_value(entry[key], key, hexadecimal=hexadecimal)},'
                 for key in keys if key in entry]
        body += _packed(parts)
    body[-1] = body[-1].removesuffix(',')
    return [*lines, f'  {name}:', f'    {{{body[0]}', *(f'     {line}' for line in body[1:-1]),
            f'     {body[-1]}}}'] if len(body) > 1 else [*lines, f'  {name}: {{{body[0]}}}']


def _value(value: Any, key: str, *, hexadecimal: bool) -> str:
    if isinstance(value, Mapping):
        return '{' + ', '.join(f'{name}: {scalar(each)}' for name, each in value.items()) + '}'
    return scalar(value, key, hexadecimal=hexadecimal)


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
