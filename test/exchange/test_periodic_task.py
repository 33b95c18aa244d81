# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What timer threads see to beside their drives."""

import math
import threading

import pytest

from drive_can_bridge.exchange.exchange import PeriodicTask


def test_once_a_period_and_a_little_early_where_a_thread_is_awake() -> None:
    done: list[float] = []
    periodic_task = PeriodicTask(done.append)
    assert periodic_task.run(5.0) == math.inf
    periodic_task.begin(1.0, now=10.0)
    assert periodic_task.run(10.0) == 11.0
    assert periodic_task.run(10.8) == 11.0
    assert not done
    assert periodic_task.run(10.95) == 12.0    # the beat is kept
    assert periodic_task.run(11.5) == 12.0
    assert periodic_task.run(12.3) == 13.0
    assert done == [10.95, 12.3]


def test_it_is_due_at_the_moment_from_which_it_may_come() -> None:
    done: list[float] = []
    periodic_task = PeriodicTask(done.append)
    periodic_task.begin(2.0, now=0.0)
    assert periodic_task.run(1.75) == 2.0
    assert periodic_task.run(1.8) == 4.0       # a tenth of a period early
    assert done == [1.8]


def test_what_was_missed_is_left_out() -> None:
    done: list[float] = []
    periodic_task = PeriodicTask(done.append)
    periodic_task.begin(1.0, now=0.0)
    assert periodic_task.run(7.5) == 8.5
    assert periodic_task.run(7.6) == 8.5
    assert done == [7.5]


@pytest.mark.usefixtures('threads')
def test_no_thread_waits_for_another() -> None:
    begun, go_on = threading.Event(), threading.Event()
    done: list[float] = []

    def action(now: float) -> None:
        done.append(now)
        begun.set()
        go_on.wait()
    periodic_task = PeriodicTask(action)
    periodic_task.begin(1.0, now=0.0)
    other = threading.Thread(target=periodic_task.run, args=(1.0,))
    other.start()
    assert begun.wait()
    assert periodic_task.run(2.0) == 3.0
    assert done == [1.0]
    ended = threading.Event()

    def end() -> None:
        periodic_task.end()
        ended.set()
    ending = threading.Thread(target=end)
    ending.start()
    assert not ended.wait(0.05), 'it waits for the call that is under way'
    go_on.set()
    other.join()
    ending.join()
    assert ended.is_set()
    assert periodic_task.run(100.0) == math.inf
    assert done == [1.0]
