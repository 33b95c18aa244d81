# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The inside of a simulated drive, whatever protocol it speaks: registers, motor, operating state.

Registers are raw integers by parameter name. Some of them are computed (actual values, status
words), the others keep what is written, within the limits of the profile.
"""

from collections.abc import Callable, Collection, Sequence
import math
import zlib

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import Access, Parameter, ParameterType, Storage, Value
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.simulation import names, scales
from drive_can_bridge.simulation.axes import Axes
from drive_can_bridge.simulation.control import Operation
from drive_can_bridge.simulation.names import Quantity
from drive_can_bridge.simulation.scales import RawRange
from drive_can_bridge.simulation.status import State, StatusWord

WARNING_TEMPERATURE = 80.0
#: what a fault code shows while there is a fault
FAULT_CODE = 7

#: share of the link voltage by which the mains swing it, and how fast (rad/s): of a drive at rest
#: it is the one value that moves, so that whoever looks sees that it is alive
MAINS_SWING = 0.005
MAINS_RATE = 2.0 * math.pi * 0.3


class Plant:
    """
    Registers and motor of one drive.

    :param volatile: names of parameters that a power cycle resets although the profile does not
        say where they are stored (those exchanged cyclically live in RAM).
    :param preferred: names of the parameters in the cyclic request.
    :ivar stuck: names of parameters on which writes have no effect.
    """

    def __init__(self, profile: Profile, *, volatile: Collection[str] = (),
                 preferred: Sequence[str] = ()) -> None:
        self.parameters = profile.parameters
        self.control = profile.control
        self.operation = Operation(profile.control)
        self.stuck: set[str] = set()
        self._control_name = profile.control.parameter if profile.control else None
        self._volatile = volatile
        self._now: float | None = None
        self._raw: dict[str, int] = {}
        self.axes = Axes(self.parameters, self._raw, self._control_name, preferred)
        self._range = {name: RawRange(parameter, limits=True)
                       for name, parameter in self.parameters.items()}
        for parameter in self.parameters.values():
            self._raw[parameter.name] = self._initial(parameter)
        self.axes.ramps_changed()
        self._held: dict[str, int] = {}
        self._computed: dict[str, Callable[[], int]] = {}
        for parameter in self.parameters.values():
            source = None if parameter.writable else self._source(parameter)
            if source is not None:
                self._computed[parameter.name] = source

    def advance(self, now: float) -> None:
        """Let the motor move up to now."""
        if self._now is None:
            self._now = now
        duration = max(now - self._now, 0.0)
        self._now += duration
        self.axes.advance(duration, self.operation)

    def raw(self, name: str) -> int:
        """Return a register as of the last :meth:`advance`."""
        source = self._computed.get(name)
        if source is None:
            return self._raw[name]
        held = self._held.get(name)
        return source() if held is None else held

    def write(self, name: str, raw: int) -> None:
        """Write a register as a request does: clamped to its limits, unless it is stuck."""
        if name not in self.stuck:
            self._store(name, self._range[name].clamp(raw))

    def value(self, name: str) -> Value:
        """Return a register as a physical value."""
        return self.parameters[name].value_from_raw(self.raw(name))

    def set_value(self, name: str, value: Value) -> None:
        """
        Set any register, read-only ones included, as if by hand at the drive.

        A computed one is held at the value, until :meth:`release` or a power cycle.

        :raises ValueRefused: the value does not fit the parameter.
        """
        raw = self.parameters[name].raw_from_value(value)
        if name in self._computed:
            self._held[name] = raw
        else:
            self._store(name, raw)

    def release(self, name: str) -> None:
        """Compute a register again that was held."""
        self._held.pop(name, None)

    def power_on(self) -> None:
        """Begin anew after a loss of power: only what EEPROM keeps is left."""
        for name, parameter in self.parameters.items():
            if self.is_volatile(parameter):
                self._raw[name] = self._initial(parameter)
        self._held.clear()
        self.operation.power_on()
        self.axes.power_on()

    def trip(self, duration: float = 0.0) -> None:
        """Fail; the cause lasts for some seconds."""
        self.operation.trip(self._now or 0.0, duration)
        self.axes.advance(0.0, self.operation)

    def is_volatile(self, parameter: Parameter) -> bool:
        """Tell whether a power cycle resets a register (of unknown storage: EEPROM)."""
        if parameter.storage is not None:
            return parameter.storage is Storage.RAM
        return (parameter.name in self.axes.setpoints or parameter.name in self._volatile
                or parameter.name == self._control_name)

    # -- inside -----------------------------------------------------------------------------------

    def _store(self, name: str, raw: int) -> None:
        self._raw[name] = raw
        if name == self._control_name:
            self.operation.word_written(raw, self._now or 0.0)
        elif name in self.axes.ramps:
            self.axes.ramps_changed()

    def _source(self, parameter: Parameter) -> Callable[[], int] | None:
        """Return what computes a read-only register; None for a plain one."""
        span = RawRange(parameter, limits=False)
        name = parameter.name
        if name in self.axes.actuals:
            return lambda: span.nearest(self.axes.actual(name))
        word = StatusWord(parameter, self.control)
        if word:
            return lambda: word.compose(self._state(), self._raw[name])
        quantity = names.measured(parameter)
        if quantity is None:
            return None
        measure = self._measure(parameter, quantity)
        return lambda: span.nearest(measure())

    def _measure(self, parameter: Parameter, quantity: Quantity) -> Callable[[], float]:
        """Return what a quantity of the motor amounts to in the parameter's unit."""
        motor = self.axes.motor
        if quantity is Quantity.SPEED:
            setpoint = self.axes.speed_setpoint
            if setpoint is not None and parameter.unit == setpoint.unit:
                return lambda: motor.speed
            return lambda: scales.speed_value(parameter, motor.revolutions_per_second,
                                              motor.share_of_rated_speed)
        if quantity is Quantity.POSITION:
            return lambda: scales.position_value(parameter, motor.position)
        if quantity is Quantity.TEMPERATURE:
            return lambda: scales.temperature_value(parameter, motor.temperature)
        if quantity is Quantity.FAULT_CODE:
            return lambda: FAULT_CODE if self.operation.faulted else 0
        full = scales.rating(parameter, quantity)
        if quantity is Quantity.VOLTAGE:
            if {'motor', 'output'} & set(parameter.name.split('_')):
                return lambda: full * 0.7 * abs(motor.share_of_rated_speed)
            return lambda: full * (1.0 - 0.02 * motor.current + MAINS_SWING * math.sin(
                MAINS_RATE * (self._now or 0.0)))
        if quantity is Quantity.TORQUE:
            return lambda: full * motor.torque
        if quantity is Quantity.POWER:
            return lambda: full * motor.torque * motor.share_of_rated_speed
        if quantity is Quantity.LOAD:
            return lambda: full * abs(motor.torque)
        return lambda: full * motor.current

    def _initial(self, parameter: Parameter) -> int:
        """Return a value that a new drive might have; the same one each time."""
        span = self._range[parameter.name]
        if self.control is not None and parameter.name == self._control_name:
            return self.control.disable
        if parameter.name in self.axes.ramps:
            return span.nearest(self.axes.initial_ramp_value(parameter))
        if parameter.name in self.axes.setpoints or parameter.neutral is not None:
            try:
                return span.clamp(parameter.neutral_raw)
            except ValueRefused:
                return span.clamp(0)
        words = set(parameter.name.split('_'))
        if (parameter.bits or 'status' in words or parameter.type is ParameterType.BOOL
                or parameter.access is Access.WRITE_ONLY):
            return span.clamp(0)
        if {'limit', 'maximum', 'max'} & words:
            return span.nearest(100.0 if parameter.maximum is None else parameter.maximum)
        if {'minimum', 'min'} & words and parameter.minimum is not None:
            return span.nearest(parameter.minimum)
        if parameter.minimum is not None and parameter.maximum is not None:
            return span.nearest(parameter.minimum + (parameter.maximum - parameter.minimum) / 3.0)
        # any figure will do, as long as it is not 0 and differs between parameters
        return span.clamp(10 + zlib.crc32(parameter.name.encode()) % 90)

    def _state(self) -> State:
        motor, operation = self.axes.motor, self.operation
        return State(
            enabled=operation.enabled, stopping=operation.stopping, fault=operation.faulted,
            warning=motor.temperature > WARNING_TEMPERATURE, speed=motor.speed,
            setpoint_reached=operation.enabled and motor.speed == self.axes.target)
