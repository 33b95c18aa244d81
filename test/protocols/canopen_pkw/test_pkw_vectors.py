# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The golden vectors of the PKW mailbox and the CANopen frames around it, both ways."""

import json
from pathlib import Path
from typing import Any

import pytest

from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen_pkw import addresses, pkw

FILE = json.loads((Path(__file__).parents[2] / 'vectors' / 'canopen_pkw.json').read_text(
    encoding='utf-8'))
VECTORS = FILE['vectors']
#: names of the manual -> functions
FUNCTIONS = {
    'none': pkw.Function.NONE, 'error': pkw.Function.ERROR,
    'R_REG_16': pkw.Function.READ_REGISTER_16, 'R_REG_32': pkw.Function.READ_REGISTER_32,
    'W_REG_16': pkw.Function.WRITE_REGISTER_16, 'W_REG_32': pkw.Function.WRITE_REGISTER_32,
    'R_CO_16': pkw.Function.READ_OBJECT_16, 'R_CO_32': pkw.Function.READ_OBJECT_32,
    'W_CO_16': pkw.Function.WRITE_OBJECT_16, 'W_CO_32': pkw.Function.WRITE_OBJECT_32,
}
COMMANDS = {
    'start': network.NmtCommand.START, 'stop': network.NmtCommand.STOP,
    'pre_operational': network.NmtCommand.ENTER_PRE_OPERATIONAL,
    'reset_node': network.NmtCommand.RESET_NODE,
    'reset_communication': network.NmtCommand.RESET_COMMUNICATION,
}
NODE = FILE['defaults']['node']


def rows(*uses: str) -> list[Any]:
    """Return vectors as test parameters."""
    return [pytest.param(row, id=f'{row["id"]}-{row["name"]}') for row in VECTORS
            if row['use'] in uses]


def message(row: dict[str, Any]) -> pkw.Message:
    """Make the message that a vector describes, without the codec."""
    first, second = row['data_words']
    return pkw.Message(word=row['word_1'], code=int(FUNCTIONS[row['function']]),
                       toggle=row['toggle'] == 1, low=row['low_byte'], words=(first, second))


def data(row: dict[str, Any]) -> bytes:
    return bytes.fromhex(row['data_hex'])


def layout(row: dict[str, Any]) -> pkw.Layout:
    return pkw.Layout(row['layout'])


def address(row: dict[str, Any]) -> pkw.Address:
    by_object = FILE['functions'][row['function']]['addressing'] == 'canopen'
    return pkw.Address(row['word_1'], row['low_byte'] if by_object else None)


def frame(text: str) -> Frame:
    identifier, _, payload = text.partition('#')
    return Frame(int(identifier, 16), bytes.fromhex(payload), False)


# -- the mailbox ----------------------------------------------------------------------------------


def test_all_vectors_are_run() -> None:
    assert len(rows('both', 'decode', 'reject')) == len(VECTORS) == 48
    used = {row['function'] for row in VECTORS if 'function' in row}
    assert used == set(FUNCTIONS) == set(FILE['functions'])
    for name in set(FUNCTIONS) - {'none', 'error'}:
        directions = {row['direction'] for row in VECTORS if row.get('function') == name}
        assert directions == {'request', 'response'}
    assert {row['layout'] for row in VECTORS} == {entry.value for entry in pkw.Layout}


@pytest.mark.parametrize('row', rows('both'))
def test_encodes(row: dict[str, Any]) -> None:
    assert pkw.encode(message(row), layout(row)) == data(row)


@pytest.mark.parametrize('row', rows('both', 'decode'))
def test_decodes(row: dict[str, Any]) -> None:
    assert pkw.decode(data(row), layout(row)) == message(row)


@pytest.mark.parametrize('row', rows('reject'))
@pytest.mark.parametrize('any_layout', pkw.Layout)
def test_rejects(row: dict[str, Any], any_layout: pkw.Layout) -> None:
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


