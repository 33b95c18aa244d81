# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one device over the PKW mailbox.

.. code-block:: text

    IDLE ──activate, bus up──► RUNNING ──deactivate──► STOPPING ──► IDLE
      ▲                           │ bus down
      └───────────────────────────┘

While running, a round of reads begins every period, as long as the node takes PDOs (see
:mod:`.node`). A complete round is published as one sample and makes the drive online; three
rounds (``missed_limit``) with a read that nobody answered make it offline, and so do a boot-up
frame, a heartbeat that says that the node is not operational, and heartbeats that cease. Whatever
the reason: the control word goes back to ``disable``, setpoints go neutral and want re-arming. A
drive that was told to run is told to stand still at once, whatever is known of the node: what is
only silent may still be listening.

Setpoints and the control word are written while the drive is online: when they change, and
setpoints again after ``refresh_interval``.
"""

from collections.abc import Collection
from enum import Enum
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.events import (
    ForeignMasterSeen, ProcessDataReceived,
)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.outbox import Left
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.session import LOOKING, Session
from drive_can_bridge.core.users import Users
from drive_can_bridge.protocols.access import ChannelServer
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.canopen.node import Change, Node
from drive_can_bridge.protocols.canopen.notes import PacedNotes
from drive_can_bridge.protocols.canopen_pkw import addresses, pkw, procedures
from drive_can_bridge.protocols.canopen_pkw.addresses import Span
from drive_can_bridge.protocols.canopen_pkw.control_writer import ControlWriter
from drive_can_bridge.protocols.canopen_pkw.identifiers import Identifiers
from drive_can_bridge.protocols.canopen_pkw.mailbox import (
    MailboxChannel, MailboxCourier, Reply, Step,
)
from drive_can_bridge.protocols.canopen_pkw.pkw import Address, Layout, Message
from drive_can_bridge.protocols.canopen_pkw.round import Round
from drive_can_bridge.protocols.canopen_pkw.sent_writes import SentWrites
from drive_can_bridge.protocols.canopen_pkw.setpoint_writer import SetpointWriter
from drive_can_bridge.protocols.channel import Lane
from drive_can_bridge.protocols.exchange_book import ExchangeBook
from drive_can_bridge.protocols.safe_stop import SafeStop

#: how often a drive is told to stand still
STOP_ATTEMPTS = 3
#: s that this may take all together: of a drive that answers, and of one that has fallen silent
STOP_TIME = 3.0
STOP_TIME_SILENT = 0.4
SILENT = ('no complete round of reads: drive silent, not operational, or other COB-IDs than '
          'configured')


class Phase(Enum):
    """What the session is doing."""

    IDLE = 'idle'
    RUNNING = 'running'
    STOPPING = 'last writes'


class PkwSession(Session):
    """NMT supervision, the polled exchange, and the requests of users between its reads."""

    def __init__(self, drive: DriveConfiguration) -> None:
        table = drive.profile.control
        control: ControlMachine | None = None
        if table is not None:
            control = ControlMachine(table, timeout=drive.control_timeout, pulse=1)
        super().__init__(drive, control, roles=Roles(
            drive, controlled=control is not None, cells=addresses.keys,
            refusal=lambda parameter: '' if parameter.listed else addresses.half_refusal(
                parameter, drive.profile)))
        options = drive.options
        self._identifiers = Identifiers.of(drive)
        self._layout = Layout(options.layout)
        self._addressing: str = options.addressing
        self._word_order: str = options.word_order
        self._notes = PacedNotes(self.report.note)
        self._node = Node(drive.station, nmt_start=options.nmt_start,
                          heartbeat_timeout=options.heartbeat_timeout)
        self._channel = MailboxChannel(MailboxCourier(
            self._send, order=options.abort_code_order, retry=self.retry))
        self.users = Users(
            self, ChannelServer(self._channel, procedures.RegisterAccess(
                self.retry, addressing=self._addressing, word_order=self._word_order)),
            blocked=self._blocked, control_refusal=self._control_refusal)
        self._stop: SafeStop[Step, Reply] = SafeStop(self, self._channel, self._stop_ended)
        self._setpoint_writer = SetpointWriter(
            self._channel, self.setpoints, self.report.warn, self.told,
            addressing=self._addressing,
            word_order=self._word_order, refresh=options.refresh_interval)
        self._control_writer: ControlWriter | None = None
        self._status: Parameter | None = None
        if control is not None and table is not None:
            word = drive.profile.parameters[table.parameter]
            self._control_writer = ControlWriter(
                self._channel, control, word, self.control_changed, self.report.warn, self.told,
                disable=table.disable, addressing=self._addressing,
                word_order=self._word_order,
                refresh=options.refresh_interval if word in drive.cyclic_request else 0.0)
            self._status = drive.profile.parameters.get(table.status_parameter or '')
        self._writes = SentWrites(
            self.sent, addressing=self._addressing, word_order=self._word_order)
        self._round = Round(drive, self._status, self.report.warn)
        self._book = ExchangeBook(drive, self.statistics)
        self._timer = self._book.timer
        self._phase = Phase.IDLE
        self._status_known = False  # it was read just now
        self._received_at = -math.inf

    # -- life cycle -------------------------------------------------------------------------------

    def prepare_stop(self, now: float) -> bool:
        return self._phase is not Phase.IDLE and (
            self.told.owed or self.ever_online and now >= self._node.free_at)

    def begin_stop(self, now: float) -> bool:
        self._node.stop()
        self._timer.stop()
        self._channel.drop(now)
        self._phase = Phase.STOPPING
        self._stop_now(self._stop_time, now)
        return True

    def _stop_now(self, time: float, now: float, *, in_the_end: float = 0.0) -> None:
        """
        Tell the drive to stand still, within so many s.

        :param in_the_end: s that the answer to the last attempt is waited for at least: a device
            may be slow, and nobody waits for the end of this stop.
        """
        writes = [] if self._control_writer is None else [self._control_writer.disable_write()]
        writes += self._setpoint_writer.neutral_writes()
        self._channel.cancel(Lane.STOP)
        self._channel.make_room(now)
        timeout = min(self.configuration.parameter_timeout,
                      time / (STOP_ATTEMPTS * max(1, len(writes))))
        self._stop.begin(
            procedures.write_until_answered(
                writes, STOP_ATTEMPTS, timeout, max(timeout, in_the_end)),
            self._stop_confirmed, now, insist=self._phase is Phase.STOPPING)

    def _stop_confirmed(self) -> None:
        if not self.gate.mute:
            self.told.stopped()

    def _stop_ended(self) -> None:
        if self._phase is Phase.STOPPING:
            self.go_idle('deactivated')

    @property
    def stopped(self) -> bool:
        return self._phase is Phase.IDLE

    @property
    def longest_stop(self) -> float:
        return self._stop_time if self._phase is Phase.STOPPING else 0.0

    @property
    def _stop_time(self) -> float:
        return STOP_TIME if self.online else STOP_TIME_SILENT

    def bus_down(self, now: float, reason: str) -> None:
        self._node.forget()
        super().bus_down(now, reason)

    def time_lost(self, now: float) -> None:
        self._channel.time_lost(now)
        if self._phase is Phase.RUNNING:
            self.stood_still(now)
            self.start_over(now)

    def begin(self, now: float) -> None:
        self.report.advice = LOOKING
        self._phase = Phase.RUNNING
        self._forget_exchange()
        self._round.start_over()
        self._node.begin(now)
        self._follow_node(now)
        self._stop_if_owed(now)

    def go_idle(self, advice: str) -> None:
        self._phase = Phase.IDLE
        self._node.stop()
        self._timer.stop()
        self._channel.clear()
        self._notes.flush(self._channel.now)
        self._round.refusals.clear()
        self.be_offline(advice)

    # -- online and offline -----------------------------------------------------------------------

    def _found(self, now: float) -> None:
        self._node.online()
        self.be_online()
        self._setpoint_writer.forget()
        if self._control_writer is not None:
            self._control_writer.forget()
        self.control_changed(now)
        self._setpoint_writer.look(now)

    def lost(self, now: float, *, was_online: bool) -> None:
        self._forget_exchange()

    def _forget_exchange(self) -> None:
        """Forget the round and the writes that are under way."""
        for lane in (Lane.OWN, Lane.SETPOINTS, Lane.CONTROL):
            self._channel.cancel(lane)
        self._book.missed_in_row = 0

    def withdrawn(self, now: float) -> None:
        """Leave it to the stop to write ``disable``."""

    def _stop_if_owed(self, now: float) -> None:
        if self.told.owed:
            self._stop_now(STOP_TIME_SILENT, now, in_the_end=self.configuration.parameter_timeout)

    def _leave_alone(self, reason: str, now: float) -> None:
        """Handle a drive that is silent, but may be listening: it has to stand still."""
        was_online = self.online
        self.lose(reason, now)
        self._node.offline(now)
        self._send_nmt()
        if was_online:
            self._stop_now(STOP_TIME_SILENT, now, in_the_end=self.configuration.parameter_timeout)

    def _cut_off(self, reason: str, answer: str, now: float) -> None:
        """
        Handle a node that takes no PDOs: nothing that was sent is answered any more.

        A stop under way takes its course: however often a node starts anew, stops do not pile up.
        """
        self._send_nmt()    # a stop that comes before it is lost
        self.lose(reason, now)
        self.users.fail_all(answer)
        if self._channel.is_idle(Lane.STOP):
            self._channel.clear()
            self._stop_if_owed(now)

    def _send_nmt(self) -> None:
        for frame in self._node.take_frames():
            self.outbox.put(frame)

    # -- the round --------------------------------------------------------------------------------

    def _start_round(self, now: float) -> None:
        self._write_expired(now)
        self._book.begin(now)
        if self.online:
            self._setpoint_writer.look(now)
            self.see_to_control_word(now)
        self._channel.run(
            procedures.read_round(self._round.plan, self._read_answered, self._round.refused),
            self._round_ended, now)

    def _read_answered(self, span: Span, words: tuple[int, ...]) -> None:
        """Take an answer of the round; the status counts from the moment it was read."""
        self._round.refusals.pop(span, None)
        if self.online:
            self._take_status(dict(zip(span.addresses, words)))
            self.control_changed(self._channel.now)
            self._status_known = False

    def _take_status(self, words: dict[Address, int]) -> None:
        raw = self._round.status(words)
        if raw is not None and self.control is not None:
            self._status_known = True
            self.control.status_received(raw, self._channel.now)

    def _round_ended(self, words: procedures.RoundResult) -> None:
        now = self._channel.now
        if words is None:
            self._miss(now)
            return
        self._book.missed_in_row = 0
        raws = self._round.raws(words)
        if not self.online:
            if self._node.heartbeat_lost:
                return
            self.gate.measured(raws)   # before anything is written
            self._found(now)
            self._take_status(words)
            self.control_changed(now)
            self._status_known = False
        self.gate.measured(raws)
        if None in raws:
            return  # something was refused: there is no complete sample
        self._book.answered(self._received_at)
        self.report.note(ProcessDataReceived(
            tuple(raw for raw in raws if raw is not None), self._received_at))

    def _miss(self, now: float) -> None:
        if not self._book.missed():
            return
        if self.online:
            limit = self.configuration.missed_limit
            self._leave_alone(f'no complete round of reads for {limit} periods', now)
        elif not self._node.heartbeat_lost:
            self.report.advice = SILENT

    def _write_expired(self, now: float) -> None:
        if self.gate.expire(now):
            self._setpoint_writer.look(now)

    # -- frames -----------------------------------------------------------------------------------

    def _send(self, message: Message, left: Left) -> None:
        def told(sent: bool, now: float) -> None:
            if sent:
                self._writes.note(message)
            left(sent, now)
        self.outbox.put(Frame(self._identifiers.request, pkw.encode(message, self._layout),
                               False), told)

    def frames_left(self, now: float, refused: Collection[int] = ()) -> None:
        super().frames_left(now, refused)
        if refused:
            self._channel.advance(now)

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        identifier, data, extended = frame
        identifiers = self._identifiers
        if extended:
            return
        try:
            if identifier == identifiers.response:
                self._received_at = now - age
                message = pkw.decode(data, self._layout)
                if not self._channel.receive(message, now):
                    self.report.reject(f'PKW response that nobody asked for: {message}')
            elif identifier == identifiers.heartbeat:
                self._heartbeat(network.decode_heartbeat(data), now)
            elif identifier == identifiers.emergency:
                text = self._node.receive_emergency(network.decode_emergency(data))
                if text:
                    ails = self._node.emergency is not None
                    self._notes.note('emergency' if ails else 'emergency over', text, now,
                                     warning=ails)
            elif identifier == identifiers.request:
                self.report.note(ForeignMasterSeen(
                    f'another master sends PKW requests to node {self.configuration.station}: '
                    f'{frame}'))
        except RemoteProtocolError as error:
            self.report.reject(str(error))

    def _heartbeat(self, state: network.NmtState, now: float) -> None:
        running = self._phase is Phase.RUNNING
        change = self._node.receive_heartbeat(state, now, running)
        if self._phase is Phase.STOPPING and now < self._node.free_at and not self.told.owed:
            self.go_idle('deactivated')
        if not running:
            return
        if change is Change.RESTARTED:
            self._notes.note('boot-up', 'boot-up: the device has started', now)
            self._cut_off('the device restarted', 'no answer: the device restarted', now)
            self.report.advice = 'the device restarted: waiting for it to answer'
        elif change is Change.NOT_OPERATIONAL:
            text = self._node.refusal(now)
            self._cut_off(text, f'drive offline: {text}', now)
        self._follow_node(now, fresh=change is not Change.NONE)

    def _follow_node(self, now: float, *, fresh: bool = True) -> None:
        """
        Begin rounds when the node takes PDOs; while offline, see to it that it does.

        :param fresh: something is new; otherwise rounds keep their beat.
        """
        if not self.online:
            self._node.offline(now)
        self._send_nmt()
        free_at = self._node.free_at
        self._channel.hold(free_at)
        if not self.online and (fresh or now < free_at):
            self._timer.start(max(now, free_at))
        self._channel.advance(now)

    # -- timer ------------------------------------------------------------------------------------

    def handle_timer(self, now: float) -> None:
        self._notes.handle_timer(now)
        if self._phase is Phase.RUNNING:
            if now >= self._node.next_timer():
                if self._node.handle_timer(now) is Change.HEARTBEAT_LOST:
                    self._leave_alone(f'no heartbeat for {self._node.heartbeat_timeout:g} s', now)
                self._send_nmt()
            if self.control is not None and now >= self.control.next_timer():
                self.control.handle_timer(now)
                self.control_changed(now)
            self._write_expired(now)
        self._channel.advance(now)
        if now >= self._timer.due and self._channel.is_idle(Lane.OWN):
            self._start_round(now)

    def next_timer(self) -> float:
        soonest = self._channel.next_timer()
        if self._phase is not Phase.RUNNING:
            return soonest
        if self._channel.is_idle(Lane.OWN):
            soonest = min(soonest, self._timer.due)
        soonest = min(soonest, self._node.next_timer(), self._notes.next_timer())
        return soonest if self.control is None else min(soonest, self.control.next_timer())

    # -- control ----------------------------------------------------------------------------------

    def _control_refusal(self, action: ControlAction, refusal: str) -> str:
        if action is ControlAction.ENABLE:
            for setpoint in self.setpoints.held:    # the drive has another position than this
                refused = self._setpoint_writer.refusals.get(setpoint.parameter.name)
                if refused:
                    return f'it would jump: write of {refused}'
        return refusal

    def see_to_control_word(self, now: float) -> None:
        if not self.online:
            return
        if self._control_writer is not None:
            self._control_writer.update(
                now, known=self._status_known or self._status is None)
        if self.setpoints.changed and not self.setpoints.enabled:
            self._setpoint_writer.look(now)     # neutral follows the word at once

    # -- users ------------------------------------------------------------------------------------

    def _blocked(self, now: float) -> str:
        blocked = self._node.refusal(now) if self._phase is Phase.RUNNING else ''
        return f'drive offline: {blocked}' if blocked else ''

    # -- state ------------------------------------------------------------------------------------

    @property
    def warning(self) -> str:
        texts = []
        if self._node.emergency is not None:
            texts.append(f'emergency {self._node.emergency.text}: remove its cause')
        texts += [f'poll of {text}: correct cyclic_response or the profile'
                  for text in self._round.refusals.values()]
        texts += [f'write of {text}: correct cyclic_request, the command or the profile'
                  for text in self._setpoint_writer.refusals.values()]
        if self._control_writer is not None and self._control_writer.refusal:
            texts.append(f'write of {self._control_writer.refusal}: look at the device')
        if (self._node.heartbeat_timeout > 0.0 and not self._node.heard_heartbeat):
            texts.append('no heartbeat although heartbeat_timeout is set: configure the '
                         "device's heartbeat producer (1017h)")
        return '; '.join(texts)

    def facts(self) -> dict[str, str]:
        emergency = self._node.emergency
        return {'nmt_state': self._node.state_text,
                'emergency': 'none' if emergency is None else emergency.text}
