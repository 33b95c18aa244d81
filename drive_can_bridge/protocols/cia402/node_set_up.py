# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What is done with a drive before its first PDO, as one sequence.

.. code-block:: text

    6041h ─enabled─► 6040h until it is not ─► heartbeats ─► NMT pre-operational ─► PDOs, SYNC
        ─► 60C2h, 6502h, 6060h ─► NMT start, as soon as there is SYNC ─► operational
        ─► where axes are that stay there ─► 6041h as above ─► PDOs flow

All that may take minutes, and others may have enabled the drive meanwhile: so it is asked for its
state once more before the first PDO, and disabled. Whatever nobody answers ends it; it restarts
then. What differs from the configuration, and cannot be made to fit, is told in words, and the
drive is not cycled.
"""

import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.stop_duty import Happened
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.canopen.network import NmtCommand, NmtState
from drive_can_bridge.protocols.canopen.node import START_PAUSE, WatchedNode
from drive_can_bridge.protocols.cia402 import pdo, states, stop_options
from drive_can_bridge.protocols.cia402.limits import LimitCheck
from drive_can_bridge.protocols.cia402.mapped import read_mapped
from drive_can_bridge.protocols.cia402.objects import (
    at_object, differs, ObjectAccess, SetUpEnd, SetUpOutcome, SetUpState)
from drive_can_bridge.protocols.cia402.pdo import request_pdos, response_pdos
from drive_can_bridge.protocols.cia402.pdo_set_up import PdoSetUp
from drive_can_bridge.protocols.cia402.state_machine import DISABLE_WORDS, DriveRules
from drive_can_bridge.protocols.cia402.states import MODES, ServoState
from drive_can_bridge.protocols.cia402.sync import SyncProducer
from drive_can_bridge.protocols.cia402.transactor import (
    ObjectRead, Procedure, Reply, SdoChannel, Transfer)
from drive_can_bridge.protocols.cia402.watch import BridgeWatch
from drive_can_bridge.protocols.transactor import Refused, Silence

SYNC_COB_ID, SYNC_PERIOD, SYNC_COUNTER = 0x1005, 0x1006, 0x1019
PRODUCER = 0x1017
#: 1005h: the device itself produces SYNC
_PRODUCES_SYNC = 1 << 30
#: s between two looks at what is awaited
POLL_PERIOD = 0.02
#: s that a drive has to acknowledge its stop until SYNC begins, and that a silent one is silent
STOP_TIME, SILENCE_TIME = 0.5, 1.0
#: s that the first heartbeat behind NMT start is waited for
_HEARTBEAT_WAIT = 0.5
#: looks at a state that a heartbeat has yet to tell
_LOOKS = 5
_POWERS = (-3, -4, -5, -6, -2, -1, 0)


class NodeSetUp:
    """
    The sequence for one drive.

    :param rules: learn what the drive does at a quick stop.
    :param limits: learn what they are before anything is sent.
    :ivar watch: who watches the bridge.
    :ivar options: what 605Ah, 605Bh, 605Ch say, by index; without those that the drive lacks.
    :param producer: of SYNC; None: the drive does not hear it.
    :ivar nmt_at: when it was sent NMT last.
    :ivar started_at: when it was sent NMT start last.
    :ivar moving: in which state it was found, where nobody has seen it leave that since.
    """

    def __init__(self, session: Session, node: WatchedNode, rules: DriveRules, channel: SdoChannel,
                 limits: LimitCheck, producer: SyncProducer | None) -> None:
        drive = session.configuration
        self._session, self._node, self._rules = session, node, rules
        self._channel, self._limits, self._producer = channel, limits, producer
        self._drive, self._options = drive, drive.options
        self._mode = MODES[drive.options.mode]
        objects = self._objects = ObjectAccess(drive.parameter_retries + 1)
        self._transfer, self._read = objects.transfer, objects.read
        self._put, self._must = objects.put, objects.must
        self._reported: set[str] = set()
        self.moving: ServoState | None = None
        self._found = NOTHING           # what was told of a drive that runs
        self.options: dict[int, int] = {}
        self.nmt_at = self.started_at = -math.inf
        self.forget(-math.inf)
        self.watch = BridgeWatch(objects, drive, self.report_once)
        self._pdos = PdoSetUp(objects, drive, self._may_write, self.report_once)

    def forget(self, now: float) -> None:
        """Know nothing of the state of the drive."""
        self._since = now
        self._disabled = False
        self._asked_at = self._stopped_at = math.inf

    @property
    def sync_at(self) -> float:
        """From when on SYNC starts nothing that is in the buffers of the drive."""
        if self._disabled:
            return -math.inf
        node, answer_time = self._node, self._drive.parameter_timeout
        heard_at = max(self._since, node.heard_at, node.pdo_at)
        silent_at = max(self._asked_at + answer_time, heard_at + SILENCE_TIME)
        return min(max(self._asked_at, self._stopped_at + STOP_TIME), silent_at)

    def run(self) -> Procedure[SetUpOutcome]:
        """Do it; returns a :class:`SetUpOutcome`."""
        self._asked_at = min(self._asked_at, self._channel.now)
        reply = yield Transfer(states.STATUS_WORD)
        if isinstance(reply, Silence):
            if self._node.heard_at > self._asked_at:
                yield from self._stop_blindly(attempts=1)
            return SetUpOutcome(SetUpState.ABSENT)
        try:
            yield from self._stand_still(reply)
            yield from self._learn()
            yield from self._heartbeat()
            if self._options.mapping != 'assume':
                yield from self._check_objects(reply)
                yield from self._exchange()
            yield from self._interpolation_time()
            yield from self._choose_mode()
            yield from self.watch.set_up()
            yield from self._await_heartbeats()
            yield from self._start()
            yield from self._find_axes()
            status = yield from self._check_again()
        except SetUpEnd as end:
            return end.outcome
        return SetUpOutcome(SetUpState.READY, status=status)

    def _check_again(self) -> Procedure[int]:
        """Check heartbeats and status again after the set-up; return the status word."""
        while True:
            yield from self._await_heartbeats()
            status = yield from self._stand_still(
                (yield from self._transfer(Transfer(states.STATUS_WORD))))
            if not self._node.ceased:
                return status

    # -- one object -------------------------------------------------------------------------------

    def report_once(self, text: Sentence, *, warning: bool = True) -> None:
        """Report once what the drive lacks, if anything."""
        if text and text not in self._reported:
            self._reported.add(text)
            self._session.report.note(Noted(text, warning=warning))

    # -- the steps --------------------------------------------------------------------------------

    def _stand_still(self, reply: ObjectRead | Refused) -> Procedure[int]:
        """
        Disable a drive that is found enabled, or that a SYNC may enable, before anything else.

        :param reply: its status word.
        :return: the last one.
        """
        producer = self._producer
        while True:
            raw = yield from self._disable(reply)
            self._disabled = producer is None or (
                states.state_of(raw) not in states.ONE_WORD_FROM_ENABLED)
            found = None if self._disabled or producer is None else (
                yield from self._power_off(producer))
            if found is None:
                break
            reply = found
        self._rules.known_disabled()
        if self._disabled:
            self._session.duty.happened(Happened.STOPPED)
        return raw

    def _disable(self, reply: ObjectRead | Refused) -> Procedure[int]:
        """Disable a drive that is found enabled; return the last status word."""
        looks, word, refusal = 0, -1, NOTHING
        until = self._channel.now + self._drive.control_timeout
        while True:
            if isinstance(reply, Refused):
                yield from self._stop_blindly()
                raise differs(sentences.object_refused(
                    at_object(states.STATUS_WORD), reply.meaning))
            raw = reply.number(2)
            state = states.state_of(raw)
            self._rules.standstill.status(raw, self._channel.now)
            if state not in states.MOVING:
                break
            self._stopped_at = min(self._stopped_at, self._channel.now)
            self.moving = state
            # a fault reaction ends by itself, whatever it is told; a quick stop takes its course
            braking = state is ServoState.FAULT_REACTION or (
                state is ServoState.QUICK_STOP_ACTIVE and (yield from self._brakes()))
            found = (sentences.found_braking if braking else sentences.found_enabled)(state.value)
            if self._channel.now >= until:
                runs = found if braking else sentences.found_running(state.value)
                raise SetUpEnd(SetUpOutcome(SetUpState.RUNS, together((runs, refusal))))
            if not looks and found != self._found:
                self._found = found
                self._session.report.note(Noted(found, warning=True))
            wanted = DISABLE_WORDS[self._options.disable_word]
            if state is ServoState.QUICK_STOP_ACTIVE:
                wanted = states.DISABLE_VOLTAGE
            if not braking and (wanted != word or not looks % _LOOKS):
                word = wanted
                refusal = yield from self._put(states.CONTROL_WORD, 0, word, 2)
            looks += 1
            yield Transfer(pause=POLL_PERIOD)
            reply = yield from self._transfer(Transfer(states.STATUS_WORD))
        self._found, self.moving = NOTHING, None
        return raw

    def _power_off(self, producer: SyncProducer) -> Procedure[ObjectRead | Refused | None]:
        """
        Write 0000h: a SYNC may put into effect a 000Fh that the drive still has in its buffers.

        :return: its status word then; None: for 0.5 s it has not obeyed.
        """
        self._stopped_at = min(self._stopped_at, self._channel.now)
        while True:
            refusal = yield from self._put(states.CONTROL_WORD, 0, states.DISABLE_VOLTAGE, 2)
            if not refusal:
                reply = yield from self._transfer(Transfer(states.STATUS_WORD))
                if isinstance(reply, Refused):
                    return reply
                state = states.state_of(reply.number(2))
                if state not in states.ONE_WORD_FROM_ENABLED:
                    return reply
                refusal = sentences.still_in_state(state.value)
            if producer.opened or self._channel.now + POLL_PERIOD >= self._stopped_at + STOP_TIME:
                self.report_once(sentences.sync_may_start(refusal))
                return None
            yield Transfer(pause=POLL_PERIOD)

    def _stop_blindly(self, attempts: int | None = None) -> Procedure[None]:
        """Stop a drive whose state is unknown, before SYNC begins."""
        producer = self._producer
        if producer is not None and not producer.opened and self._stopped_at == math.inf:
            self._stopped_at = self._channel.now
            word = DISABLE_WORDS[self._options.disable_word].to_bytes(2, 'little')
            yield Transfer(states.CONTROL_WORD, 0, word, attempts=attempts)

    def _brakes(self) -> Procedure[bool]:
        """Return whether a quick stop takes its course."""
        standstill = self._rules.standstill
        standstill.quick_stop_option = yield from self._read(
            states.QUICK_STOP_OPTION, 0, 2, signed=True)
        yield from standstill.poll(self._channel, sampled=False)
        return not standstill.holds

    def _learn(self) -> Procedure[None]:
        """Read what the drive does at a stop."""
        for index in states.STOP_OPTIONS:
            value = yield from self._read(index, 0, 2, signed=True)
            if value is None:
                self.options.pop(index, None)
            else:
                self.options[index] = value
                self.report_once(stop_options.unknown(index, value))
            self._rules.standstill.quick_stop_option = self.options.get(states.QUICK_STOP_OPTION)

    def learn_again(self) -> Procedure[None]:
        """Read it once more: users have written it."""
        try:
            yield from self._learn()
            yield from self.watch.learn_again()
        except SetUpEnd:    # nobody answers: what was read stands
            return

    def _heartbeat(self) -> Procedure[None]:
        """Set up the heartbeats of the drive."""
        node, interval = self._node, round(1000 * self._options.heartbeat_producer)
        node.heartbeat_timeout = self._options.heartbeat_timeout
        if not interval:
            return
        found = yield from self._read(PRODUCER, 0, 2)
        absent = self._objects.absent
        if found == interval:
            return
        refusal = yield from self._put(PRODUCER, 0, interval, 2)
        if not refusal:
            node.heartbeats_begin(self._channel.now)    # after a restart it sends none until now
            return
        if absent or found and found >= 1000 * node.heartbeat_timeout:
            node.heartbeat_timeout = 0.0
            self.report_once(sentences.no_heartbeat_producer())
        else:       # it may send them as it is
            self.report_once(refusal)

    def _check_objects(self, status: Reply) -> Procedure[None]:
        """See that all is there that is to be mapped, and that limits are not without effect."""
        drive = self._drive
        without_effect = self._limits.found((yield from read_mapped(
            self._objects, [*request_pdos(drive), *response_pdos(drive)], status)))
        if without_effect:
            raise differs(without_effect)

    def _await_heartbeats(self) -> Procedure[None]:
        """Wait for heartbeats that have ceased: it would be online again, and not watched."""
        if self._node.ceased:
            self._session.report.advise(sentences.no_heartbeat(self._node.heartbeat_timeout))
            while self._node.ceased:
                yield Transfer(pause=POLL_PERIOD)

    def _start(self) -> Procedure[None]:
        """Start the node, or wait until another master does."""
        if self._producer is not None:
            yield from self._sync_begins(self._producer)
        if self._options.nmt_start:
            self._nmt(NmtCommand.START)
            self.started_at = self._channel.now
            yield Transfer(pause=START_PAUSE)
            yield from self._becomes_operational()
        elif self._waits_for_start and self._node.state is not None:
            self._session.report.advise(sentences.node_state(self._node.state.text))
            while self._waits_for_start:
                yield Transfer(pause=POLL_PERIOD)
                if self._channel.now > self._node.heard_at + SILENCE_TIME / 2:
                    yield Transfer(states.STATUS_WORD, attempts=1)  # SYNC is for those heard

    def _sync_begins(self, producer: SyncProducer) -> Procedure[None]:
        """Wait until there is SYNC: a drive that watches it needs it when it is started."""
        while not producer.opened:
            self._session.report.advise(sentences.sync_not_begun())
            yield Transfer(pause=POLL_PERIOD)
        pause = producer.before_start(self._channel.now) if self._options.nmt_start else 0.0
        if pause:
            yield Transfer(pause=pause)

    def _becomes_operational(self) -> Procedure[None]:
        """Wait for what shows that the node is operational; for a heartbeat, if it sends them."""
        node, started_at = self._node, self.started_at
        until = started_at + self._drive.control_timeout
        heard_by = started_at
        if node.interval is not None:
            heard_by += min(_HEARTBEAT_WAIT, 1.5 * max(
                node.interval, self._options.heartbeat_producer))
        while node.pdo_at < started_at:
            said, now = node.said_since(started_at), self._channel.now
            if said is NmtState.OPERATIONAL or said is None and now >= heard_by:
                return
            if now >= until:
                raise SetUpEnd(SetUpOutcome(SetUpState.SILENT, sentences.node_state(
                    (said or NmtState.PRE_OPERATIONAL).text)))
            yield Transfer(pause=POLL_PERIOD)

    def starting(self, now: float) -> bool:
        """Return whether the node may still be on its way to operational."""
        return now < self.started_at + self._drive.control_timeout and (
            self._node.said_since(self.started_at) is not NmtState.OPERATIONAL)

    @property
    def _waits_for_start(self) -> bool:
        node = self._node   # that it is operational, PDOs show as well
        return node.said_since(node.pdo_at) not in (None, NmtState.OPERATIONAL)

    def wake(self, now: float) -> None:
        """Send a node that answers nothing to pre-operational, if NMT is our business."""
        self.nmt_at = now
        if self._options.nmt_start:
            self._nmt(NmtCommand.ENTER_PRE_OPERATIONAL)

    def _nmt(self, command: NmtCommand) -> None:
        self.nmt_at = max(self.nmt_at, self._channel.now)
        self._session.outbox.put(network.encode_nmt(command, self._drive.station))

    def _find_axes(self) -> Procedure[None]:
        """Read where axes are that stay where they are, until setpoints can carry it."""
        setpoints = self._session.setpoints
        while True:
            for setpoint in setpoints.held:
                measured = setpoint.measured
                word = yield from self._read(measured.index or 0, measured.subindex or 0)
                if word is None:
                    raise differs(sentences.object_refused(
                        at_object(measured.index or 0, measured.subindex or 0), measured.name))
                setpoints.changed |= setpoint.measure(measured.raw_from_word(
                    word & (1 << measured.type.bits) - 1))
            if setpoints.known:
                return
            self._session.report.advise(setpoints.untold_text)
            yield Transfer(pause=5 * POLL_PERIOD)

    def _choose_mode(self) -> Procedure[None]:
        number, name = self._mode.number, self._options.mode
        offered = yield from self._read(states.MODES_OFFERED)
        if offered is not None and not offered >> number - 1 & 1:
            raise differs(sentences.mode_not_offered(name, number, offered))
        yield from self._must(states.MODE, 0, number, 1)

    def _interpolation_time(self) -> Procedure[None]:
        """Write 60C2h, where the drive has it."""
        index, period = states.INTERPOLATION_TIME, self._drive.period
        value = yield from self._read(index, 1, 1)
        if value is None:
            return
        fitting = interpolation_time(period)
        if fitting is None:
            self.report_once(sentences.interpolation_time_left(period))
            return
        count, power = fitting
        if (value, (yield from self._read(index, 2, 1, signed=True))) == fitting:
            return
        refusal = (yield from self._put(index, 2, power, 1)) or (
            yield from self._put(index, 1, count, 1))
        if refusal:
            self.report_once(refusal)

    # -- how PDOs travel --------------------------------------------------------------------------

    def _exchange(self) -> Procedure[None]:
        """Compare the set-up of PDOs and SYNC, and write what differs, if that is wanted."""
        if self._options.mapping == 'configure' and self._options.nmt_start:
            self._nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        elif self._options.mapping == 'configure' and self._options.heartbeat_producer > 0:
            for _ in range(_LOOKS):     # whether it may be written, a heartbeat says
                if self._node.state is None:
                    yield Transfer(pause=self._options.heartbeat_producer / 2)
        if self._producer is not None:
            yield from self._sync()
        yield from self._pdos.set_up()

    def _may_write(self, text: Sentence) -> None:
        """End here where what differs is not to be written."""
        options = self._options
        if options.mapping != 'configure':
            raise differs(text, sentences.maps_to_correct)
        if not options.nmt_start and self._node.state is not NmtState.PRE_OPERATIONAL:
            raise differs(sentences.not_pre_operational(text))

    def _sync(self) -> Procedure[None]:
        identifier = yield from self._read(SYNC_COB_ID)
        if identifier is not None and identifier & (
                _PRODUCES_SYNC | pdo.LONG_IDENTIFIER | pdo.LONG_IDENTIFIER - 1
                ) != network.SYNC_IDENTIFIER:
            self._may_write(sentences.object_differs(
                at_object(SYNC_COB_ID), f'{identifier:08X}h', f'{network.SYNC_IDENTIFIER:08X}h'))
            yield from self._must(SYNC_COB_ID, 0, network.SYNC_IDENTIFIER, 4)
        period, wanted = (yield from self._read(SYNC_PERIOD)), round(1e6 * self._drive.period)
        if period and period != wanted:
            self._may_write(sentences.object_differs(
                at_object(SYNC_PERIOD), f'{period} us', f'{wanted} us'))
            yield from self._must(SYNC_PERIOD, 0, wanted, 4)
        if period:
            self.report_once(sentences.sync_watched(wanted, 0.5 * self._drive.period))
        counter = yield from self._read(SYNC_COUNTER, 0, 1)
        if (counter or 0) > 1:
            raise differs(sentences.object_differs(at_object(SYNC_COUNTER), str(counter), '0'))


def interpolation_time(period: float) -> tuple[int, int] | None:
    """
    Return a period as 60C2h has it: a number of 8 bits, and the power of ten of its unit in s.

    >>> interpolation_time(0.005), interpolation_time(0.0005), interpolation_time(1 / 3)
    ((5, -3), (5, -4), None)
    """
    for power in _POWERS:
        count = round(period / 10.0 ** power)
        if 1 <= count <= 0xFF and abs(count * 10.0 ** power - period) < 1e-9:
            return count, power
    return None
