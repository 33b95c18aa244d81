# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""YAML text of profiles, read alike by rcl and by any YAML parser."""

from collections.abc import Iterable, Mapping
import re
import textwrap
from typing import Any

from drive_can_bridge.configuration.scalars import read_scalar

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
#: plain words that some YAML parser reads as something else than text
YAML_WORDS = frozenset('null true false yes no on off y n nan inf infinity'.split())


def one_line(text: str) -> str:
    """Return a text without line breaks, control characters and superfluous space."""
    if not text.isprintable():
        text = ''.join(each if each.isprintable() else ' ' for each in text)
    return ' '.join(text.split())


def scalar(value: Any) -> str:
    """Return a scalar as YAML."""
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
    Return the lines of an entry: facts, description, bits, trust, a line or more each.

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
    """Return parts in as few lines as possible; a part longer than a line is broken at a space."""
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
    """Return a text as comment lines."""
    return textwrap.wrap(one_line(text), WIDTH, initial_indent=f'{indent}# ',
                         subsequent_indent=f'{indent}# ', break_long_words=False,
                         break_on_hyphens=False) or [f'{indent}#']


def block(key: object, value: Any, indent: str = '') -> list[str]:
    """Return nested mappings as YAML, a line a value."""
    if not isinstance(value, Mapping):
        return [f'{indent}{key}: {scalar(value)}']
    lines = [line for name, each in value.items() for line in block(name, each, f'{indent}  ')]
    return [f'{indent}{key}:', *lines, *[''] * (not indent)]
