# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Answers that come too late must not meet the next question.

No answer in these protocols tells which request made it: at best, what was asked for. After a read
that nobody answered in time, the answer may still be on its way, with a value older than a write
that followed. So whatever the late answer could be mistaken for is not asked for again until a
quarantine is over; what arrives in it is thrown away.

A quarantine counts only if somebody listened: where the process stood still at its end, what
arrived meanwhile may still lie in a buffer, and gets time to come out of it.
"""

from collections.abc import Hashable
import math

#: s by which the read after a quarantine may be late, and it still was listened to
PUNCTUAL = 0.0005
#: s for the reader to fetch what a process that stood still finds in its buffers
CATCHING_UP = 0.01
#: quarantines that are remembered before those that are long over are forgotten
REMEMBERED = 32


class Quarantine:
    """
    What must not be asked for yet.

    Questions that a late answer cannot be mistaken for have keys of their own.
    """

    __slots__ = ('_until',)

    def __init__(self) -> None:
        # until when; and whether somebody has yet to listen at its end
        self._until: dict[Hashable, tuple[float, bool]] = {}

    def begin(self, key: Hashable, until: float) -> None:
        """Do not ask before ``until``, or later where that was said before."""
        if len(self._until) >= REMEMBERED:
            self._forget(until)
        self._until[key] = max(self.ready_at(key), until), True

    def ready_at(self, key: Hashable) -> float:
        """Return when the question may be asked."""
        return self._until[key][0] if key in self._until else -math.inf

    def holds(self, key: Hashable, now: float, late: float) -> bool:
        """
        Say whether to listen on although it is time to ask.

        :param late: s since it was time to ask.
        """
        until, unheard = self._until.get(key, (-math.inf, False))
        if not unheard:
            return False
        if late <= PUNCTUAL:
            self._until[key] = until, False
            return False
        self._until[key] = now + CATCHING_UP, False
        return True

    def time_lost(self, now: float) -> None:
        """Listen on where nobody did at the end of a quarantine."""
        for key, (until, unheard) in self._until.items():
            if unheard:
                self._until[key] = max(until, now + CATCHING_UP), unheard

    def _forget(self, now: float) -> None:
        """Forget quarantines that have ended long ago, or else the oldest."""
        over = [key for key, (until, _) in self._until.items() if until < now - 1.0]
        for key in over or [min(self._until, key=self.ready_at)]:
            del self._until[key]
