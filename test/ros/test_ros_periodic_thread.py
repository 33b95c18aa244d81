# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A thread that does something again and again."""

import threading

from clocks import HandClock
import pytest
from waiting import clock, pause, wait_for

from drive_can_bridge.ros.threads import PeriodicThread


def test_again_and_again_until_stopped() -> None:
    calls: list[float] = []
    thread = PeriodicThread('again', 0.01, lambda: calls.append(clock().now()), print, clock())
    begun = clock().now()
    thread.start()
    wait_for(lambda: len(calls) > 5, 'six calls')
    assert calls[0] - begun >= 0.01
    assert calls[5] - begun >= 0.06
    thread.stop()
    count = len(calls)
    pause(0.05)
    assert len(calls) == count
    assert 'again' not in [each.name for each in threading.enumerate()]


def test_another_period_begins_at_once() -> None:
    calls: list[float] = []
    thread = PeriodicThread('again', 3600.0, lambda: calls.append(clock().now()), print, clock())
    thread.start()
    thread.set_period(0.01)
    wait_for(lambda: len(calls) > 1, 'calls')
    thread.set_period(3600.0)
    thread.stop()


def test_a_failure_is_told_and_does_not_end_it() -> None:
    told: list[str] = []

    def fail() -> None:
        raise ValueError('no')
    thread = PeriodicThread('again', 0.01, fail, told.append, clock())
    thread.start()
    wait_for(lambda: len(told) > 1, 'two failures')
    thread.stop()
    assert set(told) == {'ValueError: no'}


def test_no_burst_after_standing_still() -> None:
    clock = [100.0]
    calls: list[float] = []
    thread = PeriodicThread('again', 0.01, lambda: calls.append(clock[0]), print,
                            HandClock(lambda: clock[0]))
    thread._changed = _Jumps(clock, [0.01, 50.0, 0.01, 0.01], thread)  # type: ignore[assignment]
    thread._run()
    # once at the time of each wait; 5,000 were due in the second one
    assert calls == pytest.approx([100.01, 150.01, 150.02, 150.03])


class _Jumps:
    """An alarm that nobody rings: each sleep lets the clock jump."""

    def __init__(self, clock: list[float], jumps: list[float], thread: PeriodicThread) -> None:
        self._clock, self._jumps, self._thread = clock, jumps, thread

    def wait(self, until: float) -> bool:
        self._clock[0] += self._jumps.pop(0)
        self._thread._ending = not self._jumps
        return False
