# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The 29-bit codec with anything that fits, and with anything at all."""

from builders import parameter
from hypothesis import example, given, strategies as st

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.datamodel import extended
from drive_can_bridge.protocols.datamodel.options import differences, effective, padded
from drive_can_bridge.protocols.datamodel.process_words import CyclicCodec

STATIONS = st.integers(0, 127)
WORDS = st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=4)
ENTRIES = st.lists(st.sampled_from([0, 1, 50, 209, 65535]), min_size=4, max_size=4)


@st.composite
def windows(draw: st.DrawFn) -> tuple[int, list[int]]:
    words = draw(WORDS)
    return draw(st.integers(0, 0x10000 - len(words))), words


@given(STATIONS, st.lists(st.integers(0, 0xFFFF), max_size=4))
def test_cyclic_telegrams(station: int, words: list[int]) -> None:
    parameters = [parameter(f'word_{slot}', 10 + slot) for slot in range(len(words))]
    codec = CyclicCodec(station, parameters, parameters)
    request = codec.encode_request(words)
    response = extended.encode_answer(request.identifier, words)
    assert codec.decode_request(request.data) == (tuple(words), '')
    assert codec.decode_response(response.data) == (tuple(words), '')
    assert extended.decode(request, count=len(words), strict=True) == extended.CyclicRequest(
        tuple(words))
    assert extended.decode(response, count=len(words), strict=True) == extended.CyclicResponse(
        tuple(words))
    assert extended.station_of(request.identifier) == station
    assert response.identifier == codec.response_identifier == request.identifier + 0x10000000
    assert codec.request_identifier == request.identifier


@given(STATIONS, windows())
def test_acyclic_telegrams(station: int, window: tuple[int, list[int]]) -> None:
    number, words = window
    asked = extended.encode_read_request(station, number, len(words))
    answer = extended.encode_answer(asked.identifier, words)
    assert extended.decode(asked) == extended.ReadTelegram(number, len(words))
    assert extended.decode(answer) == extended.ReadResponse(number, tuple(words))
    assert answer.identifier == asked.identifier + 0x10000000
    assert extended.station_of(asked.identifier) == station
    assert asked.data == bytes(8)
    if number != 0xFFFF:
        written = extended.encode_write(station, number, words)
        assert extended.decode(written) == extended.WriteTelegram(number, tuple(words))
        assert written.identifier == asked.identifier + 0x100000


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.booleans(), st.integers(0, 4),
       st.booleans())
@example(0x103FFFF0, b'', True, 4, False)
@example(0x103FFFFF, bytes(8), True, 4, False)
@example(0x102FFFF2, bytes(8), True, 4, False)
@example(0x3F1, bytes(8), False, 4, False)
def test_anything(identifier: int, data: bytes, is_extended: bool, count: int,
                  strict: bool) -> None:
    frame = Frame(identifier, data, is_extended)
    try:
        telegram = extended.decode(frame, count=count, strict=strict)
    except RemoteProtocolError as error:
        assert str(error)
        return
    assert is_extended
    assert extended.station_of(identifier) == identifier >> 21 & 0x7F
    if identifier & 0xF:
        assert (identifier >> 4 & 0xFFFF) + (identifier & 0xF) <= 0x10000
    if not isinstance(telegram, extended.ReadTelegram):
        assert len(data) >= 2 * len(telegram.words)
        assert len(data) == 8 or not strict


@given(ENTRIES, ENTRIES)
def test_maps(request: list[int], response: list[int]) -> None:
    wanted_request, wanted_response = effective(request), effective(response)
    assert 0 not in wanted_request
    assert padded(wanted_request)[:len(wanted_request)] == wanted_request
    assert not differences(request, response, wanted_request=wanted_request,
                           wanted_response=wanted_response)
    # a longer response map will do, a longer request map will not
    assert not differences(request, response, wanted_request=wanted_request,
                           wanted_response=wanted_response[:1])
    shorter = wanted_request[:-1]
    found = differences(request, response, wanted_request=shorter,
                        wanted_response=wanted_response)
    assert bool(found) == (shorter != wanted_request)
