# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What of a simulated drive moves: the motor, and every other actual value that follows a setpoint.

One setpoint moves the shaft: the first speed or position in the cyclic request, or else the first
speed of the profile, or else the first position. Speeds and positions of the other kind are those
of the shaft then. Any other pair of setpoint and actual value follows on its own, from 0 to its
largest setpoint in a second.
"""

from collections.abc import Mapping, Sequence

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.simulation import names, scales
from drive_can_bridge.simulation.control import Operation
from drive_can_bridge.simulation.motor import Motor, Ramp, Rates
from drive_can_bridge.simulation.names import Pair, Quantity, RampKind, RampUse

#: s from 0 to the rated speed, where the profile has no ramp parameter
RAMP_TIME = 1.0
RAMP_TIME_MIN = 0.01
QUICK_STOP_TIME = 0.2
#: s from rated speed to standstill without torque
COAST_TIME = 4.0


class Axes:
    """
    Motor and followers of one drive.

    :param registers: raw integers by parameter name; read whenever time passes.
    :param control_name: name of the control parameter, which is no setpoint.
    :param preferred: names of the parameters in the cyclic request.
    :ivar speed_setpoint: what moves the shaft, or None: a position does, or nothing.
    :ivar setpoints: names of all parameters that are setpoints.
    :ivar actuals: the pairs, by the name of the actual value.
    """

    def __init__(self, parameters: Mapping[str, Parameter], registers: Mapping[str, int],
                 control_name: str | None, preferred: Sequence[str] = ()) -> None:
        self._registers = registers
        found = names.pairs(parameters, without=control_name)
        named = names.setpoints(parameters, without=control_name)
        self.setpoints = {p.name for p in named} | {pair.setpoint.name for pair in found}
        self.ramps = {ramp.parameter.name: ramp for ramp in names.ramp_parameters(parameters)}
        # a speed setpoint whose actual value the profile lacks still moves the motor
        mover = _mover([pair.setpoint for pair in found] + named, preferred)
        by_speed = mover is not None and names.quantity_of(mover) is Quantity.SPEED
        self.speed_setpoint = speed = mover if by_speed else None
        other_kind = Quantity.POSITION if by_speed else Quantity.SPEED
        self.actuals = {pair.actual.name: pair for pair in found
                        if names.quantity_of(pair.setpoint) is not other_kind}
        self._mover = mover
        self._followers = {name: Ramp() for name, pair in self.actuals.items()
                           if speed is None or pair.setpoint is not speed}
        rated = scales.rated_speed(speed) if speed else 1.0
        self.motor = Motor(rated, scales.revolutions_per_unit(speed, rated) if speed else 1.0)
        self._coast = Rates(rated / COAST_TIME, rated / COAST_TIME)
        self.ramps_changed()

    @property
    def target(self) -> float:
        """Commanded speed."""
        if self.speed_setpoint is None:
            return 0.0
        return self._value(self.speed_setpoint)

    def actual(self, name: str) -> float:
        """Return the actual value of a pair."""
        follower = self._followers.get(name)
        return self.motor.speed if follower is None else follower.value

    def advance(self, duration: float, operation: Operation) -> None:
        """Let time pass."""
        motor = self.motor
        if operation.stopping:
            target, rates = 0.0, self._quick_stop
        else:
            target, rates = self.target, self._rates
        if not operation.enabled:
            rates = self._coast
        if self.speed_setpoint is None:
            motor.ramp.value = 0.0
        motor.advance(duration, target, rates, energised=operation.enabled)
        for name, ramp in self._followers.items():
            self._follow(self.actuals[name], ramp, duration, operation)
        if operation.stopping and motor.speed == 0.0:
            operation.standstill()
            motor.advance(0.0, 0.0, rates, energised=operation.enabled)

    def power_on(self) -> None:
        """Stand still; the position is kept, as by an absolute encoder."""
        self.motor.ramp = Ramp()
        for name in self._followers:
            self._followers[name] = Ramp()
        self.ramps_changed()

    def initial_ramp_value(self, parameter: Parameter) -> float:
        """Return what a new drive has in a ramp parameter."""
        ramp = self.ramps[parameter.name]
        seconds = QUICK_STOP_TIME if ramp.use is RampUse.QUICK_STOP else RAMP_TIME
        if ramp.kind is RampKind.RATE:
            return self.motor.rated_speed / seconds
        return seconds * 1000.0 if parameter.unit == 'ms' else seconds

    def ramps_changed(self) -> None:
        """Translate the ramp parameters into rates."""
        rated = self.motor.rated_speed
        rising = falling = rated / RAMP_TIME
        quick: float | None = None
        for name, ramp in self.ramps.items():
            if name not in self._registers:
                continue
            value = self._value(ramp.parameter)
            if ramp.kind is RampKind.TIME:
                seconds = value / 1000.0 if ramp.parameter.unit == 'ms' else value
                rate = rated / max(seconds, RAMP_TIME_MIN)
            else:
                rate = min(max(value, rated / 1000.0), rated / RAMP_TIME_MIN)
            if ramp.use is RampUse.QUICK_STOP:
                quick = rate
            if ramp.use in (RampUse.BOTH, RampUse.RISING):
                rising = rate
            if ramp.use in (RampUse.BOTH, RampUse.FALLING):
                falling = rate
        if quick is None:
            quick = max(rated / QUICK_STOP_TIME, falling)
        self._rates = Rates(rising, falling)
        self._quick_stop = Rates(quick, quick)

    def _follow(self, pair: Pair, ramp: Ramp, duration: float, operation: Operation) -> None:
        position = names.quantity_of(pair.setpoint) is Quantity.POSITION
        target = self._value(pair.setpoint)
        if not operation.enabled or operation.stopping:
            # without torque a position stays, and everything else ends
            target = ramp.value if position else 0.0
        rate = scales.rated_speed(pair.setpoint) / RAMP_TIME
        before = ramp.value
        ramp.advance(duration, target, Rates(rate, rate))
        if pair.setpoint is self._mover:
            turns = scales.revolutions_per_position(pair.setpoint)
            self.motor.position += (ramp.value - before) * turns
            self.motor.ramp.value = ramp.slope * turns

    def _value(self, parameter: Parameter) -> float:
        return float(parameter.value_from_raw(self._registers[parameter.name]))


def _mover(candidates: Sequence[Parameter], preferred: Sequence[str]) -> Parameter | None:
    """Choose the setpoint that moves the shaft."""
    def rank(parameter: Parameter) -> tuple[int, bool]:
        place = (preferred.index(parameter.name) if parameter.name in preferred
                 else len(preferred))
        return place, names.quantity_of(parameter) is Quantity.POSITION

    kinds = (Quantity.SPEED, Quantity.POSITION)
    return min((p for p in candidates if names.quantity_of(p) in kinds), key=rank, default=None)
