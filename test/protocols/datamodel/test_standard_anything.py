# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
An 11-bit drive's codec with anything at all, and its session under anything that may happen.

The observer knows the protocol's bytes and the contract, nothing of the session's inside. It keeps
its own books: which read is open, until when there has to be silence, which commands went through.
"""

import math
from typing import Any, NamedTuple

from any_order import Observer, PATIENCE, SETTINGS, SLACK
from builders import (
    ACTUAL, CONTROL, CURRENT, DAMPING, drive, FLAG, GAIN, KEY, LIMIT, MAXIMUM, ORDER, parameter,
    RAMP, RO, SPEED, STATUS, WORD,
)
from datamodel_anything import TwoSetpoints
from drives import StandardDrive
from hypothesis import example, given, strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule
import pytest

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.events import ProcessDataReceived, StationFound, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.datamodel import standard
from drive_can_bridge.protocols.datamodel.extended import ReadTelegram, WriteTelegram
from drive_can_bridge.protocols.families import FAMILIES

TIMEOUT = 0.1
QUARANTINE = 0.1
#: between an answer and the next read
PAUSE = 0.001
GAP = 0.02
FAR = parameter('heat', 300, access=RO)
RAW = parameter('p600', 600, listed=False)
WRITABLE = (GAIN, DAMPING, FLAG, RAMP, MAXIMUM, ORDER, KEY, KEY, RAW)
#: in EEPROM, or nobody knows
EEPROMS = {30, 31, 44, 600}
RAMS = {40, 41, 42, 43}
SETPOINTS = (50, 51)
CONTROL_WORD, STATUS_WORD = 52, 211
REGISTERS = (30, 31, 40, 41, 42, 43, 44, 50, 51, 52, 209, 210, 211, 300, 600)


# -- the codec ------------------------------------------------------------------------------------

WORDS = st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=4)


@given(st.integers(0, 0x7FF), st.integers(0, 0xFFFF), st.integers(1, 4), st.integers(0, 0xFFFF),
       WORDS)
def test_telegrams(identifier: int, number: int, count: int, word: int, words: list[int]) -> None:
    written = standard.encode_write(identifier, number, word)
    assert written.data == bytes([6, number & 255, number >> 8, word & 255, word >> 8, 0, 0, 0])
    assert standard.decode_request(written) == WriteTelegram(number, (word,))
    if number + count <= 0x10000:
        asked = standard.encode_read_request(identifier, number, count)
        assert asked.data == bytes([3, number & 255, number >> 8, count, 0, 0, 0, 0])
        assert standard.decode_request(asked) == ReadTelegram(number, count)
    answer = standard.encode_read_response(identifier, words)
    assert (answer.identifier, len(answer.data), answer.extended) == (identifier, 8, False)
    for wanted in range(1, len(words) + 1):
        assert standard.decode_read_response(answer, wanted) == tuple(words[:wanted])


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.booleans(), st.integers(1, 4),
       st.booleans())
@example(0x3F1, bytes.fromhex('03FFFF0200000000'), False, 1, False)
@example(0x3F1, bytes.fromhex('03D1000000000000'), False, 1, False)
@example(0x7F1, bytes(2), False, 1, True)
def test_anything(identifier: int, data: bytes, is_extended: bool, count: int,
                  strict: bool) -> None:
    heard = Frame(identifier if is_extended else identifier & 0x7FF, data, is_extended)
    try:
        request = standard.decode_request(heard)
    except RemoteProtocolError as error:
        assert str(error)
    else:
        assert not is_extended
        assert len(data) == 8
        assert data[0] == (6 if isinstance(request, WriteTelegram) else 3)
        assert isinstance(request, WriteTelegram) or data[3] == request.count
    try:
        words = standard.decode_read_response(heard, count, strict=strict)
    except RemoteProtocolError as error:
        assert str(error)
        assert is_extended or len(data) < 2 * count or strict and len(data) != 8
    else:
        assert not is_extended
        assert [word % 256 for word in words] == list(data[0:2 * count:2])
        assert [word // 256 for word in words] == list(data[1:2 * count:2])


# -- the session ----------------------------------------------------------------------------------


class Asked(NamedTuple):
    """A read on the wire."""

    number: int
    count: int
    at: float


class StandardObserver(Observer):
    """Checks every frame that the session sends."""

    def __init__(self, *, period: float, timeout: float, immediate: bool, strict: bool,
                 controlled: bool) -> None:
        super().__init__(timeout=timeout, immediate=immediate)
        self.controlled = controlled
        self.period = period
        self.strict = strict
        self.quiet_until = -math.inf
        self.eeprom_at = -math.inf
        self.enabling = False
        #: what the words could have been before the call that is being looked at
        self.before: list[set[int]] = [{0}, {0}, {0}]

    def call_begins(self) -> None:
        """Keep what may be sent until this call finds out otherwise."""
        self.before = self.possible()

    def possible(self) -> list[set[int]]:
        """Return what may be in the setpoints, and in the control word."""
        words = [{raw & 0xFFFF} if armed else {0} for raw, armed in zip(self.raws, self.armed)]
        return [*words, {0, 1, 2, 0x80} if self.enabling else {0, 2, 0x80}]

    def disarm(self) -> None:
        super().disarm()
        self.enabling = False

    def doubt(self) -> None:
        """Wait for the event: until then, the drive is there."""

    def deactivated(self, session: Any) -> None:
        self.disarm()
        self.online = session.online  # until the event says otherwise
        self.before = self.possible()
        self.asked = None  # silence is kept all the same

    def time_was_lost(self, session: Any) -> None:
        self.disarm()
        self.online = session.online  # until the event says otherwise

    def commanded(self, index: int, raw: int, outcome: CommandOutcome, now: float) -> None:
        if outcome is CommandOutcome.DISABLED:
            assert self.controlled
            self.armed[index], self.raws[index] = False, 0
            return
        if outcome is CommandOutcome.NOT_ARMED:
            assert self.controlled or self.held() or not (
                self.online and self.active and self.immediate)
            if self.timeout and now - self.since[index] > self.timeout:
                self.armed[index] = False
            assert self.controlled or self.held() or not self.armed[index], (
                'a command in time has to count')
            self.armed[index] = False
            return
        assert self.online, 'only a drive that answers is armed'
        assert self.active
        if outcome is CommandOutcome.ACCEPTED:
            assert self.controlled or self.armed[index]
        else:
            assert self.immediate or abs(raw) <= 1, 'armed by something that is not neutral'
        self.armed[index], self.raws[index], self.since[index] = True, raw, now

    def sees(self, sent: Frame, now: float) -> None:
        assert self.bus, 'nothing is sent on a bus that is down'
        assert not sent.extended
        assert sent.identifier == 0x3F1
        data = sent.data
        assert len(data) == 8
        number = data[1] + 256 * data[2]
        if data[0] == 3:
            assert data[4:] == bytes(4)
            self.sees_read(number, data[3], now)
        else:
            assert data[0] == 6
            assert data[5:] == bytes(3)
            self.sees_write(number, data[3] + 256 * data[4], now)

    def sees_read(self, number: int, count: int, now: float) -> None:
        assert self.active or count == 1 and number in (
            *SETPOINTS, CONTROL_WORD, STATUS_WORD), 'after the stop'
        assert 1 <= count <= 4
        assert number + count <= 0x10000
        assert self.asked is None or now >= self.asked.at + TIMEOUT - SLACK, 'one read at a time'
        assert now >= self.quiet_until - SLACK, 'silence'
        assert now >= self.eeprom_at + GAP - SLACK, 'reads wait for the EEPROM'
        self.asked = Asked(number, count, now)
        self.quiet_until = now + TIMEOUT + QUARANTINE

    def sees_write(self, number: int, word: int, now: float) -> None:
        self.timer_ran(now)     # whoever sends something has looked at the time, too
        if number in SETPOINTS or number == CONTROL_WORD:
            index = (*SETPOINTS, CONTROL_WORD).index(number)
            if not self.online:
                assert word == 0, 'a drive that does not answer is stopped, and nothing else'
            self.tells(number, runs=word != 0)
            allowed = self.before[index] | self.possible()[index] | {0}
            assert word in allowed, f'{number} := {word}, possible {allowed}'
            if number != CONTROL_WORD and word and self.timeout:
                assert now - self.since[index] <= self.timeout + 2 * self.period + SLACK, 'stale'
            return
        assert self.active
        assert number in EEPROMS | RAMS
        if number in EEPROMS:
            assert now >= self.eeprom_at + GAP - SLACK, 'EEPROM writes are paced'
            self.eeprom_at = now

    def refused(self, sent: Frame, now: float) -> None:
        if sent.data[0] == 3:   # an answer is waited for all the same
            self.asked = Asked(sent.data[1] + 256 * sent.data[2], sent.data[3], now)
            self.quiet_until = now + TIMEOUT + QUARANTINE

    def timer_ran(self, now: float) -> None:
        """Record that the session had the chance to see a time-out."""
        if self.asked is not None and now >= self.asked.at + TIMEOUT:
            self.asked = None
            self.quiet_until = max(self.quiet_until, now + QUARANTINE)

    def hears(self, heard: Frame, now: float) -> None:
        """Keep the books before the session gets a frame."""
        if heard.extended or heard.identifier != 0x7F1:
            return
        if self.asked is None:
            self.quiet_until = max(self.quiet_until, now + QUARANTINE)
        elif len(heard.data) >= (8 if self.strict else 2 * self.asked.count):
            self.quiet_until = now + PAUSE
            self.asked = None


class SessionMachine(TwoSetpoints):
    """Everything that may happen to a session."""

    readable = (GAIN, DAMPING, FLAG, RAMP, MAXIMUM, STATUS, FAR, RAW)
    writable = WRITABLE
    stop_takes = 2.0
    bus_may_refuse = True
    settles = 20, 6
    silent = True

    @initialize(period=st.sampled_from([0.02, 0.02, 0.3]), timeout=st.sampled_from([0.0, 0.05]),
                immediate=st.booleans(), control=st.sampled_from(['', 'listed', 'by hand']),
                strict=st.booleans(), refresh=st.sampled_from([0.0, 0.05, 0.5]))
    def begin(self, period: float, timeout: float, immediate: bool, control: str, strict: bool,
              refresh: float) -> None:
        setpoints = (SPEED, LIMIT, WORD) if control == 'listed' else (SPEED, LIMIT)
        session = FAMILIES['datamodel_standard'].make_session(drive(
            'datamodel_standard', period=period, command_timeout=timeout,
            rearm_immediate=immediate, control=CONTROL if control else None,
            table=(SPEED, LIMIT, WORD, ACTUAL, CURRENT, STATUS, FAR, *WRITABLE[:-2]),
            request=setpoints, response=(ACTUAL, CURRENT, STATUS, FAR), parameter_timeout=TIMEOUT,
            quarantine=QUARANTINE, refresh_interval=refresh,
            length_policy='strict' if strict else 'lenient'))
        self.start(session, StandardObserver(
            period=period, timeout=timeout, immediate=immediate, strict=strict,
            controlled=bool(control)))
        self.registers = {**dict.fromkeys(REGISTERS, 0), 211: 1}
        self.device = StandardDrive(self.registers)
        self.samples = 0

    def happened(self, event: Any) -> None:
        observer = self.observer
        if isinstance(event, StationLost):
            assert observer.online, 'lost, but it was not there'
            observer.disarm()
            observer.online = False
        elif isinstance(event, StationFound):
            assert not observer.online
            assert observer.active
            assert observer.bus
            observer.online = True
        elif isinstance(event, ProcessDataReceived):
            assert self.session.active
            assert len(event.raws) == 4
            assert event.received_at <= self.now
            self.samples += 1

    def looked(self, sent: bool) -> None:
        self.observer.call_begins()

    def apply(self, sent: Frame) -> None:
        if sent.data[0] == 6:
            self.device.takes(sent)
        else:
            self.unanswered.append(sent)
            del self.unanswered[:-3]

    def timer(self) -> None:
        """Run the timer until there is nothing left to be done now."""
        for _ in range(20):
            stopped = self.session.stopped
            self.session.handle_timer(self.now)
            self.look(silent=stopped)
            self.observer.timer_ran(self.now)
            if self.session.next_timer() > self.now:
                return
        raise AssertionError('the timer spins')

    def time_is_lost(self) -> None:
        self.observer.timer_ran(self.now + 1.0)     # nobody listened: what was asked is given up
        super().time_is_lost()

    # -- the drive --------------------------------------------------------------------------------

    @precondition(lambda self: self.unanswered)
    @rule(choice=st.integers(0, 2), length=st.sampled_from([8, 7, 6, 2, 1]))
    def drive_answers(self, choice: int, length: int = 8) -> None:
        asked = self.unanswered.pop(min(choice, len(self.unanswered) - 1))
        for answer in self.device.takes(asked):
            self.hears(answer._replace(data=answer.data[:length]))

    def hears(self, heard: Frame) -> None:
        self.observer.hears(heard, self.now)
        self.session.receive_frame(heard, self.now)
        self.look()

    @rule(number=st.sampled_from([30, 40, 209, 211, 211, 211]),
          word=st.sampled_from([0, 1, 3, 8, 0xFFFF]))
    def drive_changes(self, number: int, word: int) -> None:
        self.registers[number] = word

    @rule(identifier=st.one_of(st.sampled_from([0x7F1, 0x7F1, 0x3F1, 0x7F2, 0x103FFFF0]),
                               st.integers(0, 0x1FFFFFFF)),
          data=st.one_of(st.binary(max_size=8), st.just(bytes(8))), is_extended=st.booleans())
    def anything_arrives(self, identifier: int, data: bytes, is_extended: bool) -> None:
        self.hears(Frame(identifier if is_extended else identifier & 0x7FF, data, is_extended))

    # -- users ------------------------------------------------------------------------------------

    @rule(index=st.integers(0, 1), value=st.sampled_from([5.0, 7.5]))
    def commander_falls_silent(self, index: int, value: float) -> None:
        self.command(index, 0.0)
        self.command(index, value)
        self.time_passes_in_time(40, True)

    def wanted(self, action: ControlAction) -> None:
        if action is ControlAction.ENABLE:
            self.observer.enabling = True

    @rule(bus=st.booleans(), steps=st.integers(0, 3))
    def restart(self, bus: bool, steps: int) -> None:
        """Begin anew while the last read may be unanswered."""
        self.time_passes_in_time(steps, False)
        if bus:
            self.bus_goes_down()
            self.bus_goes_up()
        else:
            self.deactivate()
            self.activate()
        self.time_passes_in_time(2, False)

    def deactivate(self) -> None:
        super().deactivate()
        assert not self.control_requests

    @invariant()
    def polling_goes_on(self) -> None:
        if self.session is None:
            return
        assert self.session.online == self.observer.online
        assert self.session.statistics.exchanges == self.samples
        if self.observer.active and self.observer.bus:
            assert self.session.next_timer() < math.inf

    def teardown(self) -> None:
        if self.session is not None:
            self.deactivate_to_the_end()


TestSession = SessionMachine.TestCase
TestSession.settings = SETTINGS
pytestmark = pytest.mark.timeout(PATIENCE)
