# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Text: foreign names made printable; values, types and misspelt names as users read them.

A name with a line feed in it forges a line of the log, one with escape sequences writes elsewhere
on the screen, and one of two megabytes fills both.
"""

from array import array
from collections.abc import Iterable, Sequence
import difflib
from functools import lru_cache
import math
import re
import shlex
from typing import Any

#: characters of what users or the bus bring
TEXT_MAX = 256
_CUT = '…'
#: of a value that a message shows
_SHOWN_MAX = 40
#: what ROS calls a node of which it knows a publisher, and not the name yet
UNNAMED_NODE = '_NODE_NAME_UNKNOWN_'


def printable(text: str, limit: int | None = TEXT_MAX) -> str:
    r"""
    Return a text with everything escaped that is not printable, cut to ``limit`` characters.

    :param limit: None: as long as it is.

    >>> printable('gain\n[ERROR] \x1b[2Jno\x9b1m')
    'gain\\n[ERROR] \\x1b[2Jno\\x9b1m'
    """
    if limit is not None and len(text) > limit:
        # what is cut off has not to be looked at: an escaped text is never shorter
        text = text[:limit] + _CUT
    if not text.isprintable():
        text = ''.join(each if each.isprintable() else
                       each.encode('unicode_escape', 'surrogatepass').decode('ascii')
                       for each in text)
    return text if limit is None or len(text) <= limit else text[:limit - 1] + _CUT


def column_lines(headings: Sequence[str], rows: Sequence[Sequence[str]], *,
                 numbers: Sequence[str] = ()) -> list[str]:
    """
    Return a table as lines of columns; nothing is cut.

    :param numbers: headings of columns that are aligned to the right.
    """
    widths = [max(map(len, column)) for column in zip(headings, *rows)]
    return ['  '.join(cell.rjust(width) if heading in numbers else cell.ljust(width)
                      for cell, width, heading in zip(row, widths, headings, strict=True)).rstrip()
            for row in (headings, *rows)]


def value_text(value: float) -> str:
    """Write a value as one would publish it, without binary noise: ``3000``, ``0.1``, ``true``."""
    return str(value).lower() if isinstance(value, bool) else f'{value:.12g}'


def show(value: Any) -> str:
    """Write a value as a user would recognise it: ``'abc'``, ``true``, ``8``, ``8.0``."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, str):
        text = value if len(value) <= _SHOWN_MAX else value[:_SHOWN_MAX - 1] + '…'
        return f"'{text}'"
    if isinstance(value, float):
        text = value_text(value)
        return f'{text}.0' if math.isfinite(value) and text.lstrip('-').isdigit() else text
    if isinstance(value, int):
        return str(value)
    return describe_type(value)


def seems_limit(*texts: str) -> bool:
    """Return whether names and descriptions mention something that bounds."""
    return any(word in text.lower() for text in texts for word in ('limit', 'max'))


#: types in words; a bool is an integer, too
_TYPES = ((bool, 'a bool'), (str, 'a string'), (int, 'an integer'), (float, 'a number'),
          (dict, 'a mapping'))


def describe_type(value: Any) -> str:
    """Return the type of a value in words."""
    for kind, words in _TYPES:
        if isinstance(value, kind):
            return words
    if isinstance(value, (list, tuple, array)):     # which is how rclpy gives numbers
        return 'a list' if value else 'an empty list'
    return 'no value' if value is None else f'a {type(value).__name__}'


def nearest(word: str, known: Iterable[str], *, cutoff: float = 0.6) -> str | None:
    """Return the known word that looks most like ``word``, or None."""
    matches = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return matches[0] if matches else None


#: characters of ``additional_constraints`` that are looked at
_CONSTRAINTS_MAX = 65536


def facts_in(constraints: str) -> dict[str, str]:
    """Return the ``key=value`` pairs of a descriptor; none of one that is not understood."""
    try:
        words = shlex.split(constraints[:_CONSTRAINTS_MAX])
    except ValueError:
        return {}
    pairs = (word.partition('=') for word in words)
    return {printable(key): printable(value, None if key in ('values', 'bits') else TEXT_MAX)
            for key, separator, value in pairs if separator}


_ROS_NAME = re.compile(r'(/[A-Za-z_][A-Za-z0-9_]*)+')


def is_ros_name(name: str) -> bool:
    """Return whether a full name may stand in front of a topic."""
    return len(name) <= TEXT_MAX and _ROS_NAME.fullmatch(name) is not None


def duration_text(seconds: float) -> str:
    """
    Return a duration as people write it.

    >>> duration_text(0.0182), duration_text(4295)
    ('0.018 s', '1.2 h')
    """
    for unit, name in ((3600.0, 'h'), (60.0, 'min')):
        if seconds >= unit:
            return f'{seconds / unit:.2g} {name}'
    return f'{seconds:.2g} s'


def counted(number: int, one: str, many: str = '') -> str:
    """Return a number of things; without ``many`` an s makes it the plural."""
    return f'{number} {one if number == 1 else many or one + "s"}'


_ENTRY = re.compile(r'(?:^| )(-?[0-9]+):((?:(?! -?[0-9]+:).)+)', re.ASCII)


def joined(names: Iterable[tuple[int, str]]) -> str:
    """Write names in one line."""
    return ' '.join(f'{number}:{name}' for number, name in names)


@lru_cache(maxsize=4096)
def taken_apart(text: str) -> tuple[tuple[int, str], ...]:
    """Read names from one line; what is none is left out."""
    return tuple((int(number), name) for number, name in _ENTRY.findall(text))
