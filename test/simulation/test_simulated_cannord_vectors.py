# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The simulated CANnord inverter against the golden vectors.

It shares the codec with the bridge and would share its mistakes; so what goes in and what is
compared here are the literal bytes of the vectors.
"""

import json
from pathlib import Path
from typing import Any

from builders import INT16, parameter, RO
from cannord_builders import configuration, word
import pytest

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import ParameterType
from drive_can_bridge.simulation.cannord import SimulatedCannordInverter

FILE = json.loads((Path(__file__).parents[1] / 'vectors' / 'cannord.json').read_text(
    encoding='utf-8'))
REQUEST = [word(f'setpoint_{number}') for number in (1, 2, 3, 4, 5)]
#: what the frames of the status word alone cannot tell: actual values that are plain registers
REPORT = [word(f'reading_{number}', access=RO) for number in (1, 2, 3, 4, 5)]
UNTOUCHED = 0x0333


def rows(table: str, *kinds: str, expect: str = 'ok') -> list[Any]:
    return [pytest.param(row, id=f'{row["id"]}-{row["name"]}') for row in FILE[table]
            if row['kind'] in kinds and row['expect'] == expect]


def made_for(row: dict[str, Any]) -> SimulatedCannordInverter:
    """Make an inverter that has the parameter of a vector, and the layout."""
    number, index = row.get('number'), row.get('index', 0)
    table = [*REQUEST, *REPORT]
    if number is not None:
        array = row['code'] in (6, 7, 8, 9, 11, 12) or row['kind'] == 'answer' and (
            row['code'] in (4, 5, 6))
        double = row['code'] in (3, 8, 11, 13) or row['kind'] == 'answer' and (
            row['code'] in (2, 5))
        kind = ParameterType.INT32 if double else ParameterType.UINT16
        table.append(parameter('wanted', number, subindex=index if array else None,
                               type=INT16 if row.get('negative') else kind))
    options = {'broadcast': 'all', 'extra_setpoints': row['kind'].startswith('extra'),
               'extended_identifiers': len(row['can_id_hex']) == 8,
               'swap_setpoints_2_3': row.get('swap', False),
               'value_order': row.get('value_order', 'high_first'),
               'index_byte': row.get('index_byte', 'low')}
    made = SimulatedCannordInverter(configuration(
        table=table, station=row['station'], request=REQUEST, response=REPORT, **options))
    for setpoint in REQUEST:
        made.registers.write(setpoint.name, UNTOUCHED)
    return made


def frame(row: dict[str, Any]) -> Frame:
    text = row['can_id_hex']
    return Frame(int(text, 16), bytes.fromhex(row['data_hex']), len(text) == 8)


def answer_identifier(row: dict[str, Any]) -> int:
    """Return the identifier after that of a request, in either form."""
    return int(row['can_id_hex'], 16) + (0x40000 if len(row['can_id_hex']) == 8 else 1)


@pytest.mark.parametrize('row', rows('process', 'request', 'broadcast_group', 'broadcast_all',
                                     'extra_request'))
def test_takes_setpoints(row: dict[str, Any]) -> None:
    made = made_for(row)

    made.receive_frame(frame(row), 0.0)

    first = 3 if row['kind'] == 'extra_request' else 0
    expected = [UNTOUCHED] * 5
    expected[first:first + len(row['values'])] = row['values']
    assert [made.registers.raw(setpoint.name) for setpoint in REQUEST] == expected
    answers = made.take_frames()
    if row['kind'].startswith('broadcast'):
        assert answers == []
    else:
        answer, = answers
        assert answer.identifier == answer_identifier(row)
        assert len(answer.data) == len(frame(row).data)
    if 'word' in row:
        assert made.plant.operation.word == int(row['word'], 16)
    assert not made.violations


@pytest.mark.parametrize('row', rows('process', 'response', 'extra_response'))
def test_reports_actual_values(row: dict[str, Any]) -> None:
    made = made_for(row)
    first = 3 if row['kind'] == 'extra_response' else 0
    for reading, raw in zip(REPORT[first:], row['values'], strict=False):
        made.registers.set_value(reading.name, reading.value_from_raw(raw))
    length = len(frame(row).data)
    request = int(row['can_id_hex'], 16) - (0x40000 if frame(row).extended else 1)

    made.receive_frame(Frame(request, b'\x7E\x04' + bytes(length - 2), frame(row).extended), 0.0)

    answer, = made.take_frames()
    assert answer.identifier == frame(row).identifier
    if first:
        assert answer.data[:4] == frame(row).data[:4]
        assert answer.data[4:] == b'\0'
    else:
        assert answer.data[2:] == frame(row).data[2:]


@pytest.mark.parametrize('row', rows('process', 'response', expect='reject'))
def test_lengths_that_do_not_exist(row: dict[str, Any]) -> None:
    made = made_for(row)
    made.receive_frame(Frame(0x0C8, frame(row).data, False), 0.0)
    assert made.take_frames() == []
    assert sum(made.violations.values()) == 1


@pytest.mark.parametrize('row', [row for row in rows('parameter', 'task')
                                 if row.values[0]['code'] != 0])
def test_carries_out_tasks(row: dict[str, Any]) -> None:
    made = made_for(row)
    if row['code'] in (1, 6):
        made.set_value('wanted', 103)

    made.receive_frame(frame(row), 0.0)

    answer, = made.take_frames()
    assert answer.identifier == answer_identifier(row)
    task, = (entry for entry in FILE['tasks'] if entry['task'] == row['code'])
    low, high = answer.data[0], answer.data[1]
    assert high >> 4 in task['answers']
    assert (low, high & 0x0F) == (frame(row).data[0], frame(row).data[1] & 0x0F)
    assert answer.data[2:4] == frame(row).data[2:4]
    if row['code'] not in (1, 6, 9):
        # a write is answered by the value that is there now
        assert answer.data[4:] == frame(row).data[4:]
        assert made.value('wanted') == (
            row['value'] - 2 ** 32 if row['value'] >= 2 ** 31 else row['value'])
        assert made.eeprom_writes == (row['code'] in (2, 3, 7, 8))
    assert not made.violations


@pytest.mark.parametrize('row', [row for row in rows('parameter', 'answer')
                                 if row.values[0]['code'] in (1, 2, 4, 5)
                                 and row.values[0]['use'] == 'both'])
def test_answers(row: dict[str, Any]) -> None:
    made = made_for(row)
    value = row['value']
    made.set_value('wanted', value)
    task = 0x10 if row['code'] in (1, 2) else 0x60
    data = frame(row).data
    request = bytes([data[0], task | data[1] & 0x0F, data[2], data[3]]) + bytes(4)
    identifier = int(row['can_id_hex'], 16) - (0x40000 if frame(row).extended else 1)

    made.receive_frame(Frame(identifier, request, frame(row).extended), 0.0)

    assert made.take_frames() == [frame(row)]
