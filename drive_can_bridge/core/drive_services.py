# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What users want of one drive: commands, requests, control; and why they are refused.

A command is judged at once. A request is answered by exactly one event: refused at once, or when
it has been served, or when the control machine says so.
"""

from collections.abc import Callable
from typing import Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.events import DriveState, RequestCompleted
from drive_can_bridge.core.fault_watch import FaultWatch
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.neutral_stop import NeutralStop
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.requests import Failure, FailureKind, is_answer, Outcomes, Request
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.setpoints import CommandOutcome, Setpoints
from drive_can_bridge.core.statistics import DriveStatistics

#: requests of one drive that may wait behind the one being served
WAITING_REQUESTS_MAX = 64


class RequestServer(Protocol):
    """Serves requests one after the other."""

    @property
    def waiting(self) -> int:
        """How many requests wait behind the one being served."""

    def serve(self, request: Request, done: Callable[[Outcomes], None], now: float) -> None:
        """Queue a request; ``done`` gets an outcome for each name."""

    def cancel(self) -> None:
        """Forget all requests without completing them."""

    def known(self, request: Request) -> Outcomes:
        """Return the outcomes of the first names of a forgotten request."""


class Conversation(Protocol):
    """What users can request depends on the drive's session: the part of it that is read here."""

    activated: bool
    active: bool
    serving: bool
    bus_available: bool
    online: bool
    homes: bool
    defect: Sentence
    control: ControlMachine | None
    fault_watch: FaultWatch | None
    neutral_stop: NeutralStop
    report: Reporter
    roles: Roles
    setpoints: Setpoints
    statistics: DriveStatistics

    @property
    def state(self) -> DriveState:
        """The state in one word."""

    def home(self, request: ControlRequest, now: float) -> None:
        """Start homing the axis."""

    def request_control(self, request: ControlRequest, now: float) -> None:
        """Handle a request for a control action."""

    def request_refusal(self, now: float) -> Failure | None:
        """Return what of the drive itself forbids requests for parameters."""

    def request_answered(self, request: Request, outcomes: Outcomes) -> None:
        """Record a request that was served, and answered."""

    def control_refusal(self, action: ControlAction, refusal: Sentence, *,
                        offline: bool) -> Sentence:
        """Return why a control action is refused, where a family has another text than usual."""


class DriveServices:
    """
    The users' side of one session.

    :param server: serves requests for parameters.
    """

    def __init__(self, session: Conversation, server: RequestServer) -> None:
        self._session = session
        self._server = server
        self._open: list[Request] = []      # being served

    # -- commands ---------------------------------------------------------------------------------

    def command(self, index: int, value: Value, now: float) -> CommandOutcome:
        """
        Handle a setpoint command (index into ``setpoints.items``).

        :raises ValueRefused: the value cannot be sent; counted, nothing else changes.
        """
        session = self._session
        try:
            outcome = session.setpoints.command(
                index, value, now, active=session.activated)
        except ValueError:
            session.statistics.commands_refused += 1
            raise
        if outcome is CommandOutcome.NOT_ARMED and session.state is DriveState.DISABLED:
            return CommandOutcome.DISABLED
        return outcome

    # -- requests ---------------------------------------------------------------------------------

    def submit(self, request: Request | ControlRequest, now: float) -> None:
        """
        Handle a request.

        It is answered by exactly one ``RequestCompleted``, or ``ControlCompleted``.
        """
        if not isinstance(request, ControlRequest):
            self._request(request, now)
            return
        session = self._session
        refusal = self.control_refusal(request.action)
        if request.action is ControlAction.HOME and not refusal:
            session.home(request, now)
            return
        if refusal:
            session.report.note(ControlCompleted(request, False, refusal))
            return
        if session.control is None:
            session.neutral_stop.request(request, now)
            return
        session.request_control(request, now)

    @property
    def waiting(self) -> int:
        """How many requests for parameters wait behind the one being served."""
        return self._server.waiting

    def fail_all(self, failure: Failure) -> None:
        """
        Complete all pending parameter requests with a failure, and forget them.

        What was already written stays written, so its outcomes are reported.
        """
        self._server.cancel()
        requests = self._open.copy()
        self._open.clear()
        for request in requests:
            self._refuse(request, failure, self._server.known(request))

    def _request(self, request: Request, now: float) -> None:
        failure = self._session.request_refusal(now)
        absence = self._absence
        if failure is None and (absence or self.waiting >= WAITING_REQUESTS_MAX):
            failure = Failure(FailureKind.UNAVAILABLE, absence or sentences.busy())
        if failure is not None:
            self._refuse(request, failure)
        elif not len(request):
            self._complete(request, ())
        else:
            self._open.append(request)
            self._server.serve(request, lambda outcomes: self._served(request, outcomes), now)

    def _served(self, request: Request, outcomes: Outcomes) -> None:
        self._open.remove(request)
        self._complete(request, outcomes)
        self._session.request_answered(request, outcomes)

    def _refuse(self, request: Request, failure: Failure, known: Outcomes = ()) -> None:
        """Complete a request with the same failure for every name without a known outcome."""
        self._complete(request, (*known, *(failure,) * (len(request) - len(known))))

    def _complete(self, request: Request, outcomes: Outcomes) -> None:
        session, event = self._session, RequestCompleted(request, outcomes)
        failed = sum(isinstance(outcome, Failure) for outcome in outcomes)
        session.statistics.requests_failed += failed
        session.statistics.requests_ok += len(outcomes) - failed
        if session.fault_watch is not None and session.fault_watch.take(event):
            return
        if session.serving and outcomes:
            session.online = any(map(is_answer, outcomes))
        session.report.note(event)

    # -- refusals ---------------------------------------------------------------------------------

    @property
    def _absence(self) -> Sentence:
        session = self._session
        if not session.active:
            return (session.activated and session.defect) or sentences.bridge_inactive()
        return NOTHING if session.bus_available else sentences.bus_down()

    def control_refusal(self, action: ControlAction) -> Sentence:
        """Return why a control action cannot be requested now; '' if it can."""
        session = self._session
        if action is ControlAction.HOME and not session.homes:
            return sentences.no_homing()
        offline = False
        if session.control is None and action is not ControlAction.QUICK_STOP:
            refusal = sentences.no_control_section()
        elif self._absence:
            refusal = self._absence
        elif not session.online:
            offline = session.state is not DriveState.MAPPING_DIFFERS
            refusal = (sentences.drive_offline_because(session.state.value)
                       if not offline else sentences.drive_offline())
        else:
            refusal = (
                session.setpoints.untold_text if action is ControlAction.ENABLE else NOTHING)
        return session.control_refusal(action, refusal, offline=offline)

    def write_refusal(self, parameter: Parameter) -> Sentence:
        """Return why users may not write this parameter now; '' if they may."""
        session = self._session
        return session.roles.write_refusal(
            parameter, exchanging=session.active and not session.serving)
