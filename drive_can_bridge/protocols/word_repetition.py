# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
When a control word is written once more, of those that are written when they change.

A word may get lost on the way, a device may acknowledge it and take no notice, somebody else may
have written another one. So one that the drive does not follow, by what it reports since, is
written again, ever more seldom.
"""

import math

from drive_can_bridge.core.control_machine import ControlMachine

#: s until a word that the drive takes no notice of is written again: at first, and at most
REPEAT_FIRST = 0.2
REPEAT_LAST = 2.0
#: how often at most where each write wears an EEPROM
EEPROM_REPEATS = 3
#: how often to a drive at fault: whether it got the word is not to be seen
FAULT_REPEATS = 3


class WordRepetition:
    """
    The control words of one drive.

    :param control: None: there are none, and nothing is ever due.
    :param wears: each write wears an EEPROM.
    :param acknowledged: the drive has what was written: what starts it is not repeated.
    :ivar word: what was written last; None: nobody knows, or the bus refused it.
    """

    def __init__(self, control: ControlMachine | None, *, wears: bool = False,
                 acknowledged: bool = False) -> None:
        self._control = control
        self._wears = wears
        self._acknowledged = acknowledged
        self.forget()

    def forget(self) -> None:
        """Record that nothing is known of the drive."""
        self.word: int | None = None
        self._ran = False       # the word before was enable
        self._repeats = 0
        self._due_at = math.inf

    def begun(self, word: int) -> None:
        """Record that a word is being written."""
        if word == self.word:
            self._repeats += 1
        else:
            self._repeats = 0
            if self.word is not None and self._control is not None:
                self._ran = self.word == self._control.table.enable
        self.word = word
        self._due_at = math.inf     # until it left

    def left(self, now: float, pause: float | None = None) -> None:
        """
        Record that it left; where writes are acknowledged, that it was.

        :param pause: s until it is to leave again in any case; None: it is no pulse.
        """
        self._due_at = now + (min(REPEAT_FIRST * 2 ** min(self._repeats, 10), REPEAT_LAST)
                              if pause is None else pause)

    def due(self, now: float) -> bool:
        """Tell whether the word that has left, and is still the current one, is due again."""
        control = self._control
        if control is None or self._due_at == math.inf:
            return False
        if control.word_due:    # another one was to follow, and never left
            return True
        if now < self._due_at:
            return False
        if self._acknowledged:
            return control.stopping and control.unconfirmed
        if control.pulsing:
            return True
        if self._wears:
            return control.disregard != '' and self._repeats < EEPROM_REPEATS
        # rid of its fault, it would run by itself, had it missed the word
        return control.unconfirmed or (
            self._ran and control.fault and self._repeats < FAULT_REPEATS)
