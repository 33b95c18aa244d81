# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives of a bus take turns."""

from builders import drive
from exchange_builders import Bench
import pytest

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.exchange.exchange import exchanges_in_slot, stagger


def test_one_drive_has_the_bus_for_itself() -> None:
    assert stagger([0.02]) == [0.0]


def test_drives_are_spread_over_their_period() -> None:
    assert stagger([0.02] * 4) == pytest.approx([0.0, 0.005, 0.01, 0.015])


def test_no_finer_than_a_slot() -> None:
    # fifteen drives every 5 ms: three slots of five
    turns = stagger([0.005] * 15)
    assert turns == pytest.approx([0.0] * 5 + [0.005 / 3] * 5 + [0.01 / 3] * 5)
    assert len(set(turns)) == 3  # equal ones exactly: they are served together


@pytest.mark.parametrize('bitrate, extended, sharing', [
    (1_000_000, True, 5), (1_000_000, False, 6), (800_000, True, 4), (500_000, True, 2),
    (250_000, True, 1), (125_000, False, 1), (10_000, True, 1)])
def test_a_turn_is_what_the_wire_carries_in_a_slot(
        bitrate: int, extended: bool, sharing: int) -> None:
    # 290 bits an exchange with 29 bits of identifier, 246 with 11, in 1.5 ms
    bus = BusConfiguration('main', 'socketcan', 'can0', bitrate=bitrate)
    assert exchanges_in_slot(bus, extended=extended) == sharing


def test_behind_a_serial_line_each_drive_has_its_turn() -> None:
    # a frame of 27 characters takes 2.3 ms at 115,200 baud, whatever the bus can do
    bus = BusConfiguration('main', 'slcan', '/dev/ttyACM0', bitrate=1_000_000)
    assert exchanges_in_slot(bus, extended=True) == 1


def test_no_finer_than_the_wire_needs() -> None:
    # fifteen drives every 10 ms at 1 Mbit/s: three turns of five, where six have time
    assert stagger([0.01] * 15, 5) == pytest.approx(
        [0.0] * 5 + [0.01 / 3] * 5 + [0.02 / 3] * 5)
    # and the sixteenth has a turn more
    assert len(set(stagger([0.01] * 16, 5))) == 4


def test_no_finer_than_a_slot_where_more_share_it_than_the_wire_carries() -> None:
    assert stagger([0.005] * 30, 5) == stagger([0.005] * 30)


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


def test_drives_of_a_fast_bus_share_turns() -> None:
    bench = Bench(*(drive(name=f'drive_{number}', station=number, mapping='assume')
                    for number in range(1, 11)), bitrate=1_000_000)
    assert [session.phase for session in bench.sessions] == pytest.approx(
        [0.0] * 5 + [0.01] * 5)
