# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the 11-bit codec does besides the telegrams of ``test_telegrams.py``, and tables."""

from collections.abc import Callable
from typing import Any

import pytest

from drive_can_bridge.core.errors import LocalProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.datamodel import standard


# -- the manual's tables, "Lettura di parametri" and "Scrittura di un parametro" ------------------


def test_reading_byte_by_byte() -> None:
    made = standard.encode_read_request(0x3F1, 0x1234, 4)
    assert made == Frame(0x3F1, bytes([3, 0x34, 0x12, 4, 0, 0, 0, 0]), False)
    answer = Frame(0x7F1, bytes([0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88]), False)
    assert standard.decode_read_response(answer, 4) == (0x2211, 0x4433, 0x6655, 0x8877)


def test_writing_byte_by_byte() -> None:
    made = standard.encode_write(0x3F1, 0x1234, 0xABCD)
    assert made == Frame(0x3F1, bytes([6, 0x34, 0x12, 0xCD, 0xAB, 0, 0, 0]), False)


def test_sums_are_sums() -> None:
    """An OR of 3F8h and 9 would be 3F9h."""
    assert standard.identifier(0x3F8, 9) == 0x401


@pytest.mark.parametrize(('encode', 'arguments'), [
    (standard.encode_read_request, [(0, 0), (0, 5), (-1, 1), (0xFFFF, 2), (70000, 1)]),
    (standard.encode_write, [(-1, 0), (0x10000, 0), (50, -1), (50, 0x10000)]),
    (standard.encode_read_response, [((),), ((0,) * 5,), ((-1,),), ((0x10000,),)])])
def test_what_cannot_be_encoded(
        encode: Callable[..., Frame], arguments: list[tuple[Any, ...]]) -> None:
    for each in arguments:
        with pytest.raises(LocalProtocolError):
            encode(0x3F1, *each)
