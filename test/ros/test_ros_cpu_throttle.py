# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Threads that leave the interpreter to others."""

import time

from clocks import REAL

from drive_can_bridge.ros.threads import CpuThrottle


def busy(seconds: float) -> None:
    """Compute so long."""
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def test_who_computes_without_end_gets_its_share() -> None:
    begun = time.monotonic()
    throttle = CpuThrottle(0.25, REAL, in_hand=0.002)
    for _ in range(20):
        busy(0.002)
        throttle.keep()
    assert time.monotonic() - begun >= (20 * 0.002 - 0.002) / 0.25
