# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a session reports: events, in order, and what is missing while its drive is offline.

It is the counterpart of the outbox: frames go to the drive, this goes to people.
"""

from collections.abc import Callable, Iterable
from enum import Enum
import math

from drive_can_bridge.core.events import (
    AnswerLate, Event, FrameRejected, Noted, SetpointsExpired, StationFound, StationLost,
)
from drive_can_bridge.core.holding import Setpoint
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.sentences import may_still_be_running
from drive_can_bridge.core.statistics import DriveStatistics

#: s between two answers that are reported to be late
TELL_LATE = 10.0


class AdviceKind(Enum):
    """The basis of the advice on a drive that is not online."""

    CAUSE = 'on what was seen'
    GUESS = 'on nothing but that it does not answer: what to look at when it was never seen'
    MAPPING = 'on what it maps, which differs'


class Reporter:
    """
    The reports of one session.

    :param statistics: counts the frames that were rejected.
    :ivar events: what happened since they were taken last.
    :ivar advice: while the drive is not online: what is missing, and what to look at; '' else.
    :ivar advice_kind: what that rests on.
    """

    __slots__ = (
        '_late_taken', '_statistics', '_tell_late_at', 'advice', 'advice_kind', 'events')

    def __init__(self, statistics: DriveStatistics, advice: Sentence) -> None:
        self.events: list[Event] = []
        self.advise(advice)
        self._statistics = statistics
        self._tell_late_at = -math.inf
        self._late_taken = True     # all late answers since then

    def take(self) -> list[Event]:
        """Return what happened since the last call."""
        events = self.events
        if events:
            self.events = []
        return events

    def advise(self, text: Sentence, kind: AdviceKind = AdviceKind.CAUSE) -> None:
        """Set what is missing, and what to check."""
        self.advice, self.advice_kind = text, kind

    def guess(self, text: Sentence, *, unless: Sentence = NOTHING) -> None:
        """
        Set advice for a drive of which is only known that it does not answer.

        :param unless: what is known of it; '' for nothing.
        """
        self.advise(unless or text, AdviceKind.CAUSE if unless else AdviceKind.GUESS)

    def note(self, event: Event) -> None:
        """Report what happened."""
        self.events.append(event)

    def warn(self, text: Sentence, *, may_run: bool = False) -> None:
        """
        Report what is not as it should be.

        :param may_run: the drive may be running for that reason, which is added.
        """
        self.events.append(Noted(
            may_still_be_running(text) if may_run else text, warning=True, danger=may_run))

    def reject(self, text: Sentence) -> None:
        """Count and report a frame of the drive that is malformed or unasked."""
        self._statistics.rejected += 1
        self.events.append(FrameRejected(text))

    def unasked(self, text: Sentence, late: float | None, now: float, *,
                would_hold: Callable[[float], Sentence] | None = None,
                taken: bool = False) -> None:
        """
        Count and report an answer without an open request: rejected, or late.

        :param late: by how many s it came too late; 0: its request was dropped; None: it
            answers nothing that was asked.
        :param would_hold: returns what to set instead, for one that is so late.
        :param taken: it counts for its exchange all the same.
        """
        if late is None:
            self.reject(text)
        elif late > 0.0:
            self._statistics.late += 1
            self._statistics.late_by = late
            self._late_taken = self._late_taken and taken
            if now >= self._tell_late_at:   # once in a while
                self._tell_late_at = now + TELL_LATE
                self.events.append(AnswerLate(
                    late, would_hold(late) if would_hold is not None else NOTHING,
                    self._late_taken))
                self._late_taken = True

    def found(self) -> None:
        """Report that the drive exchanges process data."""
        self.advise(NOTHING)
        self.events.append(StationFound())

    def lost(self, reason: Sentence, *, was_online: bool, ordered: bool = False) -> None:
        """Report why the drive is offline; as an event only if it was online."""
        self.advise(reason)
        if was_online:
            self.events.append(StationLost(reason, ordered))

    def expired(self, setpoints: Iterable[Setpoint]) -> None:
        """Report that no fresh command keeps these setpoints: they went neutral."""
        found = tuple(setpoints)
        self.events.append(SetpointsExpired(
            tuple(setpoint.parameter.name for setpoint in found),
            all(setpoint.expired_at_neutral for setpoint in found)))
