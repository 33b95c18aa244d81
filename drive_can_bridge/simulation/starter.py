# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A motor starter with overload protection: contactors, currents, thermal image.

Not a model of any real controller: an induction motor switched on directly, with an inrush
current, a load current and a thermal image that trips. Time is an argument.
"""

import math

from drive_can_bridge.simulation.control import FAULTS, Machine, Rule, State

#: bits of control register 1
RUN_FORWARD, RUN_REVERSE, RESET = 1 << 0, 1 << 1, 1 << 3
RUN = RUN_FORWARD | RUN_REVERSE

#: A; the largest full load current of the controller, and what the motor takes
CONTROLLER_CURRENT = 27.0
LOAD_CURRENT = 6.3
INRUSH_CURRENT = 45.0
#: s
INRUSH_TIME_CONSTANT = 0.4
START_TIME = 2.0
#: the motor may carry this share of its full load current for ever
SERVICE_FACTOR = 1.1
#: thermal image in s, per s of trip class: six times the full load current trips after the class
CLASS_FACTOR = -1.0 / math.log1p(-(SERVICE_FACTOR / 6.0) ** 2)
#: % of the thermal capacity
TRIP_LEVEL, ALARM_LEVEL, RESET_LEVEL = 100.0, 85.0, 75.0
#: longest step of the thermal image, s
STEP = 0.05

#: trip codes
THERMAL_OVERLOAD, TEST_TRIP = 4, 10


#: after a trip the run bits have to go before they count again
MACHINE = Machine((
    Rule((State.FAULT,), RUN, 0, State.FAULT_RELEASED),
    Rule(FAULTS, 0, 0, None),
    Rule((State.SWITCH_ON_DISABLED,), RUN, 0, State.READY_TO_SWITCH_ON),
    Rule((State.SWITCH_ON_DISABLED,), 0, 0, None),
    Rule(None, RUN, RUN_FORWARD, State.OPERATION_ENABLED),
    Rule(None, RUN, RUN_REVERSE, State.OPERATION_ENABLED),
    Rule(None, 0, 0, State.READY_TO_SWITCH_ON),
), reset=(RESET, RESET), power_on=(State.READY_TO_SWITCH_ON, 0))


class Starter:
    """
    The motor behind the contactor: currents and thermal image.

    :ivar thermal: % of the thermal capacity.
    :ivar full_load_current: A.
    :ivar time_constant: s, of the thermal image.
    """

    def __init__(self) -> None:
        self.thermal = 0.0
        self.settings(100.0, 5.0)
        self._on_for: float | None = None

    @property
    def current(self) -> float:
        """Mean current of the phases, in A."""
        if self._on_for is None:
            return 0.0
        inrush = INRUSH_CURRENT - LOAD_CURRENT
        return LOAD_CURRENT + inrush * math.exp(-self._on_for / INRUSH_TIME_CONSTANT)

    @property
    def ratio(self) -> float:
        return self.current / self.full_load_current

    @property
    def starting(self) -> bool:
        """The motor was switched on a moment ago."""
        return self._on_for is not None and self._on_for < START_TIME

    @property
    def alarm(self) -> bool:
        """The motor is close to a trip."""
        return self.thermal >= ALARM_LEVEL

    @property
    def time_to_trip(self) -> float:
        """Time in s until this current would trip; infinity: never."""
        final = self._final_level
        if final <= TRIP_LEVEL:
            return math.inf
        left = (final - self.thermal) / (final - TRIP_LEVEL)
        return self.time_constant * math.log(max(left, 1.0))

    @property
    def time_to_reset(self) -> float:
        """Time in s until a motor that is off has cooled down enough."""
        return self.time_constant * math.log(max(self.thermal / RESET_LEVEL, 1.0))

    def settings(self, full_load_percent: float, trip_class: float) -> None:
        """Take over the full load current, in % of the largest one, and the trip class."""
        self.full_load_current = max(full_load_percent, 1.0) / 100.0 * CONTROLLER_CURRENT
        self.time_constant = CLASS_FACTOR * max(trip_class, 1.0)

    def advance(self, duration: float, *, on: bool) -> bool:
        """
        Let time pass.

        :param on: the contactor is closed.
        :return: the thermal capacity is used up, which has opened it.
        """
        self._on_for = (self._on_for or 0.0) if on else None
        steps = max(math.ceil(duration / STEP), 1)
        for _ in range(min(steps, 10_000)):
            step = duration / steps
            if self._on_for is not None:
                self._on_for += step
            self.thermal += (self._final_level - self.thermal) * -math.expm1(
                -step / self.time_constant)
            if self._on_for is not None and self.thermal >= TRIP_LEVEL:
                self._on_for = None
                return True
        return False

    @property
    def _final_level(self) -> float:
        """Thermal level that the present current leads to."""
        return TRIP_LEVEL * (self.ratio / SERVICE_FACTOR) ** 2
