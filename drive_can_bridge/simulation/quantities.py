# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a parameter measures, found by its name, and how large it is in its unit.

A profile does not mark which of its parameters is a speed. The simulated drive guesses from names,
by the few rules of this module (docs/simulation.md has them as a table). A parameter without a
rule is a plain register: it keeps what is written.

The motor computes shares of its rating. A rating of 100 % of a quantity is the figure of this
module for its unit, made smaller where the parameter cannot carry it.
"""

from collections.abc import Mapping, Sequence
from enum import Enum
import math
import re
from typing import NamedTuple
import zlib

from drive_can_bridge.core.parameters import Parameter, ParameterType

#: revolutions per second at a speed of 1 in the unit; one pole pair, 10 mm per revolution
_REVOLUTIONS = {
    'rpm': 1.0 / 60.0, '1/min': 1.0 / 60.0, 'min-1': 1.0 / 60.0,
    'Hz': 1.0, 'rev/s': 1.0, '1/s': 1.0,
    'rad/s': 0.5 / math.pi, 'deg/s': 1.0 / 360.0, 'mm/s': 0.1, 'm/s': 100.0,
}
#: revolutions per second at rated speed, for a unit without revolutions
_RATED_REVOLUTIONS = 25.0
#: value after one revolution
_PER_REVOLUTION = {'rev': 1.0, 'rad': 2.0 * math.pi, 'deg': 360.0, '°': 360.0,
                   'mm': 10.0, 'm': 0.01}
_INCREMENTS_PER_REVOLUTION = 4096.0
_DEFAULT_RATING = 100.0


class Quantity(Enum):
    """The quantities of parameters, with the words in their names."""

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


_RATINGS = {
    Quantity.TORQUE: {'Nm': 20.0, 'N': 2000.0, 'A': 8.0},
    Quantity.CURRENT: {'A': 10.0, 'mA': 10_000.0},
    Quantity.VOLTAGE: {'V': 560.0, 'mV': 560_000.0, 'kV': 0.56},
    Quantity.POWER: {'W': 3000.0, 'kW': 3.0},
}
MOVING = (Quantity.SPEED, Quantity.POSITION)
#: quantities of parameters that are exchanged cyclically, where the name does not show it
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
    """Return what a parameter measures, or None."""
    words = words_of(parameter)
    if words & {'fault', 'error', 'alarm'} and words & {'code', 'number'}:
        return Quantity.FAULT_CODE
    return next((quantity for quantity in Quantity if words.intersection(quantity.value)), None)


def measured(parameter: Parameter) -> Quantity | None:
    """Return what a read-only parameter shows of the motor; None for settings and the rest."""
    if parameter.writable or words_of(parameter) & _SETTING_WORDS:
        return None
    return quantity_of(parameter)


def mover(found: Sequence[Pair], cyclic: Sequence[Parameter], control: str | None,
          ) -> tuple[Parameter | None, Quantity | None]:
    """
    Return the setpoint that moves the shaft.

    :param cyclic: the cyclic request, in order. What is a speed or a position there counts first,
        by its name or by its unit.
    :param control: name of the control parameter.
    :return: the setpoint, and whether it is a speed or a position.
    """
    for parameter in cyclic:
        quantity = quantity_of(parameter) or BY_UNIT.get(parameter.unit)
        if (quantity in MOVING and parameter.name != control
                and not parameter.limit and not words_of(parameter) & _LIMIT_WORDS):
            return parameter, quantity
    return next(((pair.setpoint, kind) for kind in MOVING for pair in found
                 if quantity_of(pair.setpoint) is kind), (None, None))


def pairs(parameters: Mapping[str, Parameter], *, without: str | None = None) -> list[Pair]:
    """
    Return setpoints and the actual values that follow them; first those that have one.

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
    """Return ``ramp_time``, ``acceleration_time``, ``ramp_down_time``, ``deceleration`` …."""
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
    """Return ``torque_limit``, ``maximum_speed`` … and the limits of the profile."""
    return [
        (parameter, quantity) for parameter in parameters.values()
        if (quantity := quantity_of(parameter)) in (
            Quantity.SPEED, Quantity.TORQUE, Quantity.CURRENT)
        and parameter.writable and (parameter.limit or words_of(parameter) & _UPPER_WORDS)]


def likely_fault(codes: Sequence[tuple[int, str]]) -> int:
    """Return the most likely fault of a drive: an overcurrent, if it has one."""
    known = [raw for raw, _ in codes if raw]
    return next((raw for raw, name in codes if raw and 'overcurrent' in name.lower()),
                known[0] if known else 0)


