# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The golden vectors of CANnord.

:mod:`test_telegrams` runs identifiers, process data and parameters both ways through the codecs.
"""

import json
from pathlib import Path
from typing import Any

import pytest

from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.cannord import identifiers, process_data, states
from drive_can_bridge.protocols.cannord.identifiers import MessageObject
from drive_can_bridge.protocols.cannord.parameter_frame import (
    ERRORS, ParameterLayout, ResponseId, Task)

FILE = json.loads((Path(__file__).parents[2] / 'vectors' / 'cannord.json').read_text(
    encoding='utf-8'))


# -- identifiers ----------------------------------------------------------------------------------


def test_the_manuals_example() -> None:
    example = FILE['example_of_address_100']
    assert [identifiers.identifier(kind, 100) for kind in MessageObject] == [
        200, 201, 712, 713] == [example[name] for name in (
            'process_request', 'process_response', 'parameter_task', 'parameter_answer')]
    assert identifiers.group_identifier(100) == 1027 == example['group']
    assert identifiers.all_identifier() == 1032 == example['all']


@pytest.mark.parametrize('address', [-1, 256])
def test_addresses_that_do_not_exist(address: int) -> None:
    with pytest.raises(LocalProtocolError, match='0 to 255'):
        identifiers.identifier(MessageObject.PROCESS_REQUEST, address)
    with pytest.raises(LocalProtocolError, match='0 to 255'):
        identifiers.group_identifier(address)


def test_routes() -> None:
    route = Route.of(0xC9)
    assert route.matches(Frame(0xC9, b'', False))
    assert not route.matches(Frame(0xC9, b'', True))
    assert not route.matches(Frame(0xC8, b'', False))
    wide = Route.of(0x03240000, extended=True)
    assert wide.matches(Frame(0x03240000, b'', True))
    assert not wide.matches(Frame(0x03240001, b'', True))


# -- process data ---------------------------------------------------------------------------------


def test_no_frame_is_both_main_and_additional() -> None:
    for row in FILE['process']:
        if row['expect'] == 'ok':
            extra = row['kind'].startswith('extra')
            other = process_data.decode_main if extra else process_data.decode_extra
            with pytest.raises(RemoteProtocolError):
                other(bytes.fromhex(row['data_hex']))


def test_what_cannot_be_sent() -> None:
    for values, length in (([1, 2], 4), ([1, 2, 3, 4], 8), ([0], 6), ([0x10000], 4), ([-1], 4)):
        with pytest.raises(LocalProtocolError):
            process_data.encode_main(0x047E, values, length=length)
    for values in ([1, 2, 3], [0x10000], [-1]):
        with pytest.raises(LocalProtocolError):
            process_data.encode_extra(values)
    with pytest.raises(LocalProtocolError):
        process_data.main_length(4)
    for size in (0, 4, 6, 8):
        with pytest.raises(RemoteProtocolError):
            process_data.decode_extra(bytes(size))


# -- parameters -----------------------------------------------------------------------------------


@pytest.mark.parametrize(('identifier', 'number', 'index', 'value'), [
    (16, 1, 0, 0), (-1, 1, 0, 0), (1, 2048, 0, 0), (1, -1, 0, 0), (1, 1, 256, 0), (1, 1, -1, 0),
    (1, 1, 0, 1 << 32), (1, 1, 0, -(1 << 31) - 1)])
def test_fields_out_of_range(identifier: int, number: int, index: int, value: int) -> None:
    with pytest.raises(LocalProtocolError):
        ParameterLayout().encode(identifier, number, index, value)


def test_every_task_and_answer_has_a_vector() -> None:
    assert (len(FILE['process']), len(FILE['parameter'])) == (42, 44)
    found = {kind: {row['code'] for row in FILE['parameter']
                    if row['kind'] == kind and row['expect'] == 'ok'}
             for kind in ('task', 'answer')}
    assert found == {'task': set(map(int, Task)), 'answer': set(map(int, ResponseId))}


def test_errors_have_words() -> None:
    assert sorted(ERRORS) == FILE['error_numbers']


# -- states ---------------------------------------------------------------------------------------


@pytest.mark.parametrize('row', FILE['status_words'], ids=lambda row: row['word'])
def test_states(row: dict[str, str]) -> None:
    word = int(row['word'], 16)
    assert states.state_of(word).value == row['state']
    assert states.is_faulted(word) == ('fault' in row['state'])


@pytest.mark.parametrize('text', FILE['status_words_of_no_state'])
def test_words_of_no_state(text: str) -> None:
    assert states.state_of(int(text, 16)) is states.InverterState.UNKNOWN


def test_control_words() -> None:
    assert (states.READY, states.RUN, states.QUICK_STOP, states.ACKNOWLEDGE) == (
        0x047E, 0x047F, 0x047A, 0x04FE)
    assert [states.parameter_set_bits(chosen) for chosen in (1, 2, 3, 4)] == [
        0, 0x4000, 0x8000, 0xC000]
    assert [states.parameter_set_of(word) for word in (0x047F, 0x447F, 0x847F, 0xC47F)] == [
        1, 2, 3, 4]
    for chosen in (0, 5):
        with pytest.raises(LocalProtocolError):
            states.parameter_set_bits(chosen)


def test_status_bits() -> None:
    assert states.STATUS_BITS == {
        'ready_to_switch_on': 0, 'ready': 1, 'enabled': 2, 'fault': 3, 'voltage_enabled': 4,
        'no_quick_stop': 5, 'switch_on_disabled': 6, 'warning': 7, 'setpoint_reached': 8,
        'bus_control': 9, 'bit_10': 10, 'rotating_right': 11, 'rotating_left': 12, 'bit_13': 13}


@pytest.mark.parametrize('row', FILE['normalisation'], ids=lambda row: str(row['raw']))
def test_normalisation(row: dict[str, Any]) -> None:
    for unit, reference, key in (('%', 100.0, 'percent'), ('Hz', 50.0, 'hertz_of_50')):
        setpoint = Parameter('setpoint', ParameterType.INT16, unit=unit, scaled=True,
                             scale=reference / 0x4000)
        assert setpoint.value_from_raw(row['raw']) == row[key]
        assert setpoint.raw_from_value(row[key]) == row['raw']
