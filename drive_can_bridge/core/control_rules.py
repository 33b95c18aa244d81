# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which control word serves what is wanted of a drive.

Mostly the table says it all: one word for each action. Where the next word depends on what the
drive reports (CiA 402: 0007h before 000Fh), a family hands in rules of its own.
"""

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.profile import ControlTable
from drive_can_bridge.core.sentences import NOTHING, Sentence


class TableRules:
    """
    One word for each action, as the table has them.

    :ivar known: the actions that there is a word for.
    """

    def __init__(self, table: ControlTable) -> None:
        self._words: dict[ControlAction, int] = {
            action: word for action in ControlAction
            if (word := getattr(table, action.value, None)) is not None}
        self.known = frozenset(self._words)

    def word(self, sending: ControlAction, *, enabling: bool) -> int:
        """
        Return the word to be sent now.

        :param sending: what it is for.
        :param enabling: ``disable`` is sent on the way to ``enable``.
        """
        return self._words[sending]

    def rests(self, word: int) -> bool:
        """Tell whether a word tells the drive to stand still."""
        return word == self._words[ControlAction.DISABLE]

    def left(self, word: int) -> None:
        """Record a word that has left."""

    def reported(self, raw: int, *, behind: bool) -> None:
        """
        Take a status word.

        :param behind: it arrived after the current word had left.
        """

    def forget(self) -> None:
        """Record that nothing is known of the drive."""

    @property
    def holds(self) -> Sentence:
        """What is answered to a quick stop in which the drive stays; '' if it does not."""
        return NOTHING

    @property
    def lacking(self) -> Sentence:
        """What a drive that reports enabled lacks to be driven; '' if nothing."""
        return NOTHING

    def remark(self, sending: ControlAction) -> Sentence:
        """Say what else is known of why a drive does not do what is wanted; '' for nothing."""
        return NOTHING

    @property
    def loose(self) -> bool:
        """Nothing holds the axis in its place although the drive is enabled."""
        return False
