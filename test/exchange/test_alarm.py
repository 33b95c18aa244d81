# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The alarm of the timer thread."""

import threading

from drive_can_bridge.exchange.alarm import Alarm


def test_ring_before_the_sleep_is_kept() -> None:
    alarm = Alarm()
    alarm.ring()
    assert alarm.sleep(3600.0), 'somebody rang'
    assert not alarm.sleep(0.0)


def test_several_rings_count_once() -> None:
    alarm = Alarm()
    for _ in range(3):
        alarm.ring()
    assert alarm.sleep(3600.0)
    assert not alarm.sleep(0.0), 'nothing is left: this one ends by its time'


def test_sleep_ends_by_itself_even_when_its_time_is_over() -> None:
    alarm = Alarm()
    assert not alarm.sleep(-1.0)
    assert not alarm.sleep(0.001)
    assert not alarm.sleep(0.0)


def test_ring_wakes_the_sleeper() -> None:
    alarm = Alarm()
    sleeper = threading.Thread(target=alarm.sleep, args=(3600.0,), daemon=True)
    sleeper.start()
    alarm.ring()
    sleeper.join(timeout=30.0)
    assert not sleeper.is_alive()


def test_rings_of_many_threads() -> None:
    alarm = Alarm()
    threads = [threading.Thread(target=lambda: [alarm.ring() for _ in range(2000)])
               for _ in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        alarm.sleep(0.001)
    for thread in threads:
        thread.join()
    alarm.sleep(0.0)
    alarm.ring()
    assert alarm.sleep(0.0)
