# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Calls that ask for too much, and names that are not what they seem."""

from bridges import CONVEYOR, parameters, StartBridge
from clients import Client, from_value, to_value, wait_until
import pytest
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParameters,
    SetParametersAtomically,
)

from drive_can_bridge.core import sentences

DRIVE = 'drive_can_bridge: drive conveyor'
MANY = [f'name_{number}' for number in range(1001)]
LONG = ['ramp_time', 'x' * 257]
HUGE = ['y' * 2_000_000]
REASONS = {
    'many': (MANY, '1001 names in one call, at most 1000 are allowed'),
    'long': (LONG, 'a name longer than 256 characters'),
    'huge': (HUGE, 'a name longer than 256 characters')}


@pytest.mark.parametrize('which', REASONS)
def test_a_call_that_asks_for_too_much_is_answered_at_once(
        bridge: StartBridge, client: Client, which: str) -> None:
    names, reason = REASONS[which]
    one = bridge().online()
    client.listen()
    before = len(client.logged())
    with one.record() as recorder:
        def call(service: str, kind: object, request: object) -> object:
            return client.call(f'/conveyor/{service}', kind, request)
        answer = call('get_parameters', GetParameters, GetParameters.Request(names=names))
        assert [from_value(value) for value in answer.values] == [None] * len(names)
        parameters = [Parameter(name=name, value=to_value(1.0)) for name in names]
        answer = call('set_parameters', SetParameters,
                      SetParameters.Request(parameters=parameters))
        assert [(result.successful, result.reason) for result in answer.results] == [
            (False, reason)] * len(names)
        answer = call('set_parameters_atomically', SetParametersAtomically,
                      SetParametersAtomically.Request(parameters=parameters))
        assert (answer.result.successful, answer.result.reason) == (
            False, sentences.nothing_written(reason))
        answer = call('describe_parameters', DescribeParameters,
                      DescribeParameters.Request(names=names))
        assert len(answer.descriptors) == len(names)
        assert all(entry.type == 0 and len(entry.name) <= 256 for entry in answer.descriptors)
        answer = call('get_parameter_types', GetParameterTypes,
                      GetParameterTypes.Request(names=names))
        assert list(answer.types) == [0] * len(names)
        answer = call('list_parameters', ListParameters, ListParameters.Request(prefixes=names))
        assert not answer.result.names
        recorder.catch_up()
        assert not [frame for frame in recorder.frames() if frame[0] & 0x1FFFF0 == 0x0001E0]
    assert client.wait_logged(reason).startswith('conveyor: ')
    assert len(client.logged()) - before <= 6
    status = client.diagnostics(DRIVE, lambda drive: reason in drive['last_parameter_error'])
    assert all(len(value) <= 256 for value in status.values())


def test_a_thousand_unknown_names_do_not_fill_the_log(bridge: StartBridge,
                                                      client: Client) -> None:
    bridge().online()
    client.listen()
    assert client.get('/conveyor', *MANY[:1000]) == [None] * 1000
    client.wait_logged('conveyor: read parameters: 984 more names of the same call failed')
    assert client.set('/conveyor', **dict.fromkeys(MANY[:1000], 1))[-1] == (
        False, sentences.unknown_parameter('name_999'))
    client.wait_logged('conveyor: set parameters: 984 more names of the same call failed')
    lines = [line for line in client.logged() if 'unknown parameter' in line]
    assert len(lines) == 32
    status = client.diagnostics(DRIVE, lambda drive: True)
    assert status['parameter_requests_failed'] == '2000'


def test_a_thousand_names_that_wait_when_the_bridge_ends_are_one_line(
        bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'missed_limit': 100000,
                                      'parameter_timeout': 60.0})).online()
    one.played['conveyor'].fault('silent')
    client.listen()
    future = client.ask('/conveyor/get_parameters', GetParameters, GetParameters.Request(
        names=[f'p{number}' for number in range(1000, 2000)]))
    wait_until(lambda: one.node.drives['conveyor'].calls == 1)
    one.node.stop()
    client.wait_logged('conveyor: read p1000 (P1000) and 999 more: ')
    assert len([line for line in client.logged() if 'conveyor: read ' in line]) == 1
    wait_until(future.done)


EVIL = 'ramp\n[ERROR] [1.0] [drive_can_bridge]: all lost\x1b[2J\x9b31m\u202e'
SHOWN = (r'ramp\n[ERROR] [1.0] [drive_can_bridge]: all lost\x1b[2J\x9b31m'
         r'\u202e')
UNKNOWN = sentences.unknown_parameter(SHOWN)


def test_names_that_would_forge_the_log(bridge: StartBridge, client: Client) -> None:
    bridge().online()
    client.listen()
    assert client.get('/conveyor', EVIL) == [None]
    assert client.wait_logged('all lost') == f'conveyor: read {SHOWN}: {UNKNOWN}'
    assert client.set('/conveyor', **{EVIL: 1}) == [(False, UNKNOWN)]
    assert not client.transition(label=EVIL)
    client.wait_logged(f'transition {SHOWN} is not possible')
    status = client.diagnostics(DRIVE, lambda drive: 'lost' in drive['last_parameter_error'])
    assert status['last_parameter_error'] == f'set {SHOWN}: {UNKNOWN}'
    assert all(line.isprintable() for line in client.logged(0))
