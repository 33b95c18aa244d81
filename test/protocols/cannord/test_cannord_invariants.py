# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A session under anything that may happen, in any order, watched by somebody who only sees frames.

The observer knows the protocol's bytes and the contract, nothing of the session's inside.
"""

import math

from builders import drive
from cannord_session_builders import (
    ACCELERATION, ACCELERATION_2, ACTUAL, COUNTER, CURRENT, FAULT_NUMBER, FLAG, FOURTH, FREQUENCY,
    INPUTS, inverter, MONITORING, OFFSET, PARAMETERS, POSITION, SECOND, THIRD, VALUE_4,
)
from hypothesis import given, settings, strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule, RuleBasedStateMachine
import pytest

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import (
    ProcessDataReceived, RequestCompleted, StationFound, StationLost,
)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.requests import (
    BUSY, Failure, ReadRequest, ReadValue, WriteRequest, Written,
)
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.families import FAMILIES

#: more than rounding errors, less than anything that matters
SLACK = 1e-7
TIMEOUT = 0.1
RAW = Parameter('p310', ParameterType.UINT32, 310, listed=False, width_known=False)
READABLE = (*PARAMETERS, RAW, ACTUAL, FREQUENCY)
WRITABLE = (ACCELERATION, ACCELERATION_2, OFFSET, COUNTER, RAW, ACTUAL)
WRITES = (2, 3, 7, 8, 11, 12, 13, 14)
#: states that a drive may tell: ready, enabled, fault, disabled, quick stop, nonsense
STATUS = (0x0B31, 0x0F37, 0x0B38, 0x0B70, 0x0B17, 0x0B21, 0x0B3F)


class Observer:
    """Checks every frame that the session sends."""

    def __init__(self, *, period: float, timeout: float, immediate: bool, extra: bool) -> None:
        self.period = period
        self.timeout = timeout
        self.immediate = immediate
        self.extra = extra
        self.active = False
        self.bus = False
        self.online = False
        self.farewell = 0
        self.cycled_at = -math.inf
        self.extra_due = False
        self.may_run = False
        self.asked: tuple[bytes, float] | None = None
        self.written: set[bytes] = set()
        self.acknowledged: set[int] = set()
        self.raws = [0, 0]
        self.since = [-math.inf, -math.inf]
        self.armed = [False, False]

    def doubt(self) -> None:
        """Start over: whatever was known counts no more."""
        self.online = False
        self.may_run = False
        self.armed = [False, False]
        self.raws = [0, 0]

    def commanded(self, index: int, raw: int, outcome: CommandOutcome, now: float) -> None:
        if not self.online or not self.active:
            assert outcome is CommandOutcome.NOT_ARMED
            return
        if not self.armed[index] and not self.immediate and abs(raw) > 1:
            assert outcome is CommandOutcome.NOT_ARMED
            return
        assert outcome is (CommandOutcome.ACCEPTED if self.armed[index] else CommandOutcome.ARMED)
        self.armed[index], self.raws[index], self.since[index] = True, raw, now

    def expected(self, now: float) -> list[int]:
        """Return the setpoints that a cycle has to carry now."""
        for index in range(2):
            if self.armed[index] and 0 < self.timeout < now - self.since[index]:
                self.armed[index], self.raws[index] = False, 0
        return [raw & 0xFFFF for raw in self.raws]

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
        assert len(data) == 8
        assert now >= self.cycled_at + 0.5 * min(self.period, 0.1) - SLACK, 'a burst'
        self.cycled_at = now
        words = [int.from_bytes(data[place:place + 2], 'little') for place in (0, 2, 4, 6)]
        assert words[1:] == [*self.expected(now), 0]
        assert words[0] in (0x047E, 0x047F, 0x047A, 0x04FE)
        if words[0] == 0x047F:
            assert self.may_run, 'nothing but ~/enable starts a drive'
        if not self.active:
            assert self.farewell > 0, 'nothing after the stop'
            self.farewell -= 1
            assert words == [0x047E, 0, 0, 0]

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
        Take note of a parameter response; tell whether it answers the last task.

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


class SessionMachine(RuleBasedStateMachine):
    """Everything that may happen to a session."""

    @initialize(period=st.sampled_from([0.02, 0.005, 0.3]), timeout=st.sampled_from([0.0, 0.05]),
                immediate=st.booleans(), extra=st.booleans(), monitored=st.booleans(),
                persist=st.booleans())
    def begin(self, period: float, timeout: float, immediate: bool, extra: bool,
              monitored: bool, persist: bool) -> None:
        table = (FREQUENCY, SECOND, THIRD, FOURTH, ACTUAL, CURRENT, INPUTS, VALUE_4, *PARAMETERS)
        response = (ACTUAL, CURRENT, INPUTS, VALUE_4)
        self.session = FAMILIES['cannord'].make_session(drive(
            'cannord', period=period, command_timeout=timeout, rearm_immediate=immediate,
            request=(FREQUENCY, SECOND), response=response[:4 if extra else 3],
            table=(*table, MONITORING) if monitored else table, extra_setpoints=extra,
            persist_writes=persist))
        self.observer = Observer(
            period=period, timeout=timeout, immediate=immediate, extra=extra)
        self.now = 1000.0
        self.open: list[ReadRequest | WriteRequest] = []
        self.tickets: list[object] = []
        self.status = 0x0B31
        self.next_value = 1
        self.unanswered: list[Frame] = []
        self.heard: set[int] = set()

    # -- looking ----------------------------------------------------------------------------------

    def look(self) -> None:
        """Fetch and check everything that the session gives out."""
        for event in self.session.take_events():
            if isinstance(event, StationLost):
                self.observer.doubt()
            elif isinstance(event, StationFound):
                assert self.observer.active
                self.observer.online = True
            elif isinstance(event, ProcessDataReceived):
                assert self.observer.online
                assert set(event.raws[:1]) <= self.heard, 'no value that did not arrive'
                assert len(event.raws) <= 5
            elif isinstance(event, RequestCompleted):
                assert event.request in self.open, 'one answer per request'
                self.open.remove(event.request)
                self.check_outcomes(event)
        for outcome in self.session.take_control_outcomes():
            assert outcome.ticket in self.tickets, 'one answer per control request'
            self.tickets.remove(outcome.ticket)
        for sent in self.session.take_frames():
            self.observer.sees(sent, self.now)
            self.unanswered.append(sent)
            del self.unanswered[:-4]
        assert not self.observer.extra_due

    def check_outcomes(self, event: RequestCompleted) -> None:
        request = event.request
        assert len(event.outcomes) == len(request)
        if isinstance(request, ReadRequest):
            assert all(isinstance(outcome, (Failure, ReadValue)) for outcome in event.outcomes)
            return
        for (parameter, raw), outcome in zip(request.items, event.outcomes):
            if isinstance(outcome, Written):
                assert parameter is not ACTUAL
                assert raw & 0xFFFF in self.observer.acknowledged, 'the drive acknowledged it'

    # -- the passage of time ----------------------------------------------------------------------

    @rule(steps=st.integers(1, 30))
    def time_passes_well(self, steps: int) -> None:
        self.time_passes_in_time(steps, True)

    @rule(steps=st.integers(1, 12), answering=st.booleans())
    def time_passes_in_time(self, steps: int, answering: bool) -> None:
        for _ in range(steps):
            due = self.session.next_timer()
            if due > self.now + 2.0:
                self.now += 0.01
                return
            self.now = max(self.now, due)
            self.session.handle_timer(self.now)
            self.look()
            while answering and self.unanswered:
                self.now += 0.0002
                self.drive_answers(0)

    @rule(pause=st.sampled_from([0.0, 0.0001, 0.003, 0.017, 0.06, 0.4, 0.99]))
    def time_passes_late(self, pause: float) -> None:
        self.now += pause
        self.session.handle_timer(self.now)
        self.look()

    # -- the drive --------------------------------------------------------------------------------

    @precondition(lambda self: self.unanswered)
    @rule(choice=st.integers(0, 3))
    def drive_answers(self, choice: int) -> None:
        asked = self.unanswered.pop(min(choice, len(self.unanswered) - 1))
        identifier, data, _ = asked
        if identifier == 0x002 and len(data) == 5:
            self.hears(Frame(0x003, b'\x01\x00\x02\x00\xA5', False))
        elif identifier == 0x002:
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
        self.status = status

    @rule()
    def drive_faults(self) -> None:
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
        try:
            outcome = self.session.command(index, value, self.now)
        except ValueRefused:
            assert not 0 <= value <= 25 or value is True
            return
        scale = (50 if index == 0 else 100) / 16384
        self.observer.expected(self.now)
        self.observer.commanded(index, math.floor(value / scale + 0.5), outcome, self.now)
        self.look()

    @rule(parameters=st.lists(st.sampled_from(READABLE), max_size=5), times=st.integers(1, 80))
    def users_read(self, parameters: list[Parameter], times: int) -> None:
        for _ in range(times):
            self.submit(ReadRequest(tuple(parameters)))

    @rule(parameters=st.lists(st.sampled_from(WRITABLE), max_size=3), atomic=st.booleans())
    def users_write(self, parameters: list[Parameter], atomic: bool) -> None:
        items = []
        for parameter in parameters:
            self.next_value += 1    # each value is written once: so repetitions are seen
            items.append((parameter, self.next_value & 0x7FFF))
        self.submit(WriteRequest(tuple(items), atomic))

    def submit(self, request: ReadRequest | WriteRequest) -> None:
        waiting = len(self.open)
        self.open.append(request)
        self.session.submit(request, self.now)
        refused = any(
            isinstance(event, RequestCompleted) and event.request is request
            and Failure(BUSY) in event.outcomes for event in self.session._events)
        if refused:
            assert self.observer.active
            assert self.observer.bus
            assert waiting in (64, 65)
        self.look()
        assert len(self.open) <= 65

    @rule(action=st.sampled_from(ControlAction))
    def control(self, action: ControlAction) -> None:
        ticket = self.session.request_control(action, self.now)
        if isinstance(ticket, str):
            assert ticket
        else:
            assert self.observer.active
            self.tickets.append(ticket)
            if action is ControlAction.ENABLE:
                self.observer.may_run = True
            elif action is not ControlAction.RESET_FAULT:
                self.observer.may_run = False
        self.look()

    # -- the life of a session --------------------------------------------------------------------

    @rule(kind=st.integers(0, 5))
    def upset(self, kind: int) -> None:
        (self.bus_goes_up, self.bus_goes_down, self.activate, self.deactivate,
         self.deactivate_to_the_end, self.time_is_lost)[kind]()

    @precondition(lambda self: not self.session.online)
    @rule()
    def all_is_well(self) -> None:
        """Bring the drive online."""
        self.status = 0x0B31
        if not self.observer.bus:
            self.bus_goes_up()
        if not self.observer.active:
            self.activate()
        for _ in range(3):
            self.time_passes_in_time(8, True)

    def time_is_lost(self) -> None:
        self.now += 1.0
        self.session.time_lost(self.now)
        self.look()

    def bus_goes_up(self) -> None:
        self.observer.bus = True
        if self.observer.active:
            self.observer.doubt()
        self.session.bus_up(self.now)
        self.look()

    def bus_goes_down(self) -> None:
        self.observer.doubt()
        self.session.bus_down(self.now, 'unplugged')
        self.observer.asked = None
        self.observer.bus = False
        self.look()
        assert not self.open
        assert self.session.next_timer() == math.inf

    def activate(self) -> None:
        self.observer.active = True
        self.observer.doubt()
        self.session.activate(self.now)
        self.look()

    def deactivate(self) -> None:
        self.observer.active = False
        online = self.observer.online
        self.observer.doubt()
        self.observer.online = online
        self.observer.farewell = 0 if self.session.stopped else 3
        self.observer.asked = None
        self.session.deactivate(self.now)
        self.look()
        assert not self.open

    def deactivate_to_the_end(self) -> None:
        self.deactivate()
        end = self.now + 1.0
        while self.session.next_timer() <= end:
            self.now = max(self.now, self.session.next_timer())
            self.session.handle_timer(self.now)
            self.look()
        assert self.session.stopped
        assert self.session.next_timer() == math.inf
        assert not self.tickets
        assert not self.session.online

    # -- always -----------------------------------------------------------------------------------

    @invariant()
    def counts_are_right(self) -> None:
        if not hasattr(self, 'session'):
            return
        assert self.session._waiting_requests() <= 64
        assert self.session.online == self.observer.online or not self.observer.active
        if not self.observer.bus:
            assert not self.session.online
            assert self.session.stopped
        assert not self.session.take_frames()
        if not self.session.online:
            assert not any(item.armed for item in self.session.setpoints.items)


TestSession = SessionMachine.TestCase
TestSession.settings = settings(max_examples=150, stateful_step_count=50, deadline=None)
pytestmark = pytest.mark.timeout(600)


@settings(deadline=None)
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
        session.submit(ReadRequest((OFFSET, POSITION, FLAG, FAULT_NUMBER)), 1.001)
    if state == 'stopping':
        session.deactivate(1.001)
    for place, (identifier, data, is_extended) in enumerate(frames):
        near = (identifier, 3 << shift, 0x203 << shift, 0x400 << shift)[place % 4]
        session.receive_frame(Frame(near, data, extended if place % 4 else is_extended), now)
        session.handle_timer(now)
        now += 0.001
