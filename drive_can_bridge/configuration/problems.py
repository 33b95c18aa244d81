# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Problems, and where they are.

A :class:`Tree` is a piece of configuration with the place it came from: a section of a parameter
file, a profile, or the overrides of a node (which have no file). All checks record in trees what
they find, so that the same check names ``FILE:LINE: key.path`` or ``key.path``.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Union

from drive_can_bridge.core import complaints
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.text import printable

Path = tuple[Union[str, int], ...]

#: characters of a message, which names what may be many
MESSAGE_MAX = 2000
#: lines that a user may read; a file of 4 MiB may have a million mistakes
PROBLEMS_MAX = 1000


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
    message: Sentence

    def __str__(self) -> str:
        """Return the line that users see; always one line, whatever a key or value contains."""
        place = f'{printable(self.file, None)}:{self.line}: ' if self.file else ''
        key = f'{printable(self.key)}: ' if self.key else ''
        return f'{place}{key}{printable(self.message, MESSAGE_MAX)}'

    @property
    def text(self) -> Sentence:
        """The line that users see, with the code and the fields of what is wrong, and where."""
        return Sentence(str(self), self.message.code, {
            **self.message.fields, 'file': self.file, 'line': self.line, 'key': self.key})


@dataclass(frozen=True)
class Tree:
    """
    Nested mappings, lists and scalars with their places, and the problems found in them.

    :param lines: line of every key and list item, by path.
    :param damaged: paths whose value is missing or useless because of a problem noted already.
    :param incomplete: paths of mappings that had an unreadable key: what seems to be
        missing in them may have been meant by it.
    :param problems: what is wrong, in the order in which it was found.
    :param warnings: what is allowed but suspicious, likewise.
    """

    data: dict[str, Any]
    file: str = ''
    lines: dict[Path, int] = field(default_factory=dict)
    damaged: set[Path] = field(default_factory=set)
    incomplete: set[Path] = field(default_factory=set)
    problems: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)
    _wrong: set[Path] = field(default_factory=set)

    def line(self, path: Path) -> int:
        """Return the line of the deepest known part of a path."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)

    def wrong(self, path: Path, message: Sentence, *, at: Path | None = None) -> None:
        """
        Record a problem with the value at ``path``.

        :param at: path of the line, where it is another one (an item of a list).
        """
        self._wrong.add(path)
        self.problems.append(self.problem(path, message, at=at))

    def suspicious(self, path: Path, message: Sentence, *, at: Path | None = None) -> None:
        """Record that the value at ``path`` is allowed, but probably not what is meant."""
        self.warnings.append(self.problem(path, message, at=at))

    def problem(self, path: Path, message: Sentence, *, at: Path | None = None) -> Problem:
        """Return a problem with the value at ``path`` without recording it."""
        key = '.'.join(part for part in path if isinstance(part, str))
        return Problem(self.file, self.line(path if at is None else at), key, message)

    def cut(self, path: Path) -> None:
        """Remove a value that is not to be used."""
        self.damaged.add(path)
        parent: Any = self.data
        for part in path[:-1]:
            parent = parent.get(part) if isinstance(parent, dict) else None
        if isinstance(parent, dict) and path:
            parent.pop(path[-1], None)

    def is_damaged(self, path: Path) -> bool:
        """Return whether the value at ``path``, or what contains it, was found useless."""
        return any(path[:length] in self.damaged for length in range(len(path) + 1))

    def is_sound(self, path: Path) -> bool:
        """Return whether nothing at ``path`` or below it was found wrong or useless."""
        size = len(path)
        return not any(place[:size] == path for found in (self.damaged, self._wrong)
                       for place in found)


def report(problems: Iterable[Problem]) -> list[Sentence]:
    """
    Return problems as lines: without duplicates, by file and in its order.

    Of more than :data:`PROBLEMS_MAX` the last line says how many.
    """
    unique = list(dict.fromkeys(problems))
    order = {file: rank for rank, file in enumerate(dict.fromkeys(p.file for p in unique))}
    unique.sort(key=lambda problem: (order[problem.file], problem.line))
    lines = [problem.text for problem in unique[:PROBLEMS_MAX]]
    if len(unique) > PROBLEMS_MAX:
        lines.append(complaints.more(count=len(unique) - PROBLEMS_MAX))
    return lines
