# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The golden vectors and the manual's worked examples, both ways through the codec."""

from collections.abc import Sequence
import json
from pathlib import Path
from typing import Any

from builders import drive, parameter
import pytest

from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError, Unasked
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.protocols.datamodel import extended
from drive_can_bridge.protocols.datamodel.options import effective
from drive_can_bridge.protocols.datamodel.process_words import CyclicCodec
from drive_can_bridge.protocols.families import FAMILIES

FILE = json.loads((Path(__file__).parents[2] / 'vectors' / 'datamodel.json').read_text(
    encoding='utf-8'))
ROWS = [row for row in FILE['vectors'] if row['protocol'] == 'extended']
KINDS = {
    'cyclic_request': extended.CyclicRequest, 'cyclic_response': extended.CyclicResponse,
    'acyclic_write': extended.Write, 'read_request': extended.ReadRequest,
    'read_response': extended.ReadResponse,
}


def rows(use: str, *expectations: str) -> list[Any]:
    """Return vectors as test parameters. Remote frames never become a Frame: not the codec's."""
    return [pytest.param(row, id=f'{row["id"]}-{row["name"]}') for row in ROWS
            if use in (row['use'], 'any') and row['expect'] in expectations
            and not row['is_remote_frame']]


def frame(row: dict[str, Any]) -> Frame:
    return Frame(int(row['can_id_hex'], 16), bytes.fromhex(row['data_hex']),
                 row['is_extended_id'])


def decode(row: dict[str, Any], *, strict: bool = False) -> extended.Telegram:
    mapping = row['fields'].get('mapping')
    count = 4 if mapping is None else len(effective(mapping))
    telegram = extended.decode(frame(row), count=count, strict=strict)
    assert extended.station_of(frame(row).identifier) == row['fields']['station']
    return telegram


def telegram(row: dict[str, Any]) -> extended.Telegram:
    """Make the telegram that a vector describes, without the codec."""
    fields = row['fields']
    words = tuple(row['words_u16'])
    kind = KINDS[row['kind']]
    if kind in (extended.CyclicRequest, extended.CyclicResponse):
        return kind(words)
    if kind is extended.ReadRequest:
        return extended.ReadRequest(fields['param'], fields['count'])
    return kind(fields['param'], words)


def encode(row: dict[str, Any]) -> Frame:
    fields = row['fields']
    station, words = fields['station'], row['words_u16']
    if row['kind'] == 'cyclic_request':
        return codec(station, words).encode_request(words)
    if row['kind'] == 'cyclic_response':
        return extended.encode_answer(codec(station, words).request_identifier, words)
    if row['kind'] == 'acyclic_write':
        return extended.encode_write(station, fields['param'], words)
    if row['kind'] == 'read_response':
        request = extended.encode_read_request(station, fields['param'], len(words))
        return extended.encode_answer(request.identifier, words)
    return extended.encode_read_request(station, fields['param'], fields['count'])


def codec(station: int, words: Sequence[int], *, strict: bool = False) -> CyclicCodec:
    """Return the codec of a drive that has so many unsigned words in both telegrams."""
    parameters = [parameter(f'word_{slot}', 10 + slot) for slot in range(len(words))]
    return CyclicCodec(station, parameters, parameters, strict=strict)


def test_all_vectors_are_run() -> None:
    run = [*rows('both', 'ok'), *rows('decode', 'ok', 'reject', 'accept_if_lenient'),
           *rows('encode', 'reject')]
    remote = [row for row in ROWS if row['is_remote_frame']]
    assert len(run) + len(remote) == len(ROWS) == 58
    assert len(remote) == 1


@pytest.mark.parametrize('row', rows('both', 'ok'))
def test_encodes(row: dict[str, Any]) -> None:
    made = encode(row)

    assert made == frame(row)
    assert made.extended
    assert len(made.data) == row['dlc'] == 8


@pytest.mark.parametrize('row', [*rows('both', 'ok'), *rows('decode', 'ok')])
@pytest.mark.parametrize('strict', [False, True])
def test_decodes(row: dict[str, Any], strict: bool) -> None:
    assert decode(row, strict=strict) == telegram(row)


@pytest.mark.parametrize('row', [row for row in [*rows('both', 'ok'), *rows('decode', 'ok')]
                                 if row.values[0]['kind'].startswith('cyclic')])
def test_fast_path_decodes_the_same(row: dict[str, Any]) -> None:
    words = tuple(row['words_u16'])
    fast = codec(row['fields']['station'], words)
    decoded = (fast.decode_request if row['kind'] == 'cyclic_request' else fast.decode_response)
    assert decoded(frame(row).data) == (words, '')
    assert frame(row).identifier == (fast.request_identifier if row['kind'] == 'cyclic_request'
                                     else fast.response_identifier)


@pytest.mark.parametrize('row', [*rows('both', 'ok'), *rows('decode', 'ok')])
def test_fields_stand_where_the_masks_say(row: dict[str, Any]) -> None:
    identifier, fields = int(row['can_id_hex'], 16), row['fields']
    assert identifier & extended.DIR == fields['dir'] * 0x10000000
    assert identifier & extended.STATION_MASK == fields['station'] * 0x200000
    assert identifier & extended.W == fields['bit20'] * 0x100000
    assert identifier & extended.PARAMETER_MASK == fields['param'] * 0x10
    assert identifier & extended.COUNT_MASK == fields['count']


@pytest.mark.parametrize('row', rows('decode', 'reject'))
@pytest.mark.parametrize('strict', [False, True])
def test_rejects(row: dict[str, Any], strict: bool) -> None:
    with pytest.raises(RemoteProtocolError):
        decode(row, strict=strict)


