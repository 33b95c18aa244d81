# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``~/quick_stop`` of a drive without a control word: everything neutral, at once.

From the request on only neutral is sent, and commands arm nothing, until the drive
has answered an exchange that carried all of it, or has not in time.
"""

from dataclasses import dataclass
import math
from typing import Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.command_interlock import CommandInterlock
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlCompleted, ControlRequest
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.setpoints import Setpoints


class Commanded(Protocol):
    """A drive that follows its setpoints; the session itself."""

    configuration: DriveConfiguration
    setpoints: Setpoints
    interlock: CommandInterlock
    report: Reporter

    def hand_out_neutral(self, now: float) -> None:
        """Send all setpoints at once, neutral as they are."""


@dataclass(frozen=True)
class Wait:
    """
    A stop that is not confirmed yet.

    :ivar requests: the requests that wait; others join the first.
    :ivar lacking: names of what has not left since.
    """

    requests: list[ControlRequest]
    lacking: set[str]


class NeutralStop:
    """
    The requests that wait until one drive has everything neutral; usually none.

    :ivar due: when it has lasted too long; infinity: no request waits.
    """

    def __init__(self, session: Commanded) -> None:
        self._session = session
        self._wait: Wait | None = None
        self.due = math.inf

    @property
    def pending(self) -> bool:
        """Whether a request waits."""
        return self._wait is not None

    def request(self, request: ControlRequest, now: float) -> None:
        """Go neutral; answered by exactly one ``ControlCompleted``."""
        session = self._session
        if self._wait is not None:
            self._wait.requests.append(request)
            return
        names = {setpoint.parameter.name for setpoint in session.setpoints.items
                 if not setpoint.parameter.limit}
        self._wait = Wait([request], names)
        self.due = now + session.configuration.control_timeout
        if not names:
            self._end(True, sentences.nothing_commanded())
        else:
            session.interlock.hold(True)
            session.hand_out_neutral(now)

    def left(self, name: str) -> None:
        """Record that one setpoint has left, neutral as it is."""
        if self._wait is not None:
            self._wait.lacking.discard(name)

    def all_left(self) -> None:
        """Record that all of them have left together."""
        if self._wait is not None:
            self._wait.lacking.clear()

    def answered(self) -> None:
        """Record an answer that shows that what has left last has arrived."""
        if self._wait is not None and not self._wait.lacking:
            self._end(True, sentences.neutral_without_control())

    def refused(self, why: Sentence) -> None:
        """Record that the drive does not take a neutral setpoint."""
        self.fail(sentences.may_still_be_running(why))

    def fail(self, reason: Sentence) -> None:
        """Complete the waiting requests: the stop they wait for is over."""
        self._end(False, reason)

    def handle_timer(self, now: float) -> None:
        """Wait no longer than a control service may take."""
        if now >= self.due:
            self.refused(sentences.neutral_unanswered(
                self._session.configuration.control_timeout))

    def _end(self, success: bool, message: Sentence) -> None:
        wait, self._wait, self.due = self._wait, None, math.inf
        if wait is not None:
            for request in wait.requests:
                self._session.report.note(ControlCompleted(request, success, message))
            self._session.interlock.hold(False)
