# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The simulated DataModel drive with 11-bit identifiers: golden vectors and literal bytes.

It shares the codec with the bridge and would share its mistakes; so what goes in and what is
compared here are the literal bytes of the vectors and of the manual's tables.
"""

from collections.abc import Iterable
from typing import Any

from builders import ACTUAL, frame, parameter, RAM
from hypothesis import given, strategies as st
import pytest
from simulation_builders import (
    ask, configuration, EXAMPLE, frame_of, register_name, RULES, UNTOUCHED, vectors,
)

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import LocalProtocolError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive

NUMBERS = (30, 31, 50, 209, 0x1234, 0x1235, 0xFFFD, 0xFFFE, 0xFFFF)

READ_RAMP = '3F1#031E000100000000'
UNDEFINED = 'frame that the manual does not define (ignored)'


def standard(parameters: Iterable[Parameter] = EXAMPLE, **options: Any) -> DriveConfiguration:
    """Make the configuration of an 11-bit drive."""
    return configuration(parameters, protocol='datamodel_standard', **options)


def drive(parameters: Iterable[Parameter] = EXAMPLE, *, neighbours: Iterable[Route] = (),
          **options: Any) -> SimulatedDataModelDrive:
    """Make an 11-bit drive."""
    made = SimulatedDataModelDrive(standard(parameters, **options))
    made.neighbours += neighbours
    return made


# -- golden vectors -------------------------------------------------------------------------------


def plain_drive(row: dict[str, Any]) -> SimulatedDataModelDrive:
    """Make a drive whose parameters are plain registers, with the addresses of the vector."""
    fields = row['fields']
    address = fields.get('address', 1)
    bases = {}
    if address == 20:
        bases = {'request_id_base': 0x300, 'response_id_base': 0x380}
    made = drive([parameter(f'reg_{number}', number, storage=RAM) for number in NUMBERS],
                 station=address, request=(), response=(), **bases)
    for number in NUMBERS:
        made.set_value(f'reg_{number}', UNTOUCHED)
    return made


@pytest.mark.parametrize('row', vectors('standard', 'std_read_request'))
def test_read_request(row: dict[str, Any]) -> None:
    made = plain_drive(row)
    fields = row['fields']
    address, count = fields['address'], fields['count']

    made.receive_frame(frame_of(row), 0.0)

    answer, = made.take_frames()
    assert answer.identifier == {1: 0x7F1, 15: 0x7FF, 20: 0x394}[address]
    assert not answer.extended
    used = b'\0' * 8 if fields['pnu'] == 122 else b'\x51' * 2 * count
    assert answer.data == used[:2 * count] + b'\xA5' * (8 - 2 * count)
    assert not made.violations


#: what is asked for the answers of the vectors: bytes of the manual's table, by hand
QUESTIONS = {
    'V55': ('3F1#03D1000100000000', 209), 'V56': ('3F1#03D1000100000000', 209),
    'V58': ('3F1#037A000400000000', 122), 'V60': ('3F1#0334120200000000', 0x1234),
    'V64': ('3FF#03D1000100000000', 209), 'V66': ('314#031E000200000000', 30),
}


@pytest.mark.parametrize('row', vectors('standard', 'std_read_response'))
def test_read_response(row: dict[str, Any]) -> None:
    question, first = QUESTIONS[row['id']]
    made = plain_drive(row)
    data = bytes.fromhex(row['data_hex'])
    count = row['fields']['expected_count']
    for place in range(count):
        made.set_value(register_name(first + place),
                       data[2 * place] + 256 * data[2 * place + 1])

    made.receive_frame(frame(question), 0.0)

    answer, = made.take_frames()
    assert answer.identifier == int(row['can_id_hex'], 16)
    assert not answer.extended
    assert answer.data[:2 * count] == data[:2 * count]
    assert answer.data[2 * count:] == b'\xA5' * (8 - 2 * count)


@pytest.mark.parametrize('row', vectors('standard', 'std_write'))
def test_write(row: dict[str, Any]) -> None:
    made = plain_drive(row)

    made.receive_frame(frame_of(row), 0.0)

    data = bytes.fromhex(row['data_hex'])
    expected = dict.fromkeys(NUMBERS, UNTOUCHED)
    expected[row['fields']['pnu']] = data[3] + 256 * data[4]
    assert {number: made.value(f'reg_{number}') for number in NUMBERS} == expected
    assert made.take_frames() == []
    assert not made.violations


@pytest.mark.parametrize('row', vectors('standard', 'invalid'))
def test_what_the_manual_does_not_define(row: dict[str, Any]) -> None:
    made = plain_drive(row)

    made.receive_frame(frame_of(row), 0.0)

    assert made.take_frames() == []
    assert {made.value(f'reg_{number}') for number in NUMBERS} == {UNTOUCHED}
    assert made.violations == {UNDEFINED: 1}
    assert made.requests == 0


@pytest.mark.parametrize('text', [
    '3F1#', '3F1#03', '3F1#03D10001', '3F1#03D10001000000', '3F1#0632006400',
    '3F1#0032000100000000', '3F1#FF32000100000000', '3F1#10D1000100000000',
    '3F1#03FFFF0200000000', '3F1#03FDFF0400000000',         # past parameter 65535
    '3F1#03D1000600000000', '3F1#03D100FF00000000',
])
def test_other_frames_that_it_does_not_understand(text: str) -> None:
    made = drive()
    assert ask(made, text, 0.0) == []
    assert made.violations == {UNDEFINED: 1}


# -- reads ----------------------------------------------------------------------------------------


def test_a_window_with_an_unknown_parameter_is_not_answered() -> None:
    made = drive()
    # 209 to 211 exist, 212 does not, nor does 208
    assert ask(made, '3F1#03D1000300000000', 0.0) == ['7F1#0000C8000300A5A5']
    assert ask(made, '3F1#03D1000400000000', 0.0) == []
    assert ask(made, '3F1#03D0000200000000', 0.0) == []
    assert ask(made, '3F1#03D4000100000000', 0.0) == []
    assert (made.requests, made.answers) == (4, 1)
    assert not made.violations


def test_unused_bytes_of_requests_have_to_be_zero() -> None:
    made = drive([*EXAMPLE, parameter('gain', 60, storage=RAM)])
    assert ask(made, '3F1#031E000100000001', 0.0) == ['7F1#6400A5A5A5A5A5A5']
    assert ask(made, '3F1#063C000700000100', 0.0) == []
    assert made.value('gain') == 7
    assert made.violations == {
        RULES['read bytes']: 1,
        RULES['write bytes']: 1}


def test_an_offset_moves_everything_on_the_wire() -> None:
    made = drive(parameter_offset=-1)
    assert ask(made, '3F1#03D0000300000000', 0.0) == ['7F1#0000C8000300A5A5']
    ask(made, '3F1#061D00C800000000', 0.0)
    assert made.value('ramp_time') == made.value('p30') == 2.0


# -- whom it listens to ---------------------------------------------------------------------------


@pytest.mark.parametrize('text', [
    '000003F1#03D1000100000000', '000003F1#0632006400000000',    # the 29-bit twin
    '000007F1#0000000000000000', '003FFFF0#0000000000000000', '00200D11#0000000000000000',
    '3F0#03D1000100000000', '3F2#03D1000100000000', '7F2#0000000000000000', '000#0101',
])
def test_frames_of_others_and_of_the_other_format(text: str) -> None:
    made = drive()
    assert ask(made, text, 0.0) == []
    assert made.requests == 0
    assert not made.violations


def test_somebody_else_answers_in_its_place() -> None:
    made = drive()
    assert ask(made, '7F1#0000000000000000', 0.0) == []
    assert made.violations == {RULES['alone']: 1}


@pytest.mark.parametrize(('station', 'options', 'request_text', 'response'), [
    (1, {}, '3F1', '7F1'), (15, {}, '3FF', '7FF'),
    (20, {'request_id_base': 0x300, 'response_id_base': 0x380}, '314', '394'),
    # a sum, not an OR: 3F1h | 1 is 3F1h
    (1, {'request_id_base': 0x3F1, 'response_id_base': 0x7F1}, '3F2', '7F2'),
    (2046, {'request_id_base': 0, 'response_id_base': 1}, '7FE', '7FF'),
])
def test_identifiers_are_sums(station: int, options: dict[str, int], request_text: str,
                              response: str) -> None:
    made = drive(station=station, **options)
    assert ask(made, f'{request_text}#031E000100000000', 0.0) == [f'{response}#6400A5A5A5A5A5A5']
    assert ask(made, f'00000{request_text}#031E000100000000', 0.0) == []
    assert made.routes == [
        Route(int(request_text, 16), 0x7FF, False), Route(int(response, 16), 0x7FF, False)]


def test_an_identifier_over_7ff_is_refused() -> None:
    with pytest.raises(LocalProtocolError, match='7F0h . 16 = 800h does not fit 11 bits'):
        drive(station=16)


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.booleans(), st.booleans())
def test_anything(identifier: int, data: bytes, is_extended: bool, near: bool) -> None:
    made = drive()
    if near:
        identifier, is_extended = 0x3F1, False
    made.receive_frame(Frame(identifier if is_extended else identifier & 0x7FF, data,
                             is_extended), 0.0)
    for answer in made.take_frames():
        assert data[0] == 3
        assert (answer.identifier, len(answer.data), answer.extended) == (0x7F1, 8, False)


# -- EEPROM ---------------------------------------------------------------------------------------


def test_setpoints_written_cyclically_take_no_eeprom_time() -> None:
    # their storage is not in the profile; what is sent again and again is volatile
    made = drive([parameter('speed_setpoint', 50), ACTUAL],
                 request=(parameter('speed_setpoint', 50),), response=(ACTUAL,))
    for place in range(5):
        ask(made, f'3F1#063200{place:02X}00000000', 0.001 * place)
    assert made.value('speed_setpoint') == 4
    assert len(ask(made, '3F1#0332000100000000', 0.0045)) == 1
    assert not made.violations
    assert made.eeprom_writes == 0


# -- by hand --------------------------------------------------------------------------------------


def test_more_parameters_than_a_map_holds() -> None:
    many = [parameter(f'x_{number}', number, storage=RAM) for number in range(300, 312)]
    made = drive(many, request=many[:6], response=many)
    made.set_value('x_311', 5)
    assert ask(made, '3F1#0334010400000000', 0.0)[0].startswith('7F1#')
    assert ask(made, '3F1#0337010100000000', 0.0) == ['7F1#0500A5A5A5A5A5A5']


# -- faults ---------------------------------------------------------------------------------------


def foreign(made: SimulatedDataModelDrive, question: str) -> list[str]:
    """Return the foreign frames that come with three answers."""
    made.fault('foreign', 0.0)
    found = [ask(made, question, 1.0) for _ in range(3)]
    assert all(entry[-1][4:8] == '6400' for entry in found)
    return [text for entry in found for text in entry[:-1]]


def test_foreign_frames() -> None:
    assert foreign(drive(), READ_RAMP) == [
        '000007F1#5A5A5A5A5A5A5A5A', '7F9#5A5A5A5A5A5A5A5A', '701#05']


def test_foreign_frames_stay_clear_of_neighbours() -> None:
    # station 9 is there: somebody else has to be absent
    made = drive(neighbours=[Route(0x3F9, 0x7FF, False), Route(0x7F9, 0x7FF, False)])
    assert foreign(made, READ_RAMP) == ['000007F1#5A5A5A5A5A5A5A5A', '7F5#5A5A5A5A5A5A5A5A',
                                        '701#05']
    # a neighbour of another protocol with 29 bits, and one that uses 701h
    made = drive(neighbours=[Route(0x7F1, 0x1FFFFFFF, True), Route(0x701, 0x7FF, False)])
    assert foreign(made, READ_RAMP) == ['7F9#5A5A5A5A5A5A5A5A']
    # nobody is absent
    made = drive(neighbours=[Route(0, 0, True), Route(0, 0, False)])
    assert foreign(made, READ_RAMP) == []
