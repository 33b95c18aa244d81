# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Text from the graph: anybody can put anything there, and it ends on a terminal."""

import re

#: characters kept of what arrives
LIMIT = 256
#: of a line of the log, which may tell of several drives
LOG_LIMIT = 2000
_ROS_NAME = re.compile(r'(/[A-Za-z_][A-Za-z0-9_]*)+')


def printable(text: str, limit: int = LIMIT) -> str:
    """
    Return a text without anything that a terminal would obey.

    Control characters, those that change the direction of writing included, are shown as escapes;
    what is longer than ``limit`` is cut.
    """
    if len(text) > limit:
        text = f'{text[:limit - 1]}…'
    if text.isprintable():
        return text
    return ''.join(character if character.isprintable() else _escaped(character)
                   for character in text)


def is_ros_name(name: str) -> bool:
    """Tell whether a full name may stand in front of a topic."""
    return len(name) <= LIMIT and _ROS_NAME.fullmatch(name) is not None


def _escaped(character: str) -> str:
    # a lone surrogate is escaped, too: no encoding has it
    return character.encode('unicode_escape').decode('ascii')
