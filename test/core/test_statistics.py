# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Statistics of exchanges."""

import math
import random

import pytest

from drive_can_bridge.core.statistics import DriveStatistics, Statistic, WINDOW


def filled(samples: list[float]) -> Statistic:
    statistic = Statistic()
    for sample in samples:
        statistic.add(sample)
    return statistic


def test_nothing_yet() -> None:
    statistic = Statistic()
    assert math.isnan(statistic.mean)
    assert math.isnan(statistic.p99)
    assert math.isnan(statistic.maximum)
    assert statistic.samples() == []
    assert DriveStatistics().latency.count == 0


@pytest.mark.parametrize('count, p99', [(1, 1.0), (2, 2.0), (100, 99.0), (101, 100.0),
                                        (1000, 990.0), (1024, 1014.0)])
def test_percentile(count: int, p99: float) -> None:
    statistic = filled([float(value) for value in range(count, 0, -1)])
    assert statistic.p99 == p99
    assert statistic.maximum == count
    assert statistic.mean == pytest.approx((count + 1) / 2)
    assert sorted(statistic.samples()) == [float(value) for value in range(1, count + 1)]


def test_window_forgets_and_the_rest_does_not() -> None:
    statistic = filled([100.0] + [1.0] * WINDOW)
    assert statistic.p99 == 1.0
    assert statistic.maximum == 100.0
    assert statistic.count == WINDOW + 1
    assert statistic.mean == pytest.approx((100.0 + WINDOW) / (WINDOW + 1))
    assert len(statistic.samples()) == WINDOW


def test_percentile_of_times_that_become_better_and_worse() -> None:
    chance = random.Random(1)
    statistic, samples = Statistic(), []
    for round_ in range(60):
        scale = chance.choice((0.001, 1.0, 1.0, 50.0))
        for _ in range(chance.randint(1, 400)):
            samples.append(chance.expovariate(1.0) * scale * chance.choice((0.0, 1.0, 1.0)))
            statistic.add(samples[-1])
        window = sorted(samples[-WINDOW:])
        assert statistic.p99 == window[math.ceil(0.99 * len(window)) - 1], round_
        assert statistic.p99 == statistic.p99


def test_negative_samples_have_a_maximum() -> None:
    assert filled([-3.0, -2.0, -5.0]).maximum == -2.0


def test_statistics_are_not_shared() -> None:
    one, other = DriveStatistics(), DriveStatistics()
    one.latency.add(1.0)
    assert other.latency.count == 0
