# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What machines of DataModel drives have in common, whatever happens in whatever order."""

import math

from any_order import AnyOrder
from drives import ExtendedDrive
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.frame import Frame

CYCLIC = 0x003FFFF0


class ExtendedMachine(AnyOrder):
    """A drive with 29-bit identifiers: writes arrive at once, reads are answered when it likes."""

    stop_takes = 2.0
    bus_may_refuse = True
    device: ExtendedDrive

    def apply(self, sent: Frame) -> None:
        if sent.identifier != CYCLIC and sent.identifier & 0x100000:
            self.device.takes(sent)
        else:
            self.unanswered.append(sent)
            del self.unanswered[:-3]

    @precondition(lambda self: self.unanswered)
    @rule(choice=st.integers(0, 2))
    def drive_answers(self, choice: int) -> None:
        asked = self.unanswered.pop(min(choice, len(self.unanswered) - 1))
        for answer in self.device.takes(asked):
            self.hears(answer)

    def map_is_repaired(self) -> None:
        raise NotImplementedError

    def drive_is_well(self) -> None:
        self.map_is_repaired()
        super().drive_is_well()


class TwoSetpoints(AnyOrder):
    """
    Users command two setpoints.

    :cvar settles: steps until a word of it has arrived, and until a setpoint has.
    :cvar silent: nothing is sent for a command.
    """

    settles = 8, 2
    silent = False

    @rule(index=st.integers(0, 1), value=st.sampled_from([0.0, 5.0, 7.5]))
    def good_command(self, index: int, value: float) -> None:
        self.command(index, value)
        self.time_passes_in_time(4, True)

    @rule(index=st.integers(0, 1), value=st.sampled_from([0.0, 0.1, 5.0, 5, math.nan, 1e6, True]))
    def command(self, index: int, value: float) -> None:
        try:
            outcome = self.session.services.command(index, value, self.now)
        except ValueRefused:
            assert not 0 <= value <= 5 or value is True
            return
        self.observer.expected(self.now)
        self.observer.commanded(index, round(10 * value), outcome, self.now)
        self.look(silent=self.silent)

    def have_it_run(self) -> None:
        word, setpoint = self.settles
        if self.observer.controlled:
            self.registers[211] = 1
            self.control(ControlAction.ENABLE)
            self.time_passes_in_time(word, True)
            self.registers[211] = 3
            self.time_passes_in_time(word, True)
        self.command(0, 0.0)
        self.command(0, 5.0)
        self.time_passes_in_time(setpoint, True)
