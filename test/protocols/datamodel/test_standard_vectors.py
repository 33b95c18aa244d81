# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The 11-bit rows of the golden vectors, and the manual's tables, both ways through the codec."""

import json
from pathlib import Path
import struct
from typing import Any

from builders import drive
from hypothesis import given, strategies as st
import pytest
from saying import says

from drive_can_bridge.core.errors import LocalProtocolError, RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.datamodel import standard
from drive_can_bridge.protocols.datamodel.extended import ReadRequest, Write
from drive_can_bridge.protocols.families import FAMILIES

ROWS = [row for row in json.loads((Path(__file__).parents[2] / 'vectors' / 'datamodel.json')
                                  .read_text(encoding='utf-8'))['vectors']
        if row['protocol'] == 'standard']
FAMILY = FAMILIES['datamodel_standard']


def rows(*kinds: str, use: tuple[str, ...] = ('both',)) -> list[Any]:
    return [pytest.param(row, id=f'{row["id"]}-{row["name"]}') for row in ROWS
            if row['kind'] in kinds and row['use'] in use]


def frame(row: dict[str, Any]) -> Frame:
    return Frame(int(row['can_id_hex'], 16), bytes.fromhex(row['data_hex']), False)


def test_all_vectors_are_run() -> None:
    run = [*rows('std_read_request', 'std_write', 'std_read_response'),
           *rows('std_read_response', use=('decode',)), *rows('invalid', use=('decode',)),
           *rows('config_error', use=('config',))]
    assert len(run) == len(ROWS) == 18


@pytest.mark.parametrize('row', rows('std_read_request'))
def test_read_requests(row: dict[str, Any]) -> None:
    fields = row['fields']
    request = standard.identifier(fields['rx_base'], fields['address'])
    assert standard.encode_read_request(request, fields['pnu'], fields['count']) == frame(row)
    assert standard.decode_request(frame(row)) == ReadRequest(
        fields['pnu'], fields['count'])


@pytest.mark.parametrize('row', rows('std_write'))
def test_writes(row: dict[str, Any]) -> None:
    fields, (word,) = row['fields'], row['words_u16']
    request = standard.identifier(fields['rx_base'], fields['address'])
    assert standard.encode_write(request, fields['pnu'], word) == frame(row)
    assert standard.decode_request(frame(row)) == Write(fields['pnu'], (word,))


@pytest.mark.parametrize('row', rows('std_read_response', use=('both', 'decode')))
@pytest.mark.parametrize('strict', [False, True])
def test_read_responses(row: dict[str, Any], strict: bool) -> None:
    fields = row['fields']
    assert frame(row).identifier == standard.identifier(fields['tx_base'], fields['address'])
    words = standard.decode_read_response(frame(row), fields['expected_count'], strict=strict)
    assert list(words) == row['words_u16']
    if row['use'] == 'both':
        assert standard.encode_read_response(frame(row).identifier, words) == frame(row)


@pytest.mark.parametrize('row', rows('invalid', use=('decode',)))
def test_what_the_manual_does_not_define(row: dict[str, Any]) -> None:
    with pytest.raises(RemoteProtocolError):
        standard.decode_request(frame(row))


def test_an_address_over_15_is_refused_with_the_reason() -> None:
    row, = (row for row in ROWS if row['name'] == 'std-addr16')
    complaint, = FAMILY.check(drive('datamodel_standard', station=row['fields']['address']))
    assert complaint == ('station', says(
        'identifier_too_long', station=16, direction='response', base=0x7F0, identifier=0x800,
        most=15))
    with pytest.raises(LocalProtocolError, match='7F0h \\+ 16 = 800h does not fit 11 bits'):
        standard.identifier(0x7F0, 16)


def test_identifiers_of_two_stations_that_collide() -> None:
    row, = (row for row in ROWS if row['name'] == 'std-collision')
    first, second = (drive('datamodel_standard', station=station,
                           request_id_base=row['fields']['rx_base'],
                           response_id_base=row['fields']['tx_base'])
                     for station in row['fields']['stations'])
    assert any(mine.overlaps(other) for mine in FAMILY.claims(first)
               for other in FAMILY.claims(second))


