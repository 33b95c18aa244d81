# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The codecs of CiA 402 and CANopen against frames that other people printed or recorded."""

from collections import Counter
import json
from pathlib import Path
from typing import Any

from builders import frame, INT32, parameter, UINT16
import pytest

from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.sdo import Kind
from drive_can_bridge.protocols.cia402 import pdo, states
from drive_can_bridge.protocols.telegrams import Direction

FILE = json.loads((Path(__file__).parents[2] / 'vectors' / 'cia402.json').read_text(
    encoding='utf-8'))
VECTORS = FILE['vectors']
_TYPES = {0x6040: UINT16, 0x6041: UINT16, 0x6061: ParameterType.INT8, 0x60C1: INT32}


def rows(*kinds: str) -> list[Any]:
    """Return vectors as test parameters."""
    return [pytest.param(row, id=f'{row["id"]}-{row["frame"]}') for row in VECTORS
            if row['kind'] in kinds]


def place(row: dict[str, Any]) -> tuple[int, int]:
    return int(row['index'], 16), row['subindex']


def node(row: dict[str, Any]) -> int:
    return frame(row['frame']).identifier & 0x7F


def content(row: dict[str, Any]) -> bytes:
    return bytes.fromhex(row['content'])


def decoded(row: dict[str, Any], *, segments: bool = False) -> sdo.Message:
    return sdo.decode(Direction.RESPONSE, frame(row['frame']).data, segments=segments)


def test_all_vectors_are_run_and_have_sources() -> None:
    kinds = Counter(row['kind'] for row in VECTORS)
    assert set(kinds) == {
        'upload', 'uploaded', 'download', 'downloaded', 'upload_begun', 'segment_wanted',
        'segment', 'download_begun', 'segment_sent', 'segment_taken', 'abort', 'nmt',
        'heartbeat', 'sync', 'emergency', 'pdo'}
    assert {row['source'] for row in VECTORS} <= set(FILE['sources'])
    assert {len(content(row)) for row in VECTORS if row['kind'] == 'uploaded'} == {1, 2, 4}
    assert {len(content(row)) for row in VECTORS if row['kind'] == 'download'} == {1, 2, 4}


@pytest.mark.parametrize('row', rows('upload'))
def test_upload(row: dict[str, Any]) -> None:
    assert sdo.encode_upload(node(row), *place(row)) == frame(row['frame'])


@pytest.mark.parametrize('row', rows('uploaded'))
def test_uploaded(row: dict[str, Any]) -> None:
    assert decoded(row) == sdo.Message(
        Kind.UPLOADED, place(row), content(row), last=row.get('size_told', True))


@pytest.mark.parametrize('row', rows('download'))
def test_download(row: dict[str, Any]) -> None:
    assert sdo.encode_download(node(row), *place(row), content(row)) == frame(row['frame'])


@pytest.mark.parametrize('row', rows('downloaded'))
def test_downloaded(row: dict[str, Any]) -> None:
    assert decoded(row) == sdo.Message(Kind.DOWNLOADED, place(row))


@pytest.mark.parametrize('row', rows('upload_begun'))
def test_upload_by_segments_begins(row: dict[str, Any]) -> None:
    assert decoded(row) == sdo.Message(
        Kind.UPLOAD_BEGUN, place(row), number=row['size'], last=False)


@pytest.mark.parametrize('row', rows('segment_wanted'))
def test_segment_is_asked_for(row: dict[str, Any]) -> None:
    assert sdo.request(node(row), sdo.Message(
        Kind.SEGMENT_WANTED, None, toggle=row['toggle'] << 4)) == frame(row['frame'])


@pytest.mark.parametrize('row', rows('segment'))
def test_segment(row: dict[str, Any]) -> None:
    assert decoded(row, segments=True) == sdo.Message(
        Kind.SEGMENT, None, content(row), toggle=row['toggle'] << 4, last=row['last'])


@pytest.mark.parametrize('row', rows('abort'))
def test_abort(row: dict[str, Any]) -> None:
    assert decoded(row) == sdo.Message(Kind.ABORT, place(row), number=int(row['code'], 16))
    assert decoded(row, segments=True).kind is Kind.ABORT


