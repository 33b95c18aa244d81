# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A drive's parameters as the parameters of its node."""

from typing import Any

from bridges import acyclic, CONVEYOR, HASTY, LIFT, parameters, StartBridge
from clients import Client, wait_until
import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameterTypes, ListParameters

from drive_can_bridge.core import sentences

DRIVE = 'drive_can_bridge: drive conveyor'
JOG_RANGE = '-300 to 300 rpm'
NOTHING_WRITTEN = 'nothing was written'
RAMP_RANGE = '0.01 to 60 s'
SPEED_RANGE = '0 to 3000 rpm'


def test_get(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    drive = one.played['conveyor']
    drive.set_value('ramp_time', 1.25)
    drive.set_value('jog_speed', -12.3)
    drive.set_value('fan_always_on', True)
    drive.set_value('fault_code', 7)
    assert client.get('/conveyor') == []
    values = client.get('/conveyor', 'fault_code', 'ramp_time', 'p30', 'jog_speed', 'p62',
                        'fan_always_on', 'p63', 'ramp_time')
    assert values == [7, pytest.approx(1.25), 125, pytest.approx(-12.3), 0x10000 - 123, True, 1,
                      pytest.approx(1.25)]
    assert [type(value) for value in values] == [int, float, int, float, int, bool, int, float]
    client.listen()
    assert client.get('/conveyor', 'ramp_tim', 'ramp_time', 'p99999', 'p30.1') == [
        None, pytest.approx(1.25), None, None]
    client.wait_logged('conveyor: read ramp_tim: unknown parameter ramp_tim, did you mean '
                       'ramp_time?')
    status = client.diagnostics(DRIVE, lambda drive: drive['parameter_requests_failed'] == '3')
    assert status['last_parameter_error'] == \
        f'read p30.1: {sentences.unknown_parameter("p30.1")}'
    assert int(status['parameter_requests_ok']) >= 9


def test_write_only_reads_as_not_set_without_a_frame(bridge: StartBridge,
                                                     client: Client) -> None:
    one = bridge()
    one.online()
    with one.record() as recorder:
        assert client.get('/conveyor', 'user_command', 'p70') == [None, None]
        assert client.set('/conveyor', user_command=1) == [
            (True, sentences.sent_unacknowledged())]
        wait_until(lambda: acyclic(recorder))
        assert [identifier >> 20 & 1 for identifier, _ in acyclic(recorder)] == [1]


def test_one_bad_name_takes_no_other_along(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, **HASTY}))
    one.online()
    one.played['conveyor'].set_value('brake_enabled', True)
    client.listen()
    # 30 to 34 exist, 35 and 36 do not
    values = client.get('/conveyor', 'p33', 'p34', 'p35', 'p36')
    assert values[1] == 1 and values[0] is not None and values[2:] == [None, None]
    text = 'conveyor: read p35 (P35): no answer in 0.2 s, 3 attempts'
    assert client.wait_logged('p35') == text
    client.get('/conveyor', 'p35')
    client.get('/conveyor', 'p35')
    assert client.get('/conveyor', 'p31') != [None]
    assert client.logged().count(text) == 1
    # what is held back is counted, should the machine be that slow
    assert not [line for line in client.logged() if 'p35' in line and not line.startswith(text)]
    status = client.diagnostics(DRIVE, lambda drive: 'P35' in drive['last_parameter_error'])
    assert status['last_parameter_error'] == text.removeprefix('conveyor: ')


def test_no_answer_is_logged_as_the_contract_says(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'missed_limit': 1000,
                                      'parameter_timeout': 0.1}))
    one.online()
    one.played['conveyor'].fault('silent')
    client.listen()
    assert client.get('/conveyor', 'ramp_time') == [None]
    title = 'ramp_time (P30)'
    assert client.wait_logged('ramp_time') == (
        f'conveyor: read {title}: {sentences.no_answer(0.1, 3)}')
    assert client.set('/conveyor', ramp_time=2.0, jog_speed=1.0) == [
        (False, sentences.no_answer(0.1, 3))] * 2
    client.wait_logged('conveyor: set jog_speed (P62): no answer in 0.1 s, 3 attempts')


