# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Watching CANnord inverters. Frames are those of the protocol notes, address 100."""

from builders import drive, INT16, parameter, RO
from hypothesis import given, strategies as st
from trace_builders import Witness

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import ParameterType, Storage
from drive_can_bridge.core.record import Record

SPEED = parameter('frequency_setpoint', None, type=INT16, scale=100 / 16384, unit='%')
ACTUAL = parameter('actual_frequency', None, type=INT16, scale=100 / 16384, unit='%', access=RO)
RAMP = parameter('acceleration_time', 102, scale=0.01, unit='s', storage=Storage.RAM)
RAMP_2 = parameter('acceleration_time_set_2', 102, scale=0.01, unit='s', subindex=1)
FAULT = parameter('fault_code', 700, subindex=0, access=RO)
POSITION = parameter('position', 613, type=ParameterType.UINT32, subindex=0x15)


def inverter(name: str = 'mixer', station: int = 100, **options: object) -> DriveConfiguration:
    return drive('cannord', name=name, station=station,
                 table=(SPEED, ACTUAL, RAMP, RAMP_2, FAULT, POSITION),
                 request=(SPEED,), response=(ACTUAL,), **options)


def test_process_data() -> None:
    witness = Witness(inverter())
    assert witness.hears('0C8#7F040020', 0.0) == [
        '0.000000 +0.000 main mixer > cyclic request: control_word 1151, '
        'frequency_setpoint 50.0000 %']
    answer, = witness.hears('0C9#370F0020', 0.002)
    assert '< cyclic response: status_word 0F37h (ready_to_switch_on, ready, enabled,' in answer
    assert answer.endswith('actual_frequency 50.0000 % (operation enabled) [2.0 ms]')
    assert witness.observed('mixer').exchanges == 1


def test_values_four_and_five_come_in_a_frame_of_their_own() -> None:
    values = [parameter(f'setpoint_{place}', None, type=INT16) for place in range(1, 6)]
    actual = [parameter(f'actual_{place}', None, type=INT16, access=RO) for place in range(1, 6)]
    witness = Witness(drive('cannord', name='mixer', station=100, table=(*values, *actual),
                            request=values, response=actual, extra_setpoints=True))
    assert witness.hears('0C8#7F04010002000300', 0.0)[0].endswith(
        '> cyclic request: control_word 1151, setpoint_1 1, setpoint_2 2, setpoint_3 3')
    assert witness.hears('0C8#0400FFFF00', 0.001)[0].endswith(
        '> cyclic request: setpoint_4 4, setpoint_5 -1')
    assert 'actual_1 1, actual_2 2, actual_3 3 (operation enabled) [2.0 ms]' in witness.hears(
        '0C9#370F010002000300', 0.002)[0]
    assert witness.hears('0C9#0400FFFF00', 0.003)[0].endswith(
        '< cyclic response: actual_4 4, actual_5 -1')
    assert witness.observed('mixer').exchanges == 1


def test_a_fault_is_told_without_being_asked() -> None:
    witness = Witness(inverter())
    witness.hears('0C8#7F040020', 0.0)
    witness.hears('0C9#370F0020', 0.002)
    told, = witness.hears('0C9#380B0000', 0.01)
    assert told.endswith('(fault, told without being asked)')
    assert witness.hears('0C9#310B0000', 0.011)[0].endswith('UNASKED: ready to switch on')


def test_missing_answers() -> None:
    witness = Witness(inverter())
    witness.hears('0C8#7E040000', 0.0)
    assert 'LOST' in witness.hears('0C8#7E040000', 0.02)[0]
    assert 'LOST' in witness.waits(0.07)[0]
    assert witness.observed('mixer').missed == 2
    assert 'MALFORMED' in witness.hears('0C9#0000', 0.08)[0]


def test_parameters() -> None:
    witness = Witness(inverter())
    assert witness.hears('2C8#6610000000000000', 0.0) == [
        '0.000000 +0.000 main mixer > read: acceleration_time']
    assert witness.hears('2C9#6610000000006700', 0.006) == [
        '0.006000 +0.000 main mixer < read: acceleration_time 1.03 s [6.0 ms]']
    assert witness.hears('2C8#66C0010000006400', 0.1)[0].endswith(
        '> write: acceleration_time_set_2 1.00 s')
    assert witness.hears('2C9#6640010000006400', 0.106)[0].endswith(
        '< write: acceleration_time_set_2 1.00 s [6.0 ms]')
    assert witness.hears('2C8#658215000100A086', 0.2)[0].endswith('> write: position 100000')
    assert witness.hears('2C9#655215000100A086', 0.206)[0].endswith(
        '< write: position 100000 [6.0 ms]')
    assert witness.telegrams[-1].parameters == (POSITION,)
    witness.hears('2C8#BC62000000000000', 0.3)
    assert witness.hears('2C9#BC42000000006400', 0.306)[0].endswith(
        '< read: fault_code 100 [6.0 ms]')
    witness.hears('2C8#66200000000F27FF', 0.4)
    assert witness.hears('2C9#6670000000000200', 0.406)[0].endswith(
        '< write: acceleration_time: REFUSED: error 2: limit exceeded [6.0 ms]')
    witness.hears('2C8#6610000000000000', 0.5)
    assert witness.waits(0.7)[0].endswith(
        '< parameter response: acceleration_time: LOST: no answer')
    observed = witness.observed('mixer')
    assert (observed.requests, observed.refused, observed.unanswered) == (6, 1, 1)


