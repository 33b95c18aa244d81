# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The inside of a simulated NORD inverter: the common registers and motor, with the inverter's rules.

In process data 4000h is 100 % of the maximum frequency, whatever the profile calls it: so every
frequency or speed among the actual values tells the same share of 100 % as the motor has, in hertz
as in percent.
"""

from collections.abc import Callable, Collection, Sequence

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.simulation import names
from drive_can_bridge.simulation.cannord_operation import InverterOperation
from drive_can_bridge.simulation.names import Quantity
from drive_can_bridge.simulation.plant import FAULT_CODE, Plant, WARNING_TEMPERATURE
from drive_can_bridge.simulation.scales import RawRange

WARNING = 0x0080
SETPOINT_REACHED = 0x0100
BUS_CONTROL = 0x0200
ROTATING_RIGHT = 0x0800
ROTATING_LEFT = 0x1000
PARAMETER_SET_SHIFT = 14


class InverterPlant(Plant):
    """
    Registers and motor of one inverter. See the base class.

    :ivar state: the state machine, which is the base class's ``operation``.
    :ivar fault_code: what the fault number shows while there is a fault.
    """

    def __init__(self, profile: Profile, *, volatile: Collection[str] = (),
                 preferred: Sequence[str] = ()) -> None:
        self.fault_code: float = FAULT_CODE
        super().__init__(profile, volatile=volatile, preferred=preferred)
        self.operation = self.state = InverterOperation()
        moved = self.axes.speed_setpoint
        self._mover = moved if moved is not None and moved.name in preferred else None
        self._share = None if moved is None else RawRange(moved, limits=False)
        self._setpoint = 0

    def advance(self, now: float) -> None:
        """Let the motor move up to now."""
        self.obey_setpoint()
        super().advance(now)
        if self.state.shutting_down and self.axes.motor.speed == 0.0:
            self.state.standstill()
            super().advance(now)

    def power_on(self) -> None:
        """Begin anew after a loss of power."""
        self._setpoint = 0
        super().power_on()

    def take_setpoint(self, parameter: Parameter, raw: int) -> None:
        """Take a value of the process data."""
        if self._mover is not None and parameter.name == self._mover.name:
            self._setpoint = raw
        elif parameter.writable:
            self.write(parameter.name, raw)

    def obey_setpoint(self) -> None:
        """Put into force what the last control word makes of the frequency setpoint."""
        if self._mover is None or self._share is None:
            return
        raw = self._setpoint
        if self.state.frozen:
            raw = self._share.nearest(self.axes.motor.speed)
        elif not self.state.setpoint_counts:
            raw = 0
        elif self.state.reversed:
            raw = -raw
        self.write(self._mover.name, raw)

    @property
    def status_word(self) -> int:
        """The status word."""
        motor, state = self.axes.motor, self.state
        target = self.axes.target if state.enabled and not state.stopping else 0.0
        word = state.status | BUS_CONTROL | state.parameter_set - 1 << PARAMETER_SET_SHIFT
        if motor.temperature > WARNING_TEMPERATURE:
            word |= WARNING
        if motor.speed == target:
            word |= SETPOINT_REACHED
        # at standstill the manuals' examples show "right"
        return word | (ROTATING_LEFT if motor.speed < 0.0 else ROTATING_RIGHT)

    # -- inside -----------------------------------------------------------------------------------

    def _source(self, parameter: Parameter) -> Callable[[], int] | None:
        if parameter.number is None and names.measured(parameter) is Quantity.SPEED:
            return lambda: self._speed_word(parameter)
        return super()._source(parameter)

    def _speed_word(self, parameter: Parameter) -> int:
        """Return the speed as the raw integer that it is in every actual value."""
        if self._share is None:
            return 0
        low, high = parameter.type.raw_range
        return min(max(self._share.nearest(self.axes.motor.speed), low), high)

    def _measure(self, parameter: Parameter, quantity: Quantity) -> Callable[[], float]:
        if quantity is Quantity.FAULT_CODE:
            return lambda: self.fault_code if self.operation.faulted else 0.0
        return super()._measure(parameter, quantity)
