# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What users want of one drive: commands, requests, control; and why they cannot have it.

A command is judged at once. A request is answered by an event: refused at once, or when it has
been served (:class:`RequestDesk`), or when the control machine says so.
"""

from collections.abc import Callable
from typing import Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.drive_state import DriveState
from drive_can_bridge.core.events import RequestCompleted
from drive_can_bridge.core.fault_watch import FaultWatch
from drive_can_bridge.core.neutral_stop import NeutralStop
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.requests import Failure, is_answer, Outcomes, Request
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.sentences import NOTHING, Sentence
from drive_can_bridge.core.setpoints import CommandOutcome, Setpoints
from drive_can_bridge.core.statistics import DriveStatistics


#: requests of one drive that may wait behind the one being served
WAITING_REQUESTS_MAX = 64


class RequestServer(Protocol):
    """Serves requests one after the other."""

    @property
    def waiting(self) -> int:
        """How many wait behind the one being served."""

    def serve(self, request: Request, done: Callable[[Outcomes], None], now: float) -> None:
        """Queue a request; ``done`` gets an outcome for each name."""

    def cancel(self) -> None:
        """Forget all of them; nobody is told."""


class RequestDesk:
    """
    Takes requests, has them served, and sees that each is answered exactly once.

    :param emit: takes the answers.
    :param refusal: (now) -> why none are taken; '' if they are.
    :param answered: called after an answer, unless the request failed with all others.
    """

    def __init__(self, server: RequestServer, statistics: DriveStatistics,
                 emit: Callable[[RequestCompleted], None], *, refusal: Callable[[float], Sentence],
                 answered: Callable[[Request, Outcomes], None]) -> None:
        self._server = server
        self._statistics = statistics
        self._emit = emit
        self._refusal = refusal
        self._answered = answered
        self._open: list[Request] = []

    @property
    def waiting(self) -> int:
        """How many requests wait behind the one being served."""
        return self._server.waiting

    def submit(self, request: Request, now: float) -> None:
        """Take a request; it is answered by exactly one ``RequestCompleted``."""
        refusal = self._refusal(now)
        if not refusal and self.waiting >= WAITING_REQUESTS_MAX:
            refusal = sentences.busy()
        if refusal:
            self._refuse(request, refusal)
        elif not len(request):
            self._complete(request, ())
        else:
            self._open.append(request)
            self._server.serve(request, lambda outcomes: self._done(request, outcomes), now)

    def fail_all(self, reason: Sentence) -> None:
        """Forget what is under way, and answer it."""
        self._server.cancel()
        requests, self._open = self._open, []
        for request in requests:
            self._refuse(request, reason)

    def _done(self, request: Request, outcomes: Outcomes) -> None:
        self._open.remove(request)
        self._complete(request, outcomes)
        self._answered(request, outcomes)

    def _refuse(self, request: Request, reason: Sentence) -> None:
        """Answer a request with the same failure for every name."""
        self._complete(request, (Failure(reason),) * len(request))

    def _complete(self, request: Request, outcomes: Outcomes) -> None:
        for outcome in outcomes:
            if isinstance(outcome, Failure):
                self._statistics.requests_failed += 1
            else:
                self._statistics.requests_ok += 1
        self._emit(RequestCompleted(request, outcomes))


class Conversation(Protocol):
    """What users can have, by where it stands with their drive; the session itself."""

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
        """Have the axis look for its reference."""

    def control_changed(self, now: float) -> None:
        """React to a control word that may have changed."""


class Users:
    """
    The users' side of one session.

    :param server: serves requests for parameters.
    :param blocked: (now) -> what of the drive itself forbids these; '' if nothing.
    :param control_refusal: (action, refusal) -> what is said instead of the usual refusal of a
        control action, '' meaning that it is not refused.
    :param answered: called after the answer of a request that was served.
    :param control: takes what is asked of the drive by its control word; None: its own machine.
    """

    def __init__(self, session: Conversation, server: RequestServer, *,
                 blocked: Callable[[float], Sentence] = lambda now: NOTHING,
                 control_refusal: Callable[[ControlAction, Sentence], Sentence] = (
                     lambda action, refusal: refusal),
                 answered: Callable[[Request, Outcomes], None] = lambda request, outcomes: None,
                 control: Callable[[ControlRequest, float], None] | None = None) -> None:
        self._session = session
        self._control = control
        self._blocked = blocked
        self._judge = control_refusal
        self._desk = RequestDesk(
            server, session.statistics, self._completed, refusal=self._refusal,
            answered=answered)

    # -- commands ---------------------------------------------------------------------------------

    def command(self, index: int, value: Value, now: float) -> CommandOutcome:
        """
        Take a setpoint command (index into ``setpoints.items``).

        :raises ValueRefused: the value cannot be sent; counted, nothing else changes.
        """
        session = self._session
        try:
            outcome = session.setpoints.command(
                index, value, now, active=session.active)
        except ValueError:
            session.statistics.commands_refused += 1
            raise
        if outcome is CommandOutcome.NOT_ARMED and session.state is DriveState.DISABLED:
            return CommandOutcome.DISABLED
        return outcome

    # -- requests ---------------------------------------------------------------------------------

    def submit(self, request: Request | ControlRequest, now: float) -> None:
        """
        Take a request.

        It is answered by exactly one ``RequestCompleted``, or ``ControlCompleted``.
        """
        if not isinstance(request, ControlRequest):
            self._desk.submit(request, now)
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
        if self._control is not None:
            self._control(request, now)
            return
        session.control.request(request, now)
        session.control_changed(now)

    @property
    def waiting(self) -> int:
        """How many requests for parameters wait behind the one being served."""
        return self._desk.waiting

    def fail_all(self, reason: Sentence) -> None:
        """Forget the requests for parameters that are under way, and answer them."""
        self._desk.fail_all(reason)

    def _completed(self, event: RequestCompleted) -> None:
        session = self._session
        if session.fault_watch is not None and session.fault_watch.take(event):
            return
        if session.serving and event.outcomes:
            session.online = any(map(is_answer, event.outcomes))
        session.report.note(event)

    # -- refusals ---------------------------------------------------------------------------------

    def _refusal(self, now: float) -> Sentence:
        """Say why requests for parameters are not taken now; '' if they are."""
        return self._blocked(now) or self._absence

    @property
    def _absence(self) -> Sentence:
        if not self._session.active:
            return self._session.defect or sentences.bridge_inactive()
        return NOTHING if self._session.bus_available else sentences.bus_down()

    def control_refusal(self, action: ControlAction) -> Sentence:
        """Say why a control action cannot be asked for now; '' if it can."""
        session = self._session
        if action is ControlAction.HOME and not session.homes:
            return sentences.no_homing()
        if session.control is None and action is not ControlAction.QUICK_STOP:
            refusal = sentences.no_control_section()
        elif self._absence:
            refusal = self._absence
        elif not session.online:
            refusal = sentences.drive_offline()
        else:
            refusal = (
                session.setpoints.untold_text if action is ControlAction.ENABLE else NOTHING)
        return self._judge(action, refusal)

    def write_refusal(self, parameter: Parameter) -> Sentence:
        """Say why users may not write this parameter now; '' if they may."""
        session = self._session
        return session.roles.write_refusal(
            parameter, exchanging=session.active and not session.serving)
