# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A session: the conversation with one drive, as a state machine without input or output.

Whoever drives it (see :mod:`drive_can_bridge.exchange`) hands in frames, requests and the time,
and collects frames to send and events:

.. code-block:: python

    session.receive_frame(frame, now)
    session.handle_timer(now)          # when next_timer() says so
    for frame in session.take_frames(): ...
    session.frames_left(now, refused)  # there may be more frames then
    for event in session.take_events(): ...

A session never blocks, never raises on anything a drive sends, and sends nothing before
``activate``, after ``deactivate`` has run its course, or while the bus is down.

What is the same for all families stands here: when a drive is found and lost, what is taken back
then, which requests are refused, how a stop begins and what is said when it was not acknowledged.
A family fills in what the exchange of its drives is: :meth:`Session.begin`,
:meth:`Session.begin_stop`, :meth:`Session.go_idle`, frames, timers, and a few occasions to act
(below "what a family may add").
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import replace
from enum import Enum

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.events import (
    Event, FrameRejected, Noted, RequestCompleted, SetpointsExpired, StationFound, StationLost,
)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.last_sent import LastSent
from drive_can_bridge.core.outbox import Outbox
from drive_can_bridge.core.parameters import Parameter, Value
from drive_can_bridge.core.request_desk import RequestDesk, RequestServer
from drive_can_bridge.core.requests import (
    BRIDGE_INACTIVE, BUS_DOWN, BUSY, is_answer, Outcomes, Request,
)
from drive_can_bridge.core.retry import RetryPolicy
from drive_can_bridge.core.roles import Cells, Role, Roles
from drive_can_bridge.core.setpoints import CommandOutcome, Setpoints
from drive_can_bridge.core.statistics import DriveStatistics
from drive_can_bridge.core.told import MAY_RUN, Told

#: requests of one drive that may wait behind the one being served
WAITING_REQUESTS_MAX = 64
#: cyclic frames with neutral setpoints that are sent before a drive is left alone
STOP_CYCLES = 3
#: s of pause between them at most, however long the period is; and between those of a pulse
STOP_SPACING_MAX = 0.1
DRIVE_OFFLINE = 'drive offline'
#: advice until more is known
LOOKING = 'being looked for'


class DriveState(Enum):
    """The state of a drive in one word, as diagnostics shows it."""

    OFFLINE = 'offline'
    MAPPING_DIFFERS = 'mapping differs'
    DISABLED = 'disabled'
    NOT_ARMED = 'not armed'
    ONLINE = 'online'
    FAULT = 'fault'


