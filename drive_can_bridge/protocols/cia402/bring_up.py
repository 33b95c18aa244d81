# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What is done with a drive before its first PDO, as one sequence.

.. code-block:: text

    6041h ─enabled─► 6040h until it is not ─► heartbeats ─► NMT pre-operational ─► PDOs, SYNC
        ─► 60C2h, 6502h, 6060h ─► NMT start ─► where axes are that stay there ─► 6041h as above
        ─► PDOs flow

All that may take minutes, and others may have enabled the drive meanwhile: so it is asked for its
state once more before the first PDO, and disabled. Whatever nobody answers ends it; it begins anew
then. What differs from the configuration, and cannot be made to fit, is told in words, and the
drive is not cycled.
"""

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from enum import Enum
import math
from typing import Any

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.sentences import NOTHING, Sentence
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.stop_duty import Happened
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.network import NmtCommand, NmtState
from drive_can_bridge.protocols.canopen.node import Node, START_PAUSE
from drive_can_bridge.protocols.cia402 import pdo, states
from drive_can_bridge.protocols.cia402.channel import Ask, Reply, SdoChannel
from drive_can_bridge.protocols.cia402.control import DISABLE_WORDS, DriveRules
from drive_can_bridge.protocols.cia402.pdo import Pdo, request_pdos, response_pdos
from drive_can_bridge.protocols.cia402.states import MODES, State

SYNC_COB_ID, SYNC_PERIOD, SYNC_COUNTER = 0x1005, 0x1006, 0x1019
CONSUMER, PRODUCER = 0x1016, 0x1017
#: 1005h: the device itself produces SYNC
_PRODUCES_SYNC = 1 << 30
#: the bridge's heartbeat may be late by so many intervals
WATCH_INTERVALS = 3
#: s between two looks at what is awaited
LOOK_PERIOD = 0.02
#: looks at a state that a heartbeat has yet to tell
_LOOKS = 5
_POWERS = (-3, -4, -5, -6, -2, -1, 0)
_RUNNING = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)

Procedure = Generator[Ask, Reply, Any]


class Found(Enum):
    """What the sequence has come to."""

    READY = 'ready'
    DIFFERS = 'differs'
    RUNS = 'runs on'
    SILENT = 'no answer any more'
    ABSENT = 'no answer at all'


@dataclass(frozen=True)
class Outcome:
    """
    The end of the sequence.

    :param text: what differs, or how it runs on.
    :param status: the last status word, where it is ready.
    :param remedy: says what to do about what differs.
    """

    found: Found
    text: Sentence = NOTHING
    status: int = 0
    remedy: Callable[[str], Sentence] = sentences.drive_to_correct


class _End(Exception):
    """The sequence ends here."""

    def __init__(self, outcome: Outcome) -> None:
        super().__init__(outcome.text)
        self.outcome = outcome


class BringUp:
    """
    The sequence for one drive.

    :param rules: learn what the drive does at a quick stop.
    :ivar watch: sub-index of 1016h by which the drive watches the bridge, written by us; None.
    :ivar options: what 605Ah, 605Bh, 605Ch say, by index; without those that the drive lacks.
    :ivar nmt_at: when it was sent NMT last.
    """

    def __init__(self, session: Session, node: Node, rules: DriveRules,
                 channel: SdoChannel) -> None:
        drive = session.configuration
        self._session, self._node, self._rules = session, node, rules
        self._channel = channel
        self._drive, self._options = drive, drive.options
        self._mode = MODES[drive.options.mode]
        self._attempts = drive.parameter_retries + 1
        self._received, self._sent = request_pdos(drive), response_pdos(drive)
        self._synchronous: bool = drive.options.transmission == 'sync'
        self._told: set[str] = set()
        self._found = NOTHING           # what was told of a drive that runs
        self.watch: int | None = None
        self.options: dict[int, int] = {}
        self.nmt_at = -math.inf

    def run(self) -> Procedure:
        """Do it; returns an :class:`Outcome`."""
        reply = yield Ask(states.STATUS_WORD)
        if _silent(reply):
            return Outcome(Found.ABSENT)
        try:
            yield from self._stand_still(reply)
            yield from self._learn()
            yield from self._heartbeat()
            if self._options.mapping != 'assume':
                yield from self._exchange()
            yield from self._interpolation_time()
            yield from self._choose_mode()
            yield from self._watch_bridge()
            yield from self._beats()
            yield from self._start()
            yield from self._find_axes()
            status = yield from self._once_more()
        except _End as end:
            return end.outcome
        return Outcome(Found.READY, status=status)

    def _once_more(self) -> Generator[Ask, Reply, int]:
        """Look again at what nobody looked at meanwhile; return the status word."""
        while True:
            yield from self._beats()
            status = yield from self._stand_still(
                (yield from self._transfer(Ask(states.STATUS_WORD))))
            if not self._node.ceased:
                return status

    # -- one object -------------------------------------------------------------------------------

    def _transfer(self, ask: Ask) -> Generator[Ask, Reply, Reply]:
        reply = yield ask
        if _silent(reply):
            raise _End(Outcome(Found.SILENT))
        return reply

    def _read(self, index: int, subindex: int = 0, length: int = 4, *, signed: bool = False,
              ) -> Generator[Ask, Reply, 'int | None']:
        """
        Read a number; None: the drive refuses, which mostly means that it has none.

        :param length: its bytes, where the drive does not tell.
        """
        reply = yield from self._transfer(Ask(index, subindex))
        if reply.data is None:
            return None
        data = reply.data if reply.sized else reply.data[:length]
        return int.from_bytes(data, 'little', signed=signed)

    def _put(self, index: int, subindex: int, value: int, length: int,
             ) -> Generator[Ask, Reply, Sentence]:
        """Write a number, again where nobody answers: it stays the same; return the refusal."""
        data = (value & (1 << 8 * length) - 1).to_bytes(length, 'little')
        reply = yield from self._transfer(Ask(index, subindex, data, attempts=self._attempts))
        return NOTHING if reply.abort is None else sentences.object_refused(
            _place(index, subindex), sdo.describe(reply.abort))

    def _must(self, index: int, subindex: int, value: int, length: int) -> Procedure:
        refusal = yield from self._put(index, subindex, value, length)
        if refusal:
            raise _differs(refusal)

    def tell(self, text: Sentence, *, warning: bool = True) -> None:
        """Tell people once what the drive lacks."""
        if text not in self._told:
            self._told.add(text)
            self._session.report.note(Noted(text, warning=warning))

    # -- the steps --------------------------------------------------------------------------------

    def _stand_still(self, reply: Reply) -> Generator[Ask, Reply, int]:
        """
        Disable a drive that is found enabled, before anything else is touched.

        :param reply: its status word.
        :return: the last one.
        """
        looks, word, refusal = 0, -1, NOTHING
        until = self._channel.now + self._drive.control_timeout
        while True:
            if reply.data is None:
                raise _differs(sentences.object_refused(
                    _place(states.STATUS_WORD), sdo.describe(reply.abort or 0)))
            raw = int.from_bytes(reply.data[:2], 'little')
            state = states.state_of(raw)
            reacting = state is State.FAULT_REACTION    # it stops by itself, whatever it is told
            if not reacting and state not in _RUNNING:
                break
            found = (sentences.found_braking if reacting else sentences.found_enabled)(state.value)
            if self._channel.now >= until:
                runs = found if reacting else sentences.found_running(state.value)
                raise _End(Outcome(Found.RUNS, sentences.together((runs, refusal))))
            if not looks and found != self._found:
                self._found = found
                self._session.report.note(Noted(found, warning=True))
            wanted = DISABLE_WORDS[self._options.disable_word]
            if state is State.QUICK_STOP_ACTIVE:    # which takes its course
                wanted = states.DISABLE_VOLTAGE
            braking = reacting or (
                state is State.QUICK_STOP_ACTIVE and (yield from self._brakes(raw)))
            if not braking and (wanted != word or not looks % _LOOKS):
                word = wanted
                refusal = yield from self._put(states.CONTROL_WORD, 0, word, 2)
            looks += 1
            yield Ask(pause=LOOK_PERIOD)
            reply = yield from self._transfer(Ask(states.STATUS_WORD))
        self._found = NOTHING
        self._rules.known_disabled()
        self._session.duty.happened(Happened.STOPPED)
        return raw

    def _brakes(self, status: int) -> Generator[Ask, Reply, bool]:
        """Tell whether a quick stop takes its course: one that ends by itself does until then."""
        self._rules.quick_stop_option = yield from self._read(
            states.QUICK_STOP_OPTION, 0, 2, signed=True)
        if not self._rules.stays:
            return True
        return not status & states.TARGET_REACHED and (
            yield from self._read(states.VELOCITY)) != 0

    def _learn(self) -> Procedure:
        """Read what the drive does at a stop."""
        for index in states.STOP_OPTIONS:
            value = yield from self._read(index, 0, 2, signed=True)
            if value is None:
                self.options.pop(index, None)
            else:
                self.options[index] = value
            self._rules.quick_stop_option = self.options.get(states.QUICK_STOP_OPTION)

    def learn_again(self) -> Procedure:
        """Read it once more: users have written it."""
        try:
            yield from self._learn()
        except _End:    # nobody answers: what was read stands
            return

    def _heartbeat(self) -> Procedure:
        """Have the drive produce heartbeats."""
        node, interval = self._node, round(1000 * self._options.heartbeat_producer)
        node.heartbeat_timeout = self._options.heartbeat_timeout
        if not interval:
            return
        if (yield from self._read(PRODUCER, 0, 2)) != interval and (
                yield from self._put(PRODUCER, 0, interval, 2)):
            node.heartbeat_timeout = 0.0
            self.tell(sentences.no_heartbeat_producer())

    def _beats(self) -> Procedure:
        """Wait for heartbeats that have ceased: it would be online again, and not watched."""
        if self._node.ceased:
            self._session.report.advice = sentences.no_heartbeat(self._node.heartbeat_timeout)
            while self._node.ceased:
                yield Ask(pause=LOOK_PERIOD)

    def _start(self) -> Procedure:
        """Have the node take PDOs, or wait until somebody else does."""
        if self._options.nmt_start:
            self._nmt(NmtCommand.START)
            yield Ask(pause=START_PAUSE)
        elif self._waits_for_start and self._node.state is not None:
            self._session.report.advice = sentences.node_state(self._node.state.text)
            while self._waits_for_start:
                yield Ask(pause=LOOK_PERIOD)

    @property
    def _waits_for_start(self) -> bool:
        return self._node.state not in (None, NmtState.OPERATIONAL)

    def wake(self, now: float) -> None:
        """Have a node that answers nothing become pre-operational, if that is our business."""
        self.nmt_at = now
        if self._options.nmt_start:
            self._nmt(NmtCommand.ENTER_PRE_OPERATIONAL)

    def _nmt(self, command: NmtCommand) -> None:
        self.nmt_at = max(self.nmt_at, self._channel.now)
        self._session.outbox.put(network.encode_nmt(command, self._drive.station))

    def _find_axes(self) -> Procedure:
        """Read where axes are that stay where they are, until setpoints can carry it."""
        setpoints = self._session.setpoints
        while True:
            for setpoint in setpoints.held:
                measured = setpoint.measured
                word = yield from self._read(measured.index or 0, measured.subindex or 0)
                if word is None:
                    raise _differs(sentences.object_refused(
                        _place(measured.index or 0, measured.subindex or 0), measured.name))
                setpoints.changed |= setpoint.measure(measured.raw_from_word(
                    word & (1 << measured.type.bits) - 1))
            if setpoints.known:
                return
            self._session.report.advice = setpoints.untold_text
            yield Ask(pause=5 * LOOK_PERIOD)

    def _choose_mode(self) -> Procedure:
        number, name = self._mode.number, self._options.mode
        offered = yield from self._read(states.MODES_OFFERED)
        if offered is not None and not offered >> number - 1 & 1:
            raise _differs(sentences.mode_not_offered(name, number, offered))
        yield from self._must(states.MODE, 0, number, 1)

    def _interpolation_time(self) -> Procedure:
        """Write 60C2h, where the drive has it."""
        index, period = states.INTERPOLATION_TIME, self._drive.period
        value = yield from self._read(index, 1, 1)
        if value is None:
            return
        fitting = interpolation_time(period)
        if fitting is None:
            self.tell(sentences.interpolation_time_left(period))
            return
        count, power = fitting
        if (value, (yield from self._read(index, 2, 1, signed=True))) == fitting:
            return
        refusal = (yield from self._put(index, 2, power, 1)) or (
            yield from self._put(index, 1, count, 1))
        if refusal:
            self.tell(refusal)

    # -- who watches the bridge -------------------------------------------------------------------

    def _watch_bridge(self) -> Procedure:
        """Have the drive stop by itself when the bridge dies."""
        interval, mapping = self._options.bridge_heartbeat, self._options.mapping
        if mapping == 'assume':
            self.tell(sentences.watch_unknown())
            return
        slot = None
        if interval > 0.0:
            slot = yield from (self._write_watch if mapping == 'configure' else
                               self._read_watch)(interval)
        option = (yield from self._read(states.ABORT_CONNECTION_OPTION, 0, 2)) \
            if slot is not None else 0
        if option == 0:
            self.tell(sentences.nothing_stops())

    def _watchers(self) -> Generator[Ask, Reply, list[int]]:
        count = yield from self._read(CONSUMER, 0, 1)
        found = []
        for subindex in range(1, (count or 0) + 1):
            found.append((yield from self._read(CONSUMER, subindex)) or 0)
        return found

    def _write_watch(self, interval: float) -> Generator[Ask, Reply, 'int | None']:
        node = self._options.bridge_node
        entries = yield from self._watchers()
        slots = [place for place, entry in enumerate(entries, 1) if entry >> 16 & 0x7F == node] + [
            place for place, entry in enumerate(entries, 1)
            if not entry >> 16 & 0x7F or not entry & 0xFFFF]
        if not slots:
            return None
        limit = min(round(1000 * WATCH_INTERVALS * interval), 0xFFFF)
        before, self.watch = self.watch, slots[0]   # also where the end comes before the answer
        refusal = yield from self._put(CONSUMER, slots[0], node << 16 | limit, 4)
        if refusal:
            self.watch = before
            self.tell(refusal)
            return None
        return self.watch

    def _read_watch(self, interval: float) -> Generator[Ask, Reply, 'int | None']:
        for place, entry in enumerate((yield from self._watchers()), 1):
            if entry >> 16 & 0x7F == self._options.bridge_node and entry & 0xFFFF:
                if entry & 0xFFFF < 2000 * interval:
                    raise _differs(sentences.watch_too_short(
                        _place(CONSUMER, place), entry & 0xFFFF, interval),
                        sentences.maps_to_correct)
                self.tell(sentences.watch_stays(_place(CONSUMER, place)))
                return place
        return None

    def release(self, timeout: float) -> Procedure:
        """Have the drive watch the bridge no more, behind an ordered stop."""
        slot, self.watch = self.watch, None
        if slot is not None:
            yield Ask(CONSUMER, slot, bytes(4), attempts=self._attempts, timeout=timeout)

    # -- how PDOs travel --------------------------------------------------------------------------

    def _exchange(self) -> Procedure:
        """Compare the set-up of PDOs and SYNC, and write what differs, if that is wanted."""
        if self._options.mapping == 'configure' and self._options.nmt_start:
            self._nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        elif self._options.mapping == 'configure' and self._options.heartbeat_producer > 0:
            for _ in range(_LOOKS):     # whether it may be written, a heartbeat says
                if self._node.state is None:
                    yield Ask(pause=self._options.heartbeat_producer / 2)
        if self._synchronous:
            yield from self._sync()
        for wanted in self._received:
            yield from self._look_at(wanted, transmit=False)
        for wanted in self._sent:
            yield from self._look_at(wanted, transmit=True)
        if self._options.mapping == 'configure':
            yield from self._close(pdo.RPDO_COMMUNICATION, self._received)
            yield from self._close(pdo.TPDO_COMMUNICATION, self._sent)

    def _may_write(self, text: Sentence) -> None:
        """End here where what differs is not to be written."""
        options = self._options
        if options.mapping != 'configure':
            raise _differs(text, sentences.maps_to_correct)
        if not options.nmt_start and self._node.state is not NmtState.PRE_OPERATIONAL:
            raise _differs(sentences.not_pre_operational(text))

    def _sync(self) -> Procedure:
        identifier = yield from self._read(SYNC_COB_ID)
        if identifier is not None and identifier & (
                _PRODUCES_SYNC | pdo.LONG_IDENTIFIER | pdo.LONG_IDENTIFIER - 1
                ) != network.SYNC_IDENTIFIER:
            self._may_write(sentences.object_differs(
                _place(SYNC_COB_ID), f'{identifier:08X}h', f'{network.SYNC_IDENTIFIER:08X}h'))
            yield from self._must(SYNC_COB_ID, 0, network.SYNC_IDENTIFIER, 4)
        period, wanted = (yield from self._read(SYNC_PERIOD)), round(1e6 * self._drive.period)
        if period and period != wanted:
            self._may_write(sentences.object_differs(
                _place(SYNC_PERIOD), f'{period} us', f'{wanted} us'))
            yield from self._must(SYNC_PERIOD, 0, wanted, 4)
        counter = yield from self._read(SYNC_COUNTER, 0, 1)
        if (counter or 0) > 1:
            raise _differs(sentences.object_differs(_place(SYNC_COUNTER), str(counter), '0'))

    def _look_at(self, wanted: Pdo, *, transmit: bool) -> Procedure:
        """Compare one PDO; write it where it differs, and compare again."""
        difference, identifier = yield from self._compare(wanted, transmit=transmit)
        if difference:
            self._may_write(difference)
            refusal = yield from self._write(wanted, identifier, transmit=transmit)
            difference, _ = yield from self._compare(wanted, transmit=transmit, written=True)
            if refusal and difference:
                raise _differs(refusal)
            if difference:
                raise _differs(difference, sentences.maps_not_kept)

    def _types(self, *, transmit: bool) -> tuple[int, ...]:
        event = pdo.EVENT_PROFILE, pdo.EVENT_MAKER
        if not self._synchronous:
            return event
        return (pdo.SYNCHRONOUS,) if transmit else (pdo.SYNCHRONOUS, *event)

    def _compare(self, wanted: Pdo, *, transmit: bool, written: bool = False,
                 ) -> Generator[Ask, Reply, tuple[Sentence, int]]:
        """
        Return what differs, and the COB-ID as it is.

        :param written: it was just written, and any of the types that are tried will do.
        """
        at = wanted.communication
        identifier = yield from self._read(at, pdo.COB_ID)
        if identifier is None:
            raise _differs(sentences.no_such_pdo('TPDO' if transmit else 'RPDO', wanted.number))
        if identifier & ~pdo.NO_REMOTE != wanted.identifier:
            return _difference(at, pdo.COB_ID, identifier, wanted.identifier), identifier
        kind = yield from self._read(at, pdo.TRANSMISSION, 1)
        types = self._types(transmit=transmit)
        judged = transmit or self._options.mapping == 'configure'
        if judged and kind not in (types if written or transmit else types[:1]):
            return _difference(at, pdo.TRANSMISSION, kind or 0, types[0]), identifier
        difference = yield from self._other_content(wanted)
        if difference:
            return difference, identifier
        if transmit and self._options.mapping == 'configure' and not written:
            for subindex, value in self._timers():
                time = yield from self._read(at, subindex, 2)
                if time is not None and time != value:
                    return _difference(at, subindex, time, value), identifier
        return NOTHING, identifier

    def _other_content(self, wanted: Pdo) -> Generator[Ask, Reply, Sentence]:
        """Return in what a PDO holds something else."""
        entries, mapping = wanted.entries, wanted.communication + pdo.MAPPING_OFFSET
        count = yield from self._read(mapping, 0, 1)
        if count != len(entries):
            return _difference(mapping, 0, count or 0, len(entries))
        for place, entry in enumerate(entries, 1):
            found = (yield from self._read(mapping, place)) or 0
            if found != entry:
                return sentences.object_differs(
                    _place(mapping, place), pdo.entry_text(found), pdo.entry_text(entry))
        return NOTHING

    def _timers(self) -> list[tuple[int, int]]:
        """Return inhibit time (0.1 ms) and event timer (ms) that a TPDO shall have."""
        if self._synchronous:
            return [(pdo.INHIBIT_TIME, 0)]
        return [(pdo.INHIBIT_TIME, min(round(5000 * self._drive.period), 0xFFFF)),
                (pdo.EVENT_TIMER, round(1000 * self._drive.period))]

    def _write(self, wanted: Pdo, identifier: int, *, transmit: bool,
               ) -> Generator[Ask, Reply, Sentence]:
        """
        Write one PDO, in the order that all devices take.

        :return: the refusal of one that is fixed: it may fit as it is, but for type and times.
        """
        at = wanted.communication
        kept = identifier & (pdo.NO_REMOTE | pdo.LONG_IDENTIFIER)
        fixed = yield from self._put(at, pdo.COB_ID, identifier | pdo.INVALID, 4)
        undo: list[tuple[int, int]] = []
        refusal = NOTHING if fixed else (yield from self._map(wanted, undo))
        refusal = refusal or (yield from self._pace(at, fixed=bool(fixed), transmit=transmit))
        if not fixed:
            refusal = refusal or (yield from self._put(
                at, pdo.COB_ID, wanted.identifier | kept, 4))
        if refusal and not fixed:       # as it was found
            for place, content in reversed(undo):
                if (yield from self._put_entry(at + pdo.MAPPING_OFFSET, place, content)):
                    break       # it stays off, rather than with something else in it
            else:
                yield from self._put(at, pdo.COB_ID, identifier, 4)
        if refusal:
            raise _differs(refusal)
        return fixed

    def _map(self, wanted: Pdo, undo: list[tuple[int, int]]) -> Generator[Ask, Reply, Sentence]:
        """
        Write what a PDO holds, unless it holds that: it may be fixed.

        :param undo: gets the sub-indices that were written, and what they held.
        :return: the refusal.
        """
        entries, mapping = wanted.entries, wanted.communication + pdo.MAPPING_OFFSET
        count = (yield from self._read(mapping, 0, 1)) or 0
        held = {0: count}
        for place in range(1, min(count, len(entries)) + 1):
            held[place] = (yield from self._read(mapping, place)) or 0
        if held == dict(enumerate((len(entries), *entries))):
            return NOTHING
        for place, content in (0, 0), *enumerate(entries, 1), (0, len(entries)):
            refusal = yield from self._put_entry(mapping, place, content)
            if refusal:
                return refusal
            if place in held:       # what was beyond the count was nothing
                undo.append((place, held[place]))
                held[place] = content
        return NOTHING

    def _put_entry(self, mapping: int, place: int, content: int,
                   ) -> Generator[Ask, Reply, Sentence]:
        return (yield from self._put(mapping, place, content, 4 if place else 1))

    def _pace(self, at: int, *, fixed: bool, transmit: bool) -> Generator[Ask, Reply, Sentence]:
        """Write when a PDO is sent; return the refusal of what it cannot do without."""
        types, refusal = self._types(transmit=transmit), NOTHING
        for kind in types[:1] if fixed else types:
            refusal = yield from self._put(at, pdo.TRANSMISSION, kind, 1)
            if not refusal:
                break
        if refusal and not fixed:
            return refusal
        for subindex, value in self._timers() if transmit else ():
            found = yield from self._read(at, subindex, 2)
            if found == value or found is None and not value:
                continue
            refusal = yield from self._put(at, subindex, value, 2)
            if refusal and subindex == pdo.EVENT_TIMER:
                return refusal
            if refusal:
                self.tell(refusal)
        return NOTHING

    def _close(self, first: int, used: Iterable[Pdo]) -> Procedure:
        """Make PDOs invalid that are not needed."""
        needed = {each.number for each in used}
        for number in range(1, pdo.PDO_MAX + 1):
            at = first + number - 1
            if number in needed:
                continue
            identifier = yield from self._read(at, pdo.COB_ID)
            if identifier is not None and not identifier & pdo.INVALID:
                self._may_write(_difference(at, pdo.COB_ID, identifier, identifier | pdo.INVALID))
                refusal = yield from self._put(at, pdo.COB_ID, identifier | pdo.INVALID, 4)
                if refusal:
                    self.tell(refusal)


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


def _silent(reply: Reply) -> bool:
    return reply.data is None and reply.abort is None


def _differs(text: Sentence, remedy: Callable[[str], Sentence] = sentences.drive_to_correct,
             ) -> _End:
    return _End(Outcome(Found.DIFFERS, text, remedy=remedy))


def _place(index: int, subindex: int = 0) -> str:
    return f'{index:04X}h.{subindex:02X}h'


def _difference(index: int, subindex: int, found: int, wanted: int) -> Sentence:
    width = 8 if subindex == pdo.COB_ID and index < 0x1A00 and not 0x1600 <= index < 0x1800 else 2
    return sentences.object_differs(
        _place(index, subindex), f'{found:0{width}X}h', f'{wanted:0{width}X}h')
