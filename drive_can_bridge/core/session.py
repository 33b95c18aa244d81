# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A session: the conversation with one drive, as a state machine without input or output.

Its exchange (see :mod:`drive_can_bridge.exchange`) hands in frames, requests and the time,
and collects frames to send and events:

.. code-block:: python

    session.receive_frame(frame, now)
    session.handle_timer(now)          # when next_timer() says so
    for frame in session.take_frames(): ...
    session.frames_left(now, refused)  # there may be more frames then
    for event in session.take_events(): ...

A session never blocks, never raises on anything a drive sends, and sends nothing before
``activate``, after the stop of ``deactivate``, or while the bus is down.

What is the same for all families stands here: when a drive is found and lost, what is withdrawn
then, how a stop begins and what is reported when it was not acknowledged, which part acts when. A
family fills in what the exchange of its drives is: :meth:`Session.begin`,
:meth:`Session.begin_stop`, frames, and a few occasions to act (below "what a family may add").
What goes on beside that stands in the parts that a session is put together from
(:meth:`Session.set_parts`).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from enum import Enum
import math
from typing import Any, ClassVar, Protocol

from drive_can_bridge.compiled import mypyc_attr
from drive_can_bridge.core import sentences
from drive_can_bridge.core.command_interlock import CommandInterlock
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.drive_services import DriveServices
from drive_can_bridge.core.events import DriveState, Event
from drive_can_bridge.core.fault_watch import FaultWatch
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.neutral_stop import NeutralStop
from drive_can_bridge.core.outbox import Outbox
from drive_can_bridge.core.process_image import LastSent, ProcessImage
from drive_can_bridge.core.reporter import AdviceKind, Reporter
from drive_can_bridge.core.requests import (
    Failure, FailureKind, Outcomes, Request, RetryPolicy)
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.setpoints import Setpoints
from drive_can_bridge.core.statistics import DriveStatistics
from drive_can_bridge.core.stop_duty import Do, Happened, StopDuty


class Timed(Protocol):
    """Something with a timer."""

    @property
    def due(self) -> float:
        """When its timer expires; infinity: never."""


class Part(Timed, Protocol):
    """A part of a session that acts beside the others."""

    def handle_timer(self, now: float) -> None:
        """Do what is due, if anything."""

    def stop(self) -> None:
        """Cancel everything planned. The channel was cleared."""


class AcyclicPart(Timed, Protocol):
    """The acyclic channel."""

    def advance(self, now: float) -> None:
        """Do everything that is possible now."""

    def handle_stall(self, now: float) -> None:
        """Record that the process was stalled until now."""

    def clear(self) -> None:
        """Forget everything under way."""


class Stage(Enum):
    """The stages of a session."""

    #: serving requests at most
    IDLE = 'idle'
    #: looking for it, or exchanging
    RUNNING = 'running'
    #: telling it to stand still, before it is left alone
    STOPPING = 'stopping'