def words_of(parameter: Parameter) -> frozenset[str]:
    return frozenset(parameter.name.split('_'))


def highest(parameter: Parameter) -> float:
    """Return the largest magnitude a parameter may have: by its limits, else by its type."""
    limits = [limit for limit in (parameter.minimum, parameter.maximum) if limit is not None]
    if parameter.maximum is None:
        limits += parameter.value_range
    return max(map(abs, limits)) or 1.0


def rated_speed(setpoint: Parameter) -> float:
    """Return the speed that a ramp time refers to: the limit of the setpoint, or 100 %."""
    if setpoint.maximum is None and setpoint.unit == '%':
        return _DEFAULT_RATING
    return highest(setpoint)


def travel_speed(setpoint: Parameter) -> float:
    """Return the speed of a position, per s: all its range, or 25 revolutions."""
    return min(highest(setpoint), _RATED_REVOLUTIONS * per_revolution(setpoint))


def revolutions_per_unit(speed: Parameter, rated: float) -> float:
    """Return revolutions per second at a speed of one unit."""
    return _REVOLUTIONS.get(speed.unit, _RATED_REVOLUTIONS / rated)


def speed_value(parameter: Parameter, revolutions: float, share: float) -> float:
    """Return a speed, from revolutions per second and the share of the rated one, in a unit."""
    factor = _REVOLUTIONS.get(parameter.unit)
    if factor is not None:
        return revolutions / factor
    return share * (_DEFAULT_RATING if parameter.unit == '%' else highest(parameter) / 2.0)


def position_value(parameter: Parameter, revolutions: float) -> float:
    """Return a position in a unit; it wraps where the parameter ends, as counters do."""
    value = revolutions * per_revolution(parameter)
    low, high = parameter.value_range
    if parameter.minimum is not None and parameter.maximum is not None:
        low, high = parameter.minimum, parameter.maximum
    span = high - low + abs(parameter.scale)
    return low + math.fmod(math.fmod(value - low, span) + span, span)


def per_revolution(parameter: Parameter) -> float:
    """Return by how much a position changes in one revolution."""
    return _PER_REVOLUTION.get(
        parameter.unit, 1.0 if parameter.scaled else _INCREMENTS_PER_REVOLUTION)


def mains_swing(now: float) -> float:
    """
    Return the deviation of the mains, as a share of the voltage.

    Of a drive at rest it is the one value that moves: it shows that the drive is alive.
    """
    return 0.005 * math.sin(2.0 * math.pi * 0.3 * max(now, 0.0))


def full(unit: str, quantity: Quantity) -> float:
    """Return 100 % of a quantity in a unit."""
    return _RATINGS.get(quantity, {}).get(unit, _DEFAULT_RATING)


def measures(unit: str, quantity: Quantity) -> bool:
    """Return whether a unit is one of a quantity."""
    return unit == '%' or unit in _RATINGS[quantity]


def rating(parameter: Parameter, quantity: Quantity) -> float:
    """Return what a parameter shows at 100 % of a quantity."""
    wanted = full(parameter.unit, quantity)
    # a voltage hardly exceeds its rating, everything else may double
    headroom = 1.2 if quantity is Quantity.VOLTAGE else 2.0
    return min(wanted, highest(parameter) / headroom)


def plausible(parameter: Parameter) -> int:
    """Return a plausible raw integer of a new drive; the same one each time."""
    limits, words = parameter.raw_limits, words_of(parameter)
    low, high = parameter.minimum, parameter.maximum
    if parameter.neutral is not None:
        return clamp(parameter.raw_nearest(parameter.neutral) or 0, limits)
    if (parameter.bits or 'status' in words or parameter.type is ParameterType.BOOL
            or not parameter.readable):
        return clamp(0, limits)
    if {'limit', 'maximum', 'max'} & words:
        value = 100.0 if high is None else high
    elif {'minimum', 'min'} & words:
        value = 0.0 if low is None else low
    elif low is not None and high is not None:
        value = low + (high - low) / 3.0
    else:
        # any figure will do, as long as it is not 0 and differs between parameters
        return clamp(10 + zlib.crc32(parameter.name.encode()) % 90, limits)
    return nearest_raw(parameter, value, limits)


def clamp(raw: int, ends: tuple[int, int]) -> int:
    """Return the integer between two ends that is nearest to another one."""
    return min(max(raw, ends[0]), ends[1])


def nearest_raw(parameter: Parameter, value: float, ends: tuple[int, int]) -> int:
    """
    Return the raw integer nearest to a value.

    :param ends: between which it is: of the parameter's limits, or of its type.
    """
    return clamp(math.floor((value - parameter.offset) / parameter.scale + 0.5), ends)
