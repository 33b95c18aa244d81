# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""From the steady clock of the exchange to the stamps of ROS messages."""

import time

from rclpy.clock import Clock, ROSClock

from drive_can_bridge.transport.clock import steady_now

#: seconds and nanoseconds, as ``builtin_interfaces/Time`` has them
Stamp = tuple[int, int]


class Stamps:
    """Turns receive times of the steady clock into ROS time (simulated, when that is active)."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def at(self, received_at: float) -> Stamp:
        """Return the stamp of a moment of the steady clock. Simulated time only knows "now"."""
        if isinstance(self._clock, ROSClock) and self._clock.ros_time_is_active:
            nanoseconds = self._clock.now().nanoseconds
        else:
            nanoseconds = time.time_ns() - int((steady_now() - received_at) * 1e9)
        return divmod(nanoseconds, 1_000_000_000)
