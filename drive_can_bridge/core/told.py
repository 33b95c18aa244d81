# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a drive was told, and so whether it may be running by our word.

Whatever was told to run is told to stop. A session notes here each frame that the bus has taken;
whenever it cannot go on as before (a stall, a lost bus, maps that differ, the end), it looks here
whether it still owes the drive a stop.
"""

from collections.abc import Hashable

#: what a control word is among the things that travel separately, where it does
CONTROL_WORD = 'control word'
#: what a drive that does not answer was told
UNHEARD = 'whatever it has not heard'
_NOTHING_ELSE = frozenset([UNHEARD])


class Told:
    """
    What the last word to a drive was, for everything that it is told separately.

    :ivar owed: it was told to run by at least one of them, and not to stop since.
    :ivar ran: it was told to run by something that nobody acknowledges, and nothing has shown
        since that what told it to stop has arrived.
    """

    __slots__ = ('_running', 'owed', 'ran')

    def __init__(self) -> None:
        self._running: set[Hashable] = set()
        self.owed = self.ran = False

    def runs(self, what: Hashable) -> bool:
        """Tell whether one of them was told to run, and not to stop since."""
        return what in self._running

    def note(self, what: Hashable, *, runs: bool) -> None:
        """
        Take note of a frame that has left.

        :param what: which of the things that travel separately: the cyclic frame, one setpoint.
        :param runs: it holds anything but neutral and ``disable``.
        """
        if runs:
            self._running.add(what)
            self.owed = True
        elif self.owed:
            self._running.discard(what)
            self.owed = bool(self._running)

    def note_unacknowledged(self, what: Hashable, *, runs: bool) -> None:
        """Take note of one that nobody acknowledges: only an answer shows that a stop arrived."""
        self.note(what, runs=runs)
        self.ran = self.ran or runs

    def doubt(self) -> bool:
        """Take note that the drive does not answer; tell whether it may run for that reason."""
        if self.ran:
            self.note(UNHEARD, runs=True)
        return self.ran

    def answered(self) -> None:
        """Take note of an answer to what was told last: that has arrived."""
        if self._running <= _NOTHING_ELSE:
            self.stopped()

    def stopped(self) -> None:
        """Take note that the drive has confirmed to have nothing but neutral and ``disable``."""
        self._running.clear()
        self.owed = self.ran = False
