# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives of a bus take turns."""

from builders import drive
from exchange_builders import Bench
import pytest

from drive_can_bridge.exchange.exchange import stagger


def test_one_drive_has_the_bus_for_itself() -> None:
    assert stagger([0.02]) == [0.0]


def test_drives_are_spread_over_their_period() -> None:
    assert stagger([0.02] * 4) == pytest.approx([0.0, 0.005, 0.01, 0.015])


def test_no_finer_than_a_slot() -> None:
    # fifteen drives every 5 ms: three slots of five
    turns = stagger([0.005] * 15)
    assert turns == pytest.approx([0.0] * 5 + [0.005 / 3] * 5 + [0.01 / 3] * 5)
    assert len(set(turns)) == 3  # equal ones exactly: they are served together


def test_each_period_for_itself() -> None:
    assert stagger([0.01, 0.1, 0.01, 0.1]) == pytest.approx([0.0, 0.0, 0.005, 0.05])


def test_periods_below_a_slot() -> None:
    assert stagger([0.0005, 0.0005]) == [0.0, 0.0]


def test_nobody() -> None:
    assert stagger([]) == []


def test_exchange_gives_every_drive_its_turn() -> None:
    bench = Bench(drive(name='first', station=1, mapping='assume'),
                  drive(name='second', station=2, mapping='assume'))
    bench.now = 100.0041
    bench.exchange._last_pass = bench.now
    bench.begin()
    sent = {}
    for tick in range(1, 80):
        now = 100.0041 + 0.001 * tick
        for text in bench.at(now):
            sent.setdefault(text[:8], []).append(now)
            bench.hears('1' + text[1:9] + '03E800FA00010000', now + 0.0002)
    assert sent['003FFFF0'] == pytest.approx([100.0201, 100.0401, 100.0601, 100.0801], abs=2e-3)
    assert sent['005FFFF0'] == pytest.approx([100.0101, 100.0301, 100.0501, 100.0701], abs=2e-3)
