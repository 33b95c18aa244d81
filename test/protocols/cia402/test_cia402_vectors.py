# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
CiA 402 and CANopen against frames that other people printed or recorded.

Those of SDO, heartbeats, SYNC and emergencies are run by :mod:`test_telegrams`.
"""

import json
from pathlib import Path
from typing import Any

from builders import frame, INT32, parameter, UINT16
import pytest

from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.cia402 import pdo, states
from drive_can_bridge.protocols.telegrams import Direction

FILE = json.loads((Path(__file__).parents[2] / 'vectors' / 'cia402.json').read_text(
    encoding='utf-8'))
VECTORS = FILE['vectors']
_TYPES = {0x6040: UINT16, 0x6041: UINT16, 0x6061: ParameterType.INT8, 0x60C1: INT32}


def rows(kind: str) -> list[Any]:
    """Return vectors as test parameters."""
    return [pytest.param(row, id=f'{row["id"]}-{row["frame"]}') for row in VECTORS
            if row['kind'] == kind]


def place(row: dict[str, Any]) -> tuple[int, int]:
    return int(row['index'], 16), row['subindex']


def test_vectors_are_of_every_kind_and_have_sources() -> None:
    assert {row['kind'] for row in VECTORS} == {
        'upload', 'uploaded', 'download', 'downloaded', 'upload_begun', 'segment_wanted',
        'segment', 'download_begun', 'segment_sent', 'segment_taken', 'abort', 'nmt',
        'heartbeat', 'sync', 'emergency', 'pdo'}
    assert {row['source'] for row in VECTORS} <= set(FILE['sources'])
    for kind in ('uploaded', 'download'):
        assert {len(row['content']) // 2 for row in VECTORS if row['kind'] == kind} == {1, 2, 4}


@pytest.mark.parametrize('row', rows('nmt'))
def test_nmt(row: dict[str, Any]) -> None:
    command = network.NmtCommand(row['command'])
    assert network.encode_nmt(command, row['node']) == frame(row['frame'])
    assert network.decode_nmt(frame(row['frame']).data) == (command, row['node'])


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
    state = states.ServoState(name)
    assert states.PATTERNS[state] == (int(mask, 16), int(value, 16))
    # of all words those that the table says, whatever other bits are set
    assert [word & int(mask, 16) for word in range(0x10000)
            if states.state_of(word) is state] == [int(value, 16)] * (
                0x10000 >> int(mask, 16).bit_count())


@pytest.mark.parametrize('row', FILE['states_seen'], ids=lambda row: str(row['word']))
def test_states_of_real_drives(row: dict[str, Any]) -> None:
    assert states.state_of(int(row['word'], 16)) is states.ServoState(row['state'])


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
