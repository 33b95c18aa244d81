# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A motor behind the registers of any profile, found by the names of the parameters.

What no rule knows is plain memory; docs/simulation.md has the rules as a table.
"""

from collections.abc import Callable, Collection, Mapping
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.simulation import names, scales
from drive_can_bridge.simulation.axes import Axes
from drive_can_bridge.simulation.control import machine_of, Operation, Report, StatusWord
from drive_can_bridge.simulation.names import Quantity
from drive_can_bridge.simulation.plant import Mechanics
from drive_can_bridge.simulation.registers import Registers

WARNING_TEMPERATURE = 80.0
#: what a fault code shows while there is a fault
FAULT_CODE = 7


def mains_swing(now: float) -> float:
    """
    Return by which share of a voltage the mains are off.

    Of a drive at rest it is the one value that moves: whoever looks sees that it is alive.
    """
    return 0.005 * math.sin(2.0 * math.pi * 0.3 * max(now, 0.0))


class MotorPlant:
    """
    A motor, for profiles of all kinds.

    :param operation: the operating state; None: that of the profile's control section.
    :param movable: parameters that may move something; None: all.
    """

    def __init__(self, registers: Registers, configuration: DriveConfiguration,
                 mechanics: Mechanics, *, operation: Operation | None = None,
                 movable: Mapping[str, Parameter] | None = None) -> None:
        self.registers = registers
        self.control = control = configuration.profile.control
        self.operation = operation or Operation(machine_of(control))
        self._control_name = control.parameter if control else ''
        self._shown = {p.name for p in configuration.cyclic_response}
        self.axes = Axes(registers.parameters if movable is None else movable, registers,
                         configuration, mechanics, self.command)
        self.volatile: Collection[str] = {*self.axes.setpoints, self._control_name}

    def command(self, value: float) -> float:
        """Return which speed the value of the speed setpoint stands for."""
        return value

    def initial(self, parameter: Parameter) -> int | None:
        if self.control is not None and parameter.name == self._control_name:
            return self.control.disable
        if parameter.name in self.axes.ramps:
            value = self.axes.initial_ramp_value(parameter)
            return scales.nearest_raw(parameter, value, parameter.raw_limits)
        if parameter.name in self.axes.setpoints and parameter.neutral is None:
            return scales.clamp(0, parameter.raw_limits)
        return None

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        ends, nearest = parameter.type.raw_range, scales.nearest_raw
        actual = self.axes.actuals.get(parameter.name)
        quantity = names.measured(parameter)
        if quantity is None and parameter.name in self._shown:
            quantity = names.BY_UNIT.get(parameter.unit)
        if quantity is Quantity.POSITION:
            where = actual or (
                lambda: scales.position_value(parameter, self.axes.motor.position))
            return lambda: scales.clamp(
                nearest(parameter, where(), ends) + self.axes.jitter, ends)
        word = StatusWord(parameter, self.control)
        if actual is None and word:
            plain = self.registers.plain
            return lambda: word.compose(self._report(), plain(parameter.name))
        measure = actual or (quantity and self.measure(parameter, quantity))
        return (lambda: nearest(parameter, measure(), ends)) if measure else None

    def measure(self, parameter: Parameter, quantity: Quantity) -> Callable[[], float]:
        """Return what a quantity of the motor amounts to in the parameter's unit."""
        motor, setpoint = self.axes.motor, self.axes.speed_setpoint
        if quantity is Quantity.SPEED:
            if setpoint is not None and parameter.unit == setpoint.unit:
                return lambda: motor.speed
            return lambda: scales.speed_value(parameter, motor.speed * motor.revolutions,
                                              motor.share_of_rated_speed)
        if quantity is Quantity.TEMPERATURE:
            return lambda: scales.temperature_value(parameter, motor.temperature)
        if quantity is Quantity.FAULT_CODE:
            return lambda: self.operation.fault_code(FAULT_CODE)
        full = scales.rating(parameter, quantity)
        shares: dict[Quantity, Callable[[], float]] = {
            Quantity.TORQUE: lambda: motor.torque,
            Quantity.POWER: lambda: motor.torque * motor.share_of_rated_speed,
            Quantity.LOAD: lambda: abs(motor.torque),
            Quantity.CURRENT: lambda: motor.current,
            Quantity.VOLTAGE: lambda: 1.0 - 0.02 * motor.current + mains_swing(self.operation.now),
        }
        share = shares[quantity]
        if quantity is Quantity.VOLTAGE and names.words_of(parameter) & {'motor', 'output'}:
            share = lambda: 0.7 * abs(motor.share_of_rated_speed)  # noqa: E731
        return lambda: full * share()

    def allows(self, parameter: Parameter, raw: int) -> bool:
        return True

    def takes(self, parameter: Parameter) -> bool:
        return True

    def written(self, name: str, before: int, raw: int) -> None:
        if name == self._control_name:
            self.operation.word_written(raw)

    def advance(self, now: float) -> None:
        self.axes.advance(self.operation.advance(now), self.operation)

    def power_off(self) -> None:
        self.axes.power_off()

    def power_on(self) -> None:
        self.axes.power_on()

    def _report(self) -> Report:
        motor, operation = self.axes.motor, self.operation
        return Report(operation, warning=motor.temperature > WARNING_TEMPERATURE,
                      speed=motor.speed,
                      setpoint_reached=operation.enabled and motor.speed == self.axes.target)
