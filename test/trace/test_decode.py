# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is understood of frames, in lines of text (decode.yaml)."""

import gc
from typing import Any

from builders import drive, INT16, INT32, parameter, RO
from hypothesis import given, strategies as st
import pytest
from trace_builders import Witness
from transcripts import replayed, stories

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Record, RecordKind
from drive_can_bridge.core.parameters import Parameter, ParameterType, Storage
from drive_can_bridge.core.statistics import Statistic
from drive_can_bridge.protocols.observer import Verdict
from drive_can_bridge.trace.sinks import Only

STORIES = stories(__file__, 'decode.yaml')

FREQUENCY = parameter('frequency_setpoint', None, type=INT16, scale=100 / 16384, unit='%')
ACTUAL_FREQUENCY = parameter('actual_frequency', None, type=INT16, scale=100 / 16384, unit='%',
                             access=RO)
RAMP = parameter('acceleration_time', 102, scale=0.01, unit='s', storage=Storage.RAM)
RAMP_2 = parameter('acceleration_time_set_2', 102, scale=0.01, unit='s', subindex=1)
FAULT = parameter('fault_code', 700, subindex=0, access=RO)
PLACE = parameter('position', 613, type=ParameterType.UINT32, subindex=0x15)
FIVE = [parameter(f'setpoint_{place}', None, type=INT16) for place in range(1, 6)]
ACTUAL_FIVE = [parameter(f'actual_{place}', None, type=INT16, access=RO) for place in range(1, 6)]

TARGET = parameter('target_velocity', None, index=0x60FF, subindex=0, type=INT32, unit='rpm')
VELOCITY = parameter('actual_velocity', None, index=0x606C, subindex=0, type=INT32, access=RO,
                     unit='rpm')
POSITION = parameter('position', None, index=0x6064, subindex=0, type=INT32, access=RO)
TURNS = parameter('motor_turns', None, index=0x6091, subindex=1, type=ParameterType.UINT32)
ACCELERATION = parameter('acceleration', None, index=0x6083, type=ParameterType.UINT32)

STATUS = parameter('system_status', 455, access=RO, bits=(('ready', 0), ('on', 1)))
CURRENT = parameter('average_current', 500, type=ParameterType.UINT32, scale=0.01, unit='A',
                    access=RO)
COMMAND = parameter('command', 704)


def inverter(name: str = 'mixer', station: int = 100, **options: Any) -> DriveConfiguration:
    return drive('cannord', name=name, station=station,
                 table=(FREQUENCY, ACTUAL_FREQUENCY, RAMP, RAMP_2, FAULT, PLACE),
                 request=(FREQUENCY,), response=(ACTUAL_FREQUENCY,), **options)


def axis(**options: Any) -> DriveConfiguration:
    keys = {'response': (VELOCITY,), 'period': 0.01, 'mode': 'csv', **options}
    return drive('cia402', name='axis', station=4, parameter_timeout=0.1,
                 table=(TARGET, VELOCITY, POSITION, TURNS, ACCELERATION),
                 request=(TARGET,), **keys)


def starter(*response: Any, **options: Any) -> DriveConfiguration:
    return drive('canopen_pkw', name='pump', station=5, parameter_timeout=0.5,
                 table=(COMMAND, *response), request=(), response=response, **options)


PLAIN = [parameter('setpoint', 50), parameter('limit', 51)]
OTHER = parameter('other', 52)
WITH_POSITION = axis(response=(VELOCITY, POSITION), response_pdos=(1, 3))
POLLED = drive('datamodel_standard')
DRIVES = {
    'conveyor': drive(),
    'conveyor_with_time': drive(parameter_timeout=0.1),
    'conveyor_without_storage': drive(table=(*PLAIN, OTHER), request=PLAIN),
    'polled': POLLED,
    'polled_without_storage': drive(
        'datamodel_standard', table=(*PLAIN, OTHER), request=PLAIN),
    'mixer': inverter(),
    'mixer_with_five': drive('cannord', name='mixer', station=100, table=(*FIVE, *ACTUAL_FIVE),
                             request=FIVE, response=ACTUAL_FIVE, extra_setpoints=True),
    'first': inverter('first', 0),
    'second': inverter('second', 1),
    'first_of_group': inverter('first', 0, broadcast='group'),
    'second_of_group': inverter('second', 1, broadcast='group'),
    'alone': inverter('alone', 1),
    'leader': inverter('leader', 0, broadcast='group'),
    'axis': axis(),
    'axis_with_position': WITH_POSITION,
    'axis_by_event': axis(mode='pv', transmission='event', period=0.02),
    'pump': starter(STATUS, CURRENT),
    'pump_with_second': starter(STATUS, parameter('second', 456)),
    'pump_with_other': starter(STATUS, parameter('other', 500)),
    'pump_word_be': starter(STATUS, CURRENT, layout='word_be'),
}


class Story:
    """Does the steps of a transcript."""

    def step(self, step: str) -> list[str]:
        first, *words = step.split()
        if first == 'watch':
            names, _, only = ' '.join(words).partition(' only ')
            self.witness = Witness(*(DRIVES[name] for name in names.split()),
                                   only={Only(each) for each in only.split()})
            return []
        if first == 'count':
            observed = self.witness.observed(words[0])
            found = {name: getattr(observed, name) for name in words[1:]}
            return [', '.join(
                f'{name} {round(value.mean, 6) if isinstance(value, Statistic) else value}'
                for name, value in found.items())]
        if first == 'strays':
            return [str(self.witness.tracer.buses['main'].strays)]
        if not words:
            return self.witness.waits(float(first))
        frame, *sent = words
        return self.witness.hears(frame, float(first), sent=sent == ['T'] if sent else None)


@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str) -> None:
    assert replayed(STORIES[story], Story().step) == STORIES[story]


