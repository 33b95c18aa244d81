# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a session has to tell: events, in order, and what is missing while its drive is offline.

It is the counterpart of the outbox: frames go to the drive, this goes to people.
"""

from collections.abc import Iterable
import math

from drive_can_bridge.core.events import (
    AnswerLate, Event, FrameRejected, Noted, SetpointsExpired, StationFound, StationLost,
)
from drive_can_bridge.core.holding import Setpoint
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.sentences import may_still_be_running
from drive_can_bridge.core.statistics import DriveStatistics

#: s between two answers that are told to be late
TELL_LATE = 10.0


class Reporter:
    """
    The reports of one session.

    :param statistics: counts the frames that were rejected.
    :ivar events: what happened since they were taken last.
    :ivar advice: while the drive is not online: what is missing, and what to look at; '' else.
    """

    __slots__ = ('_statistics', '_tell_late_at', 'advice', 'events')

    def __init__(self, statistics: DriveStatistics, advice: Sentence) -> None:
        self.events: list[Event] = []
        self.advice = advice
        self._statistics = statistics
        self._tell_late_at = -math.inf

    def take(self) -> list[Event]:
        """Return what happened since the last call."""
        events = self.events
        if events:
            self.events = []
        return events

    def note(self, event: Event) -> None:
        """Tell what happened."""
        self.events.append(event)

    def warn(self, text: Sentence, *, may_run: bool = False) -> None:
        """
        Tell people what is not as it should be.

        :param may_run: the drive may be running for that reason, which is said.
        """
        self.events.append(Noted(
            may_still_be_running(text) if may_run else text, warning=True, danger=may_run))

    def reject(self, text: Sentence) -> None:
        """Count and tell a frame of the drive that is malformed or unasked."""
        self._statistics.rejected += 1
        self.events.append(FrameRejected(text))

    def unasked(self, text: Sentence, late: float | None, now: float) -> None:
        """
        Count and tell an answer that nobody waits for: rejected, or late.

        :param late: by how many s it came too late; 0: it is not wanted any more; None: it
            answers nothing that was asked.
        """
        if late is None:
            self.reject(text)
        elif late > 0.0:
            self._statistics.late += 1
            self._statistics.late_by = late
            if now >= self._tell_late_at:   # once in a while
                self._tell_late_at = now + TELL_LATE
                self.events.append(AnswerLate(late))

    def found(self) -> None:
        """Tell that the drive exchanges process data."""
        self.advice = NOTHING
        self.events.append(StationFound())

    def lost(self, reason: Sentence, *, was_online: bool) -> None:
        """Tell why the drive is offline; people hear of it when it was not."""
        self.advice = reason
        if was_online:
            self.events.append(StationLost(reason))

    def expired(self, setpoints: Iterable[Setpoint]) -> None:
        """Tell that no fresh command keeps these setpoints: they went neutral."""
        self.events.append(SetpointsExpired(
            tuple(setpoint.parameter.name for setpoint in setpoints)))
