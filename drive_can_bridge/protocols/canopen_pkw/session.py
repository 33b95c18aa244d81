# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The conversation with one device over the PKW mailbox.

.. code-block:: text

    IDLE ──activate, bus up──► POLLING ──deactivate──► STOPPING ──► IDLE
      ▲                           │ bus down
      └───────────────────────────┘

While polling, a round of reads begins every period, as long as the node takes PDOs (see
:mod:`.canopen.node`). A complete round is published as one sample and makes the drive online;
three rounds (``missed_limit``) with a read that nobody answered make it offline, and so do a
boot-up frame, a heartbeat that says that the node is not operational, and heartbeats that cease.
Whatever the reason: the control word goes back to ``disable``, setpoints go neutral and want
re-arming. A drive that was told to run is told to stand still at once, whatever is known of the
node: what is only silent may still be listening.

How it is looked for is one script (:meth:`PkwSession._script`), begun at the start, when the
bus is back, after a stall, when the node has restarted or says that it takes no PDOs, when the
drive is lost; it ends when the drive is found. NMT *start* goes out when the bridge starts, after
a boot-up frame, when a heartbeat says that the node is not operational, and once a second; never
more than ten times a second, however often the node asks for it: then it is put off, not left out.

Setpoints and the control word are written while the drive is online: when they change, and
setpoints again after ``refresh_interval``. The status word counts from the moment it was read,
before its round is complete.
"""

from collections.abc import Collection
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.drive_services import DriveServices
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.events import ForeignMasterSeen, Noted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.outbox import Left
from drive_can_bridge.core.requests import Failure, FailureKind
from drive_can_bridge.core.roles import Roles
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import Do, Happened
from drive_can_bridge.protocols.access import SentWrites
from drive_can_bridge.protocols.canopen import masters, network, sdo
from drive_can_bridge.protocols.canopen.network import NmtCommand, NmtState
from drive_can_bridge.protocols.canopen.node import (
    HeartbeatWatch, NodeChange, START_PERIOD, START_SPACING, WatchedNode)
from drive_can_bridge.protocols.canopen.offline_traffic import OfflineTraffic
from drive_can_bridge.protocols.canopen_pkw import addresses, pkw, procedures
from drive_can_bridge.protocols.canopen_pkw.pkw import PkwLayout, PkwMessage
from drive_can_bridge.protocols.canopen_pkw.rounds import Rounds
from drive_can_bridge.protocols.canopen_pkw.transactor import (
    MailboxChannel, MailboxTransactor, Procedure)
from drive_can_bridge.protocols.canopen_pkw.writers import ExpiryWatch, Writers
from drive_can_bridge.protocols.channel import Priority
from drive_can_bridge.protocols.lifecycle import Lifecycle, Script
from drive_can_bridge.protocols.polled_exchange import PolledExchange, Raws

#: what a node sends beside the answers of its mailbox; plus its number
_NODE_SAYS = network.HEARTBEAT_BASE, network.EMERGENCY_BASE


class PkwSession(Session):
    """NMT supervision, the polled exchange, and the requests of users between its reads."""

    def __init__(self, drive: DriveConfiguration) -> None:
        table = drive.profile.control
        control: ControlMachine | None = None
        if table is not None:
            control = ControlMachine(table, timeout=drive.control_timeout, pulse=1)
        super().__init__(drive, control, roles=Roles(
            drive, controlled=control is not None, cells=addresses.keys,
            refusal=lambda parameter: addresses.half_refusal(parameter, drive.profile)))
        options, placement = drive.options, addresses.Placement.of(drive)
        self._layout = PkwLayout(options.layout)
        self._node = WatchedNode(drive.station, heartbeat_timeout=options.heartbeat_timeout)
        self._offline_traffic = OfflineTraffic('no complete round of reads')
        self._started_at = -math.inf    # by NMT, the last time
        self._transactor = MailboxTransactor(
            self._send, order=options.abort_code_order, retry=self.retry,
            sent=SentWrites(self.sent, placement))
        self._channel = MailboxChannel(self._transactor)
        self._writers = Writers(self, self._channel)
        self._rounds = Rounds(self, self._channel, self._writers)
        self._exchange = PolledExchange(self, self, self._channel)
        self.services = DriveServices(
            self, procedures.RegisterAccess(self._channel, self.retry, placement))
        self._lifecycle = Lifecycle(self._channel)
        self.set_parts(
            self._lifecycle, HeartbeatWatch(self, self._node), channel=self._channel,
            behind_control=[ExpiryWatch(self, self._writers)])

    # -- life cycle -------------------------------------------------------------------------------

    def prepare_stop(self, now: float) -> bool:
        pending = self.duty.happened(Happened.ENDS) is Do.STOP
        return self.stage is not Stage.IDLE and (
            pending or self.ever_online and now >= self._node.free_at)

    def begin_stop(self, now: float) -> bool:
        self._lifecycle.end()
        self._exchange.stop()
        self._channel.drop(now)
        self._writers.stop(now)
        return True

    @property
    def longest_stop(self) -> float:
        return self._writers.stop_time if self.stage is Stage.STOPPING else 0.0

    def bus_down(self, now: float, reason: str) -> None:
        self._node.forget()
        super().bus_down(now, reason)

    def begin(self, now: float) -> None:
        self.report.guess(sentences.looked_for())
        self._forget_exchange()
        self._rounds.restart()
        self._node.begin(now)
        self._look_for_it(now, now)
        self._begin_rounds(now)
        self._send_pending_stop(now)

    def fall_silent(self) -> None:
        super().fall_silent()
        self._exchange.stop()
        self._rounds.refusals.clear()

    # -- online and offline -----------------------------------------------------------------------

    def read_round(self) -> Procedure[Raws | None]:
        return self._rounds.read()

    def round_answered(self, raws: Raws, now: float, *, found: bool) -> None:
        self._rounds.ended(now, found=found)

    @property
    def present(self) -> bool:
        return not self._node.heartbeat_lost

    def round_found(self, now: float) -> None:
        self._lifecycle.end()
        self.be_online()
        self._writers.forget()
        self.control_changed(now)
        self._writers.write_setpoints(now)

    def exchange_missed(self, reason: Sentence, now: float) -> None:
        if reason and self.online:
            gap = self._rounds.gap
            self._silent(sentences.lost_because(reason, gap) if gap else reason, now)
        elif reason and not self._node.heartbeat_lost:
            self.report.guess(sentences.rounds_unanswered(), unless=self._rounds.gap)

    def lost(self, now: float, *, was_online: bool) -> None:
        if was_online:
            self._offline_traffic.clear()
        self._forget_exchange()

    def _forget_exchange(self) -> None:
        """Forget the round and the writes that are under way."""
        self._exchange.cancel()
        self._exchange.forget()
        self._writers.cancel()

    def withdrawn(self, now: float) -> None:
        """Leave it to the stop to write ``disable``."""

    # -- the node ---------------------------------------------------------------------------------

    def _script(self, now: float, start_at: float) -> Script:
        """
        Start the node again and again, until the drive is found.

        :param start_at: when it is started next.
        """
        start = network.encode_nmt(NmtCommand.START, self._node.number)
        while self.configuration.options.nmt_start:
            if now < start_at:
                now = yield start_at
            self.outbox.put(start)
            self._started_at, start_at = now, now + START_PERIOD

    def _look_for_it(self, now: float, start_at: float, *, needed: bool = True) -> None:
        """
        Restart the script.

        :param needed: the node has to be started: a moment later it takes PDOs.
        """
        if needed and self.configuration.options.nmt_start:
            self._node.started(start_at)
        self._lifecycle.start(self._script(now, start_at), now)

    def _begin_rounds(self, now: float) -> None:
        """Send nothing before the node takes PDOs but what stops its drive; then look for it."""
        free_at = self._node.free_at
        self._channel.hold(free_at)
        self._exchange.timer.start(max(now, free_at))
        self._channel.advance(now)

    def _take_heartbeat(self, state: NmtState, now: float) -> None:
        change = self._node.receive_heartbeat(state, now)
        if self.stage is not Stage.RUNNING or change is NodeChange.NONE:
            return
        self._exchange.timing.heartbeat(self._node.silent_for)
        if change is NodeChange.OPERATIONAL:
            self._look_for_it(now, self._started_at + START_PERIOD, needed=False)
        else:       # before a stop: the node hears that only when it was started
            self._look_for_it(now, max(now, self._started_at + START_SPACING))
        if change is NodeChange.RESTARTED:
            self.report.note(Noted(sentences.booted()))
            self._exchange.timing.forget()
            reason = sentences.device_restarted()
            self._close(reason, Failure(
                FailureKind.NO_ANSWER, sentences.no_answer_because(reason)), now)
            self.report.advise(sentences.restarted_waiting())
        elif change is NodeChange.NOT_OPERATIONAL:
            reason = self._node.refusal(now)
            self._close(reason, Failure(
                FailureKind.OFFLINE, sentences.drive_offline_because(reason)), now)
        self._begin_rounds(now)

    def _close(self, reason: Sentence, failure: Failure, now: float) -> None:
        """Handle a node that takes no PDOs: none that was sent is answered any more."""
        self.lose(reason, now)
        self.services.fail_all(failure)
        # a stop takes its course: however often a node restarts, they do not pile up
        if self._channel.is_idle(Priority.STOP):
            self._channel.clear()
            self._send_pending_stop(now)

    def heartbeat_lost(self, now: float) -> None:
        """Handle a node whose heartbeats have ceased."""
        self._silent(sentences.no_heartbeat(self._node.heartbeat_timeout), now)

    def _silent(self, reason: Sentence, now: float) -> None:
        """Handle a drive that does not answer, or whose heartbeats have ceased."""
        was_online = self.online
        self.lose(reason, now)
        if was_online:
            self._writers.stop(now)     # it may be listening
            self._look_for_it(now, self._started_at + START_PERIOD, needed=False)

    def request_refusal(self, now: float) -> Failure | None:
        """Return why nothing can be asked by PDOs for a while; None: it can."""
        text = self._node.refusal(now) if self.stage is Stage.RUNNING else NOTHING
        return (Failure(FailureKind.OFFLINE, sentences.drive_offline_because(text)) if text else
                None)

    def _send_pending_stop(self, now: float) -> None:
        """Stop a drive whose stop is pending, although it may not receive anything."""
        if self.duty.happened(Happened.STARTED) is Do.STOP:
            self._writers.stop(now)

    def _end_futile_stop(self, now: float) -> None:
        """End a stop that was for safety only, of a node that takes no PDOs any more."""
        if now < self._node.free_at and not self.stop_pending:
            self.stop_ended()

    # -- what the device is told ------------------------------------------------------------------

    def hand_out_neutral(self, now: float) -> None:
        self._writers.write_all_setpoints(now)

    def update_control_word(self, now: float) -> None:
        if self.online:
            self._writers.write_control(now, known=self._rounds.blank)

    # -- frames -----------------------------------------------------------------------------------

    def _send(self, message: PkwMessage, left: Left) -> None:
        request = pkw.encode(message, self._layout)
        self.outbox.put(Frame(self.configuration.options.request_cob_id, request, False), left)

    def frames_left(self, now: float, refused: Collection[int] = ()) -> None:
        super().frames_left(now, refused)
        if refused:
            self._channel.advance(now)

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        identifier, data, extended = frame
        if extended:
            return
        options = self.configuration.options
        if not self.online and (identifier == options.response_cob_id
                                or identifier - self._node.number in _NODE_SAYS):
            self._offline_traffic.came(now)
        try:
            if identifier == options.response_cob_id:
                self._writers.again.sign_of_life(now)
                self._exchange.received_at = now - age
                message = pkw.decode(data, self._layout)
                if not self._channel.receive(message, now):
                    late = self._channel.late(now - age, message)
                    self.report.unasked(sentences.unasked_pkw(str(message)), late, now)
            elif self._node.receive(frame, self.report, self._take_heartbeat, now):
                self._end_futile_stop(now)
                self._writers.again.sign_of_life(now, hurry=True)
            elif identifier == options.request_cob_id:
                self.report.note(ForeignMasterSeen(sentences.other_master_asks_node(
                    self.configuration.station, 'PKW requests', str(frame))))
            elif identifier == network.NMT_IDENTIFIER:
                masters.report_nmt(frame, self.configuration.station, self.report)
            elif identifier == sdo.REQUEST_BASE + self.configuration.station:
                self.report.note(ForeignMasterSeen(
                    masters.sdo_request(frame, self.configuration.station)))
        except RemoteProtocolError as error:
            self.report.reject(sentences.malformed(error.sentence))
            if not self.online:
                self._offline_traffic.wrong(sentences.answers_otherwise(error.sentence), now)

    @property
    def offline_advice(self) -> Sentence:
        return self.defect or self._offline_traffic.instead_of(
            self.report.advice, self._node, self._channel.now)

    # -- timer ------------------------------------------------------------------------------------

    def handle_timer(self, now: float) -> None:
        super().handle_timer(now)
        if now >= self._round_due:
            self._writers.round_begins()
            if self.control is not None and self.control.stopping:
                self.update_control_word(now)   # before setpoints, should it be due again
            if self.online:
                self._writers.write_setpoints(now)
                self.update_control_word(now)
            self._exchange.begin(now)

    @property
    def _round_due(self) -> float:
        """When the next round is due; infinity: not before this one has ended."""
        return math.inf if self._exchange.reading else self._exchange.timer.due

    def next_timer(self) -> float:
        return min(self._round_due, super().next_timer())

    def control_refusal(self, action: ControlAction, refusal: Sentence, *,
                        offline: bool) -> Sentence:
        return self._writers.control_refusal(action, refusal)

    # -- state ------------------------------------------------------------------------------------

    @property
    def warning(self) -> Sentence:
        return together((
            self._node.ailing, *self._rounds.warnings(), *self._writers.warnings(),
            self._node.missing))

    def facts(self) -> dict[str, str]:
        return self._node.facts()
