# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
An axis that stays where it is, under anything that may happen, in any order.

The observer sees frames only, in both directions. Whatever happens: a position that is sent is
the one that was sent before, one that the drive has just reported while it said that it does not
run, or a command that was accepted; and without control none is sent before one was reported.
"""

import math
from typing import Any

from any_order import Observer, PATIENCE, SETTINGS
from builders import CONTROL, drive, GAIN, INT16, parameter, RAM, RO, STATUS, WORD
from datamodel_anything import CYCLIC, ExtendedMachine
from drives import ExtendedDrive
from hypothesis import strategies as st
from hypothesis.stateful import initialize, rule
import pytest

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.events import StationFound, StationLost
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.setpoints import CommandOutcome
from drive_can_bridge.protocols.families import FAMILIES

POSITION = parameter('position_setpoint', 60, type=INT16, scale=0.1, unit='deg', minimum=-100.0,
                     maximum=100.0, storage=RAM, neutral_from='actual_position',
                     arming_tolerance=0.5)
MEASURED = parameter('actual_position', 212, type=INT16, scale=0.1, unit='deg', access=RO)


#: reads 122 to 125, as the first of all
ASK_MAP = 0x002007A4


class AxisObserver(Observer):
    """
    Keeps books of positions.

    :ivar reported: the position that a cyclic answer said last; None: none since it was lost.
    :ivar read: positions that were read by number since it was lost, by us or by users.
    :ivar old: what was reported before it was lost.
    :ivar anew: since it was lost, no position was sent that it has reported since.
    :ivar heard: what it has reported while that was so: the first of these is held, although
        answers that were late may bring more before the next cycle.
    """

    def __init__(self, *, controlled: bool, timeout: float) -> None:
        super().__init__(timeout=timeout)
        self.controlled = controlled
        self.reported: int | None = None
        self.running_said = False       # what the last status said
        self.last: int | None = None    # position sent
        self.command: int | None = None
        self.commanded_at = -math.inf
        self.anew = True
        self.read: set[int] = set()
        self.old: set[int] = set()
        self.heard: set[int] = set()

    def disable(self) -> None:
        super().disable()
        self.command = None

    def lost(self) -> None:
        """Record that the axis may be anywhere."""
        if self.controlled:     # beside ``disable``, what was known goes on, sent or refused
            self.old |= self.read | ({self.reported} if self.reported is not None else set())
        self.reported, self.running_said, self.command, self.anew = None, False, None, True
        self.read.clear()
        self.heard.clear()

    def doubt(self) -> None:
        super().doubt()
        self.lost()

    def activated(self) -> None:
        super().activated()
        self.last = None

    def deactivated(self, session: Any) -> None:
        self.disarm()
        self.command = None

    def time_was_lost(self, session: Any) -> None:
        if self.active:
            self.doubt()

    def sees(self, sent: Frame, now: float) -> None:
        identifier, data, _ = sent
        number = identifier >> 4 & 0xFFFF
        words = [int.from_bytes(data[place:place + 2], 'big') for place in (0, 2)]
        if identifier == CYCLIC:
            word, position = words if self.controlled else (0, words[0])
            self.sees_position(position, now, rests=self.controlled and not word)
            self.tells('cycle', runs=bool(word))
        elif identifier == ASK_MAP and not self.online:
            self.anew = True    # it is looked for again, and where it is will be read again
        elif identifier & 0x100000 and number == 60:
            assert words[0] in {self.last, self.reported, *self.read}, 'a stop repeats what is'
        elif identifier & 0x100000 and number == 52:
            self.tells('cycle', runs=any(words))

    def sees_position(self, position: int, now: float, *, rests: bool) -> None:
        if 0.0 < self.timeout < now - self.commanded_at:
            self.command = None
        if self.command is not None and self.running_said is self.controlled:
            assert position == self.command, 'the command goes through'
        allowed = {self.last, self.command}
        if self.reported is not None and (self.anew or not self.running_said):
            allowed.add(self.reported)
        if self.anew:
            allowed |= self.read | self.old | self.heard
        elif rests and not self.running_said:   # a map that differed: where it is, is read again
            allowed |= self.read
        if not self.controlled:
            assert self.reported is not None or self.read, 'where it is, nobody knows'
        assert position in allowed, f'{position} is none of {allowed}: the axis jumps'
        # before it has answered a cycle it may be looked for again, and read anew
        if self.reported is not None:
            self.anew = False
            self.old.clear()
            self.heard.clear()
        self.last = position


class AxisMachine(ExtendedMachine):
    """Everything that may happen to the session of an axis."""

    readable = (GAIN, MEASURED, STATUS)
    writable = (GAIN,)

    @initialize(mapping=st.sampled_from(['verify', 'configure', 'assume']),
                timeout=st.sampled_from([0.0, 0.05]), control=st.booleans())
    def begin(self, mapping: str, timeout: float, control: bool) -> None:
        session = FAMILIES['datamodel_extended'].make_session(drive(
            mapping=mapping, command_timeout=timeout, control=CONTROL if control else None,
            table=(GAIN, STATUS, WORD, POSITION, MEASURED),
            request=(WORD, POSITION) if control else (POSITION,), response=(STATUS, MEASURED)))
        self.start(session, AxisObserver(controlled=control, timeout=timeout))
        self.maps = ((52, 60) if control else (60, 0), (211, 212))
        self.registers = dict.fromkeys((40, 52, 60, 211), 0)
        self.registers[212] = 700
        self.map_is_repaired()
        self.device = ExtendedDrive(self.registers)
        self.step = 0

    def map_is_repaired(self) -> None:
        request, response = self.maps
        self.registers.update(zip(range(122, 130), (*request, 0, 0, *response, 0, 0)))

    def happened(self, event: Any) -> None:
        observer = self.observer
        if isinstance(event, StationLost):
            observer.disarm()
            observer.lost()
        elif isinstance(event, StationFound):
            observer.online = True

    def hears(self, heard: Frame) -> None:
        self.registers[212] = self.registers[212] + self.step & 0xFFFF     # it never rests
        session, observer = self.session, self.observer
        words = [int.from_bytes(heard.data[place:place + 2], 'big') for place in (0, 2)]
        before = observer.reported, observer.running_said
        if heard.identifier == 0x103FFFF0:
            status, observer.reported = words
            observer.running_said = observer.controlled and bool(status & 2)
            if not observer.running_said and observer.controlled:
                observer.command = None
        elif heard.identifier == 0x10200D31 and not words[0] & 2:
            observer.running_said = False
        elif heard.identifier == 0x10200D41:
            observer.read.add(words[0])
        exchanges = session.statistics.exchanges
        session.receive_frame(heard, self.now)
        if heard.identifier == 0x103FFFF0:
            if session.statistics.exchanges == exchanges:
                observer.reported, observer.running_said = before   # nobody had asked for it
            elif observer.anew and observer.reported is not None:
                observer.heard.add(observer.reported)
        self.look()

    @rule(step=st.sampled_from([0, 1, -1, 13]), status=st.sampled_from([0, 1, 1, 3, 3, 8]))
    def drive_changes(self, step: int, status: int) -> None:
        self.step, self.registers[211] = step, status

    @rule(number=st.sampled_from([122, 126]))
    def map_is_lost(self, number: int) -> None:
        self.registers[number] = 0

    @rule(value=st.sampled_from([0.0, 70.0, 71.0, 99.0, math.nan]), near=st.integers(-7, 7))
    def command(self, value: float, near: int) -> None:
        setpoint = self.session.setpoints.items[0]
        if near:
            value = (setpoint.neutral + near) / 10
        try:
            outcome = self.session.services.command(0, value, self.now)
        except ValueRefused:
            return
        if outcome is CommandOutcome.ARMED:
            last = self.observer.last
            assert last is not None
            last -= last >> 15 << 16
            assert abs(10 * value - last) <= 5 + 1e-6, 'it arms near what was sent only'
        if outcome in (CommandOutcome.ARMED, CommandOutcome.ACCEPTED):
            self.observer.command = round(10 * value) & 0xFFFF
            self.observer.commanded_at = self.now
        self.look()

    def have_it_run(self) -> None:
        if self.observer.controlled:
            self.registers[211] = 1
            self.time_passes_in_time(4, True)
            self.control(ControlAction.ENABLE)
            self.time_passes_in_time(8, True)
            self.registers[211] = 3
            self.time_passes_in_time(8, True)
        self.command(0.0, 3)
        self.command(99.0, 0)
        self.time_passes_in_time(2, True)


TestAxis = AxisMachine.TestCase
TestAxis.settings = SETTINGS
pytestmark = pytest.mark.timeout(PATIENCE)
