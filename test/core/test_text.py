# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What others bring is printable and short; types, and names of values, in words."""

from array import array
from typing import Any

from builders import INT16, parameter
from hypothesis import given, strategies
import pytest

from drive_can_bridge.core.text import describe_type, joined, printable, taken_apart


@pytest.mark.parametrize('text, wanted', [
    ('ramp_time', 'ramp_time'), ('Größe in °C', 'Größe in °C'), ('', ''),
    ('a\nb\r\tc', r'a\nb\r\tc'),
    ('\x1b[2J\x1b]0;title\x07', r'\x1b[2J\x1b]0;title\x07'),
    ('\x9b1m\x85', r'\x9b1m\x85'),            # C1: another escape, another line feed
    ('\u2028\u202e\ufeff', r'\u2028\u202e\ufeff'),
    ('\udcff\x00', r'\udcff\x00'),
])
def test_escapes(text: str, wanted: str) -> None:
    assert printable(text) == wanted


@pytest.mark.parametrize('text, wanted', [
    ('a' * 256, 'a' * 256), ('a' * 257, 'a' * 255 + '…'), ('a' * 2_000_000, 'a' * 255 + '…'),
    ('\n' * 128, r'\n' * 128), ('\n' * 129, r'\n' * 127 + '\\…')])
def test_cuts(text: str, wanted: str) -> None:
    assert printable(text) == wanted
    assert printable(text, None).startswith(wanted[:-1])


@given(strategies.text() | strategies.text(strategies.characters(categories=['C', 'Z'])),
       strategies.integers(1, 40))
def test_anything(text: str, limit: int) -> None:
    found = printable(text, limit)
    assert found.isprintable() and len(found) <= limit
    assert printable(found, limit) == found


@pytest.mark.parametrize(('value', 'words'), [
    (True, 'a bool'), (1, 'an integer'), (1.0, 'a number'), ('1', 'a string'),
    ([], 'an empty list'), ([1], 'a list'), ((1,), 'a list'), (array('q', [1]), 'a list'),
    (array('d'), 'an empty list'), ({}, 'a mapping'), (None, 'no value')])
def test_describes_the_type(value: Any, words: str) -> None:
    assert describe_type(value) == words


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
