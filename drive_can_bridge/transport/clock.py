# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The clock by which everything is done: the ``now`` of all sessions."""

import time

#: CLOCK_MONOTONIC stands still while the machine is suspended; the drives do not
_CLOCK = getattr(time, 'CLOCK_BOOTTIME', time.CLOCK_MONOTONIC)


def steady_now() -> float:
    """Return the steady clock in s. Nobody can set it, and suspend counts."""
    return time.clock_gettime(_CLOCK)
