# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Problems, and where they are.

A :class:`Tree` is a piece of configuration together with the place it came from: a section of a
parameter file, a profile, or the parameter overrides of a node (which have no file). All checks
work on trees, so that one and the same check names ``FILE:LINE: key.path`` for a file and
``key.path`` for a node.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
import difflib
import math
from typing import Any, NamedTuple, Union

Path = tuple[Union[str, int], ...]

_TEXT_MAX = 40
_WORDS_MAX = 30


def _printable(text: str) -> str:
    """Keep a problem on its line, whatever a key or value contains."""
    return ''.join(character if character.isprintable() else '?' for character in text)


class Problem(NamedTuple):
    """
    Something wrong at one place.

    :param file: '' when the value did not come from a file.
    :param line: counted from 1.
    :param key: key path, joined with dots.
    :param message: what is wrong, what is allowed.
    """

    file: str
    line: int
    key: str
    message: str

    def __str__(self) -> str:
        """Write the line that users see."""
        text = f'{self.key}: {self.message}' if self.key else self.message
        return _printable(f'{self.file}:{self.line}: {text}' if self.file else text)


@dataclass(frozen=True)
class Tree:
    """
    Nested mappings, lists and scalars with their places.

    :param lines: line of every key and list item, by path.
    :param damaged: paths whose value is missing or useless because of a problem that has been
        noted already. What depends on them is not worth another complaint.
    :param incomplete: paths of mappings that had a key nobody could read: what seems to be
        missing in them may have been meant by it.
    """

    data: dict[str, Any]
    file: str = ''
    lines: dict[Path, int] = field(default_factory=dict)
    damaged: set[Path] = field(default_factory=set)
    incomplete: set[Path] = field(default_factory=set)

    def line(self, path: Path) -> int:
        """Return the line of the deepest known part of a path."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)

    def problem(self, path: Path, message: str, *, at: Path | None = None) -> Problem:
        """
        Describe a problem with the value at ``path``.

        :param at: path of the line, where it is another one (an item of a list).
        """
        key = '.'.join(part for part in path if isinstance(part, str))
        return Problem(self.file, self.line(path if at is None else at), key, message)

    def is_damaged(self, path: Path) -> bool:
        """Tell whether the value at ``path``, or what it stands in, was found useless."""
        return any(path[:length] in self.damaged for length in range(len(path) + 1))


def report(problems: Iterable[Problem]) -> list[str]:
    """Write problems as lines: no line twice, those of one file together and in its order."""
    unique = list(dict.fromkeys(problems))
    order = {file: rank for rank, file in enumerate(dict.fromkeys(p.file for p in unique))}
    unique.sort(key=lambda problem: (order[problem.file], problem.line))
    return [str(problem) for problem in unique]


def show(value: Any) -> str:
    """Write a value as a user would recognise it: ``'abc'``, ``true``, ``8``."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, str):
        text = value if len(value) <= _TEXT_MAX else value[:_TEXT_MAX - 1] + '…'
        return f"'{text}'"
    if isinstance(value, float):
        text = f'{value:.12g}'
        return f'{text}.0' if math.isfinite(value) and text.lstrip('-').isdigit() else text
    if isinstance(value, int):
        return str(value)
    return describe_type(value)


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
    if isinstance(value, (list, tuple)):
        return 'a list' if value else 'an empty list'
    if value is None:
        return 'no value'
    return f'a {type(value).__name__}'


def nearest(word: str, known: Iterable[str], *, cutoff: float = 0.6) -> str | None:
    """Return the known word that looks most like ``word``, or None."""
    matches = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return matches[0] if matches else None


def hint(word: str, known: Iterable[str]) -> str:
    """Write the nearest known word as a remark in brackets, or nothing."""
    match = nearest(word, known)
    return f" (did you mean '{match}'?)" if match else ''


def suggestion(word: str, known: Iterable[str]) -> str:
    """Write the end of a sentence on an unknown word: the nearest known one, or all."""
    words = list(known)
    match = nearest(word, words)
    if match is not None:
        return f"did you mean '{match}'?"
    if not words:
        return 'nothing is allowed here'
    more = ' …' if len(words) > _WORDS_MAX else ''
    return f'allowed: {", ".join(words[:_WORDS_MAX])}{more}'