def test_set(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    events = client.parameter_events('/conveyor')
    assert client.set('/conveyor', ramp_time=2.5, jog_speed=-3, fan_always_on=True,
                      brake_enabled=True) == [(True, '')] * 4
    drive = one.played['conveyor']
    assert drive.value('ramp_time') == pytest.approx(2.5)
    assert drive.value('jog_speed') == pytest.approx(-3.0)
    assert drive.value('fan_always_on') is True and drive.value('brake_enabled') is True
    wait_until(lambda: events)
    assert events == [{'ramp_time': pytest.approx(2.5), 'jog_speed': pytest.approx(-3.0),
                       'fan_always_on': True, 'brake_enabled': True}]
    assert type(events[0]['jog_speed']) is float
    # what is there already is not written again
    written = drive.eeprom_writes
    assert client.set('/conveyor', ramp_time=2.5) == [(True, '')]
    assert drive.eeprom_writes == written
    assert client.set('/conveyor') == []


def test_set_raw(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    drive = one.played['conveyor']
    assert client.set('/conveyor', p62=-100, p30=400, p63=1) == [(True, '')] * 3
    assert drive.value('jog_speed') == pytest.approx(-10.0)
    assert drive.value('ramp_time') == pytest.approx(4.0)
    assert client.get('/conveyor', 'p62') == [0x10000 - 100]
    # the rules of the listed twin
    assert client.set('/conveyor', p62=5000, p209=1, p50=1, p30=0, p62__1=3) == [
        (False, sentences.raw_refused(
            5000, 'jog_speed', sentences.out_of_range('500', JOG_RANGE))),
        (False, sentences.read_only()),
        (False, sentences.sent_cyclically('speed_setpoint')),
        (False, sentences.raw_refused(
            0, 'ramp_time', sentences.out_of_range('0', RAMP_RANGE))),
        (False, sentences.unknown_parameter('p62.1'))]
    assert client.set('/conveyor', p62=1.0) == [
        (False, sentences.wrong_type('double', 'integer'))]
    for beyond in (0x10000, -0x8001):
        assert client.set('/conveyor', p62=beyond) == [
            (False, sentences.not_in_bits(beyond, 16, -0x8000, 0xFFFF))]


def test_set_refusals(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    events = client.parameter_events('/conveyor')
    client.listen()
    with one.record() as recorder:
        results = client.set(
            '/conveyor', ramp_tim=1.0, actual_speed=1.0, ramp_time='long', brake_enabled=1,
            jog_speed=True, maximum_speed=3000.1, rated_current=float('nan'),
            speed_setpoint=1.0, torque_limit=1.0, p122=1, p129=1, p65535=1, jog_speed__x=None)
        assert results[:11] == [
            (False, sentences.unknown_parameter('ramp_tim', 'ramp_time')),
            (False, sentences.read_only()),
            (False, sentences.wrong_type('string', 'double')),
            (False, sentences.wrong_type('integer', 'bool')),
            (False, sentences.wrong_type('bool', 'double')),
            (False, sentences.out_of_range('3000.1', SPEED_RANGE)),
            (False, sentences.not_finite('nan')),
            (False, sentences.sent_cyclically('speed_setpoint')),
            (False, sentences.sent_cyclically('torque_limit')),
            (False, sentences.mapping_parameter()),
            (False, sentences.mapping_parameter())]
        assert results[11] == (False, sentences.unknown_parameter('p65535'))
        assert client.set('/conveyor', ramp_time=None) == [
            (False, sentences.wrong_type('not set', 'double'))]
        assert client.set('/conveyor', ramp_time=['a']) == [
            (False, sentences.wrong_type('array', 'double'))]
        assert not acyclic(recorder)
    client.wait_logged('conveyor: set maximum_speed: 3000.1 is out of range: 0 to 3000 rpm')
    status = client.diagnostics(DRIVE)
    assert status['parameter_requests_failed'] == '15'
    # one refusal does not keep the others from being written
    assert client.set('/conveyor', ramp_tim=1.0, jog_speed=5.0)[1] == (True, '')
    wait_until(lambda: events)
    assert events == [{'jog_speed': pytest.approx(5.0)}]


def test_read_back_something_else(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    events = client.parameter_events('/conveyor')
    drive = one.played['conveyor']
    drive.set_value('jog_speed', 1.5)
    drive.fault('stuck=jog_speed')
    client.listen()
    assert client.set('/conveyor', jog_speed=20.0) == [
        (False, sentences.read_back_differs('1.5', '20'))]
    client.wait_logged('conveyor: set jog_speed (P62): read back 1.5 instead of 20')
    assert client.set('/conveyor', fan_always_on=True) == [(True, '')]
    wait_until(lambda: events)
    assert events == [{'fan_always_on': True}]


def test_unverified_writes_say_so(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'verify_writes': False}))
    one.online()
    events = client.parameter_events('/conveyor')
    one.played['conveyor'].fault('stuck=jog_speed')
    assert client.set('/conveyor', jog_speed=20.0) == [
        (True, sentences.sent_unacknowledged())]
    wait_until(lambda: events)


def test_atomically(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    events = client.parameter_events('/conveyor')
    drive = one.played['conveyor']
    with one.record() as recorder:
        assert client.set_atomically('/conveyor', jog_speed=7.0, speed_gain=1.5,
                                     speed_integral_time=0.5, fan_always_on=True) == (True, '')
        writes = [frame for frame in acyclic(recorder) if frame[0] & 0x100000]
        assert [identifier & 0xF for identifier, _ in writes] == [4]
    assert [drive.value(name) for name in ('jog_speed', 'speed_gain', 'speed_integral_time')] == [
        pytest.approx(7.0), pytest.approx(1.5), pytest.approx(0.5)]
    wait_until(lambda: events)
    assert len(events) == 1 and len(events[0]) == 4
    before = drive.value('jog_speed')
    for values, reason in (
            ({'jog_speed': 1.0, 'ramp_time': 1.0}, NOTHING_WRITTEN),
            ({'jog_speed': 1.0, 'actual_speed': 1.0}, 'actual_speed: read-only'),
            ({'jog_speed': 1.0, 'speed_gain': 99.0}, 'speed_gain: 99 is out of range: 0 to 10'),
            ({'jog_speed': 1.0, 'speed_setpoint': 99.0}, 'speed_setpoint: sent cyclically'),
            ({'jog_speed': 1.0, 'nothing': 99.0}, 'nothing: unknown parameter')):
        success, text = client.set_atomically('/conveyor', **values)
        assert not success and reason in text and NOTHING_WRITTEN in text
    assert drive.value('jog_speed') == before
    assert client.set_atomically('/conveyor', ramp_time=9.0) == (True, '')
    assert client.set_atomically('/conveyor') == (True, '')
    assert len(events) == 2


def test_control_parameter_is_refused(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift=LIFT, hoist={**LIFT, 'station': 3,
                                              'cyclic_request': ['speed_setpoint']}))
    one.online()
    for drive in ('/lift', '/hoist'):
        assert client.set(drive, control_word=1, p52=1) == [(False, 'use ~/enable')] * 2
        assert client.get(drive, 'control_word') == [0]


def test_an_offline_drive_is_tried_once(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, **HASTY}))
    one.online()
    one.played['conveyor'].fault('silent')
    wait_until(lambda: not one.node.drives['conveyor'].session.online)
    client.listen()
    names = [f'p{number}' for number in range(300, 500, 2)]
    with one.record() as recorder:
        assert client.get('/conveyor', *names) == [None] * 100
        assert len({identifier for identifier, _ in acyclic(recorder)}) == 1
    client.wait_logged('conveyor: read p498 (P498): no answer; drive offline')
    assert client.set('/conveyor', ramp_time=1.0, jog_speed=1.0) == [
        (False, sentences.no_answer_offline())] * 2
    one.played['conveyor'].fault('ok')
    assert client.get('/conveyor', 'ramp_time') != [None]


