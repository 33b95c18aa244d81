# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Who gets a frame."""

from hypothesis import given, strategies as st
import pytest

from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.exchange.exchange import Router

ROUTES = {
    'one': [Route(0x00200000, 0x0FE00000, True)],
    'two': [Route(0x00400000, 0x0FE00000, True)],
    'plain': [Route(0x3F1, 0x7FF, False), Route(0x7F1, 0x7FF, False)],
    'broad': [Route(0x100, 0x700, False)],
}


def router() -> Router[str]:
    made: Router[str] = Router()
    for owner, routes in ROUTES.items():
        made.add(routes, owner)
    return made


@pytest.mark.parametrize('identifier, extended, owner', [
    (0x003FFFF0, True, 'one'), (0x103FFFF0, True, 'one'), (0x102001E2, True, 'one'),
    (0x005FFFF0, True, 'two'), (0x007FFFF0, True, None),
    (0x3F1, False, 'plain'), (0x7F1, False, 'plain'), (0x3F2, False, None),
    (0x3F1, True, None), (0x7F1, True, None),            # the same number, the other format
    (0x123, False, 'broad'), (0x123, True, None),
])
def test_identifier_and_format_decide(identifier: int, extended: bool, owner: str | None) -> None:
    assert router().find(Frame(identifier, b'', extended)) == owner


def test_empty() -> None:
    assert Router().find(Frame(1, b'', True)) is None


@given(st.integers(0, 0x1FFFFFFF), st.booleans())
def test_agrees_with_the_routes(identifier: int, extended: bool) -> None:
    frame = Frame(identifier if extended else identifier & 0x7FF, b'', extended)
    owners = {owner for owner, routes in ROUTES.items()
              if any(route.matches(frame) for route in routes)}
    found = router().find(frame)
    assert found in owners if owners else found is None
