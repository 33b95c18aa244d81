# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The inside of a simulated NORD inverter: the common registers and motor, with the inverter's rules.

In process data 4000h is 100 % of the maximum frequency, whatever the profile calls it: so every
frequency or speed among the actual values tells the same share of 100 % as the motor has, in hertz
as in percent.
"""

from collections.abc import Callable

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.cannord.states import STATUS_BITS
from drive_can_bridge.simulation import names
from drive_can_bridge.simulation.cannord_operation import InverterOperation
from drive_can_bridge.simulation.cannord_table import groups_of
from drive_can_bridge.simulation.motor_plant import FAULT_CODE, MotorPlant, WARNING_TEMPERATURE
from drive_can_bridge.simulation.names import Quantity
from drive_can_bridge.simulation.plant import Mechanics
from drive_can_bridge.simulation.registers import initial_value, Registers
from drive_can_bridge.simulation.scales import RawRange

WARNING, SETPOINT_REACHED, BUS_CONTROL, ROTATING_RIGHT, ROTATING_LEFT = (
    1 << STATUS_BITS[name] for name in (
        'warning', 'setpoint_reached', 'bus_control', 'rotating_right', 'rotating_left'))
#: what an SK 5xxE says of itself, by parameter number: version of the data base
IDENTITY = {742: 1}


class InverterPlant(MotorPlant):
    """
    The motor of one inverter. See the base class.

    :ivar state: the state machine, which is the base class's ``operation``.
    :ivar fault_code: what the fault number shows while there is a fault.
    """

    def __init__(self, registers: Registers, configuration: DriveConfiguration,
                 mechanics: Mechanics) -> None:
        self.fault_code: float = FAULT_CODE
        self.state = InverterOperation()
        # entries of the sets 2 to 4, by name: the motor knows set 1 and what stands in for it
        self._of_sets = {
            member.name: group.members[0] for group in groups_of(registers.parameters).values()
            if group.sets for index, member in group.members.items() if index != 0}
        super().__init__(
            registers, configuration, mechanics, operation=self.state,
            movable={name: parameter for name, parameter in registers.parameters.items()
                     if name not in self._of_sets})
        moved = self.axes.speed_setpoint
        self._mover = moved if moved in configuration.cyclic_request else None
        self._share = None if moved is None else RawRange(moved, limits=False)

    def command(self, value: float) -> float:
        """Return what the last control word makes of the frequency setpoint."""
        if self._mover is None:
            return value
        if self.state.frozen:
            return self.axes.motor.speed
        if not self.state.setpoint_counts:
            return 0.0
        if self.state.reversed:
            name = self._mover.name
            raw = self.registers.clamped(name, -self.registers.plain(name))
            return float(self._mover.value_from_raw(raw))
        return value

    def move(self, duration: float) -> None:
        super().move(duration)
        if self.state.shutting_down and self.axes.motor.speed == 0.0:
            self.state.standstill()
            super().move(0.0)

    @property
    def status_word(self) -> int:
        motor, state = self.axes.motor, self.state
        target = self.axes.target if state.enabled and not state.stopping else 0.0
        word = state.status | BUS_CONTROL
        if motor.temperature > WARNING_TEMPERATURE:
            word |= WARNING
        if motor.speed == target:
            word |= SETPOINT_REACHED
        # at standstill the manuals' examples show "right"
        return word | (ROTATING_LEFT if motor.speed < 0.0 else ROTATING_RIGHT)

    def initial(self, parameter: Parameter) -> int | None:
        """Return what a new inverter has in a register: the same in all parameter sets."""
        first = self._of_sets.get(parameter.name)
        if first is None:
            return IDENTITY.get(parameter.number or 0) or super().initial(parameter)
        initial = super().initial(first)
        return initial_value(first, RawRange(first, limits=True)) if initial is None else initial

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        if parameter.number is not None or names.measured(parameter) is not Quantity.SPEED:
            return super().source(parameter)
        span, share, motor = RawRange(parameter, limits=False), self._share, self.axes.motor
        return lambda: 0 if share is None else span.clamp(share.nearest(motor.speed))

    def measure(self, parameter: Parameter, quantity: Quantity) -> Callable[[], float]:
        if quantity is Quantity.FAULT_CODE:
            return lambda: self.fault_code if self.operation.faulted else 0.0
        return super().measure(parameter, quantity)
