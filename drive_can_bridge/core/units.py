# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From the units of a profile to the SI units of a joint.

Only what a joint needs: angles to rad, speeds to rad/s. Effort is passed on in the profile's unit.
"""

from enum import Enum
import math


class Quantity(Enum):
    """A quantity of a joint."""

    POSITION = 'position'
    VELOCITY = 'velocity'
    EFFORT = 'effort'


#: an electrical frequency; divided by the pole pairs it is a speed of the shaft
ELECTRICAL_FREQUENCY = 'Hz'

_FACTORS: dict[Quantity, dict[str, float]] = {
    Quantity.POSITION: {
        'rad': 1.0,
        'deg': math.pi / 180.0,
        'rev': 2.0 * math.pi,
    },
    Quantity.VELOCITY: {
        'rad/s': 1.0,
        'deg/s': math.pi / 180.0,
        'rpm': 2.0 * math.pi / 60.0,
        ELECTRICAL_FREQUENCY: 2.0 * math.pi,
    },
}


def convertible_units(quantity: Quantity) -> tuple[str, ...]:
    """Return the units that convert; empty for effort, where every unit passes as it is."""
    return tuple(_FACTORS.get(quantity, ()))


def si_factor(quantity: Quantity, unit: str, *, gear_ratio: float = 1.0,
              pole_pairs: int = 1) -> float | None:
    """
    Return the factor from a motor's value in ``unit`` to the joint's SI value.

    :param unit: unit as written in the profile.
    :param gear_ratio: motor turns per turn of the joint; not zero, negative reverses.
    :param pole_pairs: of the motor; only an electrical frequency is divided by them.
    :return: the factor, or None where the unit does not convert.
    """
    if quantity is Quantity.EFFORT:
        return 1.0
    factor = _FACTORS[quantity].get(unit)
    if factor is None:
        return None
    if unit == ELECTRICAL_FREQUENCY:
        factor /= pole_pairs
    return factor / gear_ratio