@pytest.mark.parametrize('row', rows('decode', 'accept_if_lenient'))
def test_short_frame_depends_on_the_policy(row: dict[str, Any]) -> None:
    assert decode(row) == telegram(row)
    with pytest.raises(RemoteProtocolError, match='4 data bytes instead of 8'):
        decode(row, strict=True)


@pytest.mark.parametrize('row', rows('encode', 'reject'))
def test_refuses_to_encode(row: dict[str, Any]) -> None:
    fields = row['fields']
    station, number = fields.get('station', 1), fields.get('param', 30)
    count = fields.get('count', 1)
    words = [fields.get('value', 0)] * count
    with pytest.raises(LocalProtocolError):
        extended.encode_write(station, number, words)
    if 'value' not in fields:
        with pytest.raises(LocalProtocolError):
            extended.encode_read_request(station, number, count)


def test_refuses_to_encode_cyclic_telegrams_that_do_not_fit() -> None:
    for station, words in ((128, [0]), (-1, [0]), (1, [0] * 5), (1, [65536]), (1, [-1])):
        with pytest.raises(LocalProtocolError):
            codec(station, words).encode_request(words)
    for words in ([0] * 5, [65536], [-1]):
        with pytest.raises(LocalProtocolError):
            extended.encode_answer(0x003FFFF0, words)


def test_never_writes_parameter_65535_alone() -> None:
    # it would differ from a cyclic request in the parameter count only
    with pytest.raises(LocalProtocolError, match='65535'):
        extended.encode_write(1, 0xFFFF, [9])
    with pytest.raises(LocalProtocolError):
        extended.encode_write(1, -1, [9])
    assert str(extended.encode_read_request(1, 0xFFFF, 1)) == '002FFFF1#0000000000000000'


def test_masks() -> None:
    masks = {name: int(value, 16) for name, value in FILE['masks'].items()}
    assert masks == {
        'DIR': extended.DIR, 'STATION': extended.STATION_MASK, 'BIT20': extended.W,
        'PARAM': extended.PARAMETER_MASK, 'COUNT': extended.COUNT_MASK,
        'CYCLIC_LOW': extended.CYCLIC}
    assert sum(mask for name, mask in masks.items() if name != 'CYCLIC_LOW') == 0x1FFFFFFF


def route_of(station: int) -> Route:
    """Return the only route that the family claims for a drive."""
    claim, = FAMILIES['datamodel_extended'].claims(drive(station=station))
    return claim.route


def test_filters_let_all_responses_in() -> None:
    found = 0
    for entry in FILE['filters']:
        if entry['name'].startswith('ext responses of station'):
            route = route_of(int(entry['name'].rsplit(' ', 1)[1]))
            assert entry['extended'] and route.extended
            # ours lets the requests in as well, to notice a second master
            assert int(entry['can_id'], 16) & route.mask == route.identifier
            assert int(entry['can_mask'], 16) & ~route.mask == extended.DIR
            found += 1
    assert found == 3


def test_route_of_a_station_takes_both_directions_and_no_other_station() -> None:
    route = route_of(1)
    assert route == Route(0x00200000, 0x0FE00000, True)
    for identifier in (0x003FFFF0, 0x103FFFF0, 0x002001E2, 0x102001E2, 0x003001E2):
        assert route.matches(Frame(identifier, b'', True))
    assert not route.matches(Frame(0x103FFFF0 + 0x200000, b'', True))
    assert not route.matches(Frame(0x003FFFF0, b'', False))


# -- the manual's worked examples -----------------------------------------------------------------


def test_example_cyclic_request() -> None:
    """Reg.122 = 50, Reg.123 = 0: only the first word counts, Reg.50."""
    mapping = effective([50, 0, 7, 8])
    assert mapping == (50,)
    sent = codec(1, mapping).encode_request([1500])
    assert (sent.identifier, sent.data) == (0x003FFFF0, b'\x05\xDC\0\0\0\0\0\0')
    assert extended.decode(Frame(0x003FFFF0, b'\x05\xDC\xDE\xAD\xBE\xEF\1\2', True),
                           count=len(mapping)) == extended.CyclicRequest((1500,))


def test_example_cyclic_response() -> None:
    """Reg.126 = 209, Reg.127 = 210, Reg.128 = 0: two words count."""
    mapping = effective([209, 210, 0, 8])
    assert mapping == (209, 210)
    assert extended.decode(Frame(0x103FFFF0, b'\x11\x22\x33\x44\xA5\xA5\x5A\x5A', True),
                           count=len(mapping)) == extended.CyclicResponse((0x1122, 0x3344))


def test_example_write() -> None:
    """P = 30, N = 2: Reg.30 in BYTE0 and BYTE1, Reg.31 in BYTE2 and BYTE3, high bytes first."""
    sent = extended.encode_write(1, 30, [1000, 2000])
    assert (sent.identifier, sent.data) == (0x003001E2, b'\x03\xE8\x07\xD0\0\0\0\0')
    assert extended.decode(sent) == extended.Write(30, (1000, 2000))


def test_example_read() -> None:
    """The request carries zeros; the response repeats station, number and count."""
    sent = extended.encode_read_request(1, 30, 2)
    assert (sent.identifier, sent.data) == (0x002001E2, bytes(8))
    answer = Frame(sent.identifier | 0x10000000, b'\x03\xE8\x07\xD0\xCA\xFE\xBA\xBE', True)
    assert extended.decode(answer) == extended.ReadResponse(30, (1000, 2000))


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
