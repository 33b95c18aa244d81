# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A session under anything that may happen, in any order, watched by somebody who only sees frames.

The observer knows the protocol's bytes and the contract, nothing of the session's inside. It keeps
its own books: which maps were read, which commands went through, when an EEPROM was last written.
"""

import math
from typing import Any

from any_order import Observer, PATIENCE, SETTINGS, SLACK
from builders import (
    CONTROL, DAMPING, drive, FLAG, GAIN, LIMIT, MAXIMUM, ORDER, parameter, RAMP, SPEED, STATUS,
    WORD,
)
from datamodel_anything import CYCLIC, ExtendedMachine, TwoSetpoints
from drives import ExtendedDrive
from hypothesis import strategies as st
from hypothesis.stateful import initialize, rule
import pytest
from stops import MORE_CYCLES, STOP_CYCLES

from drive_can_bridge.core.events import MappingDiffered, StationFound, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.families import FAMILIES

RAW = parameter('p600', 600, listed=False)
WRITABLE = (GAIN, DAMPING, FLAG, RAMP, MAXIMUM, ORDER, RAW)
#: what stops the drive by number: setpoints and control word
STOPPED_BY = (50, 51, 52)
EEPROMS = {30, 31, 44, 600, *range(122, 130)}


class ExtendedObserver(Observer):
    """Checks every frame that the session sends."""

    def __init__(self, *, mapping: str, period: float, timeout: float, immediate: bool,
                 controlled: bool) -> None:
        super().__init__(timeout=timeout, immediate=immediate)
        self.mapping = mapping
        self.controlled = controlled
        self.neutral: set[int] = set()  # setpoints that were written neutral by number
        self.period = period
        self.verified = False
        self.request_map_read = False
        self.last_cycles = 0       # neutral cycles that may still be sent without a verified map
        self.ran = False           # and nobody knows who took the neutral cycles since
        self.cycled_at = -math.inf
        self.eeprom_at = -math.inf

    def doubt(self) -> None:
        super().doubt()
        self.verified = self.request_map_read = False
        self.last_cycles = 0

    def deactivated(self, session: Any) -> None:
        self.disarm()
        self.last_cycles = 0 if session.stopped else (
            STOP_CYCLES + MORE_CYCLES * session.duty.unacknowledged)
        self.asked = None

    def activated(self) -> None:
        super().activated()
        self.ran = False

    def time_was_lost(self, session: Any) -> None:
        if self.active:
            self.doubt()

    def refused(self, sent: Frame, now: float) -> None:
        identifier = sent.identifier
        if identifier != CYCLIC and not identifier & 0x100000:
            # nobody can tell: the answer to a read before, of the same words, will do as well
            self.asked = identifier >> 4 & 0xFFFF, identifier & 0xF, now

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
            assert self.active or number in STOPPED_BY and count == 1, 'only stops are confirmed'
            assert data == bytes(8)
            assert now >= self.eeprom_at + 0.02 - SLACK, 'reads wait for the EEPROM'
            if self.asked is not None:
                assert now >= self.asked[2] + 0.1 - SLACK, 'one read at a time'
            self.asked = number, count, now

    def sees_cycle(self, data: bytes, now: float) -> None:
        # a stop brings a cycle forward, not under 5 ms after the last one
        assert now >= self.cycled_at + min(0.005, 0.5 * self.period) - SLACK, 'a burst'
        self.cycled_at = now
        if not self.active:
            assert self.last_cycles > 0, 'nothing cyclic after the stop'
            self.last_cycles -= 1
        elif self.mapping != 'assume' and not self.verified:
            assert self.last_cycles > 0, 'no cyclic frame before the maps were read'
            self.last_cycles -= 1
        words = [int.from_bytes(data[place:place + 2], 'big') for place in (0, 2)]
        if self.controlled and not any(words):
            self.armed, self.raws = [False, False], [0, 0]  # it may have been disabled meanwhile
        assert words == self.expected(now)
        assert data[4:] == bytes(4)
        self.neutral.clear()
        self.ran = self.ran or any(words)
        self.tells('cycle', runs=any(words))

    def commanded(self, index: int, raw: int, outcome: CommandOutcome, now: float) -> None:
        if not self.controlled or not self.online or not self.active:
            super().commanded(index, raw, outcome, now)
        elif outcome in (CommandOutcome.ARMED, CommandOutcome.ACCEPTED):
            assert outcome is CommandOutcome.ACCEPTED or self.immediate or abs(raw) <= 1
            self.armed[index], self.raws[index], self.since[index] = True, raw, now
        else:
            self.armed[index], self.raws[index] = False, 0

    def sees_write(self, number: int, count: int, data: bytes, now: float) -> None:
        numbers = set(range(number, number + count))
        if numbers & {50, 51}:
            assert count == 1 and data == bytes(8), 'setpoints are written to stop only'
            self.is_neutral(number)
        if numbers & set(range(122, 130)):
            assert self.mapping == 'configure'
            assert count == 1
            assert not self.verified, 'maps are not touched while cycling'
            self.last_cycles = 0    # nor is anything cyclic sent while they are
        if number == 52:
            assert count == 1
            if not self.active:
                assert data == bytes(8), 'only disable goes with a stop'
            self.tells('word', runs=any(data))
        else:
            assert self.active or number in STOPPED_BY
        if numbers & EEPROMS:
            assert now >= self.eeprom_at + 0.02 - SLACK, 'EEPROM writes are paced'
            self.eeprom_at = now
            assert count == 1

    def is_neutral(self, number: int) -> None:
        """Record a setpoint that was written neutral, or found so, since the last cycle."""
        self.neutral.add(number)
        if self.neutral >= {50, 51}:
            self.tells('cycle', runs=False)


class SessionMachine(TwoSetpoints, ExtendedMachine):
    """Everything that may happen to a session."""

    readable = (GAIN, DAMPING, FLAG, RAMP, MAXIMUM, STATUS, RAW)
    writable = WRITABLE

    @initialize(mapping=st.sampled_from(['verify', 'configure', 'assume']),
                period=st.sampled_from([0.02, 0.005, 0.3]),
                timeout=st.sampled_from([0.0, 0.05]), immediate=st.booleans(),
                control=st.booleans(), strict=st.booleans())
    def begin(self, mapping: str, period: float, timeout: float, immediate: bool,
              control: bool, strict: bool) -> None:
        table = (SPEED, LIMIT, STATUS, WORD, *WRITABLE)
        session = FAMILIES['datamodel_extended'].make_session(drive(
            mapping=mapping, period=period, command_timeout=timeout, rearm_immediate=immediate,
            control=CONTROL if control else None, table=table, response=(STATUS,),
            length_policy='strict' if strict else 'lenient'))
        self.start(session, ExtendedObserver(
            mapping=mapping, period=period, timeout=timeout, immediate=immediate,
            controlled=control))
        self.registers = dict.fromkeys((30, 31, 40, 41, 42, 43, 44, 50, 51, 52, 211, 600), 0)
        self.registers.update(zip(range(122, 130), (50, 51, 0, 0, 211, 0, 0, 0)))
        self.registers[211] = 1
        self.device = ExtendedDrive(self.registers)

    def happened(self, event: Any) -> None:
        if isinstance(event, StationLost):
            self.observer.disarm()
            if 'no cyclic response' in event.reason and self.observer.mapping != 'assume':
                self.observer.verified = self.observer.request_map_read = False
                self.observer.last_cycles = 3
            elif 'response map' in event.reason and 'request map' not in event.reason:
                self.observer.last_cycles = 3  # the request map was just read as right
        elif isinstance(event, MappingDiffered):
            if self.observer.ran and self.observer.request_map_read:
                self.observer.last_cycles = 3  # it is told once more, now that it can be heard
            self.observer.ran = False
        elif isinstance(event, StationFound):
            self.observer.online = True

    # -- the drive --------------------------------------------------------------------------------

    def hears(self, heard: Frame) -> None:
        self.keep_books(heard)
        self.session.receive_frame(heard, self.now)
        self.look()

    def keep_books(self, heard: Frame) -> None:
        """Note what the observer may learn of the maps from an answer."""
        observer, asked = self.observer, self.observer.asked
        identifier, data, is_extended = heard
        strict = self.session.configuration.options.length_policy == 'strict'
        if (asked is None or not is_extended or not observer.bus
                or identifier != (0x10200000 | asked[0] << 4 | asked[1])
                or len(data) < (8 if strict else 2 * asked[1])
                or self.now >= asked[2] + 0.1 + SLACK):
            return
        observer.asked = None
        if asked[0] in (50, 51) and asked[1] == 1 and not any(data[:2]):
            observer.is_neutral(asked[0])
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
        st.integers(0x10200000, 0x103FFFFF), st.integers(0, 0x1FFFFFFF)),
        data=st.binary(max_size=8), is_extended=st.booleans())
    def anything_arrives(self, identifier: int, data: bytes, is_extended: bool) -> None:
        self.hears(Frame(identifier if is_extended else identifier & 0x7FF, data, is_extended))


TestSession = SessionMachine.TestCase
TestSession.settings = SETTINGS
pytestmark = pytest.mark.timeout(PATIENCE)
