# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A session under anything that may happen, in any order, watched by somebody who only sees frames.

The observer knows the protocol's bytes and the contract, nothing of the session's inside.
"""

import math
from typing import Any

from any_order import AnyOrder, Observer, PATIENCE, SETTINGS, SLACK
from builders import drive
from cannord_session_builders import (
    ACCELERATION, ACCELERATION_2, ACTUAL, COUNTER, CURRENT, FAULT_NUMBER, FLAG, FOURTH, FREQUENCY,
    INPUTS, inverter, MONITORING, OFFSET, PARAMETERS, POSITION, SECOND, THIRD, VALUE_4,
)
from hypothesis import given, strategies as st
from hypothesis.stateful import initialize, precondition, rule
import pytest
from stops import MORE_CYCLES, STOP_CYCLES

from drive_can_bridge.core.control import ControlAction, ControlCompleted
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import (
    DriveState, ProcessDataReceived, RequestCompleted, StationFound, StationLost)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.requests import Failure, ReadRequest, ReadValue, Written
from drive_can_bridge.protocols.families import FAMILIES

TIMEOUT = 0.1
RAW = Parameter('p310', ParameterType.UINT32, 310, listed=False, width_known=False)
WRITES = (2, 3, 7, 8, 11, 12, 13, 14)
#: states that a drive may tell: ready, enabled, fault, disabled, quick stop, nonsense
STATUS = (0x0B31, 0x0F37, 0x0B38, 0x0B70, 0x0B17, 0x0B21, 0x0B3F)


class CannordObserver(Observer):
    """Checks every frame that the session sends."""

    def __init__(self, *, period: float, timeout: float, immediate: bool, extra: bool) -> None:
        super().__init__(timeout=timeout, immediate=immediate, control=True)
        self.period = period
        self.extra = extra
        self.last_cycles = 0
        self.cycled_at = -math.inf
        self.extra_due = False
        self.may_run = False
        self.word = 0x047E          # the last one that left
        self.main_left = True       # of this cycle
        self.written: set[bytes] = set()
        self.acknowledged: set[int] = set()

    def doubt(self) -> None:
        super().doubt()
        self.may_run = False

    def deactivated(self, session: Any) -> None:
        online = self.online
        self.doubt()
        self.online = online
        self.last_cycles = 0 if session.stopped else (
            STOP_CYCLES + MORE_CYCLES * session.duty.unacknowledged)
        self.asked = None

    def sees(self, sent: Frame, now: float) -> None:
        identifier, data, is_extended = sent
        assert not is_extended
        assert self.bus, 'nothing is sent on a bus that is down'
        if identifier == 0x202:
            self.sees_task(data, now)
            return
        assert identifier == 0x002
        if len(data) == 5:
            assert self.extra_due, 'the additional frame follows the main one'
            self.extra_due = False
            assert data == bytes(5)
            return
        assert not self.extra_due
        self.extra_due = self.extra
        self.main_left = True
        assert len(data) == 8
        words = [int.from_bytes(data[place:place + 2], 'little') for place in (0, 2, 4, 6)]
        assert words[0] in (0x047E, 0x047F, 0x047A, 0x04FE)
        stops = words in ([0x047E, 0, 0, 0], [0x047A, 0, 0, 0])
        spacing = 0.005 if stops else 0.5 * min(self.period, 0.1)
        assert now >= self.cycled_at + min(spacing, 0.5 * self.period) - SLACK, 'a burst'
        self.cycled_at = now
        if words[0] != 0x047F:
            self.disable()
        if words[0] != self.word:
            self.enabled = False
        self.word = words[0]
        assert words[1:] == [*self.expected(now), 0]
        self.tells('cycle', runs=words != [0x047E, 0, 0, 0])
        if words[0] == 0x047F:
            assert self.may_run, 'nothing but ~/enable starts a drive'
        if not self.active:
            assert self.last_cycles > 0, 'nothing after the stop'
            self.last_cycles -= 1
            assert words == [0x047E, 0, 0, 0]

    def refused(self, sent: Frame, now: float) -> None:
        if sent.identifier != 0x002:
            return
        if len(sent.data) == 5:
            assert self.extra_due
            self.extra_due = False
            if not self.active and self.main_left:
                self.last_cycles += 1      # half a cycle is none
        else:
            assert not self.extra_due
            self.extra_due = self.extra
            self.main_left = False

    def hears_status(self, word: int) -> None:
        if self.word == 0x047F and word & 0x7F == 0x37:
            self.enabled = True

    def sees_task(self, data: bytes, now: float) -> None:
        assert self.active
        assert len(data) == 8
        task = data[1] >> 4
        assert task in (1, 6, 9, *WRITES)
        if self.asked is not None:
            assert now >= self.asked[1] + TIMEOUT - SLACK, 'one task at a time'
        if task in WRITES:
            assert data not in self.written, 'a write is never repeated'
            self.written.add(data)
        self.asked = data, now

    def hears_response(self, data: bytes) -> bool:
        """
        Record a parameter response; tell whether it answers the last task.

        It does so even late: where time was lost, nobody has given the task up yet.
        """
        if self.asked is None or len(data) != 8:
            return False
        task, response = self.asked[0][1] >> 4, data[1] >> 4
        same = data[0] == self.asked[0][0] and data[1] & 0xF == self.asked[0][1] & 0xF
        index = data[2] == self.asked[0][2]
        answers = {1: (1, 2), 2: (1,), 3: (2,), 6: (4, 5), 7: (4,), 8: (5,), 9: (6,), 11: (5,),
                   12: (4,), 13: (2,), 14: (1,)}[task]
        if not same or not (response in answers and index or response == 7 and data[2] in (
                self.asked[0][2], 0)):
            return False
        if task in WRITES and response != 7:
            begin = 4 if response in (2, 5) else 6
            if data[begin:] != self.asked[0][begin:]:
                return False
            self.acknowledged.add(int.from_bytes(self.asked[0][6:], 'little'))
        self.asked = None
        return True


class SessionMachine(AnyOrder):
    """Everything that may happen to a session."""

    bus_may_refuse = True
    readable = (*PARAMETERS, RAW, ACTUAL, FREQUENCY)
    writable = (ACCELERATION, ACCELERATION_2, OFFSET, COUNTER, RAW, ACTUAL)

    @initialize(period=st.sampled_from([0.02, 0.005, 0.3]), timeout=st.sampled_from([0.0, 0.05]),
                immediate=st.booleans(), extra=st.booleans(), monitored=st.booleans(),
                persist=st.booleans())
    def begin(self, period: float, timeout: float, immediate: bool, extra: bool,
              monitored: bool, persist: bool) -> None:
        table = (FREQUENCY, SECOND, THIRD, FOURTH, ACTUAL, CURRENT, INPUTS, VALUE_4, *PARAMETERS)
        response = (ACTUAL, CURRENT, INPUTS, VALUE_4)
        session = FAMILIES['cannord'].make_session(drive(
            'cannord', period=period, command_timeout=timeout, rearm_immediate=immediate,
            request=(FREQUENCY, SECOND), response=response[:4 if extra else 3],
            table=(*table, MONITORING) if monitored else table, extra_setpoints=extra,
            persist_writes=persist))
        self.start(session, CannordObserver(
            period=period, timeout=timeout, immediate=immediate, extra=extra))
        self.status = 0x0B31
        self.obeys = False          # it enables and disables operation as it is told
        self.succeeded: list[ControlAction] = []
        self.next_value = 1
        self.heard: set[int] = set()

    def happened(self, event: Any) -> None:
        if isinstance(event, StationLost):
            self.observer.doubt()
        elif isinstance(event, StationFound):
            assert self.observer.active
            self.observer.online = True
        elif isinstance(event, ProcessDataReceived):
            assert self.observer.online
            assert set(event.raws[:1]) <= self.heard, 'no value that did not arrive'
            assert len(event.raws) <= 5

    def completed(self, event: RequestCompleted) -> None:
        request = event.request
        if isinstance(request, ReadRequest):
            assert all(isinstance(outcome, (Failure, ReadValue)) for outcome in event.outcomes)
            return
        for (parameter, raw), outcome in zip(request.items, event.outcomes):
            if isinstance(outcome, Written):
                assert parameter is not ACTUAL
                assert raw & 0xFFFF in self.observer.acknowledged, 'the drive acknowledged it'

    def apply(self, sent: Frame) -> None:
        self.unanswered.append(sent)
        del self.unanswered[:-4]

    def looked(self, sent: bool) -> None:
        assert not self.observer.extra_due

    # -- the drive --------------------------------------------------------------------------------

    @precondition(lambda self: self.unanswered)
    @rule(choice=st.integers(0, 3))
    def drive_answers(self, choice: int) -> None:
        asked = self.unanswered.pop(min(choice, len(self.unanswered) - 1))
        identifier, data, _ = asked
        if identifier == 0x002 and len(data) == 5:
            self.hears(Frame(0x003, b'\x01\x00\x02\x00\xA5', False))
        elif identifier == 0x002:
            if self.obeys:
                self.status = 0x0B37 if data[:2] == b'\x7f\x04' else 0x0B31
            self.hears(Frame(0x003, self.status.to_bytes(2, 'little') + data[2:], False))
        else:
            task = data[1] >> 4
            response = {1: 1, 2: 1, 3: 2, 6: 4, 7: 4, 8: 5, 9: 6, 11: 5, 12: 4, 13: 2, 14: 1}[task]
            if task in (1, 6) and data[0] in (0x65, 0xCA):
                response += 1
            self.hears(Frame(0x203, bytes((
                data[0], response << 4 | data[1] & 0xF, *data[2:])), False))

    @rule(status=st.sampled_from(STATUS))
    def drive_changes(self, status: int) -> None:
        self.obeys = False
        self.status = status

    def have_it_run(self) -> None:
        self.unanswered.clear()
        self.obeys = True
        self.time_passes_in_time(12, True)
        self.succeeded.clear()
        self.control(ControlAction.ENABLE)
        self.time_passes_in_time(12, True)
        if ControlAction.ENABLE not in self.succeeded or not self.observer.enabled:
            return      # a stop was under way, or an answer was late
        self.command(0, 0.0)
        assert self.observer.armed[0]
        self.command(0, 12.5)
        self.time_passes_in_time(3, True)
        assert self.observer.running or not self.observer.armed[0]

    @rule()
    def drive_faults(self) -> None:
        self.obeys = False
        self.status = 0x0B38
        self.hears(Frame(0x003, bytes.fromhex('380B000000000000'), False))

    @precondition(lambda self: self.observer.asked)
    @rule(number=st.integers(0, 300), refusal=st.booleans())
    def drive_answers_something_else(self, number: int, refusal: bool) -> None:
        data = self.observer.asked[0]
        kind = 7 if refusal else 1
        self.hears(Frame(0x203, bytes((
            data[0], kind << 4 | data[1] & 0xF, data[2], 0, 0, 0, number & 0xFF, number >> 8)),
            False))

    def hears(self, heard: Frame) -> None:
        if heard.identifier == 0x003 and not heard.extended and len(heard.data) in (4, 8):
            word = int.from_bytes(heard.data[:2], 'little')
            self.heard.add(word)
            self.observer.hears_status(word)
            if word & 8 and self.observer.online:
                self.observer.may_run = False
        if heard.identifier == 0x203 and not heard.extended:
            self.observer.hears_response(heard.data)
        self.session.receive_frame(heard, self.now)
        self.look()

    @rule(identifier=st.one_of(st.sampled_from([0x002, 0x003, 0x202, 0x203, 0x400]),
                               st.integers(0, 0x1FFFFFFF)),
          data=st.binary(max_size=8), is_extended=st.booleans())
    def anything_arrives(self, identifier: int, data: bytes, is_extended: bool) -> None:
        self.hears(Frame(identifier if is_extended else identifier & 0x7FF, data, is_extended))

    # -- users ------------------------------------------------------------------------------------

    @rule(index=st.integers(0, 1), value=st.sampled_from(
        [0.0, 0.003, 12.5, 25.0, 25, math.nan, 1e6, True]))
    def command(self, index: int, value: float) -> None:
        # the status in an answer that nobody asked for does not count
        self.observer.faulted = self.session.state is DriveState.FAULT
        try:
            outcome = self.session.services.command(index, value, self.now)
        except ValueRefused:
            assert not 0 <= value <= 25 or value is True
            return
        scale = (50 if index == 0 else 100) / 16384
        self.observer.expected(self.now)
        self.observer.commanded(index, math.floor(value / scale + 0.5), outcome, self.now)
        self.look()

    def raw_to_write(self, raw: int) -> int:
        self.next_value += 1    # each value is written once: so repetitions are seen
        return self.next_value & 0x7FFF

    def answered(self, outcome: ControlCompleted) -> None:
        if outcome.success:
            self.succeeded.append(outcome.request.action)

    def wanted(self, action: ControlAction) -> None:
        if action is ControlAction.ENABLE:
            self.observer.may_run = True
        elif action is not ControlAction.RESET_FAULT:
            self.observer.may_run = False

    def drive_is_well(self) -> None:
        self.fates.clear()
        self.status = 0x0B31
        super().drive_is_well()


TestSession = SessionMachine.TestCase
TestSession.settings = SETTINGS
pytestmark = pytest.mark.timeout(PATIENCE)


@given(frames=st.lists(st.tuples(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8),
                                 st.booleans()), max_size=20),
       state=st.sampled_from(['inactive', 'starting', 'online', 'asking', 'stopping']),
       extended=st.booleans(), broadcast=st.sampled_from(['none', 'group', 'all']))
def test_no_frame_ever_raises(frames: list[tuple[int, bytes, bool]], state: str, extended: bool,
                              broadcast: str) -> None:
    session = FAMILIES['cannord'].make_session(inverter(
        extended_identifiers=extended, broadcast=broadcast, extra_setpoints=True,
        response=(ACTUAL, CURRENT, INPUTS, VALUE_4)))
    shift = 18 if extended else 0
    session.bus_up(0.0)
    now = 1.0
    if state != 'inactive':
        session.activate(1.0)
    if state in ('online', 'asking', 'stopping'):
        session.handle_timer(1.0)
        session.receive_frame(
            Frame(3 << shift, bytes.fromhex('310B000000000000'), extended), 1.001)
        assert session.online
    if state == 'asking':
        session.services.submit(ReadRequest((OFFSET, POSITION, FLAG, FAULT_NUMBER)), 1.001)
    if state == 'stopping':
        session.deactivate(1.001)
    for place, (identifier, data, is_extended) in enumerate(frames):
        near = (identifier, 3 << shift, 0x203 << shift, 0x400 << shift)[place % 4]
        session.receive_frame(Frame(near, data, extended if place % 4 else is_extended), now)
        session.handle_timer(now)
        now += 0.001
