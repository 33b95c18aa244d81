# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A session under anything that may happen, in any order, watched by somebody who only sees frames.

The observer knows the protocol's bytes and the contract, nothing of the session's inside. It keeps
its own books: which maps were read, which commands went through, when an EEPROM was last written.
"""

from collections.abc import Callable
import math

from builders import (
    CONTROL, DAMPING, drive, FLAG, frame, GAIN, LIMIT, MAXIMUM, ORDER, parameter, RAMP, SPEED,
    STATUS, WORD,
)
from hypothesis import given, settings, strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule, RuleBasedStateMachine
import pytest

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import RequestCompleted, StationFound, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.requests import BUSY, Failure, ReadRequest, WriteRequest
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.families import FAMILIES

#: more than rounding errors, less than anything that matters
SLACK = 1e-7
CYCLIC = 0x003FFFF0
RAW = parameter('p600', 600, listed=False)
READABLE = (GAIN, DAMPING, FLAG, RAMP, MAXIMUM, STATUS, RAW)
WRITABLE = (GAIN, DAMPING, FLAG, RAMP, MAXIMUM, ORDER, RAW)
EEPROMS = {30, 31, 44, 600, *range(122, 130)}


class Observer:
    """Checks every frame that the session sends."""

    def __init__(self, *, mapping: str, period: float, timeout: float, immediate: bool) -> None:
        self.mapping = mapping
        self.period = period
        self.timeout = timeout
        self.immediate = immediate
        self.active = False
        self.bus = False
        self.online = False
        self.verified = False
        self.request_map_read = False
        self.farewell = 0          # neutral cycles that may still be sent without a verified map
        self.cycled_at = -math.inf
        self.eeprom_at = -math.inf
        self.asked: tuple[int, int, float] | None = None
        self.raws = [0, 0]
        self.since = [-math.inf, -math.inf]
        self.armed = [False, False]
        self.cycles = 0

    def doubt(self) -> None:
        """Start over: whatever was known counts no more."""
        self.verified = self.request_map_read = False
        self.farewell = 0
        self.disarm()

    def disarm(self) -> None:
        self.online = False
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
        """Return the words that a cyclic request has to carry now."""
        for index in range(2):
            if self.armed[index] and 0 < self.timeout < now - self.since[index]:
                self.armed[index], self.raws[index] = False, 0
        return [raw & 0xFFFF for raw in self.raws]

    def sees(self, sent: Frame, now: float) -> None:
        identifier, data, is_extended = sent
        assert is_extended
        assert len(data) == 8
        assert identifier >> 21 == 1, 'a request to station 1'
        assert self.bus, 'nothing is sent on a bus that is down'
        if identifier == CYCLIC:
            self.sees_cycle(data, now)
            return
        number, count = identifier >> 4 & 0xFFFF, identifier & 0xF
        assert 1 <= count <= 4
        if identifier & 0x100000:
            self.sees_write(number, count, data, now)
        else:
            assert self.active
            assert data == bytes(8)
            assert now >= self.eeprom_at + 0.02 - SLACK, 'reads wait for the EEPROM'
            if self.asked is not None:
                assert now >= self.asked[2] + 0.1 - SLACK, 'one read at a time'
            self.asked = number, count, now

    def sees_cycle(self, data: bytes, now: float) -> None:
        self.cycles += 1
        assert now >= self.cycled_at + 0.5 * min(self.period, 0.1) - SLACK, 'a burst'
        self.cycled_at = now
        if not self.active:
            assert self.farewell > 0, 'nothing cyclic after the stop'
            self.farewell -= 1
        elif self.mapping != 'assume' and not self.verified:
            assert self.farewell > 0, 'no cyclic frame before the maps were read'
            self.farewell -= 1
        words = [int.from_bytes(data[place:place + 2], 'big') for place in (0, 2)]
        assert words == self.expected(now)
        assert data[4:] == bytes(4)

    def sees_write(self, number: int, count: int, data: bytes, now: float) -> None:
        numbers = set(range(number, number + count))
        assert not numbers & {50, 51}, 'setpoints are never written'
        if numbers & set(range(122, 130)):
            assert self.mapping == 'configure'
            assert count == 1
            assert now > self.cycled_at
            assert not self.verified, 'maps are not touched while cycling'
        if number == 52:
            assert count == 1
            if not self.active:
                assert data == bytes(8), 'only disable goes with a stop'
        else:
            assert self.active
        if numbers & EEPROMS:
            assert now >= self.eeprom_at + 0.02 - SLACK, 'EEPROM writes are paced'
            self.eeprom_at = now
            assert count == 1


class SessionMachine(RuleBasedStateMachine):
    """Everything that may happen to a session."""

    @initialize(mapping=st.sampled_from(['verify', 'configure', 'assume']),
                period=st.sampled_from([0.02, 0.005, 0.3]),
                timeout=st.sampled_from([0.0, 0.05]), immediate=st.booleans(),
                control=st.booleans(), strict=st.booleans())
    def begin(self, mapping: str, period: float, timeout: float, immediate: bool,
              control: bool, strict: bool) -> None:
        table = (SPEED, LIMIT, STATUS, WORD, *WRITABLE)
        self.session = FAMILIES['datamodel_extended'].make_session(drive(
            mapping=mapping, period=period, command_timeout=timeout, rearm_immediate=immediate,
            control=CONTROL if control else None, table=table, response=(STATUS,),
            length_policy='strict' if strict else 'lenient'))
        self.observer = Observer(
            mapping=mapping, period=period, timeout=timeout, immediate=immediate)
        self.now = 1000.0
        self.open: list[ReadRequest | WriteRequest] = []
        self.tickets: list[object] = []
        self.registers = dict.fromkeys((30, 31, 40, 41, 42, 43, 44, 52, 211, 600), 0)
        self.registers.update(zip(range(122, 130), (50, 51, 0, 0, 211, 0, 0, 0)))
        self.registers[211] = 1
        self.unanswered: list[Frame] = []

    # -- looking ----------------------------------------------------------------------------------

    def look(self) -> None:
        """Fetch and check everything that the session gives out."""
        for event in self.session.take_events():
            if isinstance(event, StationLost):
                self.observer.disarm()
                if 'no cyclic response' in event.reason and self.observer.mapping != 'assume':
                    self.observer.verified = self.observer.request_map_read = False
                    self.observer.farewell = 3
            elif isinstance(event, StationFound):
                self.observer.online = True
            elif isinstance(event, RequestCompleted):
                assert event.request in self.open, 'one answer per request'
                self.open.remove(event.request)
                assert len(event.outcomes) == len(event.request)
        for outcome in self.session.take_control_outcomes():
            assert outcome.ticket in self.tickets, 'one answer per control request'
            self.tickets.remove(outcome.ticket)
        for sent in self.session.take_frames():
            self.observer.sees(sent, self.now)
            self.apply(sent)

    def apply(self, sent: Frame) -> None:
        """Do what a drive does with a frame; its answers wait until somebody hands them over."""
        identifier, data, _ = sent
        number, count = identifier >> 4 & 0xFFFF, identifier & 0xF
        if identifier != CYCLIC and identifier & 0x100000:
            for place in range(count):
                self.registers[number + place] = int.from_bytes(
                    data[2 * place:2 * place + 2], 'big')
        else:
            self.unanswered.append(sent)
            del self.unanswered[:-3]

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

    def time_is_lost(self) -> None:
        self.now += 1.0
        stopping = not self.observer.active
        if not stopping:
            self.observer.doubt()
        self.session.time_lost(self.now)
        self.look()

    # -- the drive --------------------------------------------------------------------------------

    @precondition(lambda self: self.unanswered)
    @rule(choice=st.integers(0, 2))
    def drive_answers(self, choice: int) -> None:
        asked = self.unanswered.pop(min(choice, len(self.unanswered) - 1))
        identifier = asked.identifier
        number, count = identifier >> 4 & 0xFFFF, identifier & 0xF
        if identifier == CYCLIC:
            words = [self.registers[211]]
        elif any(number + place not in self.registers for place in range(count)):
            return
        else:
            words = [self.registers[number + place] for place in range(count)]
        data = b''.join(word.to_bytes(2, 'big') for word in words)
        self.hears(Frame(identifier | 0x10000000, data.ljust(8, b'\xA5'), True))

    def hears(self, heard: Frame) -> None:
        self.keep_books(heard)
        self.session.receive_frame(heard, self.now)
        self.look()

    def keep_books(self, heard: Frame) -> None:
        """Note what the observer may learn of the maps from an answer."""
        observer, asked = self.observer, self.observer.asked
        identifier, data, is_extended = heard
        strict = self.session.drive.family_options['length_policy'] == 'strict'
        if (asked is None or not is_extended or not observer.active or not observer.bus
                or identifier != (0x10200000 | asked[0] << 4 | asked[1])
                or len(data) < (8 if strict else 2 * asked[1])
                or self.now >= asked[2] + 0.1 + SLACK):
            return
        observer.asked = None
        if asked[1] != 4 or asked[0] not in (122, 126):
            return
        words = [int.from_bytes(data[place:place + 2], 'big') for place in (0, 2, 4, 6)]
        if asked[0] == 122:
            observer.request_map_read = words[:2] == [50, 51] and words[2] == 0
            if not observer.request_map_read:
                observer.verified = False
        else:
            observer.verified = observer.request_map_read and words[0] == 211

    @rule(number=st.sampled_from([122, 123, 124, 126, 127, 211, 211, 211, 211]),
          word=st.sampled_from([0, 1, 3, 8, 50, 51, 211]))
    def drive_changes(self, number: int, word: int) -> None:
        self.registers[number] = word

    def map_is_repaired(self) -> None:
        self.registers.update(zip(range(122, 130), (50, 51, 0, 0, 211, 0, 0, 0)))

    @rule(identifier=st.one_of(
        st.sampled_from([0x103FFFF0, 0x102007A4, 0x102007E4, 0x10200281, 0x003FFFF0, 0x105FFFF0]),
        st.integers(0, 0x1FFFFFFF)), data=st.binary(max_size=8), is_extended=st.booleans())
    def anything_arrives(self, identifier: int, data: bytes, is_extended: bool) -> None:
        self.hears(Frame(identifier if is_extended else identifier & 0x7FF, data, is_extended))

    # -- users ------------------------------------------------------------------------------------

    @rule(index=st.integers(0, 1), value=st.sampled_from([0.0, 5.0, 7.5]))
    def good_command(self, index: int, value: float) -> None:
        self.command(index, value)
        self.time_passes_in_time(4, True)

    @rule(index=st.integers(0, 1), value=st.sampled_from([0.0, 0.1, 5.0, 5, math.nan, 1e6, True]))
    def command(self, index: int, value: float) -> None:
        try:
            outcome = self.session.command(index, value, self.now)
        except ValueRefused:
            assert not 0 <= value <= 5 or value is True
            return
        self.observer.expected(self.now)
        self.observer.commanded(index, round(10 * value), outcome, self.now)
        self.look()

    @rule(parameters=st.lists(st.sampled_from(READABLE), max_size=5), times=st.integers(1, 80))
    def users_read(self, parameters: list[object], times: int) -> None:
        for _ in range(times):
            self.submit(ReadRequest(tuple(parameters)))

    @rule(items=st.lists(st.tuples(st.sampled_from(WRITABLE), st.integers(0, 1)), max_size=3),
          atomic=st.booleans())
    def users_write(self, items: list[tuple[object, int]], atomic: bool) -> None:
        self.submit(WriteRequest(tuple(items), atomic))

    def submit(self, request: ReadRequest | WriteRequest) -> None:
        waiting = len(self.open)
        self.open.append(request)
        self.session.submit(request, self.now)
        refused = any(
            isinstance(event, RequestCompleted) and event.request is request
            and Failure(BUSY) in event.outcomes for event in self.session._events)
        possible = self.observer.active and self.observer.bus and len(request) > 0
        if refused or possible and waiting == 65:   # 64 wait; one more may be under way
            assert refused and possible and waiting in (64, 65)
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
        self.map_is_repaired()
        if not self.observer.bus:
            self.bus_goes_up()
        if not self.observer.active:
            self.activate()
        for _ in range(3):
            self.time_passes_in_time(8, True)

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
        self.observer.disarm()
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


@given(frames=st.lists(st.tuples(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8),
                                 st.booleans()), max_size=20),
       state=st.sampled_from(['inactive', 'checking', 'cycling']))
def test_no_frame_ever_raises(frames: list[tuple[int, bytes, bool]], state: str) -> None:
    session = FAMILIES['datamodel_extended'].make_session(drive(control=CONTROL))
    session.bus_up(0.0)
    if state != 'inactive':
        session.activate(1.0)
    if state == 'cycling':
        session.receive_frame(frame('102007A4#0032003300000000'), 1.001)
        session.receive_frame(frame('102007E4#00D100D200D30000'), 1.002)
        session.handle_timer(1.002)
    now = 1.002
    near: list[Callable[[int], int]] = [
        lambda value: value, lambda value: 0x10200000 | value & 0x1FFFFF,
        lambda value: 0x103FFFF0 | value & 0xF, lambda value: 0x102007A4]
    for place, (identifier, data, is_extended) in enumerate(frames):
        session.receive_frame(Frame(near[place % 4](identifier), data, is_extended), now)
        session.handle_timer(now)
        now += 0.001
