# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the log says of parameters that fail, and what is refused before anything is sent."""

from bridges import acyclic, CONVEYOR, HASTY, parameters, StartBridge
from clients import Client

from drive_can_bridge.core import sentences

DRIVE = 'drive_can_bridge: drive conveyor'
SPEED_RANGE = '0 to 3000 rpm'


def test_a_failure_that_repeats_is_logged_once(bridge: StartBridge, client: Client) -> None:
    bridge(parameters(conveyor={**CONVEYOR, **HASTY})).online()
    client.listen()
    text = 'conveyor: read p35 (P35): no answer in 0.2 s, 3 attempts'
    for _ in range(3):
        assert client.get('/conveyor', 'p35') == [None]     # 30 to 34 exist
        assert client.wait_logged('p35') == text
    assert client.get('/conveyor', 'p31') != [None]
    assert client.logged().count(text) == 1
    # what is held back is counted, should the machine be that slow
    assert not [line for line in client.logged() if 'p35' in line and not line.startswith(text)]
    status = client.diagnostics(DRIVE, lambda drive: 'P35' in drive['last_parameter_error'])
    assert status['last_parameter_error'] == text.removeprefix('conveyor: ')


def test_set_refusals(bridge: StartBridge, client: Client) -> None:
    one = bridge().online()
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
            (False, sentences.nan_refused()),
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


def test_of_two_values_for_one_parameter_none_is_set_atomically(
        bridge: StartBridge, client: Client) -> None:
    one = bridge().online()
    before = one.played['conveyor'].value('ramp_time')
    with one.record() as recorder:
        assert client.set_atomically('/conveyor', ramp_time=before + 1.0, p30=150) == (
            False, sentences.nothing_written(f'ramp_time: {sentences.contradicted("p30")}'))
        assert not acyclic(recorder)
    # elsewhere they are set one after the other, as everywhere in ROS
    assert client.set('/conveyor', ramp_time=1.5, p30=100) == [(True, '')] * 2
    assert one.played['conveyor'].value('ramp_time') == 1.0
