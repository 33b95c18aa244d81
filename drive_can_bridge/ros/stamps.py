# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""From the steady clock of the exchange to the stamps of ROS messages."""

import time

from builtin_interfaces.msg import Time
from rclpy.clock import Clock, ROSClock


class Stamps:
    """Turns receive times of the steady clock into ROS time (simulated, when that is active)."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._stamp = Time()

    def at(self, received_at: float) -> Time:
        """
        Return the stamp of a moment of the steady clock.

        The message is reused: it is overwritten by the next call. Simulated time only knows
        "now".
        """
        if isinstance(self._clock, ROSClock) and self._clock.ros_time_is_active:
            return self._clock.now().to_msg()
        nanoseconds = time.time_ns() - int((time.monotonic() - received_at) * 1e9)
        stamp = self._stamp
        stamp.sec, stamp.nanosec = divmod(nanoseconds, 1_000_000_000)
        return stamp
