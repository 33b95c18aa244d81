# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What limits a motor: the registers of its profile that say how much torque and speed it may have.

A motor that lacks torque speeds up more slowly than its ramp says, does not get to its speed, and
brakes hardly faster than it runs down. Like all of the motor, that is no model of a real one.
"""

from collections.abc import Mapping
import math
from typing import NamedTuple

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.simulation import names, scales
from drive_can_bridge.simulation.motor import (
    FRICTION_TORQUE, INERTIA_TORQUE, LOAD_TORQUE, MAGNETISING_CURRENT, Rates,
)
from drive_can_bridge.simulation.names import Quantity
from drive_can_bridge.simulation.registers import Registers


class Bounds:
    """
    The limits of one motor.

    :param parameters: those that may limit it.
    :param moved: the setpoint that moves it.
    """

    def __init__(self, registers: Registers, parameters: Mapping[str, Parameter],
                 moved: Parameter | None) -> None:
        self._registers = registers
        self._found = {
            parameter.name: (parameter, quantity)
            for parameter, quantity in names.limits(parameters) if parameter is not moved and (
                moved and parameter.unit == moved.unit if quantity is Quantity.SPEED
                else scales.measures(parameter.unit, quantity))}

    def initial(self, name: str, rated_speed: float) -> float | None:
        """Return what a new drive has in a limit of which its profile says nothing."""
        parameter, quantity = self._found.get(name, (None, Quantity.SPEED))
        if parameter is None or parameter.neutral is not None or parameter.maximum is not None:
            return None
        return (rated_speed if quantity is Quantity.SPEED
                else scales.full(parameter.unit, quantity))

    @property
    def speed(self) -> float:
        """The largest speed, in the unit of the setpoint."""
        return min((self._value(parameter) for parameter, quantity in self._found.values()
                    if quantity is Quantity.SPEED), default=math.inf)

    @property
    def torque(self) -> float:
        """The largest torque, as a share of the rated one."""
        return min((self._torque(parameter, quantity)
                    for parameter, quantity in self._found.values()
                    if quantity is not Quantity.SPEED), default=math.inf)

    def _value(self, parameter: Parameter) -> float:
        return max(self._registers.commanded(parameter.name), 0.0)

    def _torque(self, parameter: Parameter, quantity: Quantity) -> float:
        share = self._value(parameter) / scales.full(parameter.unit, quantity)
        if quantity is Quantity.CURRENT:    # a part of it makes no torque
            return math.sqrt(max(share ** 2 - MAGNETISING_CURRENT ** 2, 0.0))
        return share


class Reach(NamedTuple):
    """
    What a motor can do with the torque that it may have, as shares of the rated speed.

    :param speed: how fast it gets at most; 0: it does not turn.
    :param rising: how much faster per s at most.
    :param falling: how much slower.
    """

    speed: float
    rising: float
    falling: float

    @classmethod
    def of(cls, torque: float, load: float, coast: float) -> 'Reach':
        """
        Return that of a torque.

        :param load: share of the rated torque that a weight takes.
        :param coast: how much slower it gets per s without torque.
        """
        spare = max(torque - FRICTION_TORQUE - load, 0.0)
        return cls(spare / LOAD_TORQUE, spare / INERTIA_TORQUE, torque / INERTIA_TORQUE + coast)

    def rates(self, rates: Rates, rated: float) -> Rates:
        """Return how fast a speed may change that is to change as fast as a ramp says."""
        return Rates(min(rates.rising, self.rising * rated),
                     min(rates.falling, self.falling * rated))
