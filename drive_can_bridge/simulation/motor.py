# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A motor behind the registers of any profile, found by the names of the parameters.

What no rule knows is plain memory; docs/simulation.md has the rules as a table.

One setpoint moves the shaft: the first speed or position in the cyclic request, or else the first
speed of the profile, or else the first position. Speeds and positions of the other kind are those
of the shaft then. Any other setpoint that has an actual value is followed on its own, from 0 to
the largest in a second.

A position goes to its setpoint with finite speed and acceleration. Without torque it rolls to a
standstill, or sinks under its load.

Not a model of any real machine. It makes values look alive, have the right signs, and
react to commands. Time is an argument; all formulas are closed, so that it does not
matter how often time passes.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
import math
import random

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.continuous import steps_of
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.simulation import quantities
from drive_can_bridge.simulation.drive_machine import (
    ENDS, machine_of, MachineStatus, OperatingState, StatusWord)
from drive_can_bridge.simulation.quantities import Quantity, RampParameter, RampUse
from drive_can_bridge.simulation.registers import Mechanics, Registers, WriteRefusal

#: shares of the rated torque: at rated speed, at any speed, at one rated speed per second
LOAD_TORQUE = 0.30
FRICTION_TORQUE = 0.05
INERTIA_TORQUE = 0.35
TORQUE_MAX = 2.0
#: share of the rated current of an energised motor without any torque
MAGNETISING_CURRENT = 0.2

AMBIENT_TEMPERATURE = 25.0
#: °C above ambient that rated current leads to in the end
TEMPERATURE_RISE = 50.0
TEMPERATURE_TIME_CONSTANT = 120.0
#: s from 0 to the rated speed, where the profile has no ramp parameter
RAMP_TIME = 1.0
RAMP_TIME_MIN = 0.01
QUICK_STOP_TIME = 0.2
#: s from rated speed to standstill without torque
COAST_TIME = 4.0
#: share of the rated speed with which the full load sinks
SINKING_SPEED = 0.1

WARNING_TEMPERATURE = 80.0
#: raw steps before its end at which a counter that wraps begins, at most
_BEFORE_END = 1000
#: what a fault code shows while there is a fault
FAULT_CODE = 7


@dataclass(frozen=True)
class Rates:
    """How fast a value may move away from zero and towards it, per second."""

    rising: float
    falling: float


@dataclass
class Travel:
    """
    Something that moves: a speed, and the position that follows from it.

    :ivar slope: rate of change of the speed at the end of the last step.
    """

    position: float = 0.0
    speed: float = 0.0
    slope: float = 0.0

    def run(self, duration: float, target: float, rates: Rates) -> None:
        """Accelerate towards a speed for some time; in no time the slope stays."""
        if duration <= 0.0:
            return
        way = self.slope = 0.0
        while duration > 0.0 and self.speed != target:
            before, goal = self.speed, target if self.speed * target >= 0.0 else 0.0
            rate = rates.rising if abs(goal) > abs(before) else rates.falling
            needed = abs(goal - before) / rate
            if needed <= duration:
                self.speed = goal
            else:
                needed, self.slope = duration, math.copysign(rate, goal - before)
                self.speed += self.slope * duration
            way += (before + self.speed) / 2.0 * needed
            duration -= needed
        self.position += way + self.speed * duration

    def go(self, duration: float, target: float, speed_max: float, acceleration: float) -> None:
        """Move towards a position for some time, as fast as possible and without overshoot."""
        distance = target - self.position
        braking = self.speed * abs(self.speed) / (2.0 * acceleration)
        way = math.copysign(1.0, self.speed if distance == braking else distance - braking)
        # from here on the target lies ahead: speed up (or down) to the peak, cruise, brake
        distance, speed = distance * way, self.speed * way
        peak = min(speed_max, math.sqrt(
            max(acceleration * distance + speed * speed / 2.0, 0.0)))
        change = math.copysign(acceleration, peak - speed)
        first = (peak - speed) / change
        covered = (speed + peak) / 2.0 * first
        cruise = max(distance - covered - peak * peak / (2.0 * acceleration), 0.0)
        second = cruise / peak if peak else 0.0
        left = first + second + peak / acceleration - duration
        if left <= 0.0:
            self.position, self.speed, self.slope = target, 0.0, 0.0
            return
        if duration < first:
            moved = speed * duration + change * duration * duration / 2.0
            speed, slope = speed + change * duration, change
        elif duration < first + second:
            moved, speed, slope = covered + peak * (duration - first), peak, 0.0
        else:
            moved = distance - acceleration * left * left / 2.0
            speed, slope = acceleration * left, -acceleration
        self.position += way * moved
        self.speed, self.slope = way * speed, way * slope


