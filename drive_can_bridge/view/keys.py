# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the user has chosen to see, and what keys change about it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum


class Page(Enum):
    """What is shown."""

    DRIVES = 'drives'
    DRIVE = 'drive'
    LOG = 'log'
    HELP = 'help'


class Key(Enum):
    """A key that means something."""

    UP = 'up'
    DOWN = 'down'
    NEXT_PAGE = 'next page'
    PREVIOUS_PAGE = 'previous page'
    OPEN = 'open'
    BACK = 'back'
    LOG = 'log'
    HELP = 'help'
    QUIT = 'quit'


#: what terminals send
_SEQUENCES = {
    '\x1b[A': Key.UP, '\x1bOA': Key.UP, 'k': Key.UP, '\x1b[Z': Key.UP,
    '\x1b[B': Key.DOWN, '\x1bOB': Key.DOWN, 'j': Key.DOWN, '\t': Key.DOWN,
    '\x1b[6~': Key.NEXT_PAGE, ' ': Key.NEXT_PAGE, '\x1b[5~': Key.PREVIOUS_PAGE,
    'b': Key.PREVIOUS_PAGE, '\r': Key.OPEN, '\n': Key.OPEN, '\x1b[C': Key.OPEN,
    '\x1bOC': Key.OPEN, '\x1b': Key.BACK, '\x7f': Key.BACK, '\x08': Key.BACK,
    '\x1b[D': Key.BACK, '\x1bOD': Key.BACK, 'l': Key.LOG, '?': Key.HELP,
    'h': Key.HELP, 'q': Key.QUIT, 'Q': Key.QUIT,
}
_LONGEST = max(map(len, _SEQUENCES))

#: the last line: what may be pressed here
HINTS: dict[Page, tuple[tuple[str, str], ...]] = {
    Page.DRIVES: (('↑↓', 'drive'), ('⏎', 'in detail'), ('l', 'log'),
                  ('?', 'help'), ('q', 'quit')),
    Page.DRIVE: (('↑↓', 'drive'), ('l', 'log'), ('esc', 'back'),
                 ('?', 'help'), ('q', 'quit')),
    Page.LOG: (('space', 'older'), ('b', 'newer'), ('esc', 'back'), ('?', 'help'), ('q', 'quit')),
    Page.HELP: (('↑↓', 'drive'), ('esc', 'back'), ('q', 'quit')),
}


def keys_in(text: str) -> list[Key]:
    """Return the keys in what was typed; what means nothing is left out."""
    found = []
    while text:
        for length in range(min(_LONGEST, len(text)), 0, -1):
            key = _SEQUENCES.get(text[:length])
            if key is not None and (key is not Key.BACK or length > 1 or not _unknown(text)):
                found.append(key)
                break
        else:
            length = _unknown(text) or 1
        text = text[length:]
    return found


def _unknown(text: str) -> int:
    """Return how long an escape sequence is that nobody here knows; 0: it is none."""
    if text[:2] not in ('\x1b[', '\x1bO'):
        return 0
    end = next((place for place in range(2, len(text)) if '@' <= text[place] <= '~'), None)
    return len(text) if end is None else end + 1


@dataclass(frozen=True, slots=True)
class Choice:
    """
    What the user has chosen.

    :param drive: full name of the drive that is marked, or shown; None before there is any.
    :param screen: number of the screen of a long page, from 0.
    """

    page: Page = Page.DRIVES
    drive: str | None = None
    screen: int = 0

    def among(self, drives: Sequence[str]) -> 'Choice':
        """Return the same for these drives: one that has gone cannot be chosen."""
        if self.drive in drives or (self.drive is None and not drives):
            return self
        return replace(self, drive=drives[0] if drives else None)

    def press(self, key: Key, drives: Sequence[str]) -> 'Choice':
        """Return what is chosen after a key."""
        if key in (Key.UP, Key.DOWN):
            if self.drive not in drives:
                return self.among(drives)
            step = 1 if key is Key.DOWN else -1
            place = (drives.index(self.drive) + step) % len(drives)
            return replace(self, drive=drives[place], screen=0)
        if key is Key.NEXT_PAGE:
            return replace(self, screen=self.screen + 1)
        if key is Key.PREVIOUS_PAGE:
            return replace(self, screen=max(0, self.screen - 1))
        if key is Key.BACK:
            return replace(self, page=Page.DRIVES, screen=0)
        page = _PAGES.get(key)
        return self if page is None else replace(self, page=page, screen=0)


_PAGES = {Key.OPEN: Page.DRIVE, Key.LOG: Page.LOG, Key.HELP: Page.HELP}