def test_a_response_that_no_such_task_has() -> None:
    witness = Witness(inverter())
    witness.hears('2C8#6610000000000000', 0.0)
    assert witness.hears('2C9#6640000000006700', 0.006)[0].endswith(
        '< read: acceleration_time 1.03 s: MALFORMED: response 4 to task 1 [6.0 ms]')
    # asked before the trace began: nobody knows by which task
    assert witness.hears('2C9#BC42000000006400', 0.007)[0].endswith('< read: p700 100')


def test_a_refusal_without_index_is_of_the_newest_task() -> None:
    witness = Witness(inverter())
    for time, task in ((0.0, '2C8#6660010000000000'), (0.1, '2C8#66C0020000006400'),
                       (0.2, '2C8#6660010000000000')):
        witness.hears(task, time)
    assert '< read: acceleration_time_set_2: REFUSED' in witness.hears(
        '2C9#6670000000000300', 0.206)[0]


def test_what_is_remembered_of_tasks_has_an_end_but_for_those_under_way() -> None:
    witness = Witness(inverter())
    witness.hears('2C8#66C0010000006400', 0.0)
    for index in range(1100):
        witness.hears(f'2C8#{1 + index // 256:02X}60{index % 256:02X}0000000000', 0.001)
    lost = witness.waits(10.0)
    assert len(lost) == 1101
    assert 'acceleration_time_set_2: LOST' in lost[0]
    witness.hears('2C8#6610000000000000', 20.0)
    witness.hears('2C9#6610000000006700', 20.1)
    # nobody knows any more that it was written
    assert '< read: acceleration_time_set_2' in witness.hears('2C9#6640010000006400', 30.0)[0]


def test_what_is_missing_is_told_in_the_order_of_time() -> None:
    witness = Witness(inverter('first', 0), inverter('second', 1))
    # answers may take 0.1 s, and 0.04 s in a cycle
    witness.hears('200#6610000000000000', 0.0)
    witness.hears('002#7E040000', 0.04)
    witness.hears('000#7E040000', 0.07)
    lost = witness.waits(10.0)
    assert [(line.split()[3], line.split(':')[0].split('<')[1].strip()) for line in lost] == [
        ('second', 'cyclic response'), ('first', 'parameter response'),
        ('first', 'cyclic response')]
    assert [telegram.time for telegram in witness.telegrams] == sorted(
        telegram.time for telegram in witness.telegrams)


def test_a_broadcast_group() -> None:
    witness = Witness(inverter('first', 0, broadcast='group'),
                      inverter('second', 1, broadcast='group'))
    assert witness.hears('400#7E040000', 0.0)[0].startswith(
        '0.000000 +0.000 main first > broadcast: control_word')
    witness.hears('000#7E040000', 0.0)
    witness.hears('001#310B0000', 0.002)
    witness.hears('400#7E040000', 0.02)
    witness.hears('002#7E040000', 0.02)
    lost, _ = witness.hears('400#7E040000', 0.04)
    assert 'main second < cyclic response: LOST' in lost
    assert witness.observed('first').exchanges == 1
    assert round(witness.observed('first').period.mean, 6) == 0.02
    assert witness.observed('second').missed == 1


def test_broadcasts_of_another_master() -> None:
    # the first drive would obey the second one's broadcast, too; both obey the one to all
    witness = Witness(inverter('alone', 1), inverter('leader', 0, broadcast='group'))
    telegram, = witness.hears('400#7E040000', 0.0)
    assert 'main leader > broadcast' in telegram and 'another' not in telegram
    telegram, = witness.hears('408#7F040020', 0.01)
    assert telegram.endswith(
        'main alone > broadcast: control_word 1151, frequency_setpoint 50.0000 %: SUSPICIOUS: '
        'of another master: the file has no drive with this broadcast')
    assert witness.observed('alone').period.count == 0


@given(st.lists(st.tuples(st.sampled_from([0xC8, 0xC9, 0x2C8, 0x2C9, 0x403]),
                          st.binary(max_size=8), st.floats(0, 10))))
def test_anything(frames: list[tuple[int, bytes, float]]) -> None:
    witness = Witness(inverter(broadcast='group'), inverter('other', 101, extra_setpoints=True))
    for identifier, data, time in frames:
        witness.tracer.take(Record(time, 'can0', identifier, data, False))
    witness.waits(100.0)
