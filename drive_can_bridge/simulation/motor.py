# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A motor that moves: speed follows its setpoint with a ramp, and what follows from that.

Not a model of any real machine. It is there so that values look alive, have the right signs, and
react to what is commanded. Time is an argument; all formulas are closed, so that it does not
matter how often time passes.
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
class Travel:
    """
    Something that moves: a speed, and the position that comes of it.

    :ivar slope: rate of change of the speed at the end of the last step.
    """

    position: float = 0.0
    speed: float = 0.0
    slope: float = 0.0

    def run(self, duration: float, target: float, rates: Rates) -> None:
        """Go towards a speed for some time."""
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
        self.position += way + self.speed * max(duration, 0.0)

    def go(self, duration: float, target: float, speed_max: float, acceleration: float) -> None:
        """Go towards a position for some time, as fast as possible and without overshoot."""
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

    :param rated_speed: in whatever unit its shaft moves.
    :param revolutions: revolutions per unit of its way.
    :param load: share of the rated torque that a weight takes.
    :ivar torque: share of the rated torque, with sign.
    :ivar current: share of the rated current, a magnitude.
    :ivar temperature: °C.
    """

    rated_speed: float
    revolutions: float
    load: float = 0.0
    shaft: Travel = field(default_factory=Travel)
    torque: float = 0.0
    current: float = 0.0
    temperature: float = AMBIENT_TEMPERATURE

    @property
    def speed(self) -> float:
        """Speed in the unit of the setpoint."""
        return self.shaft.speed

    @property
    def position(self) -> float:
        """Revolutions since power was applied first."""
        return self.shaft.position * self.revolutions

    @property
    def share_of_rated_speed(self) -> float:
        """Speed as a share of the rated one, with sign."""
        return self.shaft.speed / self.rated_speed

    def advance(self, duration: float, *, energised: bool,
                torque_max: float = TORQUE_MAX) -> None:
        """Record how the shaft has moved for some time, by what torque at most."""
        goal = AMBIENT_TEMPERATURE + TEMPERATURE_RISE * self.current ** 2
        self.temperature += (goal - self.temperature) * -math.expm1(
            -duration / TEMPERATURE_TIME_CONSTANT)
        if not energised:
            self.torque = self.current = 0.0
            return
        speed = self.share_of_rated_speed
        friction = math.copysign(FRICTION_TORQUE, speed) if speed else 0.0
        torque = (LOAD_TORQUE * speed + friction + self.load
                  + INERTIA_TORQUE * self.shaft.slope / self.rated_speed)
        self.torque = min(max(torque, -torque_max), torque_max)
        self.current = math.hypot(MAGNETISING_CURRENT, self.torque)
