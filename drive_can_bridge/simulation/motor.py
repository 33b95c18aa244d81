# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A motor that moves: speed follows its setpoint with a ramp, and what follows from that.

Not a model of any real machine. It is there so that values look alive, have the right signs, and
react to what is commanded. Time is an argument; all formulas are closed, so that it does not
matter how often :meth:`Motor.advance` is called.
"""

from dataclasses import dataclass, field
import math

#: shares of the rated torque: at rated speed, at any speed, at one rated speed per second
LOAD_TORQUE = 0.30
FRICTION_TORQUE = 0.05
INERTIA_TORQUE = 0.35
TORQUE_MAX = 2.0
#: share of the rated current that an energised motor takes without any torque
MAGNETISING_CURRENT = 0.2

AMBIENT_TEMPERATURE = 25.0
#: °C above ambient that rated current leads to in the end
TEMPERATURE_RISE = 50.0
TEMPERATURE_TIME_CONSTANT = 120.0


@dataclass(frozen=True)
class Rates:
    """How fast a value may move away from zero and towards it, per second."""

    rising: float
    falling: float


@dataclass
class Ramp:
    """
    A value that follows its target at a limited rate.

    :ivar slope: rate of change at the end of the last step.
    """

    value: float = 0.0
    slope: float = 0.0

    def advance(self, duration: float, target: float, rates: Rates) -> float:
        """
        Go towards the target for some time.

        :return: integral of the value over the duration.
        """
        integral = self.slope = 0.0
        while duration > 0.0 and self.value != target:
            before, goal = self.value, target if self.value * target >= 0.0 else 0.0
            rate = rates.rising if abs(goal) > abs(before) else rates.falling
            needed = abs(goal - before) / rate
            if needed <= duration:
                self.value = goal
            else:
                needed, self.slope = duration, math.copysign(rate, goal - before)
                self.value += self.slope * duration
            integral += (before + self.value) / 2.0 * needed
            duration -= needed
        return integral + self.value * max(duration, 0.0)


@dataclass
class Travel:
    """
    A position that goes to its target with limited speed and acceleration.

    :ivar slope: rate of change of the speed at the end of the last step.
    """

    position: float = 0.0
    speed: float = 0.0
    slope: float = 0.0

    def go(self, duration: float, target: float, speed_max: float, acceleration: float) -> None:
        """Go towards the target for some time, as fast as possible and without overshoot."""
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

    def run(self, duration: float, speed: float, rate: float) -> None:
        """Go to a speed instead, and on with it."""
        ramp = Ramp(self.speed)
        self.position += ramp.advance(duration, speed, Rates(rate, rate))
        self.speed, self.slope = ramp.value, ramp.slope


@dataclass
class Motor:
    """
    Speed, position, torque, current and temperature of a motor.

    :param rated_speed: in whatever unit speed setpoints have.
    :param revolutions: revolutions per second at a speed of one unit.
    :param load: share of the rated torque that a weight takes.
    :ivar position: revolutions since power was applied first.
    :ivar torque: share of the rated torque, with sign.
    :ivar current: share of the rated current, a magnitude.
    :ivar temperature: °C.
    """

    rated_speed: float
    revolutions: float
    load: float = 0.0
    ramp: Ramp = field(default_factory=Ramp)
    position: float = 0.0
    torque: float = 0.0
    current: float = 0.0
    temperature: float = AMBIENT_TEMPERATURE

    @property
    def speed(self) -> float:
        """Speed in the unit of the setpoint."""
        return self.ramp.value

    @property
    def share_of_rated_speed(self) -> float:
        """Speed as a share of the rated one, with sign."""
        return self.ramp.value / self.rated_speed

    def advance(self, duration: float, target: float, rates: Rates, *, energised: bool) -> None:
        travelled = self.ramp.advance(duration, target, rates) if duration > 0.0 else 0.0
        self.moved(duration, travelled, energised=energised)

    def moved(self, duration: float, travelled: float, *, energised: bool) -> None:
        """Take note of a way in units of speed times s: position, temperature, torque."""
        self.position += travelled * self.revolutions
        goal = AMBIENT_TEMPERATURE + TEMPERATURE_RISE * self.current ** 2
        self.temperature += (goal - self.temperature) * -math.expm1(
            -duration / TEMPERATURE_TIME_CONSTANT)
        if not energised:
            self.torque = self.current = 0.0
            return
        speed = self.share_of_rated_speed
        friction = math.copysign(FRICTION_TORQUE, speed) if speed else 0.0
        torque = (LOAD_TORQUE * speed + friction + self.load
                  + INERTIA_TORQUE * self.ramp.slope / self.rated_speed)
        self.torque = min(max(torque, -TORQUE_MAX), TORQUE_MAX)
        self.current = math.hypot(MAGNETISING_CURRENT, self.torque)
