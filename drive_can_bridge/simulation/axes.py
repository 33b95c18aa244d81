# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What of a simulated drive moves: the motor, and every other actual value that follows a setpoint.

One setpoint moves the shaft: the first speed or position in the cyclic request, or else the first
speed of the profile, or else the first position. Speeds and positions of the other kind are those
of the shaft then. Any other pair of setpoint and actual value follows on its own, from 0 to its
largest setpoint in a second.

A position goes to its setpoint with finite speed and acceleration. Without torque it rolls to a
standstill, or sinks under its load.
"""

from collections.abc import Callable, Mapping
from functools import partial
import random

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.simulation import names, scales
from drive_can_bridge.simulation.control import ENDS, Operation
from drive_can_bridge.simulation.motor import Motor, Rates, Travel
from drive_can_bridge.simulation.names import Quantity, RampParameter, RampUse
from drive_can_bridge.simulation.plant import Mechanics
from drive_can_bridge.simulation.registers import Registers

#: s from 0 to the rated speed, where the profile has no ramp parameter
RAMP_TIME = 1.0
RAMP_TIME_MIN = 0.01
QUICK_STOP_TIME = 0.2
#: s from rated speed to standstill without torque
COAST_TIME = 4.0
#: share of the rated speed with which the full load sinks
SINKING_SPEED = 0.1


class Axes:
    """
    Motor and followers of one drive.

    :param parameters: those that may move something.
    :param command: what becomes of the value of the speed setpoint.
    :ivar speed_setpoint: what moves the shaft, or None: a position does, or nothing.
    :ivar setpoints: names of all parameters that are setpoints.
    :ivar actuals: what gives the actual values that follow a setpoint, by their names.
    :ivar jitter: raw steps by which measured positions are off at the moment.
    """

    def __init__(self, parameters: Mapping[str, Parameter], registers: Registers,
                 configuration: DriveConfiguration, mechanics: Mechanics,
                 command: Callable[[float], float]) -> None:
        self._registers = registers
        self._mechanics = mechanics
        self._command = command
        self._noise = random.Random(configuration.name)
        self.jitter = 0
        control = configuration.profile.control
        control_name = control.parameter if control else None
        pairs = names.pairs(parameters, without=control_name)
        self.setpoints = {pair.setpoint.name for pair in pairs}
        self.ramps = {ramp.parameter.name: ramp for ramp in names.ramp_parameters(parameters)}
        self._rising, self._falling, self._quick_stop = (
            next((ramp for ramp in reversed(self.ramps.values()) if ramp.use in uses), None)
            for uses in ((RampUse.BOTH, RampUse.RISING), (RampUse.BOTH, RampUse.FALLING),
                         (RampUse.QUICK_STOP,)))
        # a setpoint whose actual value the profile lacks still moves the motor
        mover, quantity = names.mover(pairs, configuration.cyclic_request, control_name)
        by_speed = quantity is Quantity.SPEED
        self.speed_setpoint = speed = mover if by_speed else None
        other_kind = Quantity.POSITION if by_speed else Quantity.SPEED
        self._mover = mover.name if mover else ''
        self._travels: dict[str, tuple[Parameter, Travel]] = {}     # by setpoint
        self._followers: dict[str, tuple[Parameter, Travel]] = {}
        self.actuals: dict[str, Callable[[], float]] = {}
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
                self.actuals[actual.name] = partial(getattr, self.motor, 'speed')
            elif kind is Quantity.POSITION:
                _, travel = self._travels.setdefault(setpoint.name, (setpoint, Travel()))
                self.actuals[actual.name] = partial(getattr, travel, 'position')
            else:
                _, follower = self._followers[setpoint.name] = setpoint, Travel()
                self.actuals[actual.name] = partial(getattr, follower, 'speed')

    @property
    def target(self) -> float:
        if self.speed_setpoint is None:
            return 0.0
        return self._command(self._registers.commanded(self.speed_setpoint.name))

    def advance(self, duration: float, operation: Operation) -> None:
        energised = operation.powered and operation.enabled
        load, noise = self._mechanics.load, self._mechanics.noise
        if duration > 0.0 and noise:
            self.jitter = self._noise.randint(-noise, noise)
        motor, rated = self.motor, self.motor.rated_speed
        driven = energised and not operation.stopping
        falling = self._rate(self._falling, rated / RAMP_TIME)
        rates = Rates(self._rate(self._rising, rated / RAMP_TIME), falling)
        held = not energised and self._mechanics.brake
        # where to, and how fast, as shares of the rated speed, while nothing is commanded
        drift = 0.0 if energised or held else -SINKING_SPEED * load
        stop = 1.0 / COAST_TIME
        if energised:
            stop = self._rate(self._quick_stop, max(rated / QUICK_STOP_TIME, falling)) / rated
        for name, (setpoint, follower) in self._followers.items():
            rate = scales.rated_speed(setpoint) / RAMP_TIME
            target = self._registers.commanded(name) if driven else 0.0
            follower.run(duration, target, Rates(rate, rate))
        for name, (setpoint, travel) in self._travels.items():
            limit = scales.travel_speed(setpoint)
            if held:
                travel.speed = 0.0
            if driven:
                travel.go(duration, self._registers.commanded(name), limit,
                          limit * rates.rising / rated)
            else:
                travel.run(duration, drift * limit, Rates(stop * limit, stop * limit))
        if self._mover not in self._travels:
            if held:
                motor.shaft.speed = 0.0
            if duration > 0.0:
                motor.shaft.run(duration, self.target if driven else drift * rated,
                                rates if driven else Rates(stop * rated, stop * rated))
        motor.advance(duration, energised=energised)
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
            self._registers.put(name, travel.position)

    def initial_ramp_value(self, parameter: Parameter) -> float:
        """Return what a new drive has in a ramp parameter."""
        ramp = self.ramps[parameter.name]
        seconds = QUICK_STOP_TIME if ramp.use is RampUse.QUICK_STOP else RAMP_TIME
        if not ramp.is_time:
            return self.motor.rated_speed / seconds
        return seconds * 1000.0 if parameter.unit == 'ms' else seconds

    def _rate(self, ramp: RampParameter | None, default: float) -> float:
        """Return what a ramp parameter says, per s."""
        if ramp is None:
            return default
        rated, value = self.motor.rated_speed, self._registers.commanded(ramp.parameter.name)
        if not ramp.is_time:
            return min(max(value, rated / 1000.0), rated / RAMP_TIME_MIN)
        return rated / max(value / 1000.0 if ramp.parameter.unit == 'ms' else value, RAMP_TIME_MIN)
