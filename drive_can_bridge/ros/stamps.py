# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""From the steady clock of the exchange to the stamps of ROS messages."""

import math
import time

from rclpy.clock import Clock, ROSClock

from drive_can_bridge.transport.clock import steady_now

#: s that two looks at clocks may be apart, and how often it is tried
APART_MAX = 0.0001
ATTEMPTS = 3
#: s between two looks at which time it is: simulated or not
LOOK_PERIOD = 0.1
#: seconds and nanoseconds, as ``builtin_interfaces/Time`` has them
Stamp = tuple[int, int]


class Stamps:
    """Turns receive times of the steady clock into ROS time (simulated, when that is active)."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._simulated = False
        self._look_at = -math.inf
        self._last: tuple[float, int] = (math.nan, 0)   # moment, and the ns that were said of it

    def at(self, received_at: float) -> Stamp:
        """Return the stamp of a moment of the steady clock. Simulated time only knows "now"."""
        if received_at >= self._look_at:
            self._look_at = received_at + LOOK_PERIOD
            self._simulated = (isinstance(self._clock, ROSClock)
                               and self._clock.ros_time_is_active)
        if self._simulated:
            return divmod(self._clock.now().nanoseconds, 1_000_000_000)
        last = self._last
        if received_at != last[0]:  # else the clocks would say something else each time
            last = self._last = received_at, self._at(received_at)
        return divmod(last[1], 1_000_000_000)

    @staticmethod
    def _at(received_at: float) -> int:
        for _ in range(ATTEMPTS):
            before, nanoseconds, now = steady_now(), time.time_ns(), steady_now()
            if now - before < APART_MAX:    # else another thread had the interpreter in between
                break
        return nanoseconds - int((now - received_at) * 1e9)
