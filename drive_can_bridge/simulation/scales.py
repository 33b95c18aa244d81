# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How large the quantities of a simulated drive are in the units of its profile.

The motor computes shares of its rating. A rating of 100 % of a quantity is the figure of this
module for its unit, made smaller where the parameter cannot carry it.
"""

import math
import zlib

from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.simulation.names import Quantity, words_of

#: revolutions per second at a speed of 1 in the unit; one pole pair, 10 mm per revolution
_REVOLUTIONS = {
    'rpm': 1.0 / 60.0, '1/min': 1.0 / 60.0, 'min-1': 1.0 / 60.0,
    'Hz': 1.0, 'rev/s': 1.0, '1/s': 1.0,
    'rad/s': 0.5 / math.pi, 'deg/s': 1.0 / 360.0, 'mm/s': 0.1, 'm/s': 100.0,
}
#: revolutions per second at rated speed, for a unit that says nothing about revolutions
_RATED_REVOLUTIONS = 25.0
#: value after one revolution
_PER_REVOLUTION = {'rev': 1.0, 'rad': 2.0 * math.pi, 'deg': 360.0, '°': 360.0,
                   'mm': 10.0, 'm': 0.01}
_INCREMENTS_PER_REVOLUTION = 4096.0

_RATINGS = {
    Quantity.TORQUE: {'Nm': 20.0, 'N': 2000.0, 'A': 8.0},
    Quantity.CURRENT: {'A': 10.0, 'mA': 10_000.0},
    Quantity.VOLTAGE: {'V': 560.0, 'mV': 560_000.0, 'kV': 0.56},
    Quantity.POWER: {'W': 3000.0, 'kW': 3.0},
}
_DEFAULT_RATING = 100.0


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
    """Return how fast a position moves, per s: over all its range, or 25 revolutions."""
    return min(highest(setpoint), _RATED_REVOLUTIONS * per_revolution(setpoint))


def revolutions_per_unit(speed: Parameter, rated: float) -> float:
    """Return revolutions per second at a speed of one unit."""
    return _REVOLUTIONS.get(speed.unit, _RATED_REVOLUTIONS / rated)


def speed_value(parameter: Parameter, revolutions: float, share: float) -> float:
    """Express a speed, given in revolutions per second and as share of the rated one."""
    factor = _REVOLUTIONS.get(parameter.unit)
    if factor is not None:
        return revolutions / factor
    return share * (_DEFAULT_RATING if parameter.unit == '%' else highest(parameter) / 2.0)


def position_value(parameter: Parameter, revolutions: float) -> float:
    """Express a position; it wraps where the parameter ends, as counters do."""
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


def temperature_value(parameter: Parameter, celsius: float) -> float:
    if parameter.unit == 'K':
        return celsius + 273.15
    return celsius * 1.8 + 32.0 if parameter.unit in ('°F', 'degF', 'F') else celsius


def mains_swing(now: float) -> float:
    """
    Return by which share of a voltage the mains are off.

    Of a drive at rest it is the one value that moves: it shows that the drive is alive.
    """
    return 0.005 * math.sin(2.0 * math.pi * 0.3 * max(now, 0.0))


def full(unit: str, quantity: Quantity) -> float:
    """Return 100 % of a quantity in a unit."""
    return _RATINGS.get(quantity, {}).get(unit, _DEFAULT_RATING)


def measures(unit: str, quantity: Quantity) -> bool:
    """Tell whether a unit says how much of a quantity there is."""
    return unit == '%' or unit in _RATINGS[quantity]


def rating(parameter: Parameter, quantity: Quantity) -> float:
    """Return what a parameter shows at 100 % of a quantity."""
    wanted = full(parameter.unit, quantity)
    # a voltage hardly exceeds its rating, everything else may double
    headroom = 1.2 if quantity is Quantity.VOLTAGE else 2.0
    return min(wanted, highest(parameter) / headroom)


def plausible(parameter: Parameter) -> int:
    """Return the raw integer of a value that a new drive might have; the same one each time."""
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