def test_a_raw_address_is_forgotten_with_its_telegram() -> None:
    witness = Witness(DRIVES['pump'])

    def read(*registers: int) -> int:
        """Return how many parameters there are after that."""
        for register in registers:
            toggle = register % 2 << 7
            place = register.to_bytes(2, 'little').hex().upper()
            (line,) = witness.hears(f'505#{place}00{toggle | 0x25:02X}00000000', 0.01)
            assert line.endswith(f'read: p{register}')
            witness.hears(f'485#{place}00{toggle | 0x25:02X}01000000', 0.005)
        witness.telegrams.clear()
        gc.collect()
        return sum(isinstance(each, Parameter) for each in gc.get_objects())
    assert read(*range(9000, 9010)) == read(*range(9010, 9100))


def test_what_is_remembered_of_tasks_has_an_end_but_for_those_under_way() -> None:
    witness = Witness(inverter())
    witness.hears('2C8#66C0010000006400', 0.0)
    for index in range(1100):
        witness.hears(f'2C8#{1 + index // 256:02X}60{index % 256:02X}0000000000', 0.001)
    asked = len(witness.telegrams)
    witness.waits(10.0)
    lost = witness.telegrams[asked:]
    assert len(lost) == 1101 and {each.verdict for each in lost} == {Verdict.LOST}
    assert lost[0].parameters == (RAMP_2,)
    witness.hears('2C8#6610000000000000', 20.0)
    witness.hears('2C9#6610000000006700', 20.1)
    witness.hears('2C9#6640010000006400', 30.0)
    # nobody knows any more that it was written
    assert (witness.telegrams[-1].title, witness.telegrams[-1].parameters) == ('read', (RAMP_2,))


def test_an_object_of_megabytes_by_segments_is_neither_kept_nor_shown() -> None:
    witness = Witness(axis())
    witness.hears('604#4021100000000000', 0.0)
    witness.hears('584#4121100000002000', 0.001)
    for index in range(400):
        witness.hears(f'604#{0x60 + index % 2 * 0x10:02X}00000000000000', 0.01)
        witness.hears(f'584#{index % 2 * 0x10:02X}41424344454647', 0.011)
    kept = [value for each in witness.tracer.buses['main'].observers
            for value in vars(each).values() if isinstance(value, bytes)]
    assert 0 < max(map(len, kept)) <= 256
    line, = witness.hears('584#1D41000000000000', 0.02)
    assert 'ABCDEFGABC' in line
    assert len(witness.telegrams[-1].remark) == 256


@pytest.mark.parametrize(('drives', 'identifiers'), [
    ((drive(), drive('datamodel_standard', name='lift')),
     (0x003FFFF0, 0x103FFFF0, 0x3F1, 0x7F1, 0x002001E1)),
    ((inverter(broadcast='group'), inverter('other', 101, extra_setpoints=True)),
     (0xC8, 0xC9, 0x2C8, 0x2C9, 0x403)),
    ((WITH_POSITION,), (0x000, 0x080, 0x084, 0x184, 0x204, 0x384, 0x584, 0x604, 0x704, 0x77F)),
    ((starter(STATUS, CURRENT),), (0x505, 0x485, 0x705, 0x085, 0x000)),
], ids=['datamodel', 'cannord', 'cia402', 'canopen_pkw'])
@given(st.data())
def test_anything(drives: tuple[DriveConfiguration, ...], identifiers: tuple[int, ...],
                  data: st.DataObject) -> None:
    witness = Witness(*drives)
    frames = data.draw(st.lists(st.tuples(
        st.one_of(st.sampled_from(identifiers), st.integers(0, 0x1FFFFFFF)),
        st.binary(max_size=8), st.booleans(), st.floats(0, 10), st.sampled_from(RecordKind))))
    for identifier, content, extended, time, kind in frames:
        extended = extended or identifier > 0x7FF
        witness.tracer.take(Record(time, 'can0', identifier, content, extended, kind))
    witness.waits(100.0)
    if WITH_POSITION in drives:     # SDO segments bring none
        assert len(witness.telegrams) >= sum(
            identifier not in (0x584, 0x604) for identifier, *_ in frames)


@pytest.mark.parametrize(('watched', 'name', 'node'), [('axis', 'axis', 4), ('pump', 'pump', 5)])
def test_node_guarding_is_a_conversation_of_its_node(watched: str, name: str, node: int) -> None:
    witness = Witness(DRIVES[watched])
    timeout = DRIVES[watched].parameter_timeout

    def asks(time: float, of: int = node, *, extended: bool = False) -> list[str]:
        witness.tracer.take(Record(time, 'can0', 0x700 + of, b'', extended, RecordKind.REMOTE))
        return witness.lines()
    assert asks(0.0) == [f'0.000000 +0.000 main {name} > node guarding: request']
    assert witness.hears(f'70{node}#85', 0.002) == [
        f'0.002000 +0.000 main {name} < node guarding: operational [2.0 ms]']
    assert witness.hears(f'70{node}#05', 0.5) == [
        f'0.500000 +0.000 main {name} < heartbeat: operational']
    assert asks(1.0) == [f'1.000000 +1.000 main {name} > node guarding: request']
    lost = f'+{0.998 + timeout:.3f} main {name} < node guarding: LOST: no answer'
    assert witness.waits(1.9) == [f'{1.0 + timeout:.6f} {lost}']
    # of nobody
    assert asks(2.0, 6) == ['2.000000 +0.000 main remote frame: SUSPICIOUS: 706#']
    assert asks(2.1, extended=True) == [
        f'2.100000 +0.100 main remote frame: SUSPICIOUS: 0000070{node}#']
    assert witness.observed(name).requests == witness.observed(name).unanswered == 0
