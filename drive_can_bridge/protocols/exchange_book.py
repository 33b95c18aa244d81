# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How regularly a drive is asked, and whether it answers; for cycles and rounds alike.

Deadlines are absolute, a period apart. What could not begin in time begins late; what was missed
altogether is left out, and the beat is kept. Where something cannot wait for its turn, a cycle is
brought forward.

Answers come in the order of the cycles. One that comes while a cycle waits for it is the answer of
that exchange, as far as samples are concerned. What it *shows* is another thing: it may be the
answer to a cycle before, which is merely late. So it shows that the oldest cycle was heard of
which no answer has been seen; and one that comes while nothing waits is late where there is such a
cycle, and nobody's where there is none.

Some never come, and no answer says which. So cycles are given up after a while, or a drive that
has lost a few would never be seen to answer the last one; but not those from before a stop that
nothing has shown yet. What a gateway has held may come all the same, all at once. That is seen by
being more than one answer since the last cycle: these are to what was given up, as far as it goes.

A drive that answers more often than it was asked (a gateway that doubles frames) spoils that
count: each answer too many looks like one to the next cycle. For a while after one, only an answer
shows a stop that comes when none to a running cycle can come any more.
"""

from collections import deque
import math
from typing import NamedTuple

from drive_can_bridge.compiled import mypyc_attr
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.statistics import DriveStatistics

#: s that a cycle may be away when a stop is wanted; else it is brought forward
STOP_WAIT_MAX = 0.025
#: s between two cycles at least, however much a stop hurries
CYCLE_SPACING_MIN = 0.005
#: s between two cycles of a stop, or of a pulse, at most, however long the period is
STOP_SPACING_MAX = 0.1


def stop_spacing(period: float) -> float:
    """Return how many s lie between two cycles, or writes, of a stop or of a pulse."""
    return min(period, STOP_SPACING_MAX)


@mypyc_attr(allow_interpreted_subclasses=True)
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


#: s, and periods, after which nobody believes that an answer will come
HORIZON, HORIZON_PERIODS = 0.5, 2.0
#: s that the cycles of a stop take at most
STOP_MAX = 1.0
#: s after which nothing comes any more, not even all at once
HELD_MAX = 5.0


class PendingCycle(NamedTuple):
    """
    A cycle that waits for its answer, or may still get one.

    :ivar at: when it was sent.
    :ivar neutral: how often a running cycle was sent before; -1: it is one itself.
    """

    at: float
    neutral: int


class ExchangeBook:
    """
    Count the exchanges of one drive.

    :param timer: says when they are due; None: one of its own.
    :ivar timer: when the next one is due.
    :ivar began_at: when the last one began.
    :ivar answered_at: when an answer came last.
    :ivar missed_in_row: how many went unanswered since the last answer.
    :ivar awaiting: the answer to a cycle has not come yet.
    :ivar overdue: how late the last answer was, in s.
    :ivar stale: so many frames beside answers to cycles may be on their way.
    :ivar stop_shown: what was answered last was neutral, and so were all cycles since.
    """

    __slots__ = (
        '_asked', '_came', '_given_up', '_heard_at', '_horizon', '_kept', '_limit', '_period',
        '_ran_at', '_runs', '_since', '_statistics', '_steady', '_too_many_at', 'answered_at',
        'awaiting', 'began_at', 'missed_in_row', 'overdue', 'stale', 'stop_shown', 'timer')

    def __init__(self, drive: DriveConfiguration, statistics: DriveStatistics,
                 timer: CycleTimer | None = None) -> None:
        self.timer = timer or CycleTimer(drive.period)
        self.began_at = self.answered_at = -math.inf
        self.missed_in_row = 0
        self.awaiting = False
        self.stale = 0
        self.stop_shown = False
        self._asked: deque[PendingCycle] = deque()
        self._given_up: deque[PendingCycle] = deque()  # before those
        self._came = 0              # answers since the last cycle
        self._steady = False        # the one before was answered once
        self._heard_at = -math.inf
        self._ran_at = -math.inf        # the last running cycle was sent then
        self._too_many_at = -math.inf   # an answer came that no cycle was left for
        self._period = drive.period
        self._horizon = max(HORIZON, HORIZON_PERIODS * drive.period)
        self._kept = self._horizon + max(STOP_MAX, drive.control_timeout)
        self._runs = 0
        self._since = -math.inf     # what waits for its answer was sent then
        self.overdue = 0.0
        self._limit = drive.missed_limit
        self._statistics = statistics

    def begin(self, now: float, pause: float | None = None) -> None:
        """
        Record that an exchange begins, and plan the next.

        :param pause: s until then; None: a period.
        """
        self.began_at = now
        error = self.timer.begun(now, pause)
        if error == error:  # not NaN
            self._statistics.period_error.add(error)

    # -- cycles -----------------------------------------------------------------------------------

    def asked(self, now: float, *, runs: bool) -> None:
        """
        Record that the drive was sent a cycle that it answers.

        :param runs: it holds anything but neutral and ``disable``.
        """
        if not self.awaiting:
            self._since = now
        self.awaiting = True
        self.began_at = now
        if runs:
            self._ran_at = now
            self.invalidate()
        steady = self._came == 1
        if steady and self._steady:     # nothing is held
            self._given_up.clear()
        self._steady, self._came = steady, 0
        self._forget_older(now)
        self._asked.append(PendingCycle(now, -1 if runs else self._runs))

    def early(self, now: float) -> bool:
        """Return whether what waits has had no time: only a cycle brought forward is so near."""
        return now < self._since + 0.5 * self._period

    def invalidate(self) -> None:
        """Record that answers to cycles up to now acknowledge no stop."""
        self._runs += 1
        self.stop_shown = False

    def answer_received(self, received_at: float) -> None:
        """Record an answer: to the oldest cycle that may still get one."""
        of = self._given_up if self._came and self._given_up else self._asked or self._given_up
        if of:
            at, neutral = of.popleft()
            self._came += 1
            self._heard_at = received_at
            self.stop_shown = self.stop_shown or (
                neutral == self._runs and self._counts(received_at))
            self.overdue = max(0.0, received_at - at - self._period)

    def _counts(self, received_at: float) -> bool:
        """Return whether an answer is known to be to no running cycle, where the count says so."""
        return (received_at - self._too_many_at > HELD_MAX
                or received_at - self._ran_at > self._horizon)

    def too_many(self, received_at: float) -> None:
        """Record an answer that no cycle is left for."""
        self._too_many_at = received_at

    def late(self, received_at: float) -> float | None:
        """
        Record an answer that no cycle waits for.

        :return: by how many s answers are late: this one, or that before it, which was taken for
            that to a later cycle; 0: it is in time, but not wanted any more; None: no cycle is
            left that it could answer.
        """
        self._forget_older(received_at)
        if not self._asked and not self._given_up:
            return None
        before = self.overdue
        self.answer_received(received_at)
        return max(before, self.overdue)

    @property
    def outstanding(self) -> bool:
        """Some cycles may still be answered."""
        return bool(self._asked)

    def forget_asked(self) -> None:
        """Record that no answer to any cycle up to now is on its way."""
        self._asked.clear()
        self._given_up.clear()

    def give_up(self, silent: int) -> None:
        """
        Give up the answers to cycles from before a stop.

        :param silent: but to so many that were sent since the drive has been silent.
        """
        asked = self._asked
        before = [at for at, neutral in asked if neutral != self._runs]
        kept = min(silent, sum(at > self._heard_at for at in before))
        for _ in range(len(before) - kept):
            self._given_up.append(asked.popleft())

    def _forget_older(self, now: float) -> None:
        asked, given_up = self._asked, self._given_up
        while len(asked) > 1 and now - asked[0][0] > self._horizon:     # the last: as late as ever
            if (not self.stop_shown and asked[-1].neutral == self._runs != asked[0].neutral
                    and now - asked[0][0] <= self._kept):
                break   # a stop is not shown by answers to what it ended
            given_up.append(asked.popleft())
        while given_up and now - given_up[0][0] > HELD_MAX:
            given_up.popleft()

    # -- answers ----------------------------------------------------------------------------------

    def answered(self, received_at: float) -> None:
        """Record the answer that completes an exchange."""
        self.awaiting = False
        self.missed_in_row = 0
        self.answered_at = received_at
        statistics = self._statistics
        statistics.exchanges += 1
        latency = received_at - self.began_at
        statistics.latency.add(latency if latency > 0.0 else 0.0)

    def missed(self) -> bool:
        """Record an unanswered exchange; return whether there were too many in a row."""
        self.awaiting = False
        self._statistics.missed += 1
        self.missed_in_row += 1
        return self.missed_in_row >= self._limit

    def expect_nothing(self) -> None:
        """Expect no answer any more; one that is on its way is no surprise, though."""
        self.awaiting = False

    def take_stale(self) -> bool:
        """Count a frame that no cycle waits for; return whether it may come beside the answers."""
        if not self.stale:
            return False
        self.stale -= 1
        return True
