# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The simulated DataModel drive against the golden vectors.

It shares the codec with the bridge and would share its mistakes; so what goes in and what is
compared here are the literal bytes of the vectors.
"""

from typing import Any

from builders import parameter, RAM
import pytest
from simulation_builders import drive, frame_of, register_name, UNTOUCHED, vectors

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive

NUMBERS = (0, 30, 31, 50, 51, 52, 53, 63, *range(209, 213), *range(256, 259),
           *range(0x1234, 0x1238), *range(0xFFFC, 0x10000))


def plain_drive(row: dict[str, Any]) -> SimulatedDataModelDrive:
    """Make a drive whose parameters are plain registers."""
    made = drive([parameter(f'reg_{number}', number, storage=RAM) for number in NUMBERS],
                 station=row['fields']['station'], request=(), response=())
    for number in NUMBERS:
        made.set_value(f'reg_{number}', UNTOUCHED)
    return made


def set_map(made: SimulatedDataModelDrive, base: int, entries: list[int]) -> None:
    for slot, number in enumerate(entries):
        made.set_value(f'p{base + slot}', number)


def literal_words(row: dict[str, Any]) -> list[int]:
    """Return the words of a payload, independently of the codec."""
    data = bytes.fromhex(row['data_hex'])
    return [256 * data[2 * i] + data[2 * i + 1] for i in range(len(data) // 2)]


def length_of(entries: list[int]) -> int:
    return entries.index(0) if 0 in entries else len(entries)


@pytest.mark.parametrize('row', vectors('extended', 'cyclic_request'))
def test_cyclic_request(row: dict[str, Any]) -> None:
    made = plain_drive(row)
    entries = row['fields']['mapping']
    set_map(made, 122, entries)
    set_map(made, 126, [212, 0, 209, 0])

    made.receive_frame(frame_of(row), 0.0)

    expected = dict.fromkeys(NUMBERS, UNTOUCHED)
    expected.update(zip(entries[:length_of(entries)], literal_words(row), strict=False))
    assert {number: made.value(f'reg_{number}') for number in NUMBERS} == expected
    assert made.take_frames() == [Frame(
        int(row['can_id_hex'], 16) + 0x10000000, bytes.fromhex('5151A5A5A5A5A5A5'), True)]
    assert not made.violations


@pytest.mark.parametrize('row', vectors('extended', 'cyclic_response'))
def test_cyclic_response(row: dict[str, Any]) -> None:
    made = plain_drive(row)
    entries = row['fields']['mapping']
    set_map(made, 126, entries)
    used = min(length_of(entries), len(literal_words(row)))
    for number, word in zip(entries[:used], literal_words(row), strict=False):
        made.set_value(f'reg_{number}', word)

    made.receive_frame(Frame(int(row['can_id_hex'], 16) - 0x10000000, bytes(8), True), 0.0)

    answer, = made.take_frames()
    assert answer.identifier == int(row['can_id_hex'], 16)
    assert answer.extended
    assert len(answer.data) == 8
    assert answer.data[:2 * used] == bytes.fromhex(row['data_hex'])[:2 * used]
    rest = 2 * length_of(entries)
    assert answer.data[rest:] == b'\xA5' * (8 - rest)


@pytest.mark.parametrize('row', vectors('extended', 'acyclic_write'))
def test_write(row: dict[str, Any]) -> None:
    made = plain_drive(row)

    made.receive_frame(frame_of(row), 0.0)

    first = row['fields']['param']
    for step, word in enumerate(literal_words(row)[:row['fields']['count']]):
        number = first + step
        assert made.value(register_name(number)) == word
    assert made.take_frames() == []
    assert not made.violations


@pytest.mark.parametrize('row', [
    row for row in vectors('extended', 'read_response') if row.values[0]['expect'] == 'ok'])
def test_read(row: dict[str, Any]) -> None:
    made = plain_drive(row)
    count = row['fields']['count']
    for step, word in enumerate(literal_words(row)[:count]):
        number = row['fields']['param'] + step
        made.set_value(register_name(number), word)

    made.receive_frame(Frame(int(row['can_id_hex'], 16) - 0x10000000, bytes(8), True), 0.0)

    answer, = made.take_frames()
    assert answer.identifier == int(row['can_id_hex'], 16)
    assert answer.data[:2 * count] == bytes.fromhex(row['data_hex'])[:2 * count]
    assert answer.data[2 * count:] == b'\xA5' * (8 - 2 * count)


@pytest.mark.parametrize('row', vectors('extended', 'read_request'))
def test_read_request_is_answered_on_its_own_identifier(row: dict[str, Any]) -> None:
    made = plain_drive(row)

    made.receive_frame(frame_of(row), 0.0)

    answer, = made.take_frames()
    assert answer.identifier == int(row['can_id_hex'], 16) + 0x10000000


@pytest.mark.parametrize('row', [
    row for row in vectors('extended', 'invalid') if not row.values[0]['is_remote_frame']])
def test_what_the_manual_does_not_define(row: dict[str, Any]) -> None:
    made = plain_drive(row)

    made.receive_frame(frame_of(row), 0.0)

    assert made.take_frames() == []
    assert {made.value(f'reg_{number}') for number in NUMBERS} == {UNTOUCHED}
    assert sum(made.violations.values()) == 1
