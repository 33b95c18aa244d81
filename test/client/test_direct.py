# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The direct way to drives: what it sends and what it does not, and what ends it."""

from collections.abc import Iterator
import copy
import gc
from pathlib import Path
import re
from types import SimpleNamespace
from typing import Any
import weakref

from builders import frame
from client_builders import a_world, ALL, CONVEYOR, LIFT, MIXER, PUMP, stranger, World
import pytest
from saying import says
from waiting import wait_for

from drive_can_bridge.client import find_source, open_drives
from drive_can_bridge.client.direct import BusConversation, LISTEN
from drive_can_bridge.client.drive import Drives, Enabled
from drive_can_bridge.core.errors import BusUnavailable, DriveCanError
from drive_can_bridge.core.roles import Role
from drive_can_bridge.exchange.one_master import AnotherMaster, InUse

pytestmark = pytest.mark.usefixtures('bench')

#: what is said of drives that need more than to be asked
SAID = {
    'pre-operational': 'drive offline: node is pre-operational',
    'offline': 'no answer; drive offline',
    'hint': 'answers no PKW, --nmt-start starts it',
    'supervised': 'mixer: P513 is not 0: the drive supervises telegrams once it has got one, and '
                  'faults when they end',
}
#: everything that only a master sends to these drives, but acyclic requests
CYCLIC_REQUEST = 0x003FFFF0
MIXER_PROCESS_DATA = 0x260
PUMP_REQUEST = 0x505


@pytest.fixture
def world(tmp_path: Path, bench: object) -> Iterator[World]:
    with a_world(tmp_path) as made:
        yield made
        assert not made.errors


@pytest.fixture
def drives(world: World) -> Iterator[Drives]:
    """Return the drives of all families, their node started."""
    with open_drives(world.file, nmt_start=True) as opened:
        yield opened


def test_who_did_not_run_for_a_while_has_not_listened() -> None:
    conversation = BusConversation.__new__(BusConversation)
    now, waits = [0.0], []

    def wait(until: float) -> None:
        waits.append(until)
        now[0] = until + 60.0 * (len(waits) == 1)
        conversation._trouble = AnotherMaster('heard') if len(waits) == 5 else None

    conversation.now, conversation._trouble = (lambda: now[0]), None
    conversation._changed = SimpleNamespace(wait=wait)      # type: ignore[assignment]
    with pytest.raises(AnotherMaster):
        conversation.listen(LISTEN)


def reasons(outcomes: dict[str, Any]) -> dict[str, str]:
    return {name: outcome.reason for name, outcome in outcomes.items()}


@pytest.mark.parametrize('name', ALL)
def test_all_listed_parameters_are_read(drives: Drives, world: World, name: str) -> None:
    drive = drives[name]
    outcomes = drive.read()
    assert list(outcomes) == [
        each for each, parameter in drive.parameters.items()
        if parameter.readable and (parameter.number, parameter.index) != (None, None)]
    assert set(reasons(outcomes).values()) == {''}
    for outcome in outcomes.values():
        assert outcome.parameter is not None
        assert outcome.raw is not None and outcome.value is not None
        assert outcome.value == outcome.parameter.value_from_raw(outcome.raw)


def test_values_are_those_of_the_drive(drives: Drives, world: World) -> None:
    world.drives['conveyor'].set_value('ramp_time', 3.25)
    outcome = drives['conveyor'].read('ramp_time')['ramp_time']
    assert (outcome.raw, outcome.value) == (325, 3.25)
    assert drives['conveyor'].read('p30')['p30'].value == 325


@pytest.mark.parametrize(('name', 'parameter', 'value'), [
    ('conveyor', 'ramp_time', 1.75), ('lift', 'ramp_time', 2.5),
    ('mixer', 'acceleration_time', 4.5), ('pump', 'motor_trip_class', 10)])
def test_a_write_arrives(drives: Drives, world: World, name: str, parameter: str,
                         value: float) -> None:
    outcome = drives[name].write({parameter: value})[parameter]
    assert (outcome.ok, outcome.reason) == (True, '')
    assert world.drives[name].value(parameter) == pytest.approx(value)