@dataclass
class Motor:
    """
    Torque, current and temperature of a motor.

    :param rated_speed: in the unit of its shaft.
    :param load: share of the rated torque for a weight.
    :ivar torque: share of the rated torque, with sign.
    :ivar current: share of the rated current, a magnitude.
    :ivar temperature: °C.
    """

    rated_speed: float
    load: float = 0.0
    shaft: Travel = field(default_factory=Travel)
    torque: float = 0.0
    current: float = 0.0
    temperature: float = AMBIENT_TEMPERATURE

    @property
    def share(self) -> float:
        """The speed as a share of the rated one, with sign."""
        return self.shaft.speed / self.rated_speed

    def advance(self, duration: float, *, energised: bool,
                torque_max: float = TORQUE_MAX) -> None:
        """Update torque and temperature from the shaft's movement, within a largest torque."""
        goal = AMBIENT_TEMPERATURE + TEMPERATURE_RISE * self.current ** 2
        self.temperature += (goal - self.temperature) * -math.expm1(
            -duration / TEMPERATURE_TIME_CONSTANT)
        self.torque = self.current = 0.0
        if energised:
            friction = math.copysign(FRICTION_TORQUE, self.share) if self.share else 0.0
            torque = (LOAD_TORQUE * self.share + friction + self.load
                      + INERTIA_TORQUE * self.shaft.slope / self.rated_speed)
            self.torque = min(max(torque, -torque_max), torque_max)
            self.current = math.hypot(MAGNETISING_CURRENT, self.torque)


