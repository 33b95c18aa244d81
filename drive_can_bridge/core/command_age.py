# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How old a command is, by the clocks of two hosts, whose difference does not stay the same.

What its publisher's clock showed when a command was published, and this machine's when it
arrived, differ by its way and by the clocks. So what counts is by how much that age exceeds the
smallest of its topic: a command that waited somewhere (a stalled process, a network that
was away) differs from a fresh one in that. But quartzes differ (50 ppm are 0.25 s in 83 minutes),
and clocks are set: so the smallest age rises, and where nothing but a clock can be the reason, or
nothing else comes, the topic starts over.
"""

from enum import Enum
from typing import NamedTuple

#: ns by which a command may be older than the youngest of its topic
LATENESS_MAX = 250_000_000
#: ns in which the smallest age rises by 1 ns: 0.2 ms a second, four times what quartzes differ by
RISE = 5000
#: ns for which everything that comes is too late, by figures so close, before it is the measure
STEADY_TIME, STEADY_BAND = 10_000_000_000, 100_000_000
#: publishers whose last stamp is kept; one that has left is not recognised as such
PUBLISHERS_MAX = 64

#: stands for the gid of the only publisher of a topic, where the middleware names none
ALONE = b'alone'


class Age(Enum):
    """The result of judging the age of a command."""

    FRESH = 'fresh'
    LATE = 'late'
    #: late beside fresh ones of another publisher, by the same figure again
    CLOCKS_DIFFER = 'clocks differ'
    #: the first one by a clock that was set
    CLOCK_SET = 'clock set'
    #: the first one behind so many that were late by the same figure
    STEADILY_LATE = 'steadily late'


class AgeVerdict(NamedTuple):
    """The judged age of a command, and the figure to it in s."""

    age: Age
    seconds: float


_FRESH = AgeVerdict(Age.FRESH, 0.0)


class CommandAges:
    """
    The ages of the commands of one topic.

    All times are ns. Ages are reckoned by the steady time, so that the smallest moves along when
    the clock of this machine is set.
    """

    def __init__(self) -> None:
        self._now: int | None = None
        self._since = 0         # the look before
        self._ahead = 0
        self._moved = False
        self.forget()

    def forget(self) -> None:
        """Record that there is no publisher any more: the next one has a clock of its own."""
        self._smallest: int | None = None
        self._smallest_at = 0
        self._stamps: dict[bytes, int] = {}     # the last, by publisher
        self._run: tuple[int, int, int] | None = None   # nothing but late ones: since, least, most
        self._fresh_from: bytes | None = None
        self._last_late: int | None = None
        self._fresh_since = False               # that one

    def look(self, now: int, ahead: int) -> None:
        """
        Note the time before the waiting commands are judged.

        :param now: the steady time.
        :param ahead: by how much the time of the day is ahead of it.
        """
        first = self._now is None
        self._since = now if self._now is None else self._now
        self._moved = ahead != self._ahead and not first
        self._now, self._ahead = now, ahead

    def judge(self, source: int, received: int, publisher: bytes | None) -> AgeVerdict:
        """
        Judge a command by its stamps.

        :param source: its publisher's time of the day when it was published; 0: not known.
        :param received: this machine's when it arrived; 0: not known.
        :param publisher: its gid, or :data:`ALONE`; None: one of several.
        """
        now = self._now
        if not source or now is None:
            return _FRESH
        arrived = received - self._ahead if received else now
        # where the stamp is the time of the take, or of a clock that was set meanwhile, all that
        # is known is that it did not wait at the look before
        since = self._since if self._moved or arrived >= now else arrived
        before = self._stamp(publisher, source)
        if before is not None and source < before - LATENESS_MAX:
            # nothing that waits on a network can do that
            return self._begin(Age.CLOCK_SET, before - source, source, arrived, publisher)
        smallest = self._smallest
        if smallest is not None:
            smallest += (now - self._smallest_at) // RISE
        if (smallest is None or arrived - source < smallest) and not self._moved:
            smallest = arrived - source
            self._smallest, self._smallest_at = smallest, now
        lateness = 0 if smallest is None else since - source - smallest
        if lateness <= LATENESS_MAX:
            self._run = None
            self._fresh_from, self._fresh_since = publisher, True
            return _FRESH
        if self._is_steady(lateness, now):
            return self._begin(Age.STEADILY_LATE, lateness, source, arrived, publisher)
        differ = (self._last_late is not None and self._fresh_since
                  and abs(lateness - self._last_late) <= STEADY_BAND
                  and (publisher is None or publisher != self._fresh_from))
        self._last_late, self._fresh_since = lateness, False
        return AgeVerdict(Age.CLOCKS_DIFFER if differ else Age.LATE, 1e-9 * lateness)

    def _stamp(self, publisher: bytes | None, source: int) -> int | None:
        """Record a publisher's stamp; return the one before it, if it is known to be its own."""
        if publisher is None:
            self._stamps.pop(ALONE, None)
            return None
        before = self._stamps.get(publisher)
        if before is None and len(self._stamps) >= PUBLISHERS_MAX:
            self._stamps.clear()
        self._stamps[publisher] = source
        return before

    def _is_steady(self, lateness: int, now: int) -> bool:
        """Record a late command; return whether all were late for long, by the same figure."""
        if self._run is not None:
            since, least, most = self._run
            least, most = min(least, lateness), max(most, lateness)
            if most - least <= STEADY_BAND:
                self._run = since, least, most
                return now - since >= STEADY_TIME
        self._run = now, lateness, lateness
        return False

    def _begin(self, why: Age, figure: int, source: int, arrived: int,
               publisher: bytes | None) -> AgeVerdict:
        """Start over with a command as the first of its topic."""
        self.forget()
        self._stamp(publisher, source)
        if not self._moved and self._now is not None:
            self._smallest, self._smallest_at = arrived - source, self._now
        return AgeVerdict(why, 1e-9 * figure)
