# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A session under anything that may happen, in any order, watched by somebody who only sees frames.

The observer knows the protocol's bytes and the contract, nothing of the session's inside. The
device keeps to the mailbox rule to the letter: a request with an unchanged function byte starts
nothing.
"""

import math
from typing import Any

from any_order import AnyOrder, Observer, PATIENCE, SETTINGS
from builders import frame, read
from drives import PkwNode
from hypothesis import given, strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule
from pkw_builders import (
    CLASS, configuration, CONTROL, CURRENT, FLC, FLC_2, KEY, LEVEL, POSITION, SPEED, STATUS,
    STATUS_2, TORQUE,
)
import pytest

from drive_can_bridge.core.control import ControlAction, ControlCompleted
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import DriveState, RequestCompleted, StationFound, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.requests import WriteRequest, Written
from drive_can_bridge.protocols.families import FAMILIES

FAMILY = FAMILIES['canopen_pkw']
TIMEOUT = 0.1
READS = {0x25, 0x26}
WRITES = {0x2A, 0x2B}
SETPOINTS = {710: 0, 712: 1}
WORD = 704
REGISTERS = (456, 465, 500, 501, 606, 652, 653, 704, 710, 712, 720, 721, 730)
#: numbers of what makes it stand still, as bytes
STOPS = (b'\xC0\x02', b'\xC6\x02', b'\xC8\x02')


class Device(PkwNode):
    """Node 5."""

    obeys = False       # it runs and stands still as register 704 says

    def written(self, number: int, words: tuple[int, ...]) -> None:
        super().written(number, words)
        if number == WORD and self.obeys:
            self.registers[455] = 0x81 if words == (1,) else 0x01


class PkwObserver(Observer):
    """Checks every frame that the session sends."""

    def __init__(self, *, nmt_start: bool, control: bool) -> None:
        super().__init__(control=control)
        self.nmt_start = nmt_start
        self.word = 0       # the last one that left
        self.stopping = False
        self.blocked_until = -math.inf      # a heartbeat has said: not operational
        self.toggle: int | None = None
        self.idled = False      # the last request was function 00h

    def bus_went_up(self) -> None:
        self.disarm()

    def bus_went_down(self) -> None:
        self.asked = None
        self.stopping = False
        self.blocked_until = -math.inf

    def activated(self) -> None:
        self.stopping = False
        self.asked = None
        self.disarm()

    def deactivated(self, session: Any) -> None:
        self.stopping = True
        self.disarm()

    def time_was_lost(self, session: Any) -> None:
        if self.active:
            self.disarm()

    def sees(self, sent: Frame, now: float) -> None:
        identifier, data, extended = sent
        assert not extended
        assert self.bus, 'nothing is sent on a bus that is down'
        if identifier == 0:
            assert data == b'\x01\x05', 'NMT start to this node, nothing else ever'
            assert self.nmt_start
            assert self.active
            return
        assert identifier == 0x505
        assert len(data) == 8
        assert self.active or self.stopping, 'silence after the stop'
        code, toggle = data[3] & 0x7F, data[3] >> 7
        stops = code == 0x2A and data[:2] in STOPS and data[4:6] == bytes(2)
        assert stops or now >= self.blocked_until - 1e-9, (
            'nothing but a stop to a node that is not operational')
        assert data[2] == 0
        if self.asked is not None:
            wait = TIMEOUT if self.asked[0][3] & 0x7F else min(TIMEOUT, 0.1)
            wait = min(wait, 0.02 if stops else 0.04)   # a stop that the bus took late
            assert now >= self.asked[1] + wait - 1e-7, 'one request at a time'
        free = self.idled and self.asked is None and code in WRITES     # 00h was answered
        self.asked, self.idled = (data, now), code == 0
        if code == 0:
            assert data == bytes(8)
            return
        assert code in READS | WRITES
        if self.toggle is not None and not free:
            assert toggle != self.toggle, 'the toggle alternates'
        self.toggle = toggle
        if code in READS:
            assert data[4:] == bytes(4)
            assert self.active or (code, data[0] | data[1] << 8) == (0x25, STATUS.number)
            return
        number = data[0] | data[1] << 8
        word = data[4] | data[5] << 8
        if code == 0x2A:
            assert data[6:] == bytes(2)
        if number == WORD:
            assert code == 0x2A
            assert word in (0, 1, 8)
            self.word = word
            self.enabled = word == 1
            self.tells('word', runs=word != 0)
            if not self.online:
                assert word == 0, 'only disable to a drive that is not online'
        elif number in SETPOINTS:
            index = SETPOINTS[number]
            meant = self.raws[index] if self.armed[index] else 0
            if not self.control:
                assert word == meant
            else:   # neutral goes out when another word is chosen, before anybody can see that
                assert word in (meant, 0)
                assert word == 0 or self.word == 1, 'only while it is enabled'
            self.tells(index, runs=word != 0)
        else:
            assert self.active, 'nothing but what makes it stand still'


class SessionMachine(AnyOrder):
    """Everything that may happen to a session."""

    bus_may_refuse = True
    readable = (STATUS, LEVEL, CURRENT, FLC, FLC_2, CLASS, POSITION)
    writable = (FLC, FLC_2, CLASS, POSITION)
    stop_takes = 3.01

    @initialize(period=st.sampled_from([0.02, 0.3]), nmt_start=st.booleans(),
                control=st.booleans(), refresh=st.sampled_from([0.0, 0.05]),
                heartbeat_timeout=st.sampled_from([0.0, 0.5]))
    def begin(self, period: float, nmt_start: bool, control: bool, refresh: float,
              heartbeat_timeout: float) -> None:
        session = FAMILY.make_session(configuration(
            period=period, nmt_start=nmt_start, control=CONTROL if control else None,
            request=(SPEED, TORQUE), response=(STATUS, STATUS_2, LEVEL), command_timeout=0.0,
            refresh_interval=refresh, heartbeat_timeout=heartbeat_timeout,
            parameter_timeout=TIMEOUT))
        self.start(session, PkwObserver(nmt_start=nmt_start, control=control))
        self.succeeded: list[ControlAction] = []
        self.device = Device(5, {**dict.fromkeys(REGISTERS, 0), 455: 1})
        self.device.operational = not nmt_start
        self.key_values = 0
        self.lossy = False

    def happened(self, event: Any) -> None:
        if isinstance(event, StationLost):
            assert event.reason
            self.observer.disarm()
        elif isinstance(event, StationFound):
            assert not self.observer.online
            self.observer.online = True

    def completed(self, event: RequestCompleted) -> None:
        """Look for a write that was executed twice, or never although it was confirmed."""
        request = event.request
        if not isinstance(request, WriteRequest):
            return
        for (parameter, raw), outcome in zip(request.items, event.outcomes):
            if parameter is KEY:
                times = self.device.executed.count((730, (raw,)))
                assert times <= 1, 'a write is never executed twice'
                if isinstance(outcome, Written):
                    assert times == 1

    def apply(self, sent: Frame) -> None:
        if not self.lossy:
            self.unanswered += self.device.takes(sent)
        del self.unanswered[:-3]

    # -- frames that get lost ---------------------------------------------------------------------

    @rule(steps=st.integers(1, 4))
    def requests_get_lost(self, steps: int) -> None:
        self.lossy = True
        self.time_passes_in_time(steps, True)
        self.lossy = False

    @precondition(lambda self: self.session.online)
    @rule(index=st.integers(0, 1), raw=st.sampled_from([0, 1, 5]),
          action=st.sampled_from(ControlAction), steps=st.integers(1, 4),
          executed=st.booleans())
    def wishes_change_while_frames_get_lost(self, index: int, raw: int, action: ControlAction,
                                            steps: int, executed: bool) -> None:
        """Either the requests do not arrive, or their answers."""
        self.command(index, 0)
        self.time_passes_in_time(4, True)
        self.lossy = not executed
        self.control(action)
        self.command(index, raw)
        self.time_passes_in_time(steps, False)
        self.lossy = False
        self.unanswered.clear()
        self.device_ends_up_as_told()

    # -- the device -------------------------------------------------------------------------------

    @precondition(lambda self: self.unanswered)
    @rule(choice=st.integers(0, 2))
    def drive_answers(self, choice: int) -> None:
        answer = self.unanswered.pop(min(choice, len(self.unanswered) - 1))
        if self.observer.bus:
            asked = self.observer.asked
            if asked is not None and (
                    answer.data[3] & 0x7F == 0 == asked[0][3] & 0x7F
                    or answer.data[:3] == asked[0][:3]
                    and not (answer.data[3] ^ asked[0][3]) & 0x80):
                self.observer.asked = None
            self.hears(answer)

    @rule(number=st.sampled_from([455, 465, 652]), word=st.sampled_from([0, 1, 0x81, 4]))
    def device_changes(self, number: int, word: int) -> None:
        self.device.obeys = False
        self.device.registers[number] = word

    def have_it_run(self) -> None:
        self.device.operational = self.device.obeys = True
        self.device.registers[455] = 0x81 if self.device.registers[WORD] == 1 else 0x01
        if self.session.control is not None:
            self.time_passes_in_time(8, True)
            self.succeeded.clear()
            self.control(ControlAction.ENABLE)
            self.time_passes_in_time(12, True)
            if ControlAction.ENABLE not in self.succeeded:
                return      # a stop was under way, or an answer was late
        self.command(0, 0)
        self.command(0, 5)
        self.time_passes_in_time(8, True)

    @precondition(lambda self: self.observer.bus)
    @rule()
    def device_restarts(self) -> None:
        self.device.restarts()
        self.unanswered.clear()
        self.observer.asked = None
        self.disarm_before(Frame(0x705, b'\x00', False))

    @rule()
    def device_restarts_unheard(self) -> None:
        self.device.restarts()
        self.unanswered.clear()

    @precondition(lambda self: self.observer.bus)
    @rule(state=st.sampled_from([0x04, 0x05, 0x05, 0x7F]))
    def heartbeat(self, state: int) -> None:
        self.device.operational = state == 5
        self.observer.blocked_until = -math.inf if state == 5 else self.now + 0.99
        if state != 5:
            self.observer.asked = None
            self.disarm_before(Frame(0x705, bytes((state,)), False))
        else:
            self.hears(Frame(0x705, bytes((state,)), False))

    def disarm_before(self, heard: Frame) -> None:
        """Hear something that makes the drive offline, before anything else is sent."""
        self.session.receive_frame(heard, self.now)
        self.look()
        assert not self.session.online or not self.observer.active

    @precondition(lambda self: self.observer.bus)
    @rule(code=st.sampled_from([0, 0x2310, 0x8130]))
    def emergency(self, code: int) -> None:
        self.hears(Frame(0x085, code.to_bytes(2, 'little') + bytes(6), False))
        assert bool(self.session.warning.count('emergency')) == bool(code)

    def hears(self, heard: Frame) -> None:
        self.session.receive_frame(heard, self.now)
        self.look()

    @precondition(lambda self: self.observer.bus)
    @rule(identifier=st.one_of(st.sampled_from([0x481, 0x000, 0x085, 0x505]),
                               st.integers(0, 0x7FF)),
          data=st.binary(max_size=8), is_extended=st.booleans())
    def anything_arrives(self, identifier: int, data: bytes, is_extended: bool) -> None:
        if identifier not in (0x485, 0x705):
            self.hears(Frame(identifier, data, is_extended))

    # -- users ------------------------------------------------------------------------------------

    @rule(index=st.integers(0, 1), raw=st.sampled_from([0, 0, 1, 5, 7]))
    def command(self, index: int, raw: int) -> None:
        self.observer.faulted = self.session.state is DriveState.FAULT
        outcome = self.session.services.command(index, raw * 0.1 if index == 0 else raw, self.now)
        # a double has one raw step
        self.observer.commanded(index, raw, outcome, self.now, neutral=raw <= 1 - index)
        self.look()

    @rule(value=st.sampled_from([math.nan, -1.0, 1e9, True]))
    def bad_command(self, value: float) -> None:
        with pytest.raises(ValueRefused):
            self.session.services.command(0, value, self.now)

    @rule()
    def users_turn_the_key(self) -> None:
        self.key_values += 1    # every write has its own value: it can be counted
        self.submit(WriteRequest(((KEY, self.key_values),)))

    # -- the life of a session --------------------------------------------------------------------

    def answered(self, outcome: ControlCompleted) -> None:
        if outcome.success:
            self.succeeded.append(outcome.request.action)

    def drive_is_well(self) -> None:
        self.fates.clear()
        self.heartbeat(5)
        end = self.now + 2.0
        while not self.session.online and self.now < end:
            self.heartbeat(5)
            self.time_passes_in_time(1, True)
        assert self.session.online

    @precondition(lambda self: self.session.online)
    @rule()
    def device_ends_up_as_told(self) -> None:
        """However many frames were lost before: in peace, it soon has what the session means."""
        self.fates.clear()
        end = self.now + 1.0
        while self.now < end:
            if self.observer.bus:
                self.heartbeat(5)
            self.time_passes_in_time(5, True)
        if not self.session.online:
            return  # what was heard, or not heard, before
        registers = self.device.registers
        if self.session.control is not None:
            assert registers[WORD] == self.session.control.word
        assert [registers[710], registers[712]] == [
            item.raw for item in self.session.setpoints.items]

    def bus_goes_down(self) -> None:
        super().bus_goes_down()
        self.unanswered.clear()

    def deactivate_to_the_end(self) -> None:
        super().deactivate_to_the_end()
        self.observer.stopping = False

    @invariant()
    def whoever_is_offline_gets_advice(self) -> None:
        if self.session is not None:
            assert bool(self.session.offline_advice) is not self.session.online


TestSession = SessionMachine.TestCase
TestSession.settings = SETTINGS
pytestmark = pytest.mark.timeout(PATIENCE)


@given(frames=st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8), st.booleans()),
                       max_size=25),
       state=st.sampled_from(['inactive', 'looking', 'online', 'asking', 'stopping']),
       layout=st.sampled_from(['word_le', 'dword_swapped', 'word_be']))
def test_no_frame_ever_raises(frames: list[tuple[int, bytes, bool]], state: str,
                              layout: str) -> None:
    session = FAMILY.make_session(configuration(control=CONTROL, request=(SPEED,)))
    if state in ('inactive', 'looking'):
        session = FAMILY.make_session(configuration(layout=layout))
    session.bus_up(0.0)
    if state != 'inactive':
        session.activate(1.0)
        session.handle_timer(1.05)
    if state in ('online', 'asking', 'stopping'):
        session.receive_frame(frame('485#0000000000000000'), 1.06)
        session.receive_frame(frame('485#C70100A641000000'), 1.07)
        assert session.online
        session.receive_frame(frame('485#C002002A00000000'), 1.08)
    if state == 'asking':
        session.services.submit(read(FLC), 1.09)
    if state == 'stopping':
        session.deactivate(1.09)
    now = 1.1
    own = (0x485, 0x705, 0x085, 0x505, 0x000)
    for place, (identifier, data, is_extended) in enumerate(frames):
        chosen = own[identifier % 5] if place % 4 else identifier
        session.receive_frame(Frame(chosen, data, is_extended and place % 4 == 0), now)
        session.handle_timer(now)
        now += 0.01
    assert session.facts()['nmt_state']
