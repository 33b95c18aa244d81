# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a parameter means, found by its name.

A profile does not say which of its parameters is a speed. The simulated drive guesses from names,
by the few rules of this module (docs/simulation.md has them as a table). A parameter that no rule
takes is a plain register: it keeps what is written.
"""

from collections.abc import Mapping, Sequence
from enum import Enum
import re
from typing import NamedTuple

from drive_can_bridge.core.parameters import Parameter


class Quantity(Enum):
    """What a parameter measures, and the words that say so."""

    # in this order: a "current_position" is a position, a "torque_current" follows the torque
    SPEED = 'speed', 'velocity', 'frequency', 'rpm'
    POSITION = 'position', 'angle'
    TORQUE = 'torque', 'force'
    TEMPERATURE = 'temperature',
    VOLTAGE = 'voltage',
    POWER = 'power',
    LOAD = 'load', 'utilisation', 'utilization'
    CURRENT = 'current',
    FAULT_CODE = ()


_MOVING = (Quantity.SPEED, Quantity.POSITION)
#: what a parameter that is exchanged cyclically means, if its name does not say it
BY_UNIT = {
    **dict.fromkeys(('rpm', '1/min', 'min-1', 'rev/s', 'rad/s', 'deg/s', 'mm/s', 'm/s'),
                    Quantity.SPEED),
    **dict.fromkeys(('rev', 'rad', 'deg', '°', 'mm', 'm'), Quantity.POSITION),
}
_UPPER_WORDS = frozenset(('limit', 'maximum', 'max'))
_LIMIT_WORDS = _UPPER_WORDS | {'minimum', 'min'}
# A "nominal_current" or "speed_limit" is a setting, even where it is read-only.
_SETTING_WORDS = _LIMIT_WORDS | {'nominal', 'rated', 'reference', 'threshold', 'setpoint',
                                 'target', 'command'}
_SETPOINT = re.compile(
    r'(?:setpoint|target|reference)_(?P<after>.+)|(?P<before>.+)_(?:setpoint|reference|command)')
_ACTUALS = ('actual_{}', '{}_actual', 'actual_value_{}', 'motor_{}', '{}_feedback')


class Pair(NamedTuple):
    """A setpoint, and the actual value that follows it, where the profile has one."""

    setpoint: Parameter
    actual: Parameter | None


class RampUse(Enum):
    """Which changes of speed a ramp parameter is for."""

    BOTH = 'both'
    RISING = 'rising'
    FALLING = 'falling'
    QUICK_STOP = 'quick stop'


class RampParameter(NamedTuple):
    """
    A parameter that sets a ramp.

    :param is_time: seconds from 0 to the rated speed; False: a rate.
    """

    parameter: Parameter
    is_time: bool
    use: RampUse


def quantity_of(parameter: Parameter) -> Quantity | None:
    """Tell what a parameter measures, or None."""
    words = words_of(parameter)
    if words & {'fault', 'error', 'alarm'} and words & {'code', 'number'}:
        return Quantity.FAULT_CODE
    return next((quantity for quantity in Quantity if words.intersection(quantity.value)), None)


def measured(parameter: Parameter) -> Quantity | None:
    """Tell what a read-only parameter shows of the motor; None for settings and the rest."""
    if parameter.writable or words_of(parameter) & _SETTING_WORDS:
        return None
    return quantity_of(parameter)


def mover(found: Sequence[Pair], cyclic: Sequence[Parameter], control: str | None,
          ) -> tuple[Parameter | None, Quantity | None]:
    """
    Choose the setpoint that moves the shaft.

    :param cyclic: the cyclic request, in order. What is a speed or a position there counts first,
        by its name or by its unit.
    :param control: name of the control parameter.
    :return: the setpoint, and whether it is a speed or a position.
    """
    for parameter in cyclic:
        quantity = quantity_of(parameter) or BY_UNIT.get(parameter.unit)
        if (quantity in _MOVING and parameter.name != control
                and not parameter.limit and not words_of(parameter) & _LIMIT_WORDS):
            return parameter, quantity
    return next(((pair.setpoint, kind) for kind in _MOVING for pair in found
                 if quantity_of(pair.setpoint) is kind), (None, None))


def pairs(parameters: Mapping[str, Parameter], *, without: str | None = None) -> list[Pair]:
    """
    Find setpoints and the actual values that follow them; first those that have one.

    ``speed_setpoint`` (also ``setpoint_speed``, ``target_speed``, ``speed_reference``,
    ``speed_command``, or a writable ``speed``) goes with a read-only ``actual_speed`` (also
    ``speed_actual``, ``actual_value_…``, ``motor_…``, ``…_feedback``).

    :param without: name of the control parameter, which is no setpoint.
    """
    found = []
    for parameter in parameters.values():
        if not parameter.writable or parameter.name == without or parameter.limit:
            continue
        match = _SETPOINT.fullmatch(parameter.name)
        subject = parameter.name if match is None else match['after'] or match['before']
        actuals = (parameters.get(pattern.format(subject)) for pattern in _ACTUALS)
        actual = next((each for each in actuals if each and not each.writable), None)
        if match or actual:
            found.append(Pair(parameter, actual))
    return sorted(found, key=lambda pair: pair.actual is None)


def ramp_parameters(parameters: Mapping[str, Parameter]) -> list[RampParameter]:
    """Find ``ramp_time``, ``acceleration_time``, ``ramp_down_time``, ``deceleration`` …."""
    found = []
    for parameter in parameters.values():
        words = words_of(parameter)
        rate = bool(words & {'acceleration', 'deceleration'})
        if not parameter.writable or words & _SETTING_WORDS or not (rate or 'ramp' in words):
            continue
        rising = bool(words & {'acceleration', 'up', 'rising', 'start'})
        falling = bool(words & {'deceleration', 'down', 'falling', 'stop', 'braking', 'brake'})
        use = RampUse.BOTH
        if 'quick' in words:
            use = RampUse.QUICK_STOP
        elif rising is not falling:
            use = RampUse.RISING if rising else RampUse.FALLING
        is_time = 'time' in words or parameter.unit in ('s', 'ms') or not rate
        found.append(RampParameter(parameter, is_time, use))
    return found


def limits(parameters: Mapping[str, Parameter]) -> list[tuple[Parameter, Quantity]]:
    """Find ``torque_limit``, ``maximum_speed`` … and what is a limit by its profile."""
    return [
        (parameter, quantity) for parameter in parameters.values()
        if (quantity := quantity_of(parameter)) in (
            Quantity.SPEED, Quantity.TORQUE, Quantity.CURRENT)
        and parameter.writable and (parameter.limit or words_of(parameter) & _UPPER_WORDS)]


def likely_fault(codes: Sequence[tuple[int, str]]) -> int:
    """Return what a drive trips with most of all: an overcurrent, if it knows one."""
    known = [raw for raw, _ in codes if raw]
    return next((raw for raw, name in codes if raw and 'overcurrent' in name.lower()),
                known[0] if known else 0)


def crossings(parameters: Mapping[str, Parameter]) -> dict[str, list[tuple[str, str]]]:
    """
    Find settings of which one must not exceed the other: ``minimum_speed``, ``maximum_speed``.

    :return: names of the lower and the upper end, by the name of either.
    """
    found: dict[str, list[tuple[str, str]]] = {}
    for low in parameters.values():
        name = re.sub('(^|_)min(imum)?(?=_|$)', r'\1max\2', low.name, count=1)
        high = parameters.get(name) if name != low.name else None
        if high is not None and low.writable and high.writable and low.unit == high.unit:
            for end in (low, high):
                found.setdefault(end.name, []).append((low.name, high.name))
    return found


def words_of(parameter: Parameter) -> frozenset[str]:
    return frozenset(parameter.name.split('_'))
