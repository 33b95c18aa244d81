# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The codecs of CANnord with anything that fits, and with anything at all."""

from hypothesis import given, strategies as st

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.protocols.cannord import identifiers, process_data, states
from drive_can_bridge.protocols.cannord.identifiers import MessageObject
from drive_can_bridge.protocols.cannord.parameter_frame import ParameterFrame, ParameterLayout

WORDS = st.integers(0, 0xFFFF)


@given(st.sampled_from(MessageObject), st.integers(0, 255), st.booleans())
def test_identifiers(kind: MessageObject, address: int, extended: bool) -> None:
    value = identifiers.identifier(kind, address, extended=extended)
    if extended:
        assert value == identifiers.identifier(kind, address) * 262144
    else:
        assert identifiers.decode_identifier(value) == (kind, address)


def test_any_identifier() -> None:
    for value in range(0x800):
        found = identifiers.decode_identifier(value)
        if found is None:
            assert value >= 0x400
        else:
            assert identifiers.identifier(*found) == value


@given(WORDS, st.lists(WORDS, max_size=3), st.booleans())
def test_main_frames(word: int, values: list[int], swap: bool) -> None:
    length = process_data.main_length(len(values))
    data = process_data.encode_main(word, values, length=length, swap=swap)
    assert len(data) == length
    found = process_data.decode_main(data, swap=swap)
    assert found.word == word
    assert list(found.values[:len(values)]) == values
    assert not any(found.values[len(values):])


@given(st.lists(WORDS, max_size=2))
def test_additional_frames(values: list[int]) -> None:
    data = process_data.encode_extra(values)
    assert len(data) == 5
    assert data[4] == 0
    assert list(process_data.decode_extra(data))[:len(values)] == values


@given(st.integers(0, 15), st.integers(0, 2047), st.integers(0, 255),
       st.integers(-0x80000000, 0xFFFFFFFF), st.sampled_from(['high_first', 'low_first']),
       st.sampled_from(['low', 'high']))
def test_parameter_frames(identifier: int, number: int, index: int, value: int, value_order: str,
                          index_byte: str) -> None:
    layout = ParameterLayout(value_order, index_byte)
    data = layout.encode(identifier, number, index, value)
    assert layout.decode(data) == ParameterFrame(identifier, number, index, value & 0xFFFFFFFF)
    if value_order == 'low_first':
        assert data[4:] == (value & 0xFFFFFFFF).to_bytes(4, 'little')
    assert data[2:4].index(index) == (0 if index_byte == 'low' or not index else 1)


@given(st.binary(max_size=8), st.sampled_from(['high_first', 'low_first']),
       st.sampled_from(['low', 'high']), st.booleans())
def test_any_bytes(data: bytes, value_order: str, index_byte: str, swap: bool) -> None:
    for decode in (ParameterLayout(value_order, index_byte).decode, process_data.decode_extra,
                   lambda entry: process_data.decode_main(entry, swap=swap)):
        try:
            decode(data)
        except RemoteProtocolError as error:
            assert str(error)


@given(WORDS)
def test_any_status_word(word: int) -> None:
    state = states.state_of(word)
    if state in (states.InverterState.FAULT, states.InverterState.FAULT_REACTION):
        assert states.is_faulted(word)
    elif state is not states.InverterState.UNKNOWN:
        assert not states.is_faulted(word)
    assert (state is states.InverterState.OPERATION_ENABLED) == (word & 0x7F == 0x37)