def test_function_bytes() -> None:
    for name, function in FILE['functions'].items():
        code = FUNCTIONS[name]
        assert f'{pkw.Message(0, int(code), False).function_byte:02X}' == function['code']
        assert f'{pkw.Message(0, int(code), True).function_byte:02X}' == function['toggled']
        meaning = pkw.Message(0, int(code), True).meaning
        if function['addressing'] is None:
            assert meaning is None
        else:
            assert meaning == pkw.Meaning(function['addressing'] == 'canopen', function['write'],
                                          function['words'])


def test_slip_of_the_page_is_no_function() -> None:
    # the table of responses prints 55h where the request has 35h
    assert pkw.Message(455, 0x55, False).meaning is None
    request = pkw.read_request(pkw.Address(0x2004, 6), 1, False)
    assert not pkw.answers(pkw.decode(bytes.fromhex('0420065583200000'), pkw.Layout.WORD_LE),
                           request)


@pytest.mark.parametrize(('text', 'belongs'), [
    ('C701002583200000', True), ('C7015A2583200000', True), ('C701004E00000206', True),
    ('C70100A583200000', False), ('C70100CE00000206', False), ('C801002583200000', False),
    ('C701002683200000', False), ('C701003583200000', False), ('C701000000000000', False),
])
def test_only_the_echo_of_a_request_is_its_answer(text: str, belongs: bool) -> None:
    request = pkw.read_request(pkw.Address(455), 1, False)
    assert pkw.answers(pkw.decode(bytes.fromhex(text), pkw.Layout.WORD_LE), request) is belongs


def test_subindex_belongs_to_the_address() -> None:
    request = pkw.read_request(pkw.Address(0x2004, 6), 1, False)
    for text, belongs in (('0420063583200000', True), ('0420073583200000', False),
                          ('0420064E11000906', True), ('0420FF4E11000906', False)):
        found = pkw.decode(bytes.fromhex(text), pkw.Layout.WORD_LE)
        assert pkw.answers(found, request) is belongs


@pytest.mark.parametrize('row', [
    pytest.param(row, id=f'{row["id"]}') for row in VECTORS if 'value_32' in row])
def test_values_of_32_bits(row: dict[str, Any]) -> None:
    first, second = row['data_words']
    for order, value in row['value_32'].items():
        assert pkw.value_from_words((first, second), order == 'high_first') == value
        assert pkw.words_from_value(value, order == 'high_first') == (first, second)


def test_requests_that_do_not_fit() -> None:
    with pytest.raises(LocalProtocolError):
        pkw.read_request(pkw.Address(0x10000), 1, False)
    with pytest.raises(LocalProtocolError):
        pkw.read_request(pkw.Address(0xFFFF), 2, False)
    with pytest.raises(LocalProtocolError):
        pkw.read_request(pkw.Address(0x2004, 0xFF), 2, False)
    with pytest.raises(LocalProtocolError):
        pkw.read_request(pkw.Address(455), 3, False)
    with pytest.raises(LocalProtocolError):
        pkw.write_request(pkw.Address(704), (0x10000,), False)
    with pytest.raises(LocalProtocolError):
        pkw.write_request(pkw.Address(704), (1, -1), False)


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


@pytest.mark.parametrize('row', [row for row in FILE['network'] if row['kind'] == 'nmt'],
                         ids=lambda row: str(row['name']))
def test_nmt_commands(row: dict[str, Any]) -> None:
    command = COMMANDS[row['command']]
    assert network.encode_nmt(command, NODE) == frame(row['frame'])
    assert network.decode_nmt(frame(row['frame']).data) == (command, NODE)


@pytest.mark.parametrize('row', [row for row in FILE['network'] if row['kind'] == 'state'],
                         ids=lambda row: str(row['name']))
def test_states(row: dict[str, Any]) -> None:
    state = network.decode_heartbeat(frame(row['frame']).data)
    assert state.text == row['state']
    if 'guarding' not in row['name']:
        assert network.encode_heartbeat(NODE, state) == frame(row['frame'])


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
