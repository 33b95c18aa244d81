# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""From the steady clock of the exchange to the stamps of ROS messages."""

from collections.abc import Callable
import math
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.clock import Clock as RosClock, ROSClock

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences

#: s that two looks at clocks may be apart, and how often it is tried
APART_MAX = 0.0001
ATTEMPTS = 3
#: s between two looks at which time it is: simulated or not
LOOK_PERIOD = 0.1
#: s since 1970 that ``builtin_interfaces/Time`` can hold: until January 2038
SECONDS_MAX = 2 ** 31 - 1
NANOSECONDS = 1_000_000_000
#: seconds and nanoseconds, as ``builtin_interfaces/Time`` has them
Stamp = tuple[int, int]
#: instead of one that cannot be represented
NO_STAMP: Stamp = (0, 0)


class Stamps:
    """
    Turns receive times of the steady clock into ROS time (simulated, when that is active).

    A clock may have any time. One that no message can hold makes stamps of 0, and is logged once.

    :param ros: returns the clock of the node.
    :param warn: logs a warning.
    """

    def __init__(self, ros: Callable[[], RosClock], warn: Callable[[str], None],
                 clock: Clock) -> None:
        self._ros = ros
        self._clock = clock
        self._warn = warn
        self._told = False
        self._simulated = False
        self._look_at = -math.inf
        self._published: int | None = None  # the time of /clock where rclpy cannot hold it

    def at(self, moment: float) -> Stamp:
        """Return the stamp of a moment of the steady clock. Simulated time only knows "now"."""
        if moment >= self._look_at:
            self._look_at = moment + LOOK_PERIOD
            clock = self._ros()
            self._simulated = isinstance(clock, ROSClock) and clock.ros_time_is_active
        if not self._simulated:
            return self._stamp(self._system_time(moment))
        return self._stamp(self._ros().now().nanoseconds if self._published is None
                           else self._published)

    def now(self) -> Time:
        """Return the stamp of this moment as a message."""
        seconds, nanoseconds = self.at(self._clock.now())
        return Time(sec=seconds, nanosec=nanoseconds)

    def guarded(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback for ``/clock`` that passes on only what rclpy can hold."""
        def take(message: Any) -> None:
            nanoseconds = message.clock.sec * NANOSECONDS + message.clock.nanosec
            if _representable(nanoseconds):
                self._published = None
                callback(message)
            else:
                self._published = nanoseconds
        return take

    def _system_time(self, moment: float) -> int:
        """Return the system clock's time at a moment of the steady clock, in ns."""
        clock = self._clock
        for _ in range(ATTEMPTS):
            before, nanoseconds, now = clock.now(), clock.stamp(), clock.now()
            if now - before < APART_MAX:    # else another thread had the interpreter in between
                break
        return nanoseconds - int((now - moment) * 1e9)

    def _stamp(self, nanoseconds: int) -> Stamp:
        if _representable(nanoseconds):
            return divmod(nanoseconds, NANOSECONDS)
        if not self._told:
            self._told = True
            self._warn(sentences.clock_impossible(
                'simulated' if self._simulated else 'system', nanoseconds // NANOSECONDS,
                SECONDS_MAX))
        return NO_STAMP


def _representable(nanoseconds: int) -> bool:
    return 0 <= nanoseconds < (SECONDS_MAX + 1) * NANOSECONDS
