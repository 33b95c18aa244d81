# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Whoever waits in a test waits for a condition, by the clock that it has.

That is the clock of the bench (``clocked/``), where a test has one; otherwise that of this
machine, with a deadline that only a hang exceeds.
"""

from collections.abc import Callable
import os
import time
from typing import Any, TYPE_CHECKING

from clocks import REAL

from drive_can_bridge.clock import Clock

if TYPE_CHECKING:
    from jumping import JumpingClock

#: how much slower this machine is than one of today: what .ci/socketcan/run boots says so
SLOWNESS = float(os.environ.get('DRIVE_CAN_EMULATED') or 1.0)
#: s after which a thing that has not happened never will
DEADLINE = 120.0 * SLOWNESS
#: s between two looks: soon at first, and at last so that looking takes nothing from others
SHORTEST, LONGEST = 0.002, 0.02
#: the clock of the bench, while there is one
virtual: 'JumpingClock | None' = None


def clock() -> Clock:
    """Return the clock of the test that runs."""
    return virtual or REAL


def pause(seconds: float) -> None:
    """Let time pass."""
    clock().wait(clock().now() + seconds)


def wait_for(condition: Callable[[], Any], what: str = 'a condition', timeout: float = DEADLINE,
             ) -> Any:
    """Wait until a condition is true, and return what it returned."""
    if virtual is not None:
        return virtual.until(condition, what, timeout)
    deadline = time.monotonic() + timeout
    pause = SHORTEST
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline:
            raise AssertionError(f'waited {timeout:g} s for {what}')
        time.sleep(pause)
        pause = min(1.1 * pause, LONGEST)


def wait_for_end(lines: Callable[[], list[Any]], end: list[Any]) -> None:
    """
    Wait until that is how the lines end.

    What another process prints of the last that it heard comes when that one finds time for it.
    """
    try:
        wait_for(lambda: lines()[-len(end):] == end, f'{end} at the end')
    except AssertionError as error:
        raise AssertionError(f'{error}, where {lines()[-len(end):]} is') from None
