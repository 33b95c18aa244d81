# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Names of values: in a parameter, and in one line."""

from builders import INT16, parameter
import pytest

from drive_can_bridge.core.value_names import joined, taken_apart

BY_INPUT = 'motor by digital input 2'
NAMES = ((0, 'terminals'), (3, 'bus'), (-1, BY_INPUT), (7, 'E7: too hot'))


def test_one_line_and_back() -> None:
    assert joined(NAMES[:2]) == '0:terminals 3:bus'
    assert taken_apart(joined(NAMES)) == NAMES
    assert taken_apart('') == taken_apart('nonsense') == ()


def test_a_value_by_its_name() -> None:
    source = parameter('source', 51, type=INT16, values=NAMES)
    assert [source.name_of(value) for value in (0, 3, -1, 5)] == [
        'terminals', 'bus', BY_INPUT, '']
    assert source.value_named('bus') == 3
    assert source.value_named('3') is source.value_named('') is None
    scaled = parameter('fault', 700, scale=0.1, values=((102, 'time-out'),))
    assert scaled.name_of(scaled.value_from_raw(102)) == 'time-out'


@pytest.mark.parametrize(('scale', 'raw', 'text'), [
    (None, 7, '7'), (0.1, 102, '10.2'), (0.1, 30, '3.0'), (0.01, 5, '0.05'), (10.0, 3, '30')])
def test_a_number_as_the_manual_writes_it(scale: float | None, raw: int, text: str) -> None:
    options = {} if scale is None else {'scale': scale}
    assert parameter('fault', 700, **options).shown(raw) == text
