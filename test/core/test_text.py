# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What others bring is printable, and short, before it reaches a log or a terminal."""

from hypothesis import given, strategies
import pytest

from drive_can_bridge.core.text import printable


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
