# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Frames, routes, units and errors: the small parts."""

import math

import pytest

from drive_can_bridge.core.configuration import convertible_units, JointQuantity, si_factor
from drive_can_bridge.core.errors import (
    BusUnavailable, ConfigurationError, DriveCanError, LocalProtocolError, RemoteProtocolError)
from drive_can_bridge.core.frame import Frame, Route


def test_frames_read_as_candump_writes_them() -> None:
    assert str(Frame(0x3FFFF0, b'\x05\xDC', True)) == '003FFFF0#05DC'
    assert str(Frame(0x3F1, b'', False)) == '3F1#'
    assert Frame(0x3F1, b'', False) != Frame(0x3F1, b'', True)


def test_routes_look_at_the_format() -> None:
    route = Route(0x3F1, 0x7FF, False)
    assert route.matches(Frame(0x3F1, b'', False))
    assert not route.matches(Frame(0x3F1, b'', True))
    assert not route.matches(Frame(0x3F2, b'', False))
    assert Route(0x10200000, 0x1FE00000, True).matches(Frame(0x103FFFF0, b'', True))


@pytest.mark.parametrize('quantity, unit, options, factor', [
    (JointQuantity.VELOCITY, 'rpm', {}, 2 * math.pi / 60),
    (JointQuantity.VELOCITY, 'rad/s', {}, 1.0),
    (JointQuantity.VELOCITY, 'deg/s', {}, math.pi / 180),
    (JointQuantity.VELOCITY, 'Hz', {}, 2 * math.pi),
    (JointQuantity.VELOCITY, 'Hz', {'pole_pairs': 2}, math.pi),
    (JointQuantity.VELOCITY, 'rpm', {'pole_pairs': 2}, 2 * math.pi / 60),
    (JointQuantity.VELOCITY, 'rpm', {'gear_ratio': -2.0}, -math.pi / 60),
    (JointQuantity.POSITION, 'rev', {'gear_ratio': 2.0}, math.pi),
    (JointQuantity.POSITION, 'rad', {}, 1.0),
    (JointQuantity.POSITION, 'deg', {}, math.pi / 180), (JointQuantity.POSITION, 'rpm', {}, None),
    (JointQuantity.VELOCITY, 'furlong', {}, None), (JointQuantity.EFFORT, 'anything', {}, 1.0),
    (JointQuantity.EFFORT, 'A', {'gear_ratio': 5.0}, 1.0),
])
def test_factors(quantity: JointQuantity, unit: str, options: dict[str, float],
                 factor: float | None) -> None:
    found = si_factor(quantity, unit, **options)
    assert found == (factor if factor is None else pytest.approx(factor))


def test_units_that_convert() -> None:
    assert convertible_units(JointQuantity.POSITION) == ('rad', 'deg', 'rev')
    assert convertible_units(JointQuantity.EFFORT) == ()


def test_errors() -> None:
    error = ConfigurationError(['one', 'two'])
    assert error.problems == ['one', 'two']
    assert str(error) == 'one\ntwo'
    assert issubclass(LocalProtocolError, ValueError)
    assert issubclass(BusUnavailable, OSError)
    assert issubclass(RemoteProtocolError, DriveCanError)