@mypyc_attr(allow_interpreted_subclasses=True)
class Session(ABC):
    """
    What all families share: the life cycle, and the parts that do everything else.

    :param image: what is exchanged, where more is built into telegrams than the profile says.
    :param roles: what users may not write, where a number alone is not enough to know.
    :param leader: the machine of the drive whose control word this one obeys, if another's.
    :ivar configuration: of the drive.
    :ivar control: the control and status word machine, or None.
    :ivar setpoints: every ``cyclic_request`` parameter but the control word, in slot order.
    :ivar interlock: whether commands reach the drive.
    :ivar fault_watch: knows which fault the drive has; None: not in the profile.
    :ivar neutral_stop: the quick stop of a drive without a control word.
    :ivar roles: what the bridge uses parameters for.
    :ivar sample_parameters: of a sample, in the order of ``ProcessDataReceived.raws``.
    :ivar sent: what the drive was commanded last.
    :ivar duty: whether the drive may be running by command, and was commanded to stop.
    :ivar retry: how long and how often the drive is asked.
    :ivar users: serves requests of users; the family provides the server.
    :ivar report: events, and what is missing while the drive is offline.
    :ivar remedy: what to do about a drive whose state is ``mapping differs``.
    :ivar stage: what is being done for the drive.
    :ivar activated: the bridge is active; ``active``: and does not leave the drive alone.
    :ivar online: the drive exchanges process data.
    :ivar homes: it can look for its reference.
    :ivar ever_online: it did so at least once since activation.
    :ivar defect: what went wrong in the program, in words, while the drive is left alone for that.
    :ivar serving: it only cares for parameter requests; ``online``: the last one was answered.
    :ivar enabled_by: name of the drive whose ``~/enable`` enables it: its own, but in a group.
    :ivar partners: sessions on this bus whose timers and events any call of one may change.
    :ivar phase: s, when in each period of the steady clock this drive has its turn among those
        that share its bus; None: whenever it is ready.
    """

    services: DriveServices
    #: what came with a frame is handled before anything is sent because of that
    looks_ahead: ClassVar[bool] = False
    _acyclic: AcyclicPart

    def __init__(self, drive: DriveConfiguration, control: ControlMachine | None, *,
                 image: ProcessImage | None = None, roles: Roles | None = None,
                 leader: ControlMachine | None = None) -> None:
        image = image or ProcessImage.of(drive, controlled=control is not None)
        self.configuration = drive
        self.control = control
        self.statistics = DriveStatistics()
        self.outbox = Outbox()
        self.report = Reporter(self.statistics, sentences.not_activated())
        self.remedy: Callable[[str], Sentence] = sentences.drive_to_correct
        self.duty = StopDuty()
        self.sent = LastSent(image.request)
        self.sample_parameters = image.sample
        self.setpoints = Setpoints(
            image.setpoints, timeout=drive.command_timeout,
            rearm_immediate=drive.rearm_immediate, sample=image.sample, sent=self.sent)
        self.interlock = CommandInterlock(
            self, self.setpoints, control, image.sample, self.report, leader,
            missed_limit=drive.missed_limit)
        self.neutral_stop = NeutralStop(self)
        table = drive.profile.fault
        self.fault_watch = None if table is None else FaultWatch(self, table)
        self.roles = roles or Roles(drive, controlled=control is not None)
        self.retry = RetryPolicy(
            timeout=drive.parameter_timeout, attempts=drive.parameter_retries + 1,
            offline=lambda: self.state is DriveState.OFFLINE)
        self.stage = Stage.IDLE
        self.activated = self.active = self.serving = self.bus_available = False
        self.online = self.ever_online = False
        self.homes = False
        self.defect = NOTHING
        self.enabled_by = drive.name
        self.partners: Sequence[Session] = ()
        self.phase: float | None = None
        self._parts: Sequence[Part] = ()
        self._timed: list[tuple[Timed, Callable[[float], None]]] = []

    def set_parts(self, *parts: Part, channel: AcyclicPart,
                   behind_control: Sequence[Part] = ()) -> None:
        """
        Set the parts, in the order in which they act.

        :param channel: acts at last.
        :param behind_control: act between the control word and the channel.
        """
        self._parts, self._acyclic = (*parts, *behind_control), channel
        self._timed = [(part, part.handle_timer) for part in parts]
        if self.control is not None:
            self._timed.append((self.control, self._handle_control_timer))
        else:
            self._timed.append((self.neutral_stop, self.neutral_stop.handle_timer))
        self._timed += [(part, part.handle_timer) for part in behind_control]
        self._timed.append((channel, channel.advance))

    # -- life cycle -------------------------------------------------------------------------------

    def activate(self, now: float) -> None:
        """Start the exchange (as soon as the bus is there)."""
        self.activated = self.active = True
        self.defect = NOTHING
        self.ever_online = False
        self.sent.clear()
        self.setpoints.reset()
        self.duty.happened(Happened.ACTIVATED)  # not responsible for previous ones
        if self.bus_available:
            self.bus_up(now)

    def serve(self) -> None:
        """
        Serve parameter requests only, instead of ``activate``.

        No exchange, no setpoint, no control word, nothing unasked: so there is
        nothing to be stopped either, and no ``deactivate``.
        """
        self.active = self.serving = True

    def deactivate(self, now: float) -> None:
        """Start the safe stop: neutral setpoints, ``disable``; then silence."""
        self.activated = False
        # left alone after an internal error, and its stop not acknowledged: this one may arrive
        if self.defect and self.stopped and self.bus_available and any(
                each.stop_pending for each in (self, *self.partners)):
            self.stage = Stage.RUNNING
        self._begin_end(sentences.bridge_inactive(), now)

    def fail(self, reason: Sentence, now: float) -> None:
        """
        Stop the drive after an internal error: the state of the session cannot be trusted.

        It is offline from now on, and left alone until :meth:`recover`.

        :param reason: in words.
        """
        if self.defect or self.stage is Stage.IDLE and not self.active:
            return      # its stop goes on
        self.defect = reason
        self._begin_end(reason, now)

    def recover(self, now: float) -> None:
        """Look for the drive again, after an internal error."""
        self.defect = NOTHING
        self.active = True
        if self.bus_available:
            self.bus_up(now)

    def _begin_end(self, reason: Sentence, now: float) -> None:
        self.active = False
        if not self.online and not self.stopped:    # what ended before has been judged
            self.duty.happened(Happened.SILENT)
        pending = self.prepare_stop(now)
        if pending:
            self.stage = Stage.STOPPING
        self.services.fail_all(Failure(FailureKind.UNAVAILABLE, reason))
        self.withdraw(reason, now)
        if pending and self.begin_stop(now):
            return
        self._warn_if_running(sentences.stop_not_possible())
        self.go_idle()

    def stop_left(self, why: Sentence = NOTHING) -> None:
        """
        End a stop that was not acknowledged: send nothing more.

        :param why: what is wrong with it; by default, that it is not acknowledged.
        """
        self._warn_if_running(why or sentences.stop_not_answered())
        self.go_idle()

    def stop_ended(self) -> None:
        """End a stop by writes, if the session is stopping: its failures are reported already."""
        if self.stage is Stage.STOPPING:
            self.go_idle()

    @property
    def stopped(self) -> bool:
        """Whether the stop is complete (also: none was needed)."""
        return self.stage is Stage.IDLE

    @property
    @abstractmethod
    def longest_stop(self) -> float:
        """How many s the stop takes at most."""

    def bus_up(self, now: float) -> None:
        """Start using the bus: it was opened."""
        self.bus_available = True
        if self.active and not self.serving:
            self.report.guess(sentences.looked_for())
            self.restart(now)

    def bus_down(self, now: float, reason: str) -> None:
        """Handle the loss of the bus: requests fail, the drive is offline."""
        self.bus_available = False
        if self.unacknowledged or not (self.active or self.stopped):
            self.duty.happened(Happened.SILENT)     # no answer to the stop will come
        self.services.fail_all(Failure(FailureKind.UNAVAILABLE, sentences.bus_down()))
        down = sentences.bus_is_down(self.configuration.bus, reason)
        self.lose(down, now)
        self.go_idle(down)
        self.outbox.clear()
        self._warn_if_running(sentences.bus_lost_before_stop())

    def give_up(self, now: float) -> None:
        """Handle a stop that did not end in time: the bus accepts nothing."""
        self.duty.happened(Happened.SILENT)     # what has left of it was not answered
        self._warn_if_running(sentences.stop_not_possible())
        self.go_idle()
        self.outbox.clear()

    def go_idle(self, lost: Sentence = NOTHING) -> None:
        """
        Send nothing more, and be offline.

        :param lost: why, if it is not that the bridge was deactivated.
        """
        self.stage = Stage.IDLE
        self.fall_silent()
        self.be_offline(lost or sentences.deactivated(), ordered=not lost)

    def handle_stall(self, now: float) -> None:
        """Handle a stall of the process: nothing late is sent, setpoints must be armed again."""
        self._acyclic.handle_stall(now)
        if self.stage is Stage.RUNNING:
            self.lose_after_stall(now)
            self.restart(now)

    def restart(self, now: float) -> None:
        """Restart the exchange: the state of the drive is unknown."""
        reason = sentences.reconnected()
        if self.online:
            self.lose(reason, now)
        else:
            self.withdraw(reason, now)
        self.setpoints.forget()
        self.stage = Stage.RUNNING
        self.begin(now)

    def lose(self, reason: Sentence, now: float) -> None:
        """Set the drive offline, if it is not."""
        was_online = self.online
        self.withdraw(reason, now)
        self.setpoints.forget()
        if was_online and self.interlock.position_unknown:
            self._warn_if_running(sentences.position_unknown())
        self.be_offline(reason)
        self.lost(now, was_online=was_online)

    def lose_after_stall(self, now: float) -> None:
        """Set the drive offline after a stall: nothing was exchanged meanwhile."""
        self.lose(sentences.bridge_stood_still(), now)

    def withdraw(self, reason: Sentence, now: float) -> None:
        """Go neutral, and back to ``disable``."""
        self.neutral_stop.fail(reason)
        self.interlock.withdraw(reason, now)
        if self.control is not None:
            self.withdrawn(now)

    def be_online(self) -> None:
        """Record that the drive exchanges process data."""
        self.online = self.ever_online = True
        self.report.found()

    def be_offline(self, reason: Sentence, *, ordered: bool = False) -> None:
        """Record that the drive is offline, if it was not."""
        self.report.lost(reason, was_online=self.online, ordered=ordered)
        self.online = False
        self.went_offline()

    def _warn_if_running(self, why: Sentence) -> None:
        """Warn if the drive is left running: commanded to run, and not to stop."""
        if self.duty.happened(Happened.LEFT_ALONE) is Do.WARN:
            self.report.warn(why, may_run=True)

    # -- what a family fills in -------------------------------------------------------------------

    @abstractmethod
    def begin(self, now: float) -> None:
        """Start the exchange; the state of the drive is unknown."""

    @abstractmethod
    def begin_stop(self, now: float) -> bool:
        """Start commanding the drive to stand still; False: there is no way to."""

    # -- what a family may add --------------------------------------------------------------------

    def prepare_stop(self, now: float) -> bool:
        """Forget what the stop will not need; return whether there is anything to be stopped."""
        self._acyclic.clear()
        return self.stage is not Stage.IDLE

    def fall_silent(self) -> None:
        """Forget everything that was to be sent, or is under way."""
        self._acyclic.clear()
        for part in self._parts:
            part.stop()

    def exchange_missed(self, reason: Sentence, now: float) -> None:
        """
        Handle an exchange that was not answered, unless the drive is being stopped.

        :param reason: why the drive counts as lost; '' if it does not yet.
        """
        if reason:
            self.lose(reason, now)

    def exchange_ended(self) -> None:  # noqa: B027  optional
        """Forget the state of an exchange that has ended, answered or not."""

    def commands_expired(self, now: float) -> None:  # noqa: B027  optional
        """Record that setpoints went neutral because no fresh command keeps them."""

    def lost(self, now: float, *, was_online: bool) -> None:  # noqa: B027  optional
        """Record that the drive is lost."""

    def went_offline(self) -> None:  # noqa: B027  optional
        """Forget what is known only of a drive that is online."""

    def withdrawn(self, now: float) -> None:
        """Record that the control word is ``disable`` again."""
        self.update_control_word(now)

    def hand_out_neutral(self, now: float) -> None:  # noqa: B027  where there may be no control
        """Send all setpoints at once, neutral as they are: a drive without a control word."""

    def request_control(self, request: ControlRequest, now: float) -> None:
        """Handle a request for a control action."""
        if self.control is not None:
            self.control.request(request, now)
            self.control_changed(now)

    def control_refusal(self, action: ControlAction, refusal: Sentence, *,
                        offline: bool) -> Sentence:
        """
        Return why a control action cannot be requested; '' if it can.

        :param refusal: the usual text.
        :param offline: that the drive is offline is that text.
        """
        return refusal

    def request_refusal(self, now: float) -> Failure | None:
        """Return why the drive itself takes no parameter requests now; None if it does."""
        return None

    def request_answered(self, request: Request, outcomes: Outcomes) -> None:  # noqa: B027
        """Record a request for parameters that was served, and answered."""

    def home(self, request: ControlRequest, now: float) -> None:
        """Start homing; answered by exactly one ``ControlCompleted``."""
        raise NotImplementedError   # only called where ``homes`` is true

    def update_control_word(self, now: float) -> None:  # noqa: B027  optional
        """Send a control word that has changed."""

    # -- traffic ----------------------------------------------------------------------------------

    @abstractmethod
    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        """
        Handle a frame that one of the drive's routes matched.

        :param age: s since it was received. That counts for stamps and latencies only: whatever
            is sent in answer to it leaves now.
        """

    def handle_timer(self, now: float) -> None:
        """Do what is due. May be called at any time."""
        for part, act in self._timed:
            if now >= part.due:
                act(now)

    def next_timer(self) -> float:
        """Return when ``handle_timer`` wants to be called next; infinity: never."""
        soonest = math.inf
        for part, _ in self._timed:     # after every frame: min() costs twice as much
            at = part.due
            if at < soonest:
                soonest = at
        return soonest

    def _handle_control_timer(self, now: float) -> None:
        if self.control is not None:
            self.control.handle_timer(now)
            self.control_changed(now)

    def take_frames(self) -> list[Frame]:
        """Return the frames to be sent now, in order."""
        return self.outbox.take()

    def frames_left(self, now: float, refused: Collection[int] = ()) -> None:
        """
        Record what became of the frames last taken; there may be more to be sent then.

        :param refused: places in the list of those that the bus did not take: they do not count.
        """
        self.outbox.left(now, refused)

    def take_events(self) -> list[Event]:
        """Return what happened since the last call."""
        if self.control is not None:
            self.report.events += self.control.take_completed()
        if self.fault_watch is not None:
            self.fault_watch.look(self.report.events)
        return self.report.take()

    def control_changed(self, now: float) -> None:
        """Handle a control word, or a state, that may have changed."""
        self.interlock.follow()
        self.update_control_word(now)

    def reconfigure(self, *, command_timeout: float | None = None,
                    rearm_immediate: bool | None = None,
                    parameter_timeout: float | None = None) -> None:
        """Change what may change while running; None leaves a value alone."""
        changes: dict[str, Any] = {
            'command_timeout': command_timeout, 'rearm_immediate': rearm_immediate,
            'parameter_timeout': parameter_timeout}
        drive = self.configuration = replace(self.configuration, **{
            key: value for key, value in changes.items() if value is not None})
        self.setpoints.timeout = drive.command_timeout
        self.setpoints.rearm_immediate = drive.rearm_immediate
        self.retry.timeout = drive.parameter_timeout

    # -- state ------------------------------------------------------------------------------------

    @property
    def state(self) -> DriveState:
        """The state in one word."""
        if self.defect:
            return DriveState.OFFLINE
        watch = self.fault_watch
        if watch is not None and watch.shows and self.control is None and self.online:
            return DriveState.FAULT
        return self.interlock.state

    @property
    def shows_fault(self) -> bool:
        """Whether its own status reports a fault."""
        return self.control is not None and self.control.fault

    @property
    def warning(self) -> Sentence:
        """Why a drive that is online needs attention, and what to do; '' otherwise."""
        return NOTHING

    @property
    def error(self) -> Sentence:
        """Why a drive that is online must not be driven, as an ERROR; '' if it may."""
        return NOTHING

    @property
    def busy(self) -> Sentence:
        """What the drive does by itself, during which nothing arms; '' if nothing."""
        return NOTHING

    def facts(self) -> dict[str, str]:
        """Return what diagnostics show of this family beyond what all families have."""
        return {}

    # All that is ever asked of the stop duty is asked here (``test/test_layers.py``).

    @property
    def may_run(self) -> bool:
        """Whether the drive may still be running by command."""
        return self.duty.may_run

    @property
    def stop_pending(self) -> bool:
        """Whether the drive was commanded to run, and since then to stop only in vain."""
        return self.duty.stop_pending

    @property
    def unacknowledged(self) -> bool:
        """Whether the drive was commanded to run, and has not acknowledged its stop."""
        return self.duty.unacknowledged

    @property
    def offline_advice(self) -> Sentence:
        """While not online: what is missing and what to check; '' while online."""
        return self.defect or self.report.advice

    @property
    def guesses(self) -> bool:
        """Whether the advice rests only on the drive's not answering."""
        return not self.defect and self.report.advice_kind is AdviceKind.GUESS
