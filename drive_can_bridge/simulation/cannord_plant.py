# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The inside of a simulated NORD inverter: the common registers and motor, with the inverter's rules.

Control words: BU 0050 page 30 (bits) and page 38 (states); where the two differ, on what bit 3 = 0
leads to, page 38 counts. A word with bit 10 = 0 is ignored as a whole.

In process data 4000h is 100 % of the maximum frequency, whatever the profile calls it: so every
frequency or speed among the actual values tells the same share of 100 % as the motor has, in hertz
as in percent.
"""

from collections.abc import Callable

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.cannord import states
from drive_can_bridge.protocols.cannord.states import (
    ENABLE_OPERATION, FAULT_RESET, NO_DISABLE_VOLTAGE, NO_QUICK_STOP, STATUS_BITS, SWITCH_ON,
)
from drive_can_bridge.simulation import names
from drive_can_bridge.simulation.cannord_table import groups_of
from drive_can_bridge.simulation.control import FAULTS, Machine, Operation, Rule, RUNNING, State
from drive_can_bridge.simulation.motor_plant import MotorPlant, WARNING_TEMPERATURE
from drive_can_bridge.simulation.names import Quantity
from drive_can_bridge.simulation.plant import Mechanics
from drive_can_bridge.simulation.registers import Registers
from drive_can_bridge.simulation.scales import clamp, nearest_raw

WARNING, SETPOINT_REACHED, BUS_CONTROL, ROTATING_RIGHT, ROTATING_LEFT = (
    1 << STATUS_BITS[name] for name in (
        'warning', 'setpoint_reached', 'bus_control', 'rotating_right', 'rotating_left'))
#: what an SK 5xxE says of itself, by parameter number: version of the data base
IDENTITY = {742: 1}

#: status bits of a state: those of OFF2 and OFF3 come from the control word in two states
_STATUS = {
    State.SWITCH_ON_DISABLED: 0x40,
    State.READY_TO_SWITCH_ON: 0x31,
    State.SWITCHED_ON: 0x33,
    State.OPERATION_ENABLED: 0x37,
    State.SHUTDOWN: 0x37,
    State.QUICK_STOP: 0x17,
    State.FAULT: 0x08,
}
#: OFF2 and OFF3 in the control word, and how far on they stand in the status word
_OFF = NO_DISABLE_VOLTAGE | NO_QUICK_STOP
_OFF_SHIFT = 3
#: the parameter set, in both
_SET = states.PARAMETER_SETS - 1 << states.PARAMETER_SET_SHIFT

_MACHINE = Machine((
    Rule(FAULTS, 0, 0, None),
    Rule(None, NO_DISABLE_VOLTAGE, 0, State.SWITCH_ON_DISABLED),
    Rule((State.QUICK_STOP,), 0, 0, None),              # ends at standstill only
    Rule(RUNNING, NO_QUICK_STOP, 0, State.QUICK_STOP),
    Rule(None, NO_QUICK_STOP, 0, State.SWITCH_ON_DISABLED),
    Rule(RUNNING, SWITCH_ON, 0, State.SHUTDOWN),
    Rule(None, SWITCH_ON, 0, State.READY_TO_SWITCH_ON),
    Rule((State.SWITCH_ON_DISABLED,), 0, 0, None),      # left with bit 0 = 0 only
    Rule(None, ENABLE_OPERATION, ENABLE_OPERATION, State.OPERATION_ENABLED),
    Rule(None, 0, 0, State.SWITCHED_ON),
), reset=(FAULT_RESET, FAULT_RESET), power_on=(State.SWITCH_ON_DISABLED, _OFF),
    # b4 = 0 uses the quick stop ramp, too, but leaves the inverter enabled
    ramp=states.ENABLE_RAMP)


class InverterPlant(MotorPlant):
    """The motor of one inverter. See the base class."""

    def __init__(self, registers: Registers, configuration: DriveConfiguration,
                 mechanics: Mechanics) -> None:
        # entries of the sets 2 to 4, by name: the motor knows set 1 and what stands in for it
        self._of_sets = {
            member.name: group.members[0] for group in groups_of(registers.parameters).values()
            if group.sets for index, member in group.members.items() if index != 0}
        super().__init__(
            registers, configuration, mechanics, operation=Operation(_MACHINE),
            movable={name: parameter for name, parameter in registers.parameters.items()
                     if name not in self._of_sets})
        moved = self.speed_setpoint
        self._mover = moved if moved in configuration.cyclic_request else None

    def command(self, value: float) -> float:
        """Return what the last control word makes of the frequency setpoint."""
        operation, word = self.operation, self.operation.word
        if self._mover is None:
            return value
        if operation.state is State.SHUTDOWN:
            return 0.0
        if operation.state is State.OPERATION_ENABLED and not word & states.RELEASE_RAMP:
            return self.motor.speed
        if not word & states.ENABLE_SETPOINT:
            return 0.0
        # rotation right has priority
        if word & states.ROTATE_LEFT and not word & states.ROTATE_RIGHT:
            name = self._mover.name
            raw = self.registers.clamped(name, -self.registers.plain(name))
            return float(self._mover.value_from_raw(raw))
        return value

    @property
    def status_word(self) -> int:
        motor, operation = self.motor, self.operation
        target = self.target if operation.enabled and not operation.stopping else 0.0
        word = _STATUS[operation.state] | operation.word & _SET | BUS_CONTROL
        if operation.state in (State.SWITCH_ON_DISABLED, State.FAULT):
            word |= (operation.word & _OFF) << _OFF_SHIFT
        if motor.temperature > WARNING_TEMPERATURE:
            word |= WARNING
        if motor.speed == target:
            word |= SETPOINT_REACHED
        # at standstill the manuals' examples show "right"
        return word | (ROTATING_LEFT if motor.speed < 0.0 else ROTATING_RIGHT)

    def initial(self, parameter: Parameter) -> int:
        """Return what a new inverter has in a register: the same in all parameter sets."""
        first = self._of_sets.get(parameter.name, parameter)
        return IDENTITY.get(parameter.number or 0) or super().initial(first)

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        if parameter.number is not None or names.measured(parameter) is not Quantity.SPEED:
            return super().source(parameter)
        moved, motor = self.speed_setpoint, self.motor
        if moved is None:
            return lambda: 0
        own, its = parameter.type.raw_range, moved.type.raw_range
        return lambda: clamp(nearest_raw(moved, motor.speed, its), own)
