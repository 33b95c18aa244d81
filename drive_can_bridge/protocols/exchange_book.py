# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How regularly a drive is asked, and whether it answers; for cycles and rounds alike.

An answer belongs to the last exchange; where it may come later than that, it is *stale*, and no
surprise.
"""

import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.statistics import DriveStatistics
from drive_can_bridge.protocols.cycle_timer import CycleTimer


class ExchangeBook:
    """
    Count the exchanges of one drive.

    :ivar timer: when the next one is due.
    :ivar began_at: when the last one began.
    :ivar missed_in_row: how many went unanswered since the last answer.
    :ivar awaiting: the answer to a cycle has not come yet.
    :ivar stale: so many answers too many may be on their way.
    """

    __slots__ = (
        '_limit', '_statistics', 'awaiting', 'began_at', 'missed_in_row', 'stale', 'timer')

    def __init__(self, drive: DriveConfiguration, statistics: DriveStatistics) -> None:
        self.timer = CycleTimer(drive.period)
        self.began_at = -math.inf
        self.missed_in_row = 0
        self.awaiting = False
        self.stale = 0
        self._limit = drive.missed_limit
        self._statistics = statistics

    def begin(self, now: float, pause: float | None = None) -> None:
        """
        Take note that an exchange begins, and plan the next.

        :param pause: s until then; None: a period.
        """
        self.began_at = now
        error = self.timer.begun(now, pause)
        if error == error:  # not NaN
            self._statistics.period_error.add(error)

    def answered(self, received_at: float) -> None:
        """Take note of the answer that completes an exchange."""
        self.awaiting = False
        self.missed_in_row = 0
        statistics = self._statistics
        statistics.exchanges += 1
        latency = received_at - self.began_at
        statistics.latency.add(latency if latency > 0.0 else 0.0)

    def missed(self) -> bool:
        """Take note of an exchange that nobody answered; tell whether those were too many."""
        self.awaiting = False
        self.stale = 1  # one answer too many is on its way, if this one is only late
        self._statistics.missed += 1
        self.missed_in_row += 1
        return self.missed_in_row >= self._limit

    def expect_nothing(self) -> None:
        """Expect no answer any more; one that is on its way is no surprise, though."""
        self.stale = int(self.awaiting)
        self.awaiting = False

    def take_stale(self) -> bool:
        """Take an answer that nobody waits for; tell whether it is merely late."""
        if not self.stale:
            return False
        self.stale -= 1
        return True
