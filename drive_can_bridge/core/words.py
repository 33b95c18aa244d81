# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Values, types and misspelt names in words, as messages to users have them."""

from array import array
from collections.abc import Iterable
import difflib
import math
from typing import Any

_TEXT_MAX = 40


def value_text(value: float) -> str:
    """Write a value as one would publish it, without binary noise: ``3000``, ``0.1``, ``true``."""
    return str(value).lower() if isinstance(value, bool) else f'{value:.12g}'


def show(value: Any) -> str:
    """Write a value as a user would recognise it: ``'abc'``, ``true``, ``8``, ``8.0``."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, str):
        text = value if len(value) <= _TEXT_MAX else value[:_TEXT_MAX - 1] + '…'
        return f"'{text}'"
    if isinstance(value, float):
        text = value_text(value)
        return f'{text}.0' if math.isfinite(value) and text.lstrip('-').isdigit() else text
    if isinstance(value, int):
        return str(value)
    return describe_type(value)


def seems_limit(*texts: str) -> bool:
    """Tell whether names and descriptions speak of something that bounds."""
    return any(word in text.lower() for text in texts for word in ('limit', 'max'))


def describe_type(value: Any) -> str:
    """Name the type of a value in words."""
    if isinstance(value, bool):
        return 'a bool'
    if isinstance(value, str):
        return 'a string'
    if isinstance(value, int):
        return 'an integer'
    if isinstance(value, float):
        return 'a number'
    if isinstance(value, dict):
        return 'a mapping'
    if isinstance(value, (list, tuple, array)):     # which is how rclpy gives numbers
        return 'a list' if value else 'an empty list'
    if value is None:
        return 'no value'
    return f'a {type(value).__name__}'


def nearest(word: str, known: Iterable[str], *, cutoff: float = 0.6) -> str | None:
    """Return the known word that looks most like ``word``, or None."""
    matches = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return matches[0] if matches else None


def counted(number: int, one: str, many: str = '') -> str:
    """Return a number of things; without ``many`` an s makes it the plural."""
    return f'{number} {one if number == 1 else many or one + "s"}'