# -- the manual's tables, "Lettura di parametri" and "Scrittura di un parametro" ------------------


def test_reading_byte_by_byte() -> None:
    made = standard.encode_read_request(0x3F1, 0x1234, 4)
    assert made == Frame(0x3F1, bytes([3, 0x34, 0x12, 4, 0, 0, 0, 0]), False)
    answer = Frame(0x7F1, bytes([0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88]), False)
    assert standard.decode_read_response(answer, 4) == (0x2211, 0x4433, 0x6655, 0x8877)


def test_writing_byte_by_byte() -> None:
    made = standard.encode_write(0x3F1, 0x1234, 0xABCD)
    assert made == Frame(0x3F1, bytes([6, 0x34, 0x12, 0xCD, 0xAB, 0, 0, 0]), False)


@pytest.mark.parametrize(('address', 'request_identifier', 'response'), [
    (1, 0x3F1, 0x7F1), (15, 0x3FF, 0x7FF)])
def test_default_identifiers(address: int, request_identifier: int, response: int) -> None:
    found = [claim.route.identifier for claim in FAMILY.claims(
        drive('datamodel_standard', station=address))]
    assert found == [request_identifier, response]
    assert list(FAMILY.check(drive('datamodel_standard', station=address))) == []


def test_sums_are_sums() -> None:
    """An OR of 3F8h and 9 would be 3F9h."""
    assert standard.identifier(0x3F8, 9) == 0x401


@pytest.mark.parametrize(('number', 'count'), [(0, 0), (0, 5), (-1, 1), (0xFFFF, 2), (70000, 1)])
def test_reads_that_cannot_be_asked(number: int, count: int) -> None:
    with pytest.raises(LocalProtocolError):
        standard.encode_read_request(0x3F1, number, count)


@pytest.mark.parametrize(('number', 'word'), [(-1, 0), (0x10000, 0), (50, -1), (50, 0x10000)])
def test_writes_that_cannot_be_made(number: int, word: int) -> None:
    with pytest.raises(LocalProtocolError):
        standard.encode_write(0x3F1, number, word)


@pytest.mark.parametrize('words', [(), (0,) * 5, (-1,), (0x10000,)])
def test_answers_that_cannot_be_made(words: tuple[int, ...]) -> None:
    with pytest.raises(LocalProtocolError):
        standard.encode_read_response(0x7F1, words)


def test_lengths() -> None:
    short = Frame(0x7F1, b'\x22\x11\x33\x44', False)
    assert standard.decode_read_response(short, 2) == (0x1122, 0x4433)
    with pytest.raises(RemoteProtocolError, match='4 data bytes do not hold 3 words'):
        standard.decode_read_response(short, 3)
    with pytest.raises(RemoteProtocolError, match='4 data bytes instead of 8'):
        standard.decode_read_response(short, 2, strict=True)
    with pytest.raises(RemoteProtocolError, match='7 data bytes instead of 8'):
        standard.decode_request(Frame(0x3F1, bytes([3, 1, 0, 1, 0, 0, 0]), False))


def test_the_frame_format_counts() -> None:
    with pytest.raises(RemoteProtocolError, match='000007F1#.*not an 11-bit identifier'):
        standard.decode_read_response(Frame(0x7F1, bytes(8), True), 1)
    with pytest.raises(RemoteProtocolError, match='not an 11-bit identifier'):
        standard.decode_request(Frame(0x3F1, bytes([3, 1, 0, 1, 0, 0, 0, 0]), True))


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.booleans(), st.integers(1, 4))
def test_anything_is_decoded_or_rejected(identifier: int, data: bytes, extended: bool,
                                         count: int) -> None:
    anything = Frame(identifier, data, extended)
    try:
        words = standard.decode_read_response(anything, count)
    except RemoteProtocolError:
        assert extended or len(data) < 2 * count
    else:
        assert words == struct.unpack(f'<{count}H', data[:2 * count])
    try:
        request = standard.decode_request(anything)
    except RemoteProtocolError:
        return
    if isinstance(request, Write):
        assert data[0] == 6
    else:
        assert (data[0], data[3]) == (3, request.count)
