# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``~/quick_stop`` of a drive without a control word: everything neutral, at once.

From the request on nothing but neutral is handed out, and commands arm nothing, until the drive
has answered an exchange that carried all of it, or has not in time.
"""

import math
from typing import Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.command_gate import CommandGate
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlCompleted, ControlRequest
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.sentences import Sentence
from drive_can_bridge.core.setpoints import Setpoints


class Commanded(Protocol):
    """A drive that goes where its setpoints tell it to; the session itself."""

    configuration: DriveConfiguration
    setpoints: Setpoints
    gate: CommandGate
    report: Reporter

    def hand_out_neutral(self, now: float) -> None:
        """Have all setpoints sent at once, neutral as they are."""


class NeutralStop:
    """Those that wait until one drive has everything neutral; nobody does most of the time."""

    def __init__(self, session: Commanded) -> None:
        self._session = session
        self._requests: list[ControlRequest] = []
        self._deadline = math.inf
        self._lacking: set[str] = set()     # what has not left since
        self._left = False                  # everything has

    @property
    def pending(self) -> bool:
        """Somebody waits."""
        return bool(self._requests)

    def request(self, request: ControlRequest, now: float) -> None:
        """Go neutral; answered by exactly one ``ControlCompleted``."""
        session = self._session
        names = {setpoint.parameter.name for setpoint in session.setpoints.items
                 if not setpoint.parameter.limit}
        self._requests.append(request)
        if not names:
            self._end(True, sentences.nothing_commanded())
        elif len(self._requests) == 1:      # others join the first
            self._deadline = now + session.configuration.control_timeout
            self._lacking, self._left = names, False
            session.gate.hold(True)
            session.hand_out_neutral(now)

    def left(self, name: str) -> None:
        """Record that one setpoint has left, neutral as it is."""
        if self._requests:
            self._lacking.discard(name)
            self._left = not self._lacking

    def all_left(self) -> None:
        """Record that all of them have left together."""
        self._left = self.pending

    def answered(self) -> None:
        """Record an answer that shows that what has left last has arrived."""
        if self._left:
            self._end(True, sentences.neutral_without_control())

    def refused(self, why: Sentence) -> None:
        """Record that the drive does not take a neutral setpoint."""
        self.fail(sentences.may_still_be_running(why))

    def fail(self, reason: Sentence) -> None:
        """Answer those that wait: there is no stop to be waited for any more."""
        if self._requests:
            self._end(False, reason)

    def handle_timer(self, now: float) -> None:
        """Wait no longer than a control service may take."""
        if now >= self._deadline:
            self.refused(sentences.neutral_unanswered(
                self._session.configuration.control_timeout))

    def next_timer(self) -> float:
        """Return when :meth:`handle_timer` has something to do."""
        return self._deadline

    def _end(self, success: bool, message: Sentence) -> None:
        requests, self._requests = self._requests, []
        self._deadline, self._left = math.inf, False
        for request in requests:
            self._session.report.note(ControlCompleted(request, success, message))
        self._session.gate.hold(False)