class Session(ABC):
    """
    What all families share: setpoints, statistics, the outboxes, the life cycle.

    :ivar configuration: of the drive.
    :ivar setpoints: every ``cyclic_request`` parameter but the control word, in slot order.
    :ivar control: the control and status word machine, or None.
    :ivar retry: how long and how often the drive is asked.
    :ivar sent: what the drive was told last.
    :ivar roles: what users may not write.
    :ivar online: the drive exchanges process data.
    :ivar ever_online: it did so at least once since activation.
    :ivar serving: parameter requests are all that it cares for; ``online`` says then whether the
        drive answered the last one.
    :ivar told: whether the drive may be running by our word.
    :ivar partners: sessions on the same bus whose timers and events may change with any call of
        this one.
    :ivar phase: s, when in each period of the steady clock this drive has its turn, for drives
        that share a bus; None: whenever it is ready.
    """

    def __init__(self, drive: DriveConfiguration, control: ControlMachine | None) -> None:
        self.configuration = drive
        self.control = control
        control_table = drive.profile.control
        self._control_name = control_table.parameter if control_table and control else ''
        self.sent = LastSent(self.request_parameters)
        self.setpoints = Setpoints(
            tuple(parameter for parameter in drive.cyclic_request
                  if parameter.name != self._control_name),
            timeout=drive.command_timeout, rearm_immediate=drive.rearm_immediate,
            sample=self.sample_parameters, sent=self.sent)
        self._status_in_sample = control is not None and any(
            parameter.name == control.table.status_parameter
            for parameter in self.sample_parameters)
        self.roles = Roles(
            self.cells, control=drive.profile.parameters.get(self._control_name),
            cyclic=drive.cyclic_request, maps=self.map_cells)
        self.statistics = DriveStatistics()
        self.retry = RetryPolicy(
            timeout=drive.parameter_timeout, attempts=drive.parameter_retries + 1,
            offline=lambda: self.state is DriveState.OFFLINE)
        self.online = False
        self.ever_online = False
        self.active = False
        self.serving = False
        self.bus_available = False
        self.phase: float | None = None
        self.told = Told()
        self.partners: Sequence[Session] = ()
        self.outbox = Outbox()
        self._events: list[Event] = []
        self._advice = 'not activated'

    def serve_by(self, server: RequestServer) -> None:
        """Have requests of users served by this."""
        self._requests = RequestDesk(server, self.statistics, self._request_completed)

    @property
    def builtin_parameters(self) -> tuple[Parameter, ...]:
        """What every sample carries besides ``cyclic_response``; families that have it say so."""
        return ()

    @property
    def request_parameters(self) -> tuple[Parameter, ...]:
        """What the drive is told: ``cyclic_request``, and a control word without a slot."""
        mapped = self.configuration.cyclic_request
        word = self.configuration.profile.parameters.get(self._control_name)
        return mapped if word is None or word in mapped else (*mapped, word)

    @property
    def sample_parameters(self) -> tuple[Parameter, ...]:
        """
        The parameters of a sample, in the order of ``ProcessDataReceived.raws``.

        What is built in comes first: a short telegram lacks the last values, never the status.
        """
        return (*self.builtin_parameters, *self.configuration.cyclic_response)

    # -- life cycle -------------------------------------------------------------------------------

    def activate(self, now: float) -> None:
        """Begin to exchange (as soon as the bus is there)."""
        self.active = True
        self.ever_online = False
        self.sent.clear()
        self.setpoints.reset()
        self.told.stopped()  # what an activation before this one told is not ours to undo
        if self.bus_available:
            self._advice = LOOKING
            self.start_over(now)

    def serve(self) -> None:
        """
        Serve parameter requests and do nothing else, instead of ``activate``.

        No exchange, no setpoint, no control word, nothing that nobody asked for: so there is
        nothing to be stopped either, and no ``deactivate``.
        """
        self.active = self.serving = True

    def deactivate(self, now: float) -> None:
        """Begin the safe stop: neutral setpoints, ``disable``; then silence."""
        self.active = False
        owes = self.prepare_stop(now)
        self._requests.fail_all(BRIDGE_INACTIVE)
        self.withdraw(BRIDGE_INACTIVE, now)
        if owes and self.begin_stop(now):
            return
        if owes or not self.bus_available:
            self._leave_owing()
        self.go_idle('deactivated')

    @property
    @abstractmethod
    def stopped(self) -> bool:
        """Nothing more will be sent until the next ``activate``."""

    @property
    def longest_stop(self) -> float:
        """Return how many s a stop takes at most."""
        return STOP_CYCLES * self.stop_spacing

    def bus_up(self, now: float) -> None:
        """Begin to use the bus: it was opened."""
        self.bus_available = True
        if self.active and not self.serving:
            self._advice = LOOKING
            self.start_over(now)

    def bus_down(self, now: float, reason: str) -> None:
        """Handle the loss of the bus: requests fail, the drive is offline."""
        self.bus_available = False
        self._requests.fail_all(BUS_DOWN)
        self.lose(f'bus down: {reason}', now)
        self.go_idle(f'bus down: {reason}')
        self.outbox.clear()
        if self.told.owed:
            self.warn(f'the bus was lost before it could be told to stop: {MAY_RUN}')

    def give_up(self, now: float) -> None:
        """Handle a stop that did not come to its end in time: the bus takes nothing."""
        self._leave_owing()
        self.go_idle('deactivated')
        self.outbox.clear()

    @abstractmethod
    def time_lost(self, now: float) -> None:
        """Handle a process that stood still: nothing stale goes out, setpoints want re-arming."""

    def start_over(self, now: float) -> None:
        """Begin anew: nothing is known of the drive."""
        reason = 'the drive is being reconnected'
        if self.online:
            self.lose(reason, now)
        else:
            self.withdraw(reason, now)
        self.setpoints.forget()
        self.begin(now)

    def lose(self, reason: str, now: float) -> None:
        """Make the drive offline, if it is not."""
        was_online = self.online
        self.withdraw(reason, now)
        self.setpoints.forget()
        if was_online and self.mute and self.told.owed:
            self.warn(f'where its axis is, nobody knows, so that it is told nothing: {MAY_RUN}')
        self.be_offline(reason)
        self.lost(now, was_online=was_online)

    def stood_still(self, now: float) -> None:
        """Begin anew after a stall."""
        self.lose('the bridge stood still', now)
        self.start_over(now)

    def withdraw(self, reason: str, now: float) -> None:
        """Go neutral, and back to ``disable``."""
        self.setpoints.allow(False)
        if self.control is not None:
            self.control.withdraw(reason, now)
            self.tell_notes()
            self.let_commands_through()
            self.withdrawn(now)

    # -- what a family fills in -------------------------------------------------------------------

    @abstractmethod
    def begin(self, now: float) -> None:
        """Begin the exchange; nothing is known of the drive."""

    @abstractmethod
    def prepare_stop(self, now: float) -> bool:
        """Forget what the stop will not need; tell whether there is anything to be stopped."""

    @abstractmethod
    def begin_stop(self, now: float) -> bool:
        """Begin to tell the drive to stand still; False: there is no way to tell it."""

    @abstractmethod
    def go_idle(self, advice: str) -> None:
        """Send nothing more, and be offline."""

    # -- what a family may add --------------------------------------------------------------------

    def lost(self, now: float, *, was_online: bool) -> None:  # noqa: B027  optional
        """Take note that the drive is lost."""

    def went_offline(self) -> None:  # noqa: B027  optional
        """Forget what belongs to a drive that is online."""

    def withdrawn(self, now: float) -> None:
        """Take note that the control word is ``disable`` again."""
        self.see_to_control_word(now)

    def see_to_control_word(self, now: float) -> None:  # noqa: B027  optional
        """Have a control word sent that has changed."""

    def request_answered(self, request: Request, outcomes: Outcomes) -> None:  # noqa: B027
        """Take note of what a request has brought about."""

    def request_refusal(self, now: float) -> str:
        """Say what of the drive itself forbids requests now; '' if nothing."""
        return ''

    # -- traffic ----------------------------------------------------------------------------------

    @abstractmethod
    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        """
        Take a frame that one of the drive's routes matched.

        :param age: s since it was received. That counts for stamps and latencies only: whatever
            is sent in answer to it leaves now.
        """

    @abstractmethod
    def handle_timer(self, now: float) -> None:
        """Do what is due. Safe to call at any time."""

    @abstractmethod
    def next_timer(self) -> float:
        """Return when ``handle_timer`` wants to be called next; infinity: never."""

    def _next_turn(self, earliest: float) -> float:
        """Return the time from ``earliest`` on at which cycles may begin."""
        if self.phase is None:
            return earliest
        return earliest + (self.phase - earliest) % self.configuration.period

    def take_frames(self) -> list[Frame]:
        """Return the frames to be sent now, in order."""
        return self.outbox.take()

    def frames_left(self, now: float, refused: Collection[int] = ()) -> None:
        """
        Take note of what became of the frames last taken; there may be more to be sent then.

        :param refused: places in the list of those that the bus did not take: they do not count.
        """
        self.outbox.left(now, refused)

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        events = self._events
        if self.control is not None:
            events += self.control.take_completed()
        if events:
            self._events = []
        return events

    # -- users ------------------------------------------------------------------------------------

    def command(self, index: int, value: Value, now: float) -> CommandOutcome:
        """
        Take a setpoint command (index into ``setpoints.items``).

        :raises ValueRefused: the value cannot be sent; counted, nothing else changes.
        """
        try:
            outcome = self.setpoints.command(index, value, now)
        except ValueError:
            self.statistics.commands_refused += 1
            raise
        if outcome is CommandOutcome.NOT_ARMED and self.state is DriveState.DISABLED:
            return CommandOutcome.DISABLED
        return outcome

    def submit(self, request: Request | ControlRequest, now: float) -> None:
        """
        Take a request of a user.

        It is answered by exactly one ``RequestCompleted``, or ``ControlCompleted``.
        """
        if isinstance(request, ControlRequest):
            self._submit_control(request, now)
            return
        refusal = self.request_refusal(now) or self._refusal()
        if refusal:
            self._requests.refuse(request, refusal)
        elif not len(request):
            self._requests.complete(request, ())
        else:
            self._requests.serve(request, self.request_answered, now)

    def _submit_control(self, request: ControlRequest, now: float) -> None:
        refusal = self.control_refusal(request.action)
        if refusal or self.control is None:
            self._events.append(ControlCompleted(request, False, refusal))
            return
        self.control.request(request, now)
        self.control_changed(now)

    def _refusal(self) -> str:
        if not self.active:
            return BRIDGE_INACTIVE
        if not self.bus_available:
            return BUS_DOWN
        if self.waiting_requests >= WAITING_REQUESTS_MAX:
            return BUSY
        return ''

    def write_refusal(self, parameter: Parameter) -> str:
        """Say why users may not write this parameter now; '' if they may."""
        owner = self.roles.owner(parameter)
        if owner is None:
            return ''
        role, own = owner
        if role is Role.CONTROL:
            return 'use ~/enable'
        if role is Role.CYCLIC:
            return self.cyclic_refusal(own)
        if not self.active or self.serving:
            return ''
        return 'mapping parameter: not written while the bridge is active'

    def role(self, parameter: Parameter) -> Role | None:
        """Say what the bridge uses a parameter for that users cannot set for that reason."""
        owner = self.roles.owner(parameter)
        if owner is not None:
            return owner[0]
        cells = self.cells(parameter)
        received = not parameter.writable and any(
            parameter == other or cells & self.cells(other)
            for other in self.configuration.cyclic_response)
        return Role.CYCLIC if received else None

    def cells(self, parameter: Parameter) -> Cells:
        """Return what a parameter addresses on the drive; families with more than numbers say."""
        return frozenset() if parameter.number is None else frozenset([parameter.number])

    @property
    def map_cells(self) -> Cells:
        """What tells the drive how cyclic telegrams are to be read."""
        return frozenset()

    def cyclic_refusal(self, parameter: Parameter) -> str:
        """Say why a setpoint is not written by request."""
        return f'sent cyclically: publish ~/command/{parameter.name}'

    def fail_requests(self, reason: str) -> None:
        """Forget the requests that are under way, and answer them."""
        self._requests.fail_all(reason)

    @property
    def waiting_requests(self) -> int:
        """How many requests wait behind the one being served."""
        return self._requests.waiting

    def _request_completed(self, event: RequestCompleted) -> None:
        if self.serving and event.outcomes:
            self.online = any(map(is_answer, event.outcomes))
        self._events.append(event)

    def reconfigure(self, *, command_timeout: float | None = None,
                    rearm_immediate: bool | None = None,
                    parameter_timeout: float | None = None) -> None:
        """Change what may change while running; None leaves a value alone."""
        if command_timeout is not None:
            self.configuration = replace(self.configuration, command_timeout=command_timeout)
            self.setpoints.timeout = command_timeout
        if rearm_immediate is not None:
            self.configuration = replace(self.configuration, rearm_immediate=rearm_immediate)
            self.setpoints.rearm_immediate = rearm_immediate
        if parameter_timeout is not None:
            self.configuration = replace(self.configuration, parameter_timeout=parameter_timeout)
            self.retry.timeout = parameter_timeout

    # -- control ----------------------------------------------------------------------------------

    def control_refusal(self, action: ControlAction) -> str:
        """Say why a control action cannot be asked for now; '' if it can."""
        if self.control is None:
            return 'the profile has no control section'
        if not self.active:
            return BRIDGE_INACTIVE
        if not self.bus_available:
            return BUS_DOWN
        if not self.online:
            return DRIVE_OFFLINE
        return self.setpoints.untold_text if action is ControlAction.ENABLE else ''

    def control_changed(self, now: float) -> None:
        """React to a control word, or a state, that may have changed."""
        self.tell_notes()
        self.let_commands_through()
        self.see_to_control_word(now)

    def measured(self, raws: Sequence[int | None]) -> None:
        """Take a sample, for setpoints that stay where the axis is; after its status word."""
        if not self.setpoints.held:
            return
        control = self.control
        # once the word may have started the drive, only a status as new as the position tells
        free = control is not None and control.off and (
            control.at_rest or self._status_in_sample)
        if self.setpoints.measure(raws, driven=not free):
            self.let_commands_through()

    @property
    def mute(self) -> bool:
        """Tell whether nothing may be sent: where the axis is, nobody knows, and it would go."""
        return self.control is None and not self.setpoints.known

    def let_commands_through(self) -> None:
        """Take commands while they may move the drive, and only then: otherwise it is neutral."""
        self.setpoints.allow(self.active and self.online and self.operating)

    @property
    def operating(self) -> bool:
        """Tell whether setpoints may move the drive, as far as its control word is concerned."""
        return self.control is None or self.control.operating

    @property
    def how_to_enable(self) -> str:
        """Say what to do about a drive that is disabled."""
        return 'call ~/enable'

    # -- state ------------------------------------------------------------------------------------

    @property
    def state(self) -> DriveState:
        """The state in one word."""
        if not self.online:
            return DriveState.OFFLINE
        if self.control is not None and self.control.fault:
            return DriveState.FAULT
        if not self.operating:
            return DriveState.DISABLED
        if self.setpoints.waiting:
            return DriveState.NOT_ARMED
        return DriveState.ONLINE

    @property
    def warning(self) -> str:
        """Why all is not well although the drive is online, and what to do; '' otherwise."""
        return ''

    def facts(self) -> dict[str, str]:
        """Return what diagnostics show of this family beyond what all families have."""
        return {}

    @property
    def offline_advice(self) -> str:
        """While not online: what is missing and what to look at; '' while online."""
        return self._advice

    # -- for the families -------------------------------------------------------------------------

    @property
    def stop_spacing(self) -> float:
        """Return how many s lie between two cycles of a stop, or of a pulse."""
        return min(self.configuration.period, STOP_SPACING_MAX)

    def be_online(self) -> None:
        """Tell that the drive exchanges process data."""
        self.online = self.ever_online = True
        self._advice = ''
        self._events.append(StationFound())

    def be_offline(self, reason: str) -> None:
        """Tell that the drive is offline, if it was not."""
        self._advice = reason
        if self.online:
            self.online = False
            self._events.append(StationLost(reason))
        self.went_offline()

    def expire(self, now: float) -> bool:
        """Let setpoints go neutral that no fresh command keeps; tell whether there were any."""
        expired = self.setpoints.expire(now)
        if expired:
            self._events.append(SetpointsExpired(
                tuple(setpoint.parameter.name for setpoint in expired)))
        return bool(expired)

    def advise(self, text: str) -> None:
        """Say what is missing while the drive is offline, and what to look at."""
        self._advice = text

    def reject(self, text: str) -> None:
        """Count and tell a frame of the drive that is malformed or unasked."""
        self.statistics.rejected += 1
        self._events.append(FrameRejected(text))

    def note(self, event: Event) -> None:
        """Tell something else that happened."""
        self._events.append(event)

    def warn(self, text: str) -> None:
        """Tell people what is not as it should be."""
        self._events.append(Noted(text, warning=True))

    def _leave_owing(self) -> None:
        """Say at the end of an activation that the drive could not be told to stop."""
        if self.told.owed:
            self.warn(f'could not be told to stop: {MAY_RUN}')

    def tell_notes(self) -> None:
        """Tell what the control machine noted; during a stop, it is what everybody expects."""
        if self.control is not None:
            for note in self.control.take_notes():
                self._events.append(Noted(note, warning=self.active))