@pytest.mark.parametrize(('name', 'wanted'), [
    ('conveyor', {
        'ramp_tim': (1.0, 'unknown parameter ramp_tim, did you mean ramp_time?'),
        'actual_speed': (1.0, 'read-only'),
        'ramp_time': (99.0, '99 is out of range: 0.01 to 60 s'),
        'speed_setpoint': (5.0, 'setpoint speed_setpoint: only a running bridge sends it'),
        'p50': (7, 'setpoint speed_setpoint: only a running bridge sends it')}),
    ('conveyor', {
        'p30': (-10 ** 400, 'a number of 1329 bits is out of range: 0 to 65535'),
        'ramp_time': (10 ** 400, 'a number of 1329 bits is out of range: 0.01 to 60 s'),
        'maximum_speed': (10 ** 5000, 'a number of 16610 bits is out of range: 0 to 3000 rpm')}),
    ('conveyor', {'ramp_time': (True, 'wrong type: bool, expected double')}),
    ('lift', {'control_word': (1, 'control word: only a running bridge sends it'),
              'p52': (1, 'control word: only a running bridge sends it')})])
def test_what_cannot_be_written_says_why(drives: Drives, world: World, name: str,
                                         wanted: dict[str, tuple[Any, str]]) -> None:
    before = len(world.seen())
    values = {key: value for key, (value, _) in wanted.items()}
    told = {key: reason for key, (_, reason) in wanted.items()}
    assert {key: drives[name].check(key, value) for key, value in values.items()} == told
    assert reasons(drives[name].write(values)) == told
    assert drives['conveyor'].role('speed_setpoint') is Role.CYCLIC
    assert [each for each in world.seen()[before:] if each.identifier < 0x700] == []


def test_of_two_values_for_one_parameter_none_is_written(drives: Drives, world: World) -> None:
    before = world.drives['conveyor'].value('ramp_time')
    outcomes = drives['conveyor'].write({'ramp_time': 2.5, 'p30': 200, 'jog_speed': 3.0})
    assert {name: outcome.ok for name, outcome in outcomes.items()} == {
        'ramp_time': False, 'p30': False, 'jog_speed': True}
    assert world.drives['conveyor'].value('ramp_time') == before


def test_maps_are_written_directly(drives: Drives, world: World) -> None:
    conveyor = drives['conveyor']
    assert conveyor.role('p122') is Role.MAP
    assert conveyor.write({'p122': 50})['p122'].ok


def test_one_that_nobody_answers_takes_no_other_along(drives: Drives) -> None:
    outcomes = drives['conveyor'].read('p9999', 'ramp_time', 'bogus', 'p9998')
    assert reasons(outcomes) == {
        'p9999': says('no_answer', timeout=0.3, attempts=3), 'ramp_time': '',
        'bogus': says('unknown_parameter', name='bogus'),
        'p9998': says('no_answer', timeout=0.3, attempts=3)}
    assert list(outcomes) == ['p9999', 'ramp_time', 'bogus', 'p9998']


def test_many_that_nobody_answers_take_no_other_along(tmp_path: Path) -> None:
    keys = {**CONVEYOR, 'parameter_timeout': 0.05, 'parameter_retries': 0}
    with a_world(tmp_path, conveyor=keys) as world, open_drives(world.file) as drives:
        nowhere = [f'p{number}' for number in range(1000, 1040)]
        outcomes = drives['conveyor'].read(*nowhere, 'p209', *(f'p{n}' for n in range(1, 20)))
        assert outcomes['p209'].ok
        assert all(outcomes[name].reason == says('no_answer', timeout=0.05, attempts=1)
                   for name in nowhere)


