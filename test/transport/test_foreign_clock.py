# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How old frames are by clocks that are not the host's."""

import math
import random

import pytest

from drive_can_bridge.transport.foreign_clock import ForeignClock


def test_a_clock_that_is_behind_makes_nothing_old() -> None:
    """As it was seen: 94 ms behind, and every joint state 94 ms old."""
    clock = ForeignClock()
    for step in range(1000):
        arrival = 100.0 + 0.02 * step
        age = clock.age(1.7e9 + arrival - 0.094, arrival, waited=True)
        assert age == pytest.approx(0.0, abs=1e-5)


def test_what_came_late_is_as_old_as_it_took_longer_than_others() -> None:
    clock = ForeignClock()
    assert clock.age(1.000, 51.000, waited=True) == 0.0
    assert clock.age(1.020, 51.060, waited=True) == pytest.approx(0.040)
    assert clock.age(1.040, 51.060, waited=False) == pytest.approx(0.020)
    # one that took less than all before: they were older than was known, and none is younger
    assert clock.age(1.060, 51.050, waited=True) == 0.0
    assert clock.age(1.080, 51.080, waited=True) == pytest.approx(0.010)


def test_only_the_last_ten_seconds_count() -> None:
    clock = ForeignClock()
    clock.age(1.0, 50.0, waited=True)
    assert clock.age(10.9, 60.0, waited=True) == pytest.approx(0.1)
    # the first is forgotten
    assert clock.age(11.0, 60.1, waited=True) == 0.0


def test_a_clock_that_drifts_for_a_week_makes_nothing_old() -> None:
    for drift in (-200e-6, -20e-6, 20e-6, 200e-6):
        clock, random_ = ForeignClock(), random.Random(1)
        worst = 0.0
        for step in range(60_480):      # every ten seconds; and some in between
            for more in (0.0, 0.02, 3.0):
                arrival = 10.0 * step + more
                late = random_.uniform(0.0, 0.001)
                age = clock.age(5.0 + arrival * (1.0 + drift), arrival + late, waited=True)
                worst = max(worst, age)
        assert worst < 0.0011 + 10.0 * abs(drift)
        assert len(clock._behind) < 10


def test_a_stamp_that_goes_back_begins_again() -> None:
    clock = ForeignClock()
    clock.age(100.0, 50.0, waited=True)
    assert clock.age(90.0, 50.02, waited=True) == 0.0
    assert clock.age(90.02, 50.07, waited=True) == pytest.approx(0.03)


@pytest.mark.parametrize('stamp', [0.0, -1.0, math.nan, math.inf])
def test_no_stamp(stamp: float) -> None:
    clock = ForeignClock()
    for arrival in (50.0, 50.02, 70.0):
        assert clock.age(stamp, arrival, waited=True) == 0.0


def test_a_clock_that_stands_still_is_none() -> None:
    clock = ForeignClock()
    for step in range(1000):
        assert clock.age(5.0, 50.0 + 0.02 * step, waited=True) == 0.0
    # two at once may have the same stamp
    clock.age(6.0, 80.0, waited=True)
    assert clock.age(6.0, 80.001, waited=False) == pytest.approx(0.001)
