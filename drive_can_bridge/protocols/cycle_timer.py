# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The rhythm of a drive: absolute deadlines a period apart, for cycles and rounds alike.

What could not begin in time begins late; what was missed altogether is left out, and the beat is
kept. Where something cannot wait for its turn, a cycle is brought forward.
"""

import math

#: s that a cycle may be away when a stop is wanted; else it is brought forward
STOP_WAIT_MAX = 0.025
#: s between two cycles at least, however much a stop hurries
CYCLE_SPACING_MIN = 0.005
#: s between two cycles of a stop, or of a pulse, at most, however long the period is
STOP_SPACING_MAX = 0.1


def stop_spacing(period: float) -> float:
    """Return how many s lie between two cycles, or writes, of a stop or of a pulse."""
    return min(period, STOP_SPACING_MAX)


class CycleTimer:
    """
    When the next cycle is due.

    :ivar due: when the next one is to begin; infinity: never.
    :ivar began_at: when the last one did.
    :ivar stop_spacing: s between two cycles of a stop, or of a pulse.
    """

    __slots__ = ('_in_pace', '_period', 'began_at', 'due', 'stop_spacing')

    def __init__(self, period: float) -> None:
        self.due = math.inf
        self.began_at = -math.inf
        self.stop_spacing = stop_spacing(period)
        self._period = period
        self._in_pace = False   # the last one was due a period ago: its distance says something

    def start(self, at: float) -> None:
        """Begin with the next cycle then; infinity: never."""
        self.due = at
        self._in_pace = False

    def stop(self) -> None:
        """Plan no further cycle."""
        self.start(math.inf)

    def no_later(self, at: float) -> None:
        """Bring the next cycle forward, if there is one."""
        if math.inf > self.due > at:
            self.start(at)

    def hurry(self, now: float) -> None:
        """Bring the next cycle forward, unless it comes soon in any case: it stops the drive."""
        if self.due > now + STOP_WAIT_MAX:
            self.no_later(max(now, self.began_at + CYCLE_SPACING_MIN))

    def begun(self, now: float, pause: float | None = None) -> float:
        """
        Record that a cycle begins, and plan the next.

        :param pause: s until then; None: the period, counted from when this one was due.
        :return: distance to the previous one less the period, in s; NaN where the previous one
            had another rhythm.
        """
        error = abs(now - self.began_at - self._period) if self._in_pace else math.nan
        self.began_at = now
        if pause is not None:
            self.start(now + pause)
            return error
        self._in_pace = True
        self.due += self._period
        soonest = now + 0.5 * self._period
        if self.due < soonest:  # late: leave cycles out, keep the beat, never in a burst
            self.due += math.ceil((soonest - self.due) / self._period) * self._period
        return error