def test_state(drives: Drives) -> None:
    assert drives['lift'].enabled() is Enabled.NO
    assert drives['conveyor'].enabled() is Enabled.UNKNOWN
    assert drives['pump'].identity().startswith('controller_reference_1=')
    assert drives['conveyor'].identity() == ''
    facts = drives['pump'].facts
    assert (facts.bus, facts.protocol, facts.station, facts.through) == (
        'main', 'canopen_pkw', 5, '')
    assert facts.restore is not None and facts.restore.before


def test_each_outcome_is_told(drives: Drives) -> None:
    told: list[str] = []
    drives['conveyor'].read('ramp_time', 'bogus', told=lambda outcome: told.append(outcome.name))
    drives['conveyor'].write({'ramp_time': 1.0, 'speed_setpoint': 1.0},
                             told=lambda outcome: told.append(outcome.name))
    assert sorted(told) == ['bogus', 'ramp_time', 'ramp_time', 'speed_setpoint']


def test_nothing_is_sent_unasked(tmp_path: Path) -> None:
    keys: dict[str, Any] = copy.deepcopy(ALL)
    del keys['mixer']   # whose telegram time-out is asked for
    with a_world(tmp_path, **keys) as world, open_drives(world.file) as drives:
        opened = {each.identifier for each in world.seen()}
        assert opened <= {0x705}     # the heartbeats of the node
        drives['lift'].read('ramp_time')
        requests = {each.identifier for each in world.seen()} - {0x705, 0x7F2}
        assert requests == {0x3F2}
        drives['conveyor'].read()
        seen = world.seen()
        # every 29-bit request is a read: one frame for each answer, nothing cyclic
        assert CYCLIC_REQUEST not in {each.identifier for each in seen if each.extended}
        assert 0 not in {each.identifier for each in seen if not each.extended}


def test_no_process_data_and_no_nmt(drives: Drives, world: World, tmp_path: Path) -> None:
    with a_world(tmp_path, mixer=MIXER, pump=PUMP) as own, open_drives(own.file) as opened:
        opened['mixer'].read()
        opened['mixer'].write({'acceleration_time': 3.0})
        wait_for(lambda: 0x705 in {each.identifier for each in own.seen()}, 'a heartbeat')
        outcome = opened['pump'].read('trip_code')['trip_code']
        assert outcome.reason.startswith((SAID['pre-operational'], SAID['offline']))
        assert outcome.reason.endswith(SAID['hint'])
        identifiers = {each.identifier for each in own.seen()}
        assert 0 not in identifiers
        assert not identifiers & set(range(MIXER_PROCESS_DATA, 0x264))


def test_the_node_is_started_when_asked_for(tmp_path: Path) -> None:
    with a_world(tmp_path, pump=PUMP) as world:
        with open_drives(world.file, nmt_start=True) as drives:
            assert drives['pump'].read('trip_code')['trip_code'].ok
        assert [each for each in world.seen() if each.identifier == 0] == [frame('000#0105')]


def test_supervision_of_telegrams_is_warned_about(tmp_path: Path) -> None:
    with a_world(tmp_path, mixer=MIXER) as world:
        with open_drives(world.file) as drives:
            assert drives.warnings == ()
        for none in (0.0, -0.1):   # it runs on when telegrams end
            world.drives['mixer'].set_value('p513', none)
            with open_drives(world.file) as drives:
                assert drives.warnings == ()
        world.drives['mixer'].set_value('p513', 20)
        with open_drives(world.file) as drives:
            assert drives.warnings == (SAID['supervised'],)


def test_a_silent_drive_costs_little(tmp_path: Path) -> None:
    with a_world(tmp_path, conveyor=CONVEYOR, lift=LIFT) as world:
        world.drives['conveyor'].fault('silent')
        with open_drives(world.file) as drives:
            before = len(world.seen())
            outcomes = drives['conveyor'].read()
            assert all(reason == says('no_answer_offline')
                       for reason in reasons(outcomes).values())
            written = drives['conveyor'].write({'ramp_time': 2.0})['ramp_time']
            assert (written.ok, written.reason) == (False, says('no_answer_offline'))
            # three parameters, three times each, twice; no write among them
            assert len(world.seen()) - before == 18
            world.drives['conveyor'].fault('ok')
            assert drives['conveyor'].read('ramp_time')['ramp_time'].ok