@pytest.mark.parametrize('row', rows('nmt'))
def test_nmt(row: dict[str, Any]) -> None:
    command = network.NmtCommand(row['command'])
    assert network.encode_nmt(command, row['node']) == frame(row['frame'])
    assert network.decode_nmt(frame(row['frame']).data) == (command, row['node'])


@pytest.mark.parametrize('row', rows('heartbeat'))
def test_heartbeat(row: dict[str, Any]) -> None:
    state = network.NmtState(row['state'])
    assert network.encode_heartbeat(row['node'], state) == frame(row['frame'])
    assert network.decode_heartbeat(frame(row['frame']).data) is state


@pytest.mark.parametrize('row', rows('sync'))
def test_sync(row: dict[str, Any]) -> None:
    assert network.encode_sync() == frame(row['frame'])


@pytest.mark.parametrize('row', rows('emergency'))
def test_emergency(row: dict[str, Any]) -> None:
    emergency = network.Emergency(int(row['code'], 16), row['register'],
                                  bytes.fromhex(row['manufacturer']))
    assert network.decode_emergency(frame(row['frame']).data) == emergency
    assert network.encode_emergency(node(row), emergency) == frame(row['frame'])


def mapped(entry: int) -> Parameter:
    """Return the object of an entry of a mapping."""
    index, subindex = entry >> 16, entry >> 8 & 0xFF
    return parameter(f'x{index:x}', None, index=index, subindex=subindex, type=_TYPES[index])


@pytest.mark.parametrize('row', rows('pdo'))
def test_pdo(row: dict[str, Any]) -> None:
    expected = frame(row['frame'])
    entries = [int(entry, 16) for entry, _ in row['entries']]
    raws = [raw for _, raw in row['entries']]
    made = pdo.Pdo(1, expected.identifier, 0x1400, tuple(map(mapped, entries)))
    assert made.entries == tuple(entries)
    assert made.pack(raws) == expected.data
    assert list(made.unpack(expected.data)) == raws


@pytest.mark.parametrize('row', FILE['mapping_entries'], ids=lambda row: str(row['value']))
def test_mapping_entry(row: dict[str, Any]) -> None:
    assert pdo.mapping_entry(*place(row), row['bits'] // 8) == int(row['value'], 16)


@pytest.mark.parametrize('row', FILE['pdo_identifiers'], ids=lambda row: str(row['value']))
def test_pdo_identifier(row: dict[str, Any]) -> None:
    value = int(row['value'], 16)
    assert bool(value & pdo.INVALID) is not row['valid']
    assert value & 0x7FF == int(row['identifier'], 16)


@pytest.mark.parametrize(('name', 'mask', 'value'), FILE['states'])
def test_states(name: str, mask: str, value: str) -> None:
    state = states.State(name)
    assert states.PATTERNS[state] == (int(mask, 16), int(value, 16))
    # of all words those that the table says, whatever other bits are set
    assert [word & int(mask, 16) for word in range(0x10000)
            if states.state_of(word) is state] == [int(value, 16)] * (
                0x10000 >> int(mask, 16).bit_count())


@pytest.mark.parametrize('row', FILE['states_seen'], ids=lambda row: str(row['word']))
def test_states_of_real_drives(row: dict[str, Any]) -> None:
    assert states.state_of(int(row['word'], 16)) is states.State(row['state'])


def test_control_words() -> None:
    assert {name: int(word, 16) for name, word in FILE['control_words']} == {
        'shutdown': states.SHUTDOWN, 'switch on': states.SWITCH_ON,
        'enable operation': states.ENABLE, 'disable voltage': states.DISABLE_VOLTAGE,
        'quick stop': states.QUICK_STOP, 'fault reset': states.FAULT_RESET}


def test_command_bytes_of_all_sizes() -> None:
    heads = FILE['command_bytes']
    for size in (1, 2, 3, 4):
        data = bytes(range(1, size + 1))
        assert sdo.encode_download(5, 0x2000, 1, data).data[0] == int(
            heads['download'][str(size)], 16)
        answer = bytes((int(heads['uploaded'][str(size)], 16), 0, 0x20, 1)) + data.ljust(4, b'\0')
        assert sdo.decode(Direction.RESPONSE, answer).data == data
