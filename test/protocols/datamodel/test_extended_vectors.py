# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the 29-bit codec does besides the telegrams of ``test_telegrams.py``."""

from collections.abc import Sequence

from builders import parameter
import pytest

from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError, Unasked
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.datamodel import extended
from drive_can_bridge.protocols.datamodel.process_words import CyclicCodec


def codec(station: int, words: Sequence[int]) -> CyclicCodec:
    """Return the codec of a drive that has so many unsigned words in both telegrams."""
    parameters = [parameter(f'word_{slot}', 10 + slot) for slot in range(len(words))]
    return CyclicCodec(station, parameters, parameters)


def test_refuses_to_encode_cyclic_telegrams_that_do_not_fit() -> None:
    for station, words in ((128, [0]), (-1, [0]), (1, [0] * 5), (1, [65536]), (1, [-1])):
        with pytest.raises(LocalProtocolError):
            codec(station, words).encode_request(words)
    for words in ([0] * 5, [65536], [-1]):
        with pytest.raises(LocalProtocolError):
            extended.encode_answer(0x003FFFF0, words)


def test_an_answer_is_of_the_station_that_was_asked() -> None:
    answer = Frame(0x102001E2, bytes.fromhex('03E807D000000000'), True)
    assert extended.decode_answer(answer, 1, (30, 2)) == (1000, 2000)
    with pytest.raises(RemoteProtocolError, match='not from station 2'):
        extended.decode_answer(answer, 2, (30, 2))
    for question in ((30, 1), (31, 2), None):
        with pytest.raises(Unasked, match='nobody asked'):
            extended.decode_answer(answer, 1, question)


def test_bit_row_of_the_manual() -> None:
    """0 AAAAAAA 1 1111111111111111 0000, bit 28 first."""
    for station in (1, 5, 64, 127):
        bits = f'0{station:07b}1{"1" * 16}0000'
        assert extended.cyclic_request_identifier(station) == int(bits, 2)
