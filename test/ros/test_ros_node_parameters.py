# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameters of the bridge's own node."""

import hashlib
import json
from pathlib import Path
from typing import Any

from bridges import CONVEYOR, LIFT, parameters, StartBridge
from clients import Client, wait_until
import pytest
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters,
)

from drive_can_bridge.resources import profiles_directory

BRIDGE = '/drive_can_bridge'


def test_everything_can_be_read(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={
        **CONVEYOR, 'command_timeout': 3,
        'joint': {'name': 'belt', 'velocity': 'actual_speed'}}, lift=LIFT))
    expected = {
        'autostart': True, 'diagnostics_period': 0.1, 'profile_directories': [''],
        'buses.main.interface': 'virtual', 'buses.main.bitrate': 1_000_000,
        'buses.main.channel': one.channel(), 'buses.main.reconnect_period': 0.1,
        'drives.conveyor.bus': 'main', 'drives.conveyor.protocol': 'datamodel_extended',
        'drives.conveyor.station': 1, 'drives.conveyor.profile': 'datamodel_example',
        'drives.conveyor.period': 0.02, 'drives.conveyor.command_timeout': 3.0,
        'drives.conveyor.cyclic_request': ['speed_setpoint', 'torque_limit'],
        'drives.conveyor.missed_limit': 100, 'drives.conveyor.rearm': 'neutral',
        'drives.conveyor.parameter_retries': 2, 'drives.conveyor.verify_writes': True,
        'drives.conveyor.mapping': 'verify', 'drives.conveyor.request_map_base': 122,
        'drives.conveyor.joint.name': 'belt', 'drives.conveyor.joint.gear_ratio': 1.0,
        'drives.lift.station': 2, 'drives.lift.control_timeout': 20.0, 'use_sim_time': False}
    assert client.get(BRIDGE, *expected) == list(expected.values())
    names = client.call(f'{BRIDGE}/list_parameters', ListParameters).result.names
    assert set(expected) <= set(names)


def test_the_digest_of_the_profile(bridge: StartBridge, client: Client, tmp_path: Path) -> None:
    profile = tmp_path / 'mine.yaml'
    profile.write_text((profiles_directory() / 'datamodel_example.yaml').read_text(
        encoding='utf-8') + '# ours\n', encoding='utf-8')
    bridge(parameters(conveyor=CONVEYOR, lift={**LIFT, 'profile': str(profile), 'cyclic_request': [
        'speed_setpoint'], 'cyclic_response': ['actual_speed']}))
    names = ['drives.conveyor.profile_sha256', 'drives.lift.profile_sha256']
    assert client.get(BRIDGE, *names) == [
        hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (profiles_directory() / 'datamodel_example.yaml', profile)]
    [(done, reason)] = client.set(BRIDGE, drives__conveyor__profile_sha256='0')
    assert not done and 'read-only' in reason


def test_an_edited_profile_is_told_with_the_next_configuration(
        bridge: StartBridge, client: Client, tmp_path: Path) -> None:
    """A backup is restored by what the bridge says of the profile: of the one that it goes by."""
    profile = tmp_path / 'mine.yaml'
    text = (profiles_directory() / 'datamodel_example.yaml').read_text(encoding='utf-8')
    profile.write_text(text, encoding='utf-8')
    bridge(parameters(conveyor={**CONVEYOR, 'profile': str(profile)}))
    told = 'drives.conveyor.profile_sha256', 'drives.conveyor.restore'
    before = client.get(BRIDGE, *told)
    profile.write_text(text + 'restore: {after: {jog_speed: 5}}\n', encoding='utf-8')
    assert client.get(BRIDGE, *told) == before
    for label in ('deactivate', 'cleanup', 'configure'):
        assert client.transition(label=label)
    digest, restore = client.get(BRIDGE, *told)
    assert digest == hashlib.sha256(profile.read_bytes()).hexdigest()
    assert json.loads(restore) == {'before': [], 'after': [['jog_speed', 50, 65535]]}


@pytest.mark.parametrize('name, value', [
    ('autostart', False), ('buses.main.bitrate', 125000), ('drives.conveyor.station', 5),
    ('drives.conveyor.period', 0.1), ('drives.conveyor.cyclic_request', ['speed_setpoint']),
    ('profile_directories', ['/']), ('drives.conveyor.mapping', 'assume')])
def test_most_cannot_be_set(shared_bridge: StartBridge, client: Client, name: str,
                            value: object) -> None:
    shared_bridge()
    before = client.get(BRIDGE, name)
    [(success, reason)] = client.set(BRIDGE, **{name: value})
    assert not success and 'read-only' in reason
    assert client.get(BRIDGE, name) == before


@pytest.mark.parametrize('name, value, words', [
    ('drives.conveyor.command_timeout', -1.0, '-1.0 is out of range'),
    ('drives.conveyor.command_timeout', float('nan'), 'nan is not a finite number'),
    ('drives.conveyor.command_timeout', float('inf'), 'inf is not a finite number'),
    ('drives.conveyor.command_timeout', 'soon', "'soon' is"),
    ('drives.conveyor.command_timeout', True, 'true is'),
    ('drives.conveyor.command_timeout', None, 'allowed is'),
    ('drives.conveyor.parameter_timeout', 0, '0 is out of range'),
    ('drives.conveyor.rearm', 'never', "'never' is unknown"),
    ('drives.conveyor.rearm', 1, '1 is'),
    ('diagnostics_period', 0.0, '0.0 is out of range'),
    ('diagnostics_period', ['1'], 'a list'),
    ('drives.conveyor.color', 'red', 'undeclared'),
    ('drives.elevator.rearm', 'neutral', 'undeclared')])
