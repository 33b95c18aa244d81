# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The clock by which everything is done: the ``now`` of all sessions."""

from collections.abc import Callable
from functools import partial
import time

#: CLOCK_MONOTONIC stands still while the machine is suspended; the drives do not
_CLOCK = getattr(time, 'CLOCK_BOOTTIME', time.CLOCK_MONOTONIC)

#: the steady clock in s: nobody can set it, and suspend counts. Read several times for each frame,
#: hence no function of ours around it
steady_now: Callable[[], float] = partial(time.clock_gettime, _CLOCK)
