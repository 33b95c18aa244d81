# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How the exchange of polled protocols is planned."""

from itertools import combinations
import math

from hypothesis import given, strategies as st
import pytest

from drive_can_bridge.protocols.exchange_book import CycleTimer
from drive_can_bridge.protocols.polled_exchange import Chunk, plan_reads, round_time


def plan(*numbers: int, size: int = 4, known: set[int] | None = None) -> list[tuple[int, int]]:
    return [tuple(chunk) for chunk in
            plan_reads([Chunk(number) for number in numbers], size, known=known or set())]


def test_consecutive_numbers_share_a_read() -> None:
    assert plan(209, 210, 211) == [(209, 3)]
    assert plan(209, 210, 211, 212) == [(209, 4)]
    assert plan(209, 210, 211, 212, 213) == [(209, 4), (213, 1)]


def test_order_and_repetition_do_not_matter() -> None:
    assert plan(211, 209, 210, 209) == [(209, 3)]


def test_a_gap_is_bridged_over_what_the_drive_knows() -> None:
    assert plan(209, 211) == [(209, 1), (211, 1)]
    assert plan(209, 211, known={210}) == [(209, 3)]
    assert plan(209, 212, known={210}) == [(209, 1), (212, 1)]
    assert plan(209, 213, known={210, 211, 212}) == [(209, 1), (213, 1)]


def test_words_of_32_bits_stay_together() -> None:
    assert plan_reads([Chunk(455), Chunk(500, 2), Chunk(502, 2)], 2) == [
        Chunk(455, 1), Chunk(500, 2), Chunk(502, 2)]
    assert plan_reads([Chunk(500, 2), Chunk(501)], 2) == [Chunk(500, 2)]
    assert plan_reads([Chunk(499), Chunk(500, 2)], 2) == [Chunk(499, 1), Chunk(500, 2)]


@given(st.sets(st.integers(0, 12), min_size=1), st.sets(st.integers(0, 12)), st.integers(1, 4))
def test_no_plan_needs_fewer_reads(wanted: set[int], known: set[int], size: int) -> None:
    chunks = plan_reads([Chunk(number) for number in wanted], size, known=known)
    covered = [number for chunk in chunks
               for number in range(chunk.address, chunk.address + chunk.size)]
    assert wanted <= set(covered) <= wanted | known
    assert len(set(covered)) == len(covered)
    assert max(chunk.size for chunk in chunks) <= size
    allowed = wanted | known
    runs = [frozenset(range(first, first + length))
            for first in wanted for length in range(1, size + 1)
            if set(range(first, first + length)) <= allowed]
    assert not any(wanted <= frozenset().union(*some)
                   for some in combinations(set(runs), len(chunks) - 1) if some)


def test_the_time_of_a_round() -> None:
    # one read of two frames and one write at 125 kbit/s: 405 bits, two requests
    assert round_time([135, 135, 135], 2, 125_000) == pytest.approx(0.00324 + 0.002)


def test_rounds_keep_their_beat() -> None:
    beat = CycleTimer(0.02)
    assert beat.due == math.inf
    beat.start(10.0)
    assert beat.due == 10.0
    assert math.isnan(beat.begun(10.0))
    assert beat.due == pytest.approx(10.02)
    assert beat.begun(10.021) == pytest.approx(0.001)
    assert beat.due == pytest.approx(10.04)
    assert beat.begun(10.095) == pytest.approx(0.054)
    assert beat.due == pytest.approx(10.12), 'not 10.1: no burst'
    beat.stop()
    assert beat.due == math.inf


def test_cycles_that_stop_a_drive_are_brought_forward() -> None:
    timer = CycleTimer(0.5)
    timer.hurry(9.0)
    timer.no_later(9.0)
    assert timer.due == math.inf, 'nothing is planned'
    timer.start(10.0)
    timer.begun(10.0)
    timer.hurry(10.001)
    assert timer.due == pytest.approx(10.005), 'not in a burst'
    assert math.isnan(timer.begun(10.005, 0.1))
    assert timer.due == pytest.approx(10.105)
    timer.hurry(10.09)
    assert timer.due == pytest.approx(10.105), 'it comes soon in any case'
    timer.no_later(10.2)
    assert timer.due == pytest.approx(10.105)
    timer.no_later(10.095)
    assert timer.due == 10.095
