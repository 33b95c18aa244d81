# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A motor behind the registers of any profile, found by the names of the parameters.

What no rule knows is plain memory; docs/simulation.md has the rules as a table.

One setpoint moves the shaft: the first speed or position in the cyclic request, or else the first
speed of the profile, or else the first position. Speeds and positions of the other kind are those
of the shaft then. Any other pair of setpoint and actual value follows on its own, from 0 to its
largest setpoint in a second.

A position goes to its setpoint with finite speed and acceleration. Without torque it rolls to a
standstill, or sinks under its load.
"""

from collections.abc import Callable, Collection, Mapping
from functools import partial
import random

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.simulation import names, scales
from drive_can_bridge.simulation.bounds import Bounds, Reach
from drive_can_bridge.simulation.control import ENDS, machine_of, Operation, Report, StatusWord
from drive_can_bridge.simulation.motor import Motor, Rates, TORQUE_MAX, Travel
from drive_can_bridge.simulation.names import Quantity, RampParameter, RampUse
from drive_can_bridge.simulation.plant import Mechanics, Refusal
from drive_can_bridge.simulation.registers import Registers

#: s from 0 to the rated speed, where the profile has no ramp parameter
RAMP_TIME = 1.0
RAMP_TIME_MIN = 0.01
QUICK_STOP_TIME = 0.2
#: s from rated speed to standstill without torque
COAST_TIME = 4.0
#: share of the rated speed with which the full load sinks
SINKING_SPEED = 0.1

WARNING_TEMPERATURE = 80.0
#: what a fault code shows while there is a fault
FAULT_CODE = 7


class MotorPlant:
    """
    A motor, for profiles of all kinds.

    :param operation: the operating state; None: that of the profile's control section.
    :param movable: parameters that may move something; None: all.
    :ivar speed_setpoint: what moves the shaft, or None: a position does, or nothing.
    """

    def __init__(self, registers: Registers, configuration: DriveConfiguration,
                 mechanics: Mechanics, *, operation: Operation | None = None,
                 movable: Mapping[str, Parameter] | None = None) -> None:
        self.registers = registers
        self.control = control = configuration.profile.control
        self.operation = operation or Operation(machine_of(control))
        self._mechanics = mechanics
        self._noise = random.Random(configuration.name)
        self._jitter = 0    # raw steps by which measured positions are off at the moment
        self._control_name = control_name = control.parameter if control else ''
        self._shown = {p.name for p in configuration.cyclic_response}
        self._fault = fault = configuration.profile.fault
        self._fault_code = float(FAULT_CODE)
        if fault is not None and fault.codes:
            raw = names.likely_fault(fault.codes)
            self._fault_code = float(registers.parameters[fault.parameter].value_from_raw(raw))
        parameters = registers.parameters if movable is None else movable
        pairs = names.pairs(parameters, without=control_name)
        self._setpoints = {pair.setpoint.name for pair in pairs}
        self.volatile: Collection[str] = {*self._setpoints, control_name}
        self._ramps = {ramp.parameter.name: ramp for ramp in names.ramp_parameters(parameters)}
        self._rising, self._falling, self._quick_stop = (
            next((ramp for ramp in reversed(self._ramps.values()) if ramp.use in uses), None)
            for uses in ((RampUse.BOTH, RampUse.RISING), (RampUse.BOTH, RampUse.FALLING),
                         (RampUse.QUICK_STOP,)))
        # a setpoint whose actual value the profile lacks still moves the motor
        mover, quantity = names.mover(pairs, configuration.cyclic_request, control_name)
        by_speed = quantity is Quantity.SPEED
        self.speed_setpoint = speed = mover if by_speed else None
        other_kind = Quantity.POSITION if by_speed else Quantity.SPEED
        self._positioned = mover is not speed
        self._bounds = Bounds(registers, parameters, mover)
        self._travels: dict[str, tuple[Parameter, Travel]] = {}     # by setpoint
        self._followers: dict[str, tuple[Parameter, Travel]] = {}
        self._actuals: dict[str, Callable[[], float]] = {}
        rated, turns, shaft = 1.0, 1.0, Travel()
        if speed is not None:
            rated = scales.rated_speed(speed)
            turns = scales.revolutions_per_unit(speed, rated)
        elif mover is not None:
            self._travels[mover.name] = mover, shaft
            rated, turns = scales.travel_speed(mover), 1.0 / scales.per_revolution(mover)
        self.motor = Motor(rated, turns, mechanics.load, shaft)
        for setpoint, actual in pairs:
            kind = names.quantity_of(setpoint)
            if actual is None or kind is other_kind and setpoint is not speed:
                continue
            if setpoint is speed:
                self._actuals[actual.name] = partial(getattr, self.motor, 'speed')
            elif kind is Quantity.POSITION:
                _, travel = self._travels.setdefault(setpoint.name, (setpoint, Travel()))
                self._actuals[actual.name] = partial(getattr, travel, 'position')
            else:
                _, follower = self._followers[setpoint.name] = setpoint, Travel()
                self._actuals[actual.name] = partial(getattr, follower, 'speed')

    def command(self, value: float) -> float:
        """Return which speed the value of the speed setpoint stands for."""
        return value

    def initial(self, parameter: Parameter) -> int:
        if self.control is not None and parameter.name == self._control_name:
            return self.control.disable
        if parameter.name in self._ramps:
            value = self._initial_ramp(self._ramps[parameter.name])
            return scales.nearest_raw(parameter, value, parameter.raw_limits)
        limit = self._bounds.initial(parameter.name, self.motor.rated_speed)
        if limit is not None:
            return scales.nearest_raw(parameter, limit, parameter.raw_limits)
        if parameter.name in self._setpoints and parameter.neutral is None:
            return scales.clamp(0, parameter.raw_limits)
        return scales.plausible(parameter)

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        ends, nearest = parameter.type.raw_range, scales.nearest_raw
        actual = self._actuals.get(parameter.name)
        quantity = names.measured(parameter)
        if self._fault is not None and parameter.name == self._fault.parameter:
            quantity = Quantity.FAULT_CODE
        elif quantity is None and parameter.name in self._shown:
            quantity = names.BY_UNIT.get(parameter.unit)
        if quantity is Quantity.POSITION:
            where = actual or (lambda: scales.position_value(parameter, self.motor.position))
            return lambda: scales.clamp(nearest(parameter, where(), ends) + self._jitter, ends)
        word = StatusWord(parameter, self.control)
        if actual is None and word:
            return lambda: word.compose(self._report(), self.registers.plain(parameter.name))
        measure = actual or (quantity and self._measure(parameter, quantity))
        return (lambda: nearest(parameter, measure(), ends)) if measure else None

    def _measure(self, parameter: Parameter, quantity: Quantity) -> Callable[[], float]:
        """Return what a quantity of the motor amounts to in the parameter's unit."""
        motor, setpoint = self.motor, self.speed_setpoint
        if quantity is Quantity.SPEED:
            if setpoint is not None and parameter.unit == setpoint.unit:
                return lambda: motor.speed
            return lambda: scales.speed_value(parameter, motor.speed * motor.revolutions,
                                              motor.share_of_rated_speed)
        if quantity is Quantity.TEMPERATURE:
            return lambda: scales.temperature_value(parameter, motor.temperature)
        if quantity is Quantity.FAULT_CODE:
            return lambda: self.operation.fault_code(self._fault_code)
        full = scales.rating(parameter, quantity)
        shares: dict[Quantity, Callable[[], float]] = {
            Quantity.TORQUE: lambda: motor.torque,
            Quantity.POWER: lambda: motor.torque * motor.share_of_rated_speed,
            Quantity.LOAD: lambda: abs(motor.torque),
            Quantity.CURRENT: lambda: motor.current,
            Quantity.VOLTAGE: lambda: (
                1.0 - 0.02 * motor.current + scales.mains_swing(self.operation.now)),
        }
        share = shares[quantity]
        if quantity is Quantity.VOLTAGE and names.words_of(parameter) & {'motor', 'output'}:
            share = lambda: 0.7 * abs(motor.share_of_rated_speed)  # noqa: E731
        return lambda: full * share()

    def refusal(self, parameter: Parameter, raw: int) -> Refusal | None:
        return None

    def written(self, name: str, before: int, raw: int) -> None:
        if name == self._control_name:
            self.operation.word_written(raw)

    @property
    def target(self) -> float:
        """The speed that is commanded."""
        if self.speed_setpoint is None:
            return 0.0
        fastest = self._bounds.speed
        value = self.command(self.registers.commanded(self.speed_setpoint.name))
        return min(max(value, -fastest), fastest)

    def advance(self, now: float) -> None:
        operation = self.operation
        duration = operation.advance(now)
        energised = operation.powered and operation.enabled
        load, noise = self._mechanics.load, self._mechanics.noise
        if duration > 0.0 and noise:
            self._jitter = self._noise.randint(-noise, noise)
        motor, rated = self.motor, self.motor.rated_speed
        torque = self._bounds.torque
        reach = Reach.of(torque, load, 1.0 / COAST_TIME)
        driven = energised and not operation.stopping and reach.speed > 0.0
        falling = self._rate(self._falling, rated / RAMP_TIME)
        rates = reach.rates(Rates(self._rate(self._rising, rated / RAMP_TIME), falling), rated)
        held = not energised and self._mechanics.brake
        # where to, and how fast, as shares of the rated speed, while nothing is commanded
        drift = -SINKING_SPEED * load
        if held or energised and torque >= load:
            drift = 0.0
        stop = 1.0 / COAST_TIME
        if energised:
            stop = min(reach.falling, self._rate(
                self._quick_stop, max(rated / QUICK_STOP_TIME, falling)) / rated)
        for name, (setpoint, follower) in self._followers.items():
            rate = scales.rated_speed(setpoint) / RAMP_TIME
            target = self.registers.commanded(name) if driven else 0.0
            follower.run(duration, target, Rates(rate, rate))
        for name, (setpoint, travel) in self._travels.items():
            limit = scales.travel_speed(setpoint)
            if held:
                travel.speed = 0.0
            if driven:
                travel.go(duration, self.registers.commanded(name),
                          limit * min(reach.speed, 1.0),
                          limit * rates.rising / rated)
            else:
                travel.run(duration, drift * limit, Rates(stop * limit, stop * limit))
        if not self._positioned:
            if held:
                motor.shaft.speed = 0.0
            if duration > 0.0:
                fastest = reach.speed * rated
                motor.shaft.run(
                    duration,
                    min(max(self.target, -fastest), fastest) if driven else drift * rated,
                    rates if driven else Rates(stop * rated, stop * rated))
        motor.advance(duration, energised=energised, torque_max=min(torque, TORQUE_MAX))
        if operation.state in ENDS and motor.speed == 0.0:
            operation.standstill()
            motor.advance(0.0, energised=operation.enabled)

    def power_off(self) -> None:
        """Stand still; the position is kept, as by an absolute encoder."""
        self.motor.shaft.speed = self.motor.shaft.slope = 0.0
        for _, travel in (*self._followers.values(), *self._travels.values()):
            travel.speed = 0.0

    def power_on(self) -> None:
        """Stay where the axis is until a setpoint comes."""
        for name, (_, travel) in self._travels.items():
            self.registers.put(name, travel.position)

    def _report(self) -> Report:
        motor, operation = self.motor, self.operation
        return Report(operation, warning=motor.temperature > WARNING_TEMPERATURE,
                      speed=motor.speed,
                      setpoint_reached=operation.enabled and motor.speed == self.target)

    def _initial_ramp(self, ramp: RampParameter) -> float:
        """Return what a new drive has in a ramp parameter."""
        seconds = QUICK_STOP_TIME if ramp.use is RampUse.QUICK_STOP else RAMP_TIME
        if not ramp.is_time:
            return self.motor.rated_speed / seconds
        return seconds * 1000.0 if ramp.parameter.unit == 'ms' else seconds

    def _rate(self, ramp: RampParameter | None, default: float) -> float:
        """Return what a ramp parameter says, per s."""
        if ramp is None:
            return default
        rated, value = self.motor.rated_speed, self.registers.commanded(ramp.parameter.name)
        if not ramp.is_time:
            return min(max(value, rated / 1000.0), rated / RAMP_TIME_MIN)
        return rated / max(value / 1000.0 if ramp.parameter.unit == 'ms' else value, RAMP_TIME_MIN)
