# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Curves in bounded memory."""

from drive_can_bridge.trace.series import Curve


def test_a_short_curve_is_kept_as_it_is() -> None:
    curve = Curve('speed')
    for step in range(1000):
        curve.add(0.02 * step, float(step % 7))
    times, values = curve.points()
    assert values == [float(step % 7) for step in range(1000)]
    assert times[-1] == 0.02 * 999


def test_a_long_one_keeps_its_extremes_everywhere() -> None:
    curve = Curve('speed')
    for step in range(200_000):
        curve.add(0.02 * step, 1000.0 if step % 20_000 == 137 else float(step % 2))
    times, values = curve.points()
    assert 2000 < len(times) <= 8192
    assert times == sorted(times)
    peaks = [time for time, value in zip(times, values) if value == 1000.0]
    assert peaks == [0.02 * (20_000 * peak + 137) for peak in range(10)]
    # no part of the time is thinner than another
    assert max(after - before for before, after in zip(times, times[1:])) < 4000 / 1000
