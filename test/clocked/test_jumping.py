# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A story that cannot go on ends in words, and takes its threads with it."""

from collections.abc import Iterator
from contextlib import contextmanager
import signal

import jumping
from jumping import JumpingClock, Stuck
import pytest


class Interrupted(Exception):
    """Like a time limit, which comes as a signal."""


@contextmanager
def interruption(seconds: float) -> Iterator[None]:
    def interrupt(*_: object) -> None:
        raise Interrupted
    before = signal.signal(signal.SIGALRM, interrupt)
    left = signal.setitimer(signal.ITIMER_REAL, seconds)[0]
    try:
        yield
    finally:
        signal.signal(signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, left)


def circle(clock: JumpingClock) -> None:
    while clock.now():
        pass


def crowd(clock: JumpingClock) -> list[jumping.Task]:
    """Begin one who never waits, and some who do, also while they end."""
    def wait() -> None:
        try:
            clock.wait(clock.now() + 100.0)
        finally:
            clock.wait(clock.now() + 100.0)
    tasks = [clock.worker(run, name) for run, name in (
        (wait, 'waiting'), (lambda: clock.wake_event().wait(), 'idle'),
        (lambda: (clock.wait(clock.now() + 1.0), circle(clock)), 'hamster'))]
    for task in tasks:
        task.start()
    return tasks


@pytest.mark.parametrize('seed', range(3))
def test_a_thread_that_never_waits(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jumping, 'HANG', 0.1)
    with pytest.raises(Stuck, match='hamster has not waited for 0.1 s'):
        with jumping.jumping(seed) as clock:
            tasks = crowd(clock)
            clock.live(10.0)
    assert not any(task.thread.is_alive() for task in tasks)
    with pytest.raises(Stuck, match='broken off'):      # what a fixture does in the end
        clock.live(1.0)


def test_a_story_that_is_interrupted_in_a_turn_of_somebody_else() -> None:
    with pytest.raises(Interrupted), interruption(0.1):
        with jumping.jumping(0) as clock:
            tasks = crowd(clock)
            clock.live(10.0)
    assert not any(task.thread.is_alive() for task in tasks)


def test_a_circle_of_two() -> None:
    with pytest.raises(Stuck, match='go round in circles'):
        with jumping.jumping(0) as clock:
            one, other = clock.wake_event(), clock.wake_event()

            def play(mine: jumping.JumpingWakeEvent, yours: jumping.JumpingWakeEvent) -> None:
                while mine.wait():
                    yours.ring()
            for events in ((one, other), (other, one)):
                clock.worker(lambda events=events: play(*events), 'player').start()
            one.ring()
            clock.live(1.0)


@pytest.mark.parametrize('others', [0, 2])
def test_nobody_can_go_on(others: int) -> None:
    with pytest.raises(Stuck, match='nobody waits for anything that can happen'):
        with jumping.jumping(0) as clock:
            for _ in range(others):
                clock.worker(lambda: clock.wake_event().wait(), 'idle').start()
            clock.wake_event().wait()
