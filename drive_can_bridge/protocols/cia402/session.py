# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one drive of CiA 402.

Before the first PDO a drive is set up by SDO (:mod:`.node_set_up`), and so it is after every loss:
a node that has restarted has forgotten what was written. That it has power is not needed.
That, again and again until it is ready to be cycled, is one script (``_script``).
A drive that is lost while it is online gets three neutral cycles more before it restarts.

Whatever was told to run is told to stop: by cycles while PDOs flow, otherwise by SDO, which no
mapping can misroute. At the end, stop cycles go on until the drive says that it is disabled, or
for ``control_timeout``; then it watches the bridge no more.
"""

from collections.abc import Sequence
from functools import partial
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.drive_services import DriveServices
from drive_can_bridge.core.errors import RemoteProtocolError, Unasked
from drive_can_bridge.core.events import (
    DriveState, ForeignMasterSeen, MappingDiffered, Noted, ProcessDataReceived)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.process_image import ProcessImage
from drive_can_bridge.core.reporter import AdviceKind
from drive_can_bridge.core.requests import Failure, FailureKind, Outcomes, Request, WriteRequest
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.status_reports import Wording
from drive_can_bridge.core.stop_duty import CYCLE, Do, Happened
from drive_can_bridge.protocols.access import OneByOne
from drive_can_bridge.protocols.answers import CycleAnswers
from drive_can_bridge.protocols.canopen import masters, network, sdo
from drive_can_bridge.protocols.canopen.network import NmtState
from drive_can_bridge.protocols.canopen.node import (
    HeartbeatWatch, NodeChange, START_PAUSE, START_PERIOD, START_SPACING, WatchedNode)
from drive_can_bridge.protocols.canopen.offline_traffic import OfflineTraffic
from drive_can_bridge.protocols.channel import Channel, Priority
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.protocols.cia402.heartbeats import (
    BridgeHeartbeat, common_heartbeat, HeartbeatSender)
from drive_can_bridge.protocols.cia402.homing import Homing
from drive_can_bridge.protocols.cia402.limits import LimitCheck
from drive_can_bridge.protocols.cia402.node_set_up import NodeSetUp, POLL_PERIOD
from drive_can_bridge.protocols.cia402.objects import SetUpOutcome, SetUpState
from drive_can_bridge.protocols.cia402.pdo import request_pdos, response_pdos
from drive_can_bridge.protocols.cia402.procedures import cells, MAP, SdoAccess
from drive_can_bridge.protocols.cia402.sdo_stop import SdoStop, StopProcedure
from drive_can_bridge.protocols.cia402.setpoint_handshake import SetpointHandshake
from drive_can_bridge.protocols.cia402.standstill import Standstill
from drive_can_bridge.protocols.cia402.state_machine import control_table, DriveRules, hint
from drive_can_bridge.protocols.cia402.state_polls import StatePolls
from drive_can_bridge.protocols.cia402.states import (
    CONTROL_PARAMETER, INTERPOLATION_MAX, MODES, ServoState, state_of, STATUS_PARAMETER)
from drive_can_bridge.protocols.cia402.stop_options import OPTIONS, stops_by
from drive_can_bridge.protocols.cia402.sync import EventTimer, FreeSync, SyncProducer, SyncSlot
from drive_can_bridge.protocols.cia402.transactor import (
    ObjectRead, Procedure, Reply, SdoChannel, SdoTransactor, Transfer)
from drive_can_bridge.protocols.cyclic_exchange import CyclicExchange, EXPIRY_SPACING
from drive_can_bridge.protocols.lifecycle import Lifecycle, Script
from drive_can_bridge.protocols.safe_stop import (
    ANSWER_TIME, SafeStop, StatusRead, STOP_ATTEMPTS, StopAgain, StopWrite)
from drive_can_bridge.protocols.transactor import Silence

#: s until a drive that differs, or runs on, is looked at again
LOOK_AGAIN = 1.0
#: periods without a complete set of TPDOs that are a missed exchange, where the drive has the pace
EVENT_PERIODS = 1.5
#: emergency code of a node that has missed the heartbeats of another
HEARTBEAT_ERROR = 0x8130
_MODE_PARAMETER = Parameter(name='mode', type=ParameterType.INT8, index=states.MODE, subindex=0)


class Cia402Session(Session):
    """
    Set-up, PDOs, and parameters by SDO of one drive.

    :param producer: of SYNC on its bus; None: it is alone there.
    :param heartbeat: that of the bridge on its bus; None: there is none.
    :ivar exchange: its cycles.
    """

    #: a boot-up frame may come with the answer before it
    looks_ahead = True

    def __init__(self, drive: DriveConfiguration, producer: SyncProducer | None = None,
                 heartbeat: BridgeHeartbeat | None = None) -> None:
        options = drive.options
        table = control_table(options)
        self._standstill = Standstill(drive)
        self._rules = DriveRules(table, options, self, self._standstill)
        control = ControlMachine(
            table, timeout=drive.control_timeout, rules=self._rules,
            wording=Wording(lambda status: state_of(status).value, hint))
        self._machine = control
        super().__init__(
            drive, control, image=ProcessImage.of(
                drive, controlled=True, word=(CONTROL_PARAMETER,), status=(STATUS_PARAMETER,)),
            roles=Roles(drive, controlled=True, cells=cells, maps=frozenset((MAP,)),
                        built_in=(CONTROL_PARAMETER, _MODE_PARAMETER)))
        self._node = WatchedNode(drive.station, heartbeat_timeout=options.heartbeat_timeout)
        self._transactor = SdoTransactor(drive.station, self.outbox, self.retry, self.sent)
        self._channel: SdoChannel = Channel(self._transactor)
        self.services = DriveServices(self, SdoAccess(self._channel, self.retry, OneByOne()))
        self._stop: SafeStop[Transfer, Reply] = SafeStop(
            self, self._channel, self._stop_by_sdo_ended, None, self._read_status,
            word=CONTROL_PARAMETER)
        self._again = StopAgain(self, self._channel, self._stop, partial(
            self._stop_by_sdo, again=True))
        self._sdo_stop = SdoStop(self, self._node, self._channel, self._stop.answer_time)
        self._requests, self._responses = request_pdos(drive), response_pdos(drive)
        self._places = {each.identifier: place for place, each in enumerate(self._responses)}
        self._masters = {each.identifier for each in self._requests} | {
            sdo.REQUEST_BASE + drive.station}
        self._set: dict[int, tuple[int, ...]] = {}      # the TPDOs of this exchange
        self._synchronous: bool = options.transmission == 'sync'
        self._producer = producer or SyncProducer()
        self._sync_slot = (
            SyncSlot(drive.period, self._producer, self) if self._synchronous else None)
        self._answers = CycleAnswers(self, silence='no complete set of PDOs',
                               in_turn=not self._synchronous,
                               timer=self._sync_slot or EventTimer(drive.period),
                               period_max=INTERPOLATION_MAX if MODES[options.mode].interpolated
                               else math.inf)
        self.exchange: CyclicExchange[list[bytes]] = CyclicExchange(self._answers, self, slot=0)
        self._offline_traffic = OfflineTraffic('no complete set of PDOs')
        self._heartbeats = HeartbeatSender(self, heartbeat or common_heartbeat([drive]))
        self._limits = LimitCheck(
            [] if options.mapping == 'assume' else [
                each for each in drive.cyclic_request if each.limit],
            self.sent, self._channel, self._limits_judged)
        self._node_set_up = NodeSetUp(
            self, self._node, self._rules, self._channel, self._limits,
            self._producer if self._synchronous else None)
        self.homes = options.homing
        self._handshake = SetpointHandshake(
            self.setpoints, self._rules, drive.control_timeout, self.report,
            ) if options.mode == 'pp' else None
        self._homing = Homing(
            self, control, self._rules, self._channel, MODES[options.mode].number)
        self._polls = StatePolls(
            self, control, self._rules, self._channel, self._node_set_up, self._homing)
        self._lifecycle = Lifecycle(self._channel)
        self.set_parts(
            self._lifecycle, self._heartbeats, HeartbeatWatch(self, self._node), self._homing,
            self.exchange, *([FreeSync(self, self._producer)] if self._synchronous else ()),
            channel=self._channel)
        self._stop_until = -math.inf
        self._runs_on = False       # what its stop by SDO has come to

    # -- life cycle -------------------------------------------------------------------------------

    def begin(self, now: float) -> None:
        self._begin(now, START_SPACING)

    def _begin(self, now: float, spacing: float) -> None:
        self.exchange.stop()
        self._channel.cancel(Priority.OWN)
        self._lifecycle.stop()
        self._polls.forget()
        self._limits.stop()
        self._standstill.forget()
        self._node.begin(now)
        self._node_set_up.forget(now)
        if self.duty.happened(Happened.STARTED) is Do.STOP:
            self._stop_by_sdo(now)
        self._lifecycle.start(self._script(now, spacing), now)

    def prepare_stop(self, now: float) -> bool:
        self._channel.clear()
        self._polls.ended()
        self._homing.stop()
        self._limits.stop()
        self._stop.forget()
        self._lifecycle.stop()
        # the next activation sees for itself
        found, self._node_set_up.moving = self._node_set_up.moving, None
        if self.stage is not Stage.IDLE and not self.exchange.cycling and (
                self._rules.may_run or found is ServoState.OPERATION_ENABLED):
            # it has acknowledged its stop by SDO, and nobody has seen it disabled since
            for happened in Happened.RUN_LEFT, Happened.STOP_LEFT, Happened.SILENT:
                self.duty.channel(CYCLE, happened)
        elif self.stage is not Stage.IDLE and found is not None:
            self.report.warn(sentences.still_in_state(found.value), may_run=True)
        pending = self.duty.happened(Happened.ENDS) is Do.STOP
        return self.stage is not Stage.IDLE and (
            self.exchange.cycling or pending or self._node_set_up.watch.slot is not None)

    def begin_stop(self, now: float) -> bool:
        self._stop_until = now + self.configuration.control_timeout
        self._runs_on = False
        if self.exchange.cycling:
            self.exchange.stop_soon(now)
        elif self.stop_pending:
            self._stop_by_sdo(now)
        else:
            self._release(now)
        return True

    @property
    def longest_stop(self) -> float:
        writes = STOP_ATTEMPTS * (len(self.setpoints.items) + 1) + (
            self.configuration.parameter_retries + 1)
        return (self.exchange.longest_stop + self.configuration.control_timeout
                + self._sdo_stop.longest + writes * self._stop.answer_time + ANSWER_TIME)

    def fall_silent(self) -> None:
        super().fall_silent()
        self._stop.forget()
        self._set.clear()

    def bus_down(self, now: float, reason: str) -> None:
        self._node.forget()
        super().bus_down(now, reason)

    def lose_after_stall(self, now: float) -> None:
        self._producer.shut()
        super().lose_after_stall(now)

    # -- setting up -------------------------------------------------------------------------------

    def _script(self, now: float, spacing: float) -> Script:
        """
        Set the drive up until it can be cycled, not too often: each time it is sent NMT.

        :param spacing: s since the last NMT at least.
        """
        node_set_up, told = self._node_set_up, NOTHING
        again = node_set_up.nmt_at + spacing
        if again > now:
            now = yield again
        while True:
            self._heartbeats.handle_timer(now)     # to be heard before the drive is to watch it
            if self._stopped_by_nmt(now) and not self._stop.running and (  # that wakes it itself
                    now >= node_set_up.nmt_at + START_PERIOD):
                node_set_up.wake(now)
            outcome: SetUpOutcome = yield node_set_up.run()
            now, found, text = self._channel.now, outcome.found, outcome.text
            if found is SetUpState.READY:
                self._start_cycling(outcome.status, now)
                return
            self.remedy = outcome.remedy
            refusal = self.request_refusal(now)
            self.report.guess(sentences.set_up_unanswered(),
                              unless=text or (refusal.reason if refusal else NOTHING))
            again = now + LOOK_AGAIN
            if found is SetUpState.DIFFERS:
                self.report.advise(sentences.mapping_differs(text), AdviceKind.MAPPING)
                if text != told:
                    self.report.note(MappingDiffered(text))
            elif found is SetUpState.RUNS and text != told:
                self.report.warn(text, may_run=True)
            elif found is SetUpState.SILENT:
                again = max(now, node_set_up.nmt_at + START_PERIOD)
            elif found is SetUpState.ABSENT:
                again = now
                if now >= node_set_up.nmt_at + START_PERIOD:
                    node_set_up.wake(now)      # a node that was stopped answers nothing
            told = text or told
            now = yield again

    def _stopped_by_nmt(self, now: float) -> bool:
        """Return whether the node reports NMT state stopped, in which it answers no SDO."""
        return self._node.said(now) is NmtState.STOPPED

    def _start_cycling(self, status: int, now: float) -> None:
        exchange = self.exchange
        self._machine.status_received(status, now)
        self._answers.book.forget_asked()
        self._answers.book.stale = self._synchronous     # it answers to the SYNC before
        self.setpoints.changed = True   # what was written by SDO meanwhile was something else
        self._limits.begin()
        exchange.start(now)
        self.report.guess(sentences.cycles_unanswered())

    # -- online and offline -----------------------------------------------------------------------

    def exchange_missed(self, reason: Sentence, now: float) -> None:
        if self.exchange.leaving:
            if self.exchange.cycles_left == 0:
                self.duty.happened(Happened.SILENT)
                self.restart(now)
        elif reason and not self.online and self._node_set_up.starting(now):
            self._answers.forget()
            if not self._synchronous:
                self._expect_set(now)
        elif reason:
            self._silent(reason, now)
        elif not self._synchronous:
            self._expect_set(now)

    def heartbeat_lost(self, now: float) -> None:
        """Handle a node whose heartbeats have ceased; one that is lost gets its last cycles."""
        if self.exchange.cycling and not self.exchange.leaving:
            self._silent(sentences.no_heartbeat(self._node.heartbeat_timeout), now)

    def _silent(self, reason: Sentence, now: float) -> None:
        """Handle a drive that is silent; one that is lost by it is stopped: it may listen."""
        self._answers.forget()
        if not self.online:
            self.exchange.stop()
            self._lifecycle.start(self._script(now, START_PERIOD), now)
            return
        self.lose(reason, now)
        self.exchange.run_out(self.exchange.timer.due)

    def lost(self, now: float, *, was_online: bool) -> None:
        if was_online:
            self._offline_traffic.clear()
        self._homing.stop()
        self._limits.stop()
        self._polls.forget()
        self._set.clear()

    def _close(self, reason: Sentence, now: float, spacing: float) -> None:
        """
        Handle a node that takes no PDOs: it is set up from the beginning.

        :param spacing: s since the last NMT at least.
        """
        self.lose(reason, now)
        self._begin(now, spacing)
        self.report.advise(reason)

    # -- PDOs, sending ----------------------------------------------------------------------------

    def exchange_ended(self) -> None:
        self._set.clear()

    def encode_cycle(self, raws: list[int]) -> list[bytes]:
        if self._handshake is not None:
            self._handshake.carried(raws[0], raws[1:])
        payloads, at = [], 0
        for each in self._requests:
            count = len(each.parameters)
            payloads.append(each.pack(raws[at:at + count]))
            at += count
        return payloads

    def send_cycle(self, payloads: list[bytes], now: float) -> None:
        exchange = self.exchange
        for each, payload in zip(self._requests, payloads):
            exchange.put(Frame(each.identifier, payload, False))
        if self._sync_slot is not None:
            if self.online:     # what answers to SYNC of before has come by now
                self._answers.book.stale = 0
            exchange.expect_answer(now)
            self._producer.begun(self._sync_slot, now, exchange.await_frame())
        elif not self._answers.book.awaiting:
            self._expect_set(now)

    def _expect_set(self, now: float) -> None:
        self.exchange.expect_answer(now, now + EVENT_PERIODS * self.configuration.period)

    # -- frames from the drive --------------------------------------------------------------------

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        identifier, data, extended = frame
        if extended:
            return
        place = self._places.get(identifier)
        if not self.online:
            self._hear(identifier, place, data, now)
        try:
            if place is not None:
                self._receive_pdo(place, data, now, now - age)
            elif identifier == sdo.RESPONSE_BASE + self.configuration.station:
                self._node.heard_at = now
                self._again.sign_of_life(now)
                self._channel.receive(data, now)
            elif identifier in self._masters:
                node = self.configuration.station
                self.report.note(ForeignMasterSeen(
                    masters.sdo_request(frame, node) if identifier == sdo.REQUEST_BASE + node
                    else sentences.other_master_asks_node(node, 'process data', str(frame))))
            elif identifier == network.NMT_IDENTIFIER:
                masters.report_nmt(frame, self.configuration.station, self.report)
            elif self._node.receive(frame, self.report, self._take_heartbeat, now):
                if identifier < network.HEARTBEAT_BASE and self._missed_bridge:
                    self._heartbeats.was_missed(self._answers.timing, now)
        except Unasked as error:
            self.report.unasked(sentences.malformed(error.sentence), self._channel.late(
                now - age, data), now)
        except RemoteProtocolError as error:
            self.report.reject(sentences.malformed(error.sentence))
            if not self.online:
                self._offline_traffic.wrong(sentences.answers_otherwise(error.sentence), now)

    def _hear(self, identifier: int, place: int | None, data: bytes, now: float) -> None:
        """Note what a drive sends that is not online."""
        if place is not None:
            wanted = self._responses[place]
            if len(data) < wanted.length:
                self._offline_traffic.wrong(sentences.pdo_length(
                    wanted.number, len(data), wanted.length), now)
        if place is not None or identifier - self.configuration.station in (
                sdo.RESPONSE_BASE, network.HEARTBEAT_BASE, network.EMERGENCY_BASE):
            self._offline_traffic.came(now)

    @property
    def offline_advice(self) -> Sentence:
        return self.defect or self._offline_traffic.instead_of(
            self.report.advice, self._node, self._channel.now)

    def _receive_pdo(self, place: int, data: bytes, now: float, received_at: float) -> None:
        """Handle one PDO of a set. The fast path of the reader."""
        exchange, answers, count = self.exchange, self._answers, len(self._responses)
        self._node.pdo_at = now
        if not exchange.cycling:
            answers.book.take_stale()
            answers.timing.came(received_at)
            return
        if self._synchronous and not answers.wanted:
            if place == count - 1 and not answers.expects('transmit PDO', now, received_at):
                exchange.wait_out(now)
            return
        try:
            raws = self._responses[place].unpack(data)
        except RemoteProtocolError as error:
            self.report.reject(sentences.malformed(error.sentence))
            raws = self._responses[place].part(data)
            if place < count - 1 or not (raws or place):
                return
        if count > 1:
            self._set[place] = raws
            if len(self._set) < count:
                return
            raws = tuple(raw for each in range(count) for raw in self._set[each])
            self._set.clear()
        answers.answered(received_at)
        if not self._synchronous and exchange.cycling:
            self._expect_set(now)
        if not self.online and self.stage is Stage.RUNNING:
            if exchange.leaving:    # it is back
                self.restart(now)
                return
            self.be_online()
            self.duty.happened(Happened.ANSWERED)
        if self._handshake is not None:
            self._handshake.update(raws[0], now)
        standstill = self._standstill
        standstill.status(raws[0], now)
        if standstill.watching:
            standstill.sampled(raws, now)
        self.interlock.status(raws[0], now)
        self._polls.update(now)
        self.control_changed(now)
        self.interlock.measured(raws)
        self._homing.sampled(raws[0], raws, now)
        self.report.note(ProcessDataReceived(raws, received_at))
        exchange.wait_out(now)
        self._limits.answered(now)
        if self._limits.without_effect:
            self._see_to_limits(now)

    def _take_heartbeat(self, state: NmtState, now: float) -> None:
        stopped = state is NmtState.STOPPED and not self._stopped_by_nmt(now)
        change = self._node.receive_heartbeat(state, now)
        if self.stage is Stage.STOPPING:
            self._no_pdos_at_the_end(state, now, stopped=stopped)
        if self.stage is not Stage.RUNNING:
            return
        self._answers.timing.heartbeat(self._node.silent_for)
        if change is NodeChange.RESTARTED:
            self.report.note(Noted(sentences.booted()))
            self._answers.timing.forget()
            reason = sentences.device_restarted()
            self.services.fail_all(Failure(
                FailureKind.NO_ANSWER, sentences.no_answer_because(reason)))
            self._channel.clear()
            self._stop.forget()
            self.outbox.drop(self._of_the_conversation, now)
            self._close(reason, now, START_SPACING)
        elif state is NmtState.STOPPED and self._stop.running or (
                stopped and self.may_run and not self.exchange.cycling):
            self._amid_stop(now, stopped=stopped)
        elif state is not NmtState.OPERATIONAL and self.exchange.cycling and (
                state is NmtState.STOPPED or not self.exchange.leaving
                and now > self._node_set_up.nmt_at + START_PAUSE + START_SPACING
                and (self.online or not self._node_set_up.starting(now))):
            self.duty.happened(Happened.SILENT)     # to cycles that it was told by
            self._close(sentences.node_state(state.text), now, START_PERIOD)
        else:
            self._again.sign_of_life(now, hurry=True)

    def _of_the_conversation(self, frame: Frame) -> bool:
        """Return whether a frame is for this node, which has restarted since it was made."""
        return frame.identifier in self._masters or (
            frame.identifier == network.NMT_IDENTIFIER
            and frame.data[1] == self.configuration.station)

    def _no_pdos_at_the_end(self, state: NmtState, now: float, *, stopped: bool) -> None:
        """Stop a node by SDO, at the end, that takes no PDOs any more."""
        if self.exchange.cycling and self.unacknowledged and state is not NmtState.OPERATIONAL:
            self.exchange.mark_silent()
            self.exchange.stop()
            self._stop_by_sdo(now)
        elif state is NmtState.STOPPED and self._stop.running:
            self._amid_stop(now, stopped=stopped)

    def _amid_stop(self, now: float, *, stopped: bool) -> None:
        """Handle a node to be stopped that NMT has stopped; ``stopped``: since its last sign."""
        if not stopped:
            self._no_answer_comes(now)
            return
        again = self._stop.again or not self._stop.running
        self._channel.cancel(Priority.STOP)     # what it was told before, it may not have taken
        self._stop.forget()
        self.duty.happened(Happened.SHOWED_UP)
        self._stop_by_sdo(now, again=again)

    def _no_answer_comes(self, now: float) -> None:
        """End what is under way at once: a node that NMT has stopped answers nothing."""
        self._transactor.abandon(now)
        self._channel.advance(now)

    @property
    def mode_lacking(self) -> Sentence:
        """What the drive lacks to be driven although it reports enabled; '' if nothing."""
        return self._polls.mode_lacking

    @property
    def why(self) -> Sentence:
        """What else the drive says of why it is not enabled; '' if nothing."""
        emergency = self._node.emergency
        newest = NOTHING if emergency is None else sentences.emergency(emergency.text)
        return together((self._homing.not_back, self.unready, self._polls.error, newest))

    def request_refusal(self, now: float) -> Failure | None:
        return Failure(FailureKind.OFFLINE, sentences.drive_offline_because(sentences.node_state(
            NmtState.STOPPED.text))) if self._stopped_by_nmt(now) else None

    def request_answered(self, request: Request, outcomes: Outcomes) -> None:
        # also where the answer was lost: it may have been written
        if not self.serving and isinstance(request, WriteRequest) and any(
                parameter.index in OPTIONS for parameter, _ in request.items):
            self._channel.run(self._node_set_up.learn_again(), lambda _: None, self._channel.now)

    # -- limits -----------------------------------------------------------------------------------

    def _limits_judged(self) -> None:
        now, limits = self._channel.now, self._limits
        if limits.otherwise:
            self._node_set_up.report_once(limits.otherwise)
        if limits.without_effect and not self._see_to_limits(now):
            self.report.note(Noted(self.error, error=True))
        self._machine.rules_changed()
        self.control_changed(now)

    def _see_to_limits(self, now: float) -> bool:
        """End the exchange with a drive whose limit has no effect, unless it is enabled."""
        control = self._machine
        if (self.stage is not Stage.RUNNING or not self.online or not control.at_rest
                or control.pending and control.stopping or self._rules.state in states.MOVING):
            return False
        self.remedy = sentences.drive_to_correct
        self._close(sentences.mapping_differs(self._limits.without_effect), now, START_SPACING)
        return True

    @property
    def error(self) -> Sentence:
        why = self._limits.without_effect
        return sentences.limit_in_vain(why) if why else NOTHING

    @property
    def unready(self) -> Sentence:
        """What has to be seen before the drive is enabled; '' if nothing."""
        return self._limits.unseen

    # -- control ----------------------------------------------------------------------------------

    def home(self, request: ControlRequest, now: float) -> None:
        refusal = self.error or self._homing.refusal()
        if refusal:
            self.report.note(ControlCompleted(request, False, refusal))
        else:
            self._homing.begin(request, now)

    def update_control_word(self, now: float) -> None:
        if self.stage is Stage.STOPPING:
            return
        exchange, control = self.exchange, self._machine
        exchange.hurry(now, setpoints=self.stop_pending)
        if control.pending and control.word != exchange.word:   # one step of several
            exchange.timer.no_later(max(now, exchange.timer.began_at
                                        + exchange.timer.stop_spacing))

    def commands_expired(self, now: float) -> None:
        if self._handshake is None:
            return
        self._handshake.disarmed()       # the next status may be a period away, and its word two
        self._machine.rules_changed()
        timer = self.exchange.timer
        if self._machine.word != self.exchange.word:
            timer.no_later(max(now, timer.began_at + EXPIRY_SPACING))

    def control_refusal(self, action: ControlAction, refusal: Sentence, *,
                        offline: bool) -> Sentence:
        if refusal or action is not ControlAction.ENABLE:
            return refusal
        if self.error or not self._machine.fault:
            return self.error
        return sentences.bridge_missed() if self._missed_bridge else NOTHING

    @property
    def _missed_bridge(self) -> bool:
        """The drive says that it missed the heartbeat of the bridge."""
        # nobody heard the emergency where the bridge itself was gone
        emergency, watch = self._node.emergency, self.fault_watch
        return HEARTBEAT_ERROR in (emergency and emergency.code, watch and watch.error_code)

    # -- the stop ---------------------------------------------------------------------------------

    def _stop_by_sdo(self, now: float, *, again: bool = False, unanswered: bool = False) -> None:
        """
        Write ``disable`` and neutral setpoints to their objects.

        :param unanswered: it was told by cycles, and has answered none.
        """
        if self._stop.running:
            return
        self._channel.make_room(now)
        if self._stopped_by_nmt(now):
            self._transactor.abandon(now)
        writes = [each._replace(raw=self._machine.word) if each.is_word else each
                  for each in self._stop.writes()]
        self._stop.begin(self._see_it_stop(writes, unanswered=unanswered), now, again=again)

    def _see_it_stop(self, writes: list[StopWrite], *, unanswered: bool) -> StopProcedure:
        """Stop it, and read its state in the end, for as long as frames would go on."""
        failed = yield from self._sdo_stop.writes(writes, unanswered=unanswered)
        if not failed and self.stage is Stage.STOPPING:
            state = yield from self._state_in_the_end()
            if state in states.MOVING:
                failed = [sentences.still_in_state(state.value)]
        self._runs_on = bool(failed)
        return failed

    def _state_in_the_end(self) -> Procedure[ServoState]:
        state = ServoState.UNKNOWN
        while True:
            reply = yield Transfer(states.STATUS_WORD, timeout=self._stop.answer_time, attempts=1)
            if isinstance(reply, ObjectRead):
                raw = reply.number(2)
                state = state_of(raw)
                self._standstill.status(raw, self._channel.now)
            known = not isinstance(reply, Silence)
            if known and state not in states.MOVING or self._channel.now >= self._stop_until:
                return state
            if self._standstill.watching:
                yield from self._standstill.poll(self._channel, sampled=False)
            if self._standstill.holds:
                yield Transfer(states.CONTROL_WORD, 0, bytes(2), timeout=self._stop.answer_time)
            yield Transfer(pause=POLL_PERIOD)

    def _read_status(self, status: Parameter, timeout: float) -> StatusRead[Transfer, Reply]:
        reply = yield Transfer(states.STATUS_WORD, timeout=timeout, attempts=1)
        return reply.number() if isinstance(reply, ObjectRead) else None

    def _stop_by_sdo_ended(self) -> None:
        if self.stage is Stage.STOPPING and not self.exchange.cycling:
            self._release(self._channel.now)

    def last_cycle_left(self, now: float) -> None:
        if self.stage is not Stage.STOPPING:
            return
        book = self._answers.book
        # one that has answered its stop may miss some: it is lost by as many as ever
        listens = not book.missed_in_row or (
            book.stop_shown and book.missed_in_row < self.configuration.missed_limit)
        if now < self._stop_until and listens and (
                self._rules.state in states.MOVING or self._rules.may_run
                or self._rules.state and self._machine.word_due):
            self.exchange.cycles_left = 1   # it still brakes, or 0006h has not left
            return
        unanswered = self.unacknowledged
        self.exchange.mark_silent()
        if self._rules.state in states.MOVING or self._rules.may_run:
            self.duty.channel(CYCLE, Happened.RUN_LEFT)
            self.duty.happened(Happened.SILENT)     # of what it should have done
        self.exchange.stop()
        if unanswered:
            self._stop_by_sdo(now, unanswered=True)
        else:
            self._release(now)

    def _release(self, now: float) -> None:
        """Come to the end, as soon as the drive does not watch the bridge any more."""
        why = NOTHING
        if self._answers.book.stop_shown and self._rules.state in states.MOVING:
            why = sentences.stop_failed([sentences.still_in_state(self._rules.state.value)])
        if self.stop_pending or self._runs_on:      # then it is to stop by itself
            self.stop_left(why)
            return
        self._channel.run(self._node_set_up.watch.release(self._stop.answer_time),
                          lambda _: self.stop_left(why), now, Priority.STOP)

    # -- SYNC -------------------------------------------------------------------------------------

    @property
    def needs_sync(self) -> bool:
        """The drive is looked for, set up, in exchange, or being stopped."""
        return self.stage is Stage.RUNNING or self.stage is Stage.STOPPING and (
            self.exchange.cycling or self._stop.running)

    @property
    def heard_at(self) -> float:
        """When the drive sent anything last."""
        return max(self._node.heard_at, self._node.pdo_at)

    @property
    def sync_at(self) -> float:
        """From when on SYNC starts nothing that is in the buffers of the drive."""
        return self._node_set_up.sync_at

    # -- state ------------------------------------------------------------------------------------

    @property
    def unacknowledged(self) -> bool:
        return super().unacknowledged and not self._answers.book.stop_shown

    @property
    def state(self) -> DriveState:
        # also while it is looked at again
        if self.report.advice_kind is AdviceKind.MAPPING and not self.defect:
            return DriveState.MAPPING_DIFFERS
        return super().state

    @property
    def busy(self) -> Sentence:
        return sentences.homing() if self._homing.under_way else NOTHING

    @property
    def warning(self) -> Sentence:
        return together((
            self._node.ailing, self._node.missing, self._limits.otherwise))

    def facts(self) -> dict[str, str]:
        return {**self._node.facts(), 'stops_by': stops_by(
            self._node_set_up.options, self._node_set_up.watch.text)}


def make_sessions(drives: Sequence[DriveConfiguration]) -> list[Session]:
    """Make the sessions of one bus, in the same order: one SYNC, and one heartbeat for all."""
    producer, heartbeat = SyncProducer(), common_heartbeat(drives)
    return [Cia402Session(
        drive, producer, heartbeat if drive.options.bridge_heartbeat > 0 else None)
        for drive in drives]
