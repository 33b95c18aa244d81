# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The clock of this machine: its wake_events, threads, locks and mailboxes."""

import threading
import time

import pytest

from drive_can_bridge.clock import Mailbox, SteadyClock

CLOCK = SteadyClock()

pytestmark = pytest.mark.usefixtures('threads')


def test_ring_before_the_sleep_is_kept() -> None:
    wake_event = CLOCK.wake_event()
    wake_event.ring()
    assert wake_event.wait(CLOCK.now() + 3600.0), 'somebody rang'
    assert not wake_event.wait(0.0)


def test_several_rings_count_once() -> None:
    wake_event = CLOCK.wake_event()
    for _ in range(3):
        wake_event.ring()
    assert wake_event.wait(CLOCK.now() + 3600.0)
    assert not wake_event.wait(0.0), 'nothing is left: this one ends by its time'


def test_sleep_ends_by_itself_even_when_its_time_is_over() -> None:
    wake_event = CLOCK.wake_event()
    assert not wake_event.wait(-1.0)
    assert not wake_event.wait(CLOCK.now() + 0.001)
    assert not wake_event.wait(0.0)


def test_no_time_is_too_far_away_to_be_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    monkeypatch.setattr(time, 'sleep', slept.append)
    CLOCK.wait(1e300)
    CLOCK.wait(-1.0)
    assert slept == [1e9, 0.0]      # 32 years, which any system takes


def test_ring_wakes_the_sleeper() -> None:
    wake_event = CLOCK.wake_event()
    sleeper = CLOCK.worker(lambda: wake_event.wait(), 'sleeper')
    sleeper.start()
    wake_event.ring()
    sleeper.join(30.0)
    assert not sleeper.is_alive()


def test_rings_of_many_threads() -> None:
    wake_event = CLOCK.wake_event()
    threads = [threading.Thread(target=lambda: [wake_event.ring() for _ in range(2000)])
               for _ in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        wake_event.wait(CLOCK.now() + 0.001)
    for thread in threads:
        thread.join()
    wake_event.wait(0.0)
    wake_event.ring()
    assert wake_event.wait(0.0)


def test_a_thread_may_be_joined_whatever_became_of_it() -> None:
    done: list[str] = []

    def run() -> None:
        worker.join(3600.0)     # itself
        done.append('ran')
    worker = CLOCK.worker(run, 'worker')
    worker.join()               # has not begun
    assert not worker.is_alive()
    worker.start()
    worker.join()
    worker.join()               # has ended
    assert done == ['ran'] and not worker.is_alive()


def test_a_lock_is_taken_again_by_its_own_thread_only() -> None:
    lock = CLOCK.lock()
    found: list[bool] = []
    with lock:
        assert lock.acquire(0.0)
        lock.release()
        other = CLOCK.worker(lambda: found.append(lock.acquire(0.001)), 'other')
        other.start()
        other.join()
    assert found == [False]
    assert lock.acquire()
    lock.release()


def test_mailbox() -> None:
    box: Mailbox[int] = Mailbox(CLOCK, 2)
    assert [box.put(each) for each in (1, 2, 3)] == [True, True, False]
    box.put(4, always=True)
    assert len(box) == 3
    assert [box.get(), box.get(0.0), box.get()] == [1, 2, 4]
    with pytest.raises(TimeoutError):
        box.get(CLOCK.now() + 0.001)


def test_a_mailbox_wakes_who_waits() -> None:
    box: Mailbox[int] = Mailbox(CLOCK)
    found: list[int] = []
    worker = CLOCK.worker(lambda: found.append(box.get()), 'worker')
    worker.start()
    box.put(5)
    worker.join(30.0)
    assert found == [5]


def test_waiting_for_a_time_that_is_over() -> None:
    before = CLOCK.now()
    CLOCK.wait(before - 1.0)
    CLOCK.wait(before + 0.001)
    assert CLOCK.now() >= before + 0.001
