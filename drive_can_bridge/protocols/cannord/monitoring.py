# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Telegram monitoring: the inverter's own time-out and the period of the bridge.

P513 ("telegram time-out") makes an inverter fault (E010) when the time between two telegrams is
longer; 0 and negative values switch that off (BU 0260 page 77). It begins with the first telegram.
Process frames come once a ``period``, and so do the broadcasts of a group. A single one may get
lost on a busy bus, or be late on a busy machine, so the time-out should allow for
:data:`PERIODS_MIN` periods.

The scale of P513 comes from the profile, as that of every parameter; a profile that does not list
it gets no warning.
"""

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile

TIMEOUT_NUMBER = 513
#: periods that the time-out should last at least: one frame lost, the next one late
PERIODS_MIN = 3


def timeout_parameter(profile: Profile) -> Parameter | None:
    """Return the parameter of the profile that holds the telegram time-out in s, if any."""
    for parameter in profile.parameters.values():
        if parameter.number == TIMEOUT_NUMBER and parameter.unit == 's' and parameter.readable:
            return parameter
    return None


def timeout_warning(parameter: Parameter, timeout: float, period: float) -> str:
    """
    Say that the inverter's time-out is too tight for the period; '' if it is not.

    :param timeout: s; 0 or less: not monitored.
    :param period: s between two process frames.
    """
    least = PERIODS_MIN * period
    if timeout <= 0.0 or timeout > least - 1e-9:
        return ''
    return (f'telegram time-out {timeout:g} s ({parameter.name}, {parameter.address}) is too '
            f'tight for a period of {period:g} s: set it to {least:g} s or more, or shorten the '
            'period')
