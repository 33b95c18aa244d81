# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The golden vectors of the PKW mailbox and the CANopen frames around it.

:mod:`test_telegrams` runs the mailbox's both ways through the codec.
"""

import json
from pathlib import Path
from typing import Any

from builders import frame
import pytest

from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen_pkw import addresses, pkw

FILE = json.loads((Path(__file__).parents[2] / 'vectors' / 'canopen_pkw.json').read_text(
    encoding='utf-8'))
VECTORS = FILE['vectors']
NODE = FILE['defaults']['node']


def rows(*uses: str) -> list[Any]:
    """Return vectors as test parameters."""
    return [pytest.param(row, id=f'{row["id"]}-{row["name"]}') for row in VECTORS
            if row['use'] in uses]


def data(row: dict[str, Any]) -> bytes:
    return bytes.fromhex(row['data_hex'])


def layout(row: dict[str, Any]) -> pkw.PkwLayout:
    return pkw.PkwLayout(row['layout'])


def address(row: dict[str, Any]) -> pkw.Address:
    by_object = FILE['functions'][row['function']]['addressing'] == 'canopen'
    return pkw.Address(row['word_1'], row['low_byte'] if by_object else None)


# -- the mailbox ----------------------------------------------------------------------------------


def test_all_vectors_are_run() -> None:
    assert len(rows('both', 'decode', 'reject')) == len(VECTORS) == 48
    used = {row['function'] for row in VECTORS if 'function' in row}
    assert used == set(FILE['functions'])
    for name in used - {'none', 'error'}:
        directions = {row['direction'] for row in VECTORS if row.get('function') == name}
        assert directions == {'request', 'response'}
    assert {row['layout'] for row in VECTORS} == {entry.value for entry in pkw.PkwLayout}


@pytest.mark.parametrize('row', rows('reject'))
@pytest.mark.parametrize('any_layout', pkw.PkwLayout)
def test_rejects(row: dict[str, Any], any_layout: pkw.PkwLayout) -> None:
    with pytest.raises(RemoteProtocolError, match=f'{len(data(row))} data bytes'):
        pkw.decode(data(row), any_layout)


@pytest.mark.parametrize('row', [
    row for row in rows('both') if row.values[0]['direction'] == 'request'
    and row.values[0]['function'] != 'none'])
def test_requests_are_made(row: dict[str, Any]) -> None:
    function = FILE['functions'][row['function']]
    toggle = row['toggle'] == 1
    if function['write']:
        made = pkw.write_request(address(row), tuple(row['data_words'][:function['words']]),
                                 toggle)
    else:
        made = pkw.read_request(address(row), function['words'], toggle)
    assert pkw.encode(made, layout(row)) == data(row)


@pytest.mark.parametrize('row', [
    row for row in rows('both') if row.values[0]['direction'] == 'response'
    and row.values[0]['function'] not in ('none', 'error')])
def test_responses_are_made_and_belong_to_their_request(row: dict[str, Any]) -> None:
    function = FILE['functions'][row['function']]
    toggle = row['toggle'] == 1
    request = (pkw.write_request(address(row), (7,) * function['words'], toggle)
               if function['write']
               else pkw.read_request(address(row), function['words'], toggle))
    made = pkw.response(request, tuple(row['data_words']))
    assert pkw.encode(made, layout(row)) == data(row)
    assert pkw.answers(pkw.decode(data(row), layout(row)), request)


@pytest.mark.parametrize('row', [
    pytest.param(row, id=f'{row["id"]}') for row in VECTORS if 'value_32' in row])
def test_values_of_32_bits(row: dict[str, Any]) -> None:
    first, second = row['data_words']
    for order, value in row['value_32'].items():
        assert pkw.value_from_words((first, second), order == 'high_first') == value
        assert pkw.words_from_value(value, order == 'high_first') == (first, second)


def test_requests_that_do_not_fit() -> None:
    for place, count in (((0x10000,), 1), ((0xFFFF,), 2), ((0x2004, 0xFF), 2), ((455,), 3)):
        with pytest.raises(LocalProtocolError):
            pkw.read_request(pkw.Address(*place), count, False)
    for words in ((0x10000,), (1, -1)):
        with pytest.raises(LocalProtocolError):
            pkw.write_request(pkw.Address(704), words, False)


# -- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize('row', [
    pytest.param(row, id=f'{row["id"]}') for row in VECTORS if 'abort_code' in row])
def test_codes_of_refusals(row: dict[str, Any]) -> None:
    code, order = int(row['abort_code'], 16), row['abort_order']
    words = pkw.decode(data(row), layout(row)).words
    other = {'low_first': 'high_first', 'high_first': 'low_first'}[order]
    assert pkw.code_from_words(words, order) == code
    assert pkw.code_from_words(words, 'auto') == code
    assert pkw.code_from_words(words, other) != code
    assert pkw.words_from_code(code, order) == words


def test_table_of_codes() -> None:
    codes = {int(code, 16) for code in FILE['abort_codes']}
    assert codes == set(sdo.TEXTS)
    assert len(set(sdo.TEXTS.values())) == len(codes)
    # 'auto' can tell the order of every one of them
    for code in codes:
        for words in ((code & 0xFFFF, code >> 16), (code >> 16, code & 0xFFFF)):
            assert pkw.code_from_words(words, 'auto') == code
        assert f'{code:08X}h' in pkw.describe(code)


@pytest.mark.parametrize(('code', 'meaning'), [
    (1, 'stack full'), (3, 'register not found'), (4, 'answer delayed'), (6, 'unknown'),
    (7, 'not all registers found'), (8, 'read-only'), (10, 'word value too high'),
    (11, 'word value too low'), (12, 'byte value too high'), (13, 'byte value too low'),
    (16, 'invalid value'), (20, 'bad answer'), (0xFF, 'unknown')])
def test_small_numbers_are_those_of_the_profibus_variant(code: int, meaning: str) -> None:
    assert meaning in pkw.describe(code)
    assert 'no SDO abort code' in pkw.describe(code)


# -- registers as objects -------------------------------------------------------------------------


@pytest.mark.parametrize('row', FILE['object_map'], ids=lambda row: str(row['register']))
def test_object_map(row: dict[str, Any]) -> None:
    place = int(row['index'], 16), int(row['subindex'], 16)
    assert addresses.object_of(row['register']) == place
    assert addresses.register_of(*place) == row['register']


def test_what_the_object_map_lacks() -> None:
    for register in FILE['without_object']:
        assert addresses.object_of(register) is None
    for index, subindex in FILE['without_register']:
        assert addresses.register_of(int(index, 16), int(subindex, 16)) is None


# -- the network around it ------------------------------------------------------------------------


@pytest.mark.parametrize('row', [row for row in FILE['network'] if row['kind'] == 'state'],
                         ids=lambda row: str(row['name']))
def test_states(row: dict[str, Any]) -> None:
    state = network.decode_heartbeat(frame(row['frame']).data)
    assert state.text == row['state']


@pytest.mark.parametrize('row', [row for row in FILE['network'] if row['kind'] == 'emergency'],
                         ids=lambda row: str(row['name']))
def test_emergencies(row: dict[str, Any]) -> None:
    emergency = network.Emergency(int(row['code'], 16), int(row['register'], 16),
                                  bytes.fromhex(row['manufacturer']))
    assert network.encode_emergency(NODE, emergency) == frame(row['frame'])
    assert network.decode_emergency(frame(row['frame']).data) == emergency


@pytest.mark.parametrize('text', ['', '0000', '01', '06', '85FF'])
def test_what_is_no_state(text: str) -> None:
    with pytest.raises(RemoteProtocolError):
        network.decode_heartbeat(bytes.fromhex(text))


def test_default_identifiers() -> None:
    first = FILE['exchanges'][0]['frames']
    assert first[0].startswith(f'> {network.REQUEST_BASE + NODE:03X}#')
    assert first[1].startswith(f'< {network.RESPONSE_BASE + NODE:03X}#')