def test_a_silent_drive_that_is_to_be_started_costs_little(tmp_path: Path) -> None:
    with a_world(tmp_path, pump={**PUMP, 'parameter_timeout': 0.3}) as world:
        world.drives['pump'].fault('silent')
        with open_drives(world.file, nmt_start=True) as drives:
            assert drives['pump'].identity() == ''
            assert all(reason == says('no_answer_offline')
                       for reason in reasons(drives['pump'].read()).values())
            # three parameters, three times each, once
            requests = [each for each in world.seen()
                        if each.identifier == PUMP_REQUEST and any(each.data)]
            assert len(requests) == 9
            world.drives['pump'].fault('ok')
            wait_for(lambda: drives['pump'].read('trip_code')['trip_code'].ok, 'an answer')


def test_a_drive_that_goes_away_in_the_middle(tmp_path: Path) -> None:
    with a_world(tmp_path, conveyor=CONVEYOR) as world, open_drives(world.file) as drives:
        first = drives['conveyor'].read('ramp_time')
        world.drives['conveyor'].fault('silent')
        outcomes = drives['conveyor'].read('maximum_speed', 'ramp_time')
        assert first['ramp_time'].ok
        assert all(reason == says('no_answer', timeout=0.3, attempts=3)
                   for reason in reasons(outcomes).values())


# -- one master -----------------------------------------------------------------------------------

AXIS = {'bus': 'main', 'protocol': 'cia402', 'station': 7, 'profile': 'cia402_servo', 'mode': 'pv',
        'cyclic_request': ['target_velocity']}
REQUESTS = {'conveyor': '002003C4#0000000000000000', 'lift': '3F2#1E00',
            'mixer': '264#0012000000000000', 'pump': '505#0000000000000000'}


@pytest.mark.parametrize('name', REQUESTS)
def test_another_master_before_the_first_request(tmp_path: Path, name: str) -> None:
    with a_world(tmp_path, **ALL) as world:
        with stranger(world, frame(REQUESTS[name]), after=0.4 * LISTEN):
            with pytest.raises(AnotherMaster, match=(
                    rf'^bus main: another master talks to drive {name} \(')):
                open_drives(world.file, only=['conveyor'])


@pytest.mark.parametrize('seen', ['207#0F00', '607#4041600000000000', '000#0107'])
def test_another_master_of_an_axis(tmp_path: Path, seen: str) -> None:
    with a_world(tmp_path, axis=AXIS) as world:
        with stranger(world, frame(seen), after=0.4 * LISTEN):
            with pytest.raises(AnotherMaster, match='another master talks to drive axis '):
                open_drives(world.file)


def test_an_axis_says_whether_it_is_enabled(tmp_path: Path) -> None:
    with a_world(tmp_path, axis=AXIS) as world:
        with open_drives(world.file) as drives:
            assert drives['axis'].enabled() is Enabled.NO
        # 6060h := 3 (pv), then 6040h
        for written in ('2F606000030000', '2B406000060000', '2B406000070000', '2B4060000F0000'):
            world.send(frame(f'607#{written}00'))
        with open_drives(world.file) as drives:
            assert drives['axis'].enabled() is Enabled.YES
            world.drives['axis'].fault('silent')
            assert drives['axis'].enabled() is Enabled.UNKNOWN


def test_another_master_later(tmp_path: Path) -> None:
    with a_world(tmp_path, conveyor=CONVEYOR, lift=LIFT) as world:
        with open_drives(world.file) as drives:
            assert drives['lift'].read('ramp_time')['ramp_time'].ok
            world.send(frame(REQUESTS['conveyor']))
            with pytest.raises(AnotherMaster, match='drive conveyor'):
                for _ in range(1000):
                    drives['lift'].read()
            with pytest.raises(AnotherMaster):
                drives['lift'].write({'ramp_time': 1.0})