class MotorPlant:
    """
    A motor, for profiles of all kinds.

    :param operation: the operating state; None: that of the profile's control section.
    :param movable: parameters that may move something; None: all.
    :ivar speed_setpoint: what moves the shaft, or None: a position does, or nothing.
    """

    def __init__(self, registers: Registers, configuration: DriveConfiguration,
                 mechanics: Mechanics, *, operation: OperatingState | None = None,
                 movable: Mapping[str, Parameter] | None = None) -> None:
        self.registers = registers
        self.control = control = configuration.profile.control
        self._joint = configuration.joint
        self.operation = operation or OperatingState(machine_of(control))
        self._mechanics = mechanics
        self._noise = random.Random(configuration.name)
        self._jitter = 0    # raw steps by which measured positions are off at the moment
        self._control_name = control_name = control.parameter if control else ''
        self._shown = {p.name for p in configuration.cyclic_response}
        self._fault = fault = configuration.profile.fault
        self._fault_code = float(FAULT_CODE)
        if fault is not None and fault.codes:
            raw = quantities.likely_fault(fault.codes)
            self._fault_code = float(registers.parameters[fault.parameter].value_from_raw(raw))
        parameters = registers.parameters if movable is None else movable
        pairs = quantities.pairs(parameters, without=control_name)
        self._setpoints = {pair.setpoint.name for pair in pairs}
        self.volatile: Collection[str] = {*self._setpoints, control_name}
        self._ramps = {ramp.parameter.name: ramp
                       for ramp in quantities.ramp_parameters(parameters)}
        self._rising, self._falling, self._quick_stop = (
            next((ramp for ramp in reversed(self._ramps.values()) if ramp.use in uses), None)
            for uses in ((RampUse.BOTH, RampUse.RISING), (RampUse.BOTH, RampUse.FALLING),
                         (RampUse.QUICK_STOP,)))
        # a setpoint whose actual value the profile lacks still moves the motor
        mover, quantity = quantities.mover(pairs, configuration.cyclic_request, control_name)
        self._mover = mover
        self.speed_setpoint = mover if quantity is Quantity.SPEED else None
        self._bounds = {
            parameter.name: (parameter, kind) for parameter, kind in quantities.limits(parameters)
            if parameter is not mover and (
                mover and parameter.unit == mover.unit if kind is Quantity.SPEED
                else quantities.measures(parameter.unit, kind))}
        rated = self._turns = 1.0     # revolutions per unit of the way
        if mover is not None and quantity is Quantity.SPEED:
            rated = quantities.rated_speed(mover)
            self._turns = quantities.revolutions_per_unit(mover, rated)
        elif mover is not None:
            rated = quantities.travel_speed(mover)
            self._turns = 1.0 / quantities.per_revolution(mover)
        self.motor = Motor(rated, mechanics.load)
        self._followers: dict[str, tuple[Parameter, Travel]] = {}
        self._actuals: dict[str, Callable[[], float]] = {}
        for setpoint, actual in pairs:
            kind = quantities.quantity_of(setpoint)
            if actual is None:
                continue
            if setpoint is mover:
                self._actuals[actual.name] = partial(
                    getattr, self.motor.shaft,
                    'speed' if quantity is Quantity.SPEED else 'position')
            elif kind not in quantities.MOVING or kind is quantity:
                _, follower = self._followers[setpoint.name] = setpoint, Travel()
                self._actuals[actual.name] = partial(getattr, follower, 'speed')

    def command(self, value: float) -> float:
        """Return the speed for a value of the speed setpoint."""
        return value

    def initial(self, parameter: Parameter) -> int:
        name, value = parameter.name, None
        _, bound = self._bounds.get(name, (None, None))
        if self.control is not None and name == self._control_name:
            return self.control.disable
        if name in self._ramps:
            value = self._initial_ramp(self._ramps[name])
        elif bound and parameter.neutral is None and parameter.maximum is None:
            # a new drive is not limited
            value = self.motor.rated_speed if bound is Quantity.SPEED else quantities.full(
                parameter.unit, bound)
        elif name in self._setpoints and parameter.neutral is None:
            return quantities.clamp(0, parameter.raw_limits)
        if value is None:
            return quantities.plausible(parameter)
        return quantities.nearest_raw(parameter, value, parameter.raw_limits)

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        ends, nearest = parameter.type.raw_range, quantities.nearest_raw
        actual = self._actuals.get(parameter.name)
        quantity = quantities.measured(parameter)
        if self._fault is not None and parameter.name == self._fault.parameter:
            quantity = Quantity.FAULT_CODE
        elif quantity is None and parameter.name in self._shown:
            quantity = quantities.BY_UNIT.get(parameter.unit)
        if quantity is Quantity.POSITION:
            where = actual or (lambda: quantities.position_value(
                parameter, self.motor.shaft.position * self._turns))
            if self._joint is not None and parameter.name == self._joint.position and (
                    self._joint.continuous is not False):
                return partial(self._counter, parameter, self._joint.continuous, where)
            return lambda: quantities.clamp(nearest(parameter, where(), ends) + self._jitter, ends)
        word = StatusWord(parameter, self.control)
        if actual is None and word:
            return lambda: word.compose(self._report(), self.registers.plain(parameter.name))
        measure = actual or (quantity and self._measure(parameter, quantity))
        return (lambda: nearest(parameter, measure(), ends)) if measure else None

    def _counter(self, parameter: Parameter, continuous: bool | int,
                 where: Callable[[], float]) -> int:
        """Return the value of a counter that wraps; it starts near its end."""
        steps = steps_of(parameter, continuous)
        low = -(steps // 2) if parameter.type.signed else 0
        first = low + steps - min(steps // 8, _BEFORE_END)
        moved = math.floor(parameter.steps(where()) - parameter.steps(0.0) + 0.5) + self._jitter
        return (first + moved - low) % steps + low

    def _measure(self, parameter: Parameter, quantity: Quantity) -> Callable[[], float]:
        """Return a quantity of the motor in the parameter's unit."""
        motor, setpoint = self.motor, self.speed_setpoint
        if quantity is Quantity.SPEED:
            if setpoint is not None and parameter.unit == setpoint.unit:
                return lambda: motor.shaft.speed
            return lambda: quantities.speed_value(
                parameter, motor.shaft.speed * self._turns, motor.share)
        if quantity is Quantity.TEMPERATURE:
            return lambda: motor.temperature
        if quantity is Quantity.FAULT_CODE:
            return lambda: self.operation.fault_code(self._fault_code)
        full = quantities.rating(parameter, quantity)
        shares: dict[Quantity, Callable[[], float]] = {
            Quantity.TORQUE: lambda: motor.torque,
            Quantity.POWER: lambda: motor.torque * motor.share,
            Quantity.LOAD: lambda: abs(motor.torque),
            Quantity.CURRENT: lambda: motor.current,
            Quantity.VOLTAGE: lambda: (
                1.0 - 0.02 * motor.current + quantities.mains_swing(self.operation.now)),
        }
        share = shares[quantity]
        if quantity is Quantity.VOLTAGE and quantities.words_of(parameter) & {'motor', 'output'}:
            share = lambda: 0.7 * abs(motor.share)  # noqa: E731
        return lambda: full * share()

    def refusal(self, parameter: Parameter, raw: int) -> WriteRefusal | None:
        return None

    def written(self, name: str, before: int, raw: int) -> None:
        if name == self._control_name:
            self.operation.word_written(raw)

    @property
    def target(self) -> float:
        """The commanded speed."""
        if self.speed_setpoint is None:
            return 0.0
        fastest = self._bound(Quantity.SPEED)
        value = self.command(self.registers.commanded(self.speed_setpoint.name))
        return min(max(value, -fastest), fastest)

    def _bound(self, *kinds: Quantity) -> float:
        """Return the least of some limits: the speed, or a share of the rated torque."""
        found = math.inf
        for parameter, kind in self._bounds.values():
            if kind in kinds:
                value = max(self.registers.commanded(parameter.name), 0.0)
                if kind is not Quantity.SPEED:
                    value /= quantities.full(parameter.unit, kind)
                if kind is Quantity.CURRENT:    # a part of it makes no torque
                    value = math.sqrt(max(value ** 2 - MAGNETISING_CURRENT ** 2, 0.0))
                found = min(found, value)
        return found

    def advance(self, now: float) -> None:
        operation, motor = self.operation, self.motor
        duration = operation.advance(now)
        energised = operation.powered and operation.enabled
        if duration > 0.0 and self._mechanics.noise:
            self._jitter = self._noise.randint(-self._mechanics.noise, self._mechanics.noise)
        torque = self._bound(Quantity.TORQUE, Quantity.CURRENT)
        able = energised and torque > FRICTION_TORQUE + self._mechanics.load
        for name, (setpoint, follower) in self._followers.items():
            rate = quantities.rated_speed(setpoint) / RAMP_TIME
            driven = able and not operation.stopping
            follower.run(duration, self.registers.commanded(name) if driven else 0.0,
                         Rates(rate, rate))
        self._move(duration, energised=energised, able=able)
        motor.advance(duration, energised=energised, torque_max=min(torque, TORQUE_MAX))
        if operation.state in ENDS and motor.shaft.speed == 0.0:
            operation.standstill()
            motor.advance(0.0, energised=operation.enabled)

    def _move(self, duration: float, *, energised: bool, able: bool) -> None:
        """Move the shaft: by torque, if there is enough, else it runs down or sinks."""
        shaft, rated = self.motor.shaft, self.motor.rated_speed
        if self._mechanics.brake and not energised:
            shaft.speed = shaft.slope = 0.0
        elif not able:
            coasting = rated / COAST_TIME
            shaft.run(duration, -SINKING_SPEED * self._mechanics.load * rated,
                      Rates(coasting, coasting))
        elif self.operation.stopping:
            rate = self._rate(self._quick_stop, rated / QUICK_STOP_TIME)
            shaft.run(duration, 0.0, Rates(rate, rate))
        else:
            rates = Rates(*(self._rate(ramp, rated / RAMP_TIME)
                            for ramp in (self._rising, self._falling)))
            if self._mover is None or self.speed_setpoint is not None:
                shaft.run(duration, self.target, rates)
            else:
                shaft.go(duration, self.registers.commanded(self._mover.name), rated,
                         rates.rising)

    def power_off(self) -> None:
        """Stop all shafts; positions are kept, as by an absolute encoder."""
        for travel in (self.motor.shaft, *(each for _, each in self._followers.values())):
            travel.speed = travel.slope = 0.0

    def power_on(self) -> None:
        """Stay where the axis is until a setpoint comes."""
        if self._mover is not None and self.speed_setpoint is None:
            self.registers.put(self._mover.name, self.motor.shaft.position)

    def _report(self) -> MachineStatus:
        motor, operation = self.motor, self.operation
        return MachineStatus(operation, warning=motor.temperature > WARNING_TEMPERATURE,
                      speed=motor.shaft.speed,
                      setpoint_reached=operation.enabled and motor.shaft.speed == self.target)

    def _initial_ramp(self, ramp: RampParameter) -> float:
        """Return the initial content of a ramp parameter."""
        seconds = QUICK_STOP_TIME if ramp.use is RampUse.QUICK_STOP else RAMP_TIME
        if not ramp.is_time:
            return self.motor.rated_speed / seconds
        return seconds * 1000.0 if ramp.parameter.unit == 'ms' else seconds

    def _rate(self, ramp: RampParameter | None, default: float) -> float:
        """Return the rate of a ramp parameter, per s."""
        if ramp is None:
            return default
        rated, value = self.motor.rated_speed, self.registers.commanded(ramp.parameter.name)
        if not ramp.is_time:
            return min(max(value, rated / 1000.0), rated / RAMP_TIME_MIN)
        return rated / max(value / 1000.0 if ramp.parameter.unit == 'ms' else value, RAMP_TIME_MIN)