def test_bad_values_are_refused_in_words(shared_bridge: StartBridge, client: Client, name: str,
                                         value: object, words: str) -> None:
    one = shared_bridge()
    before = client.get(BRIDGE, name)
    [(success, reason)] = client.set(BRIDGE, **{name: value})
    assert not success and words in reason, reason
    assert client.get(BRIDGE, name) == before
    one.online()


RUBBISH = ['', ' ', '.', 'drives..', '\n', '\x1b[31m', 'é', '/', 'drives.conveyor', 'x' * 100_000]


def test_every_type_is_answered_in_words(shared_bridge: StartBridge, client: Client) -> None:
    shared_bridge()
    for kind in range(256):
        [(done, reason)] = client.set(
            BRIDGE, drives__conveyor__rearm=ParameterValue(type=kind, string_value='neutral'))
        assert done == (kind == ParameterType.PARAMETER_STRING), kind
        assert bool(reason) != done
        if kind > ParameterType.PARAMETER_STRING_ARRAY:
            assert reason == f'type {kind} does not exist'


def test_a_type_that_does_not_exist_takes_no_other_along(
        shared_bridge: StartBridge, client: Client) -> None:
    shared_bridge()
    before = client.get(BRIDGE, 'drives.conveyor.command_timeout')
    strange, words = ParameterValue(type=10), 'type 10 does not exist'
    assert client.set(BRIDGE, drives__conveyor__command_timeout=strange, nothing=strange,
                      diagnostics_period=0.2) == [(False, words), (False, words), (True, '')]
    assert client.set_atomically(BRIDGE, diagnostics_period=0.3,
                                 drives__conveyor__command_timeout=strange) == (
        False, f'drives.conveyor.command_timeout: {words}')
    assert client.get(BRIDGE, 'drives.conveyor.command_timeout', 'diagnostics_period') == [
        *before, 0.2]


@pytest.mark.parametrize('name', RUBBISH)
def test_rubbish_is_answered(shared_bridge: StartBridge, client: Client, name: str) -> None:
    shared_bridge()
    [(done, reason)] = client.set(BRIDGE, **{name: 1.0})
    assert not done and reason
    done, reason = client.set_atomically(BRIDGE, **{name: 1.0})
    assert not done and reason
    for service, kind in (('get_parameters', GetParameters),
                          ('get_parameter_types', GetParameterTypes),
                          ('describe_parameters', DescribeParameters)):
        client.call(f'{BRIDGE}/{service}', kind, kind.Request(names=[name, name]))
    for depth in (0, 1, 2**64 - 1):
        client.call(f'{BRIDGE}/list_parameters', ListParameters,
                    ListParameters.Request(prefixes=[name], depth=depth))
    assert client.set_atomically(BRIDGE)[0] in (True, False)


def test_dynamic_ones_take_effect(bridge: StartBridge, client: Client) -> None:
    one = bridge().online()
    session = one.node.drives['conveyor'].session
    assert client.set(BRIDGE, drives__conveyor__command_timeout=4,
                      drives__conveyor__parameter_timeout=0.05,
                      drives__conveyor__rearm='immediate', diagnostics_period=1) == [
        (True, '')] * 4
    assert session.setpoints.timeout == 4.0 and session.setpoints.rearm_immediate
    assert client.get(BRIDGE, 'drives.conveyor.command_timeout', 'diagnostics_period') == [4, 1]
    client.get('/conveyor', 'p35')
    client.wait_logged('conveyor: read p35 (P35): no answer in 0.05 s, 3 attempts')
    assert client.set(BRIDGE, diagnostics_period=0.05) == [(True, '')]
    client.diagnostics('drive_can_bridge: drive conveyor',
                       lambda drive: 'a command to' in drive['message'])
    assert client.set_atomically(
        BRIDGE, drives__conveyor__rearm='neutral',
        drives__conveyor__command_timeout=-1)[0] is False
    assert session.setpoints.rearm_immediate


def test_one_that_is_set_while_the_bridge_configures_itself_takes_effect(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    from drive_can_bridge.ros import bridge_node

    class Runtime(bridge_node.BridgeRuntime):
        """Somebody is quick: parameters are declared, and the drives are being made."""

        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            assert client.set(BRIDGE, drives__conveyor__command_timeout=4,
                              drives__conveyor__rearm='immediate') == [(True, '')] * 2
    monkeypatch.setattr(bridge_node, 'BridgeRuntime', Runtime)
    one = bridge()
    setpoints = one.node.drives['conveyor'].session.setpoints
    assert (setpoints.timeout, setpoints.rearm_immediate) == (4.0, True)


def test_changes_are_announced(shared_bridge: StartBridge, client: Client) -> None:
    shared_bridge()
    events = client.parameter_events(BRIDGE)
    client.set(BRIDGE, drives__conveyor__command_timeout=1.5)
    wait_until(lambda: {'drives.conveyor.command_timeout': 1.5} in events)