def test_locks_are_held_while_it_is_open(tmp_path: Path) -> None:
    with a_world(tmp_path, conveyor=CONVEYOR, lift=LIFT) as world:
        with open_drives(world.file, only=['lift']):
            with pytest.raises(InUse, match='^bus main: drive conveyor is used by process'):
                open_drives(world.file, only=['conveyor'])
        open_drives(world.file, only=['conveyor']).close()


def test_a_bus_that_is_not_there(tmp_path: Path) -> None:
    with a_world(tmp_path, conveyor=CONVEYOR) as world:
        world.wire.lose('no such device')
        with pytest.raises(BusUnavailable, match='^bus main: '):
            open_drives(world.file)
        with pytest.raises(BusUnavailable, match='^bus main: '):    # nothing stays locked
            open_drives(world.file)


def test_names(world: World) -> None:
    source = find_source(world.file)
    assert list(source.names) == ['conveyor', 'lift', 'mixer', 'pump']
    assert 'ramp_time' in source.parameter_names('conveyor')
    with pytest.raises(DriveCanError, match="^no drive 'x.'; there are: conveyor, lift, mixer"):
        open_drives(world.file, only=['x?'])


def test_a_name_that_nobody_has(world: World, drives: Drives) -> None:
    for caught in (DriveCanError, KeyError):
        with pytest.raises(caught, match=re.escape(
                "no drive 'conveyer' (did you mean 'conveyor'?); there are: conveyor, lift, "
                'mixer, pump') + '$'):
            drives['conveyer']
    assert drives.get('conveyer') is None and 'conveyer' not in drives
    with pytest.raises(DriveCanError, match="did you mean 'lift'"):
        open_drives(world.file, only='lifd')


def test_what_they_look_like(drives: Drives) -> None:
    assert repr(drives) == f'<Drives {", ".join(ALL)}>'
    assert repr(drives['lift']) == '<Drive lift>'


def test_one_name_is_no_sequence_of_letters(tmp_path: Path) -> None:
    with a_world(tmp_path, conveyor=CONVEYOR, lift=LIFT) as world:
        with open_drives(world.file, only='con*') as drives:
            assert list(drives) == ['conveyor']


@pytest.mark.parametrize(('name', 'words'), [
    ('nothing.yaml', 'No such file or directory'), ('', 'Is a directory')])
def test_a_file_that_cannot_be_read(tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(DriveCanError) as caught:
        open_drives(tmp_path / name)
    assert str(caught.value) == f'{tmp_path / name}: {words}'


def test_after_the_end(tmp_path: Path) -> None:
    with a_world(tmp_path, conveyor=CONVEYOR) as world:
        with open_drives(world.file) as drives:
            conveyor = drives['conveyor']
        for ask in (conveyor.read, lambda: conveyor.write({'ramp_time': 1.0})):
            with pytest.raises(DriveCanError, match='^bus main: is closed already$'):
                ask()


def test_a_namespace_is_of_a_bridge_only(world: World) -> None:
    with pytest.raises(DriveCanError, match='namespace is of a running bridge, params_file goes '
                                            'without one'):
        open_drives(world.file, namespace='/x')


def test_what_only_the_direct_way_has() -> None:
    with pytest.raises(DriveCanError, match='nmt_start goes with params_file only'):
        open_drives(nmt_start=True)


def test_drives_that_nobody_closes_are_locked_all_the_same(tmp_path: Path) -> None:
    with a_world(tmp_path, conveyor=CONVEYOR) as world:
        before = set(world.clock.tasks)
        conveyor = open_drives(world.file)['conveyor']
        gc.collect()
        assert conveyor.read('ramp_time')['ramp_time'].ok
        assert set(world.clock.tasks) > before
        with pytest.raises(InUse):
            open_drives(world.file)
        conversation = weakref.ref(conveyor._conversation)     # type: ignore[attr-defined]
        del conveyor
        gc.collect()
        with pytest.raises(InUse):      # its threads still run
            open_drives(world.file)
        left = conversation()
        assert left is not None
        left.close()
