# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The position of an axis that turns on and on: counters as they come, sums without wraps."""

from builders import INT16, INT32, parameter
import pytest

from drive_can_bridge.core.configuration import JointConfiguration
from drive_can_bridge.core.continuous import ContinuousPosition
from drive_can_bridge.core.parameters import ParameterType


def position(continuous: bool | int, kind: ParameterType) -> ContinuousPosition:
    return ContinuousPosition(JointConfiguration('j', position='place', continuous=continuous), (
        parameter('speed', 1), parameter('place', 2, type=kind)))


@pytest.mark.parametrize(('continuous', 'kind', 'samples', 'sums'), [
    (True, INT16, [32000, 32767, -32768, -32000, 0, 32000, -32000],
     [32000, 32767, 32768, 33536, 65536, 97536, 99072]),
    (True, INT16, [-32000, 32000, 0, -32000, 32000], [-32000, -33536, -65536, -97536, -99072]),
    (True, INT32, [2147483600, -2147483648, -2147483000], [2147483600, 2147483648, 2147484296]),
    (True, ParameterType.UINT16, [65000, 100, 40, 65500], [65000, 65636, 65576, 65500]),
    # an encoder that counts 0 to 3599, and one that counts -1800 to 1799
    (3600, ParameterType.UINT16, [3590, 5, 3595, 1795], [3590, 3605, 3595, 1795]),
    (3600, INT16, [1790, -1790, 5], [1790, 1810, 3605]),
    (4001, ParameterType.UINT16, [4000, 0, 2000, 4000, 0], [4000, 4001, 6001, 8001, 8002]),
])
def test_goes_on_where_the_counter_wraps(continuous: bool | int, kind: ParameterType,
                                         samples: list[int], sums: list[int]) -> None:
    joint = position(continuous, kind)
    assert joint.slot == 1
    assert [joint.take(raw) for raw in samples] == sums


def test_begins_again_at_the_own_value_of_the_drive() -> None:
    joint = position(True, INT16)
    said = []
    for raw in (32767, -32768, None, 5, 6, None, None, 7):
        if raw is None:
            joint.begin_again()
        else:
            said.append((joint.take(raw), joint.begun_again))
    assert said == [(32767, False), (32768, False), (5, True), (6, False), (7, True)]