def test_list(bridge: StartBridge, client: Client) -> None:
    bridge()

    def listed(*prefixes: str, depth: int = 0) -> tuple[list[str], list[str]]:
        result = client.call('/conveyor/list_parameters', ListParameters, ListParameters.Request(
            prefixes=prefixes, depth=depth)).result
        return list(result.names), list(result.prefixes)
    names, prefixes = listed()
    assert {'ramp_time', 'actual_speed', 'user_command', 'speed_setpoint'} <= set(names)
    assert len(names) == len(set(names)) == 25 and not prefixes
    assert not any(name.startswith('p3') for name in names)
    assert listed(depth=1)[0] == names
    assert listed('ramp_time') == (['ramp_time'], [])
    assert listed('ramp', depth=1) == ([], [])
    assert listed('ramp_time', 'jog_speed', depth=3)[0] == ['ramp_time', 'jog_speed']


def test_describe_and_types(bridge: StartBridge, client: Client) -> None:
    bridge()

    def described(*names: str) -> list[Any]:
        return list(client.call('/conveyor/describe_parameters', DescribeParameters,
                                DescribeParameters.Request(names=names)).descriptors)
    speed, code, brake, raw, gain = described('jog_speed', 'fault_code', 'brake_enabled', 'p30',
                                              'user_command')
    assert (speed.name, speed.type) == ('jog_speed', ParameterType.PARAMETER_DOUBLE)
    assert 'Jog speed' in speed.description and 'rpm' in speed.description
    assert not speed.read_only and not speed.dynamic_typing
    span = speed.floating_point_range[0]
    assert (span.from_value, span.to_value, span.step) == (-300.0, 300.0, 0.1)
    assert code.read_only and code.type == ParameterType.PARAMETER_INTEGER
    span = code.integer_range[0]
    assert (span.from_value, span.to_value, span.step) == (0, 65535, 1)
    assert brake.type == ParameterType.PARAMETER_BOOL
    assert not brake.integer_range and not brake.floating_point_range
    assert raw.name == 'p30' and raw.type == ParameterType.PARAMETER_INTEGER
    assert 'write-only' in gain.description
    assert [entry.type for entry in described('nothing', 'ramp_time')] == [
        ParameterType.PARAMETER_NOT_SET, ParameterType.PARAMETER_DOUBLE]
    types = client.call('/conveyor/get_parameter_types', GetParameterTypes,
                        GetParameterTypes.Request(names=['ramp_time', 'nothing', 'fault_code',
                                                         'brake_enabled', 'p30', 'user_command']))
    assert list(types.types) == [3, 0, 2, 1, 2, 2]
