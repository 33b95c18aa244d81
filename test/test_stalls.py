# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What counts as a machine that stood still, and that nothing else does."""

from itertools import accumulate

import pytest
from stalls import Stall, stalls_of

#: a second of looks that are all in time
STEADY = [0.02] * 50


@pytest.mark.parametrize(('steps', 'found'), [
    (STEADY, []),
    ([0.1, 0.119] * 10, []),                             # a little late is what machines are
    ([*STEADY, 0.13], [(1.0, 1.13)]),
    ([*STEADY, 0.5, *STEADY, 0.2], [(1.0, 1.5), (2.5, 2.7)]),
])
def test_who_wakes_late_saw_a_stall(steps: list[float],
                                    found: list[tuple[float, float]]) -> None:
    looks = [(now, 0.0) for now in accumulate([0.0, *steps])]
    assert [(round(stall.begin, 6), round(stall.end, 6)) for stall in stalls_of(looks)] == found


def test_stolen_time_is_summed_up_over_a_second() -> None:
    looks = [(0.02 * number, 0.9 if number % 5 == 0 else 0.0) for number in range(150)]
    assert not list(stalls_of(looks))                    # 18 %
    looks = [(now, min(1.0, 1.5 * share)) for now, share in looks]
    assert not list(stalls_of(looks))                    # 20 %
    looks = [(now, 0.3) for now, _ in looks]
    assert [stall.how for stall in stalls_of(looks)] == ['30 % were stolen'] * 2


def test_a_stall_is_told_in_words() -> None:
    assert str(Stall(10.0, 10.25, 'it stood still')) == 'it stood still for 0.25 s'
