# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Who a drive is: read when it comes online, a read-only parameter of the bridge."""

from pathlib import Path

from bridges import Bridge, CONVEYOR, parameters, StartBridge
from clients import Client, wait_until
import pytest
from rcl_interfaces.srv import DescribeParameters

BRIDGE = '/drive_can_bridge'
NAME = 'drives.conveyor.identity'
SPEED = """\
protocols: [datamodel_extended]
identity: [firmware, serial_number, supply, factory_made]
parameters:
  speed_setpoint: {number: 50, type: int16, scale: 0.1, unit: rpm, storage: ram}
  actual_speed: {number: 209, type: int16, scale: 0.1, unit: rpm, access: ro}
  firmware: {number: 300, access: ro}
  serial_number: {number: 305, access: ro}
  supply: {number: 310, type: int16, scale: 0.5, unit: V, access: ro}
  factory_made: {number: 311, type: bool, access: ro}
"""


@pytest.fixture
def keys(tmp_path: Path) -> dict[str, object]:
    """Return the keys of a drive with such a profile."""
    path = tmp_path / 'who.yaml'
    path.write_text(SPEED)
    return {**CONVEYOR, 'profile': str(path), 'cyclic_request': ['speed_setpoint'],
            'cyclic_response': ['actual_speed'], 'missed_limit': 5}


def give(one: Bridge, **values: float) -> None:
    """Make the simulated drive another one."""
    for name, value in values.items():
        one.played['conveyor'].set_value(name, value)


def identity_becomes(client: Client, text: str) -> None:
    """Wait for a text; a failure shows the last one."""
    seen: list[object] = []

    def there() -> bool:
        seen[:] = client.get(BRIDGE, NAME)
        return seen == [text]

    try:
        wait_until(there)
    except AssertionError:
        assert seen == [text]


def test_is_read_whenever_the_drive_comes_online(bridge: StartBridge, client: Client,
                                                 keys: dict[str, object]) -> None:
    one = bridge(parameters(conveyor=keys), autostart=False)
    give(one, firmware=10205, serial_number=4711, supply=24.5, factory_made=True)
    assert one.node.start()
    first = 'firmware=10205 serial_number=4711 supply=24.5 factory_made=true'
    identity_becomes(client, first)
    played = one.played['conveyor']
    before = one.node.drives['conveyor'].session.statistics.exchanges
    played.fault('silent')
    wait_until(lambda: not one.node.drives['conveyor'].session.online)
    give(one, serial_number=4712)
    assert client.get(BRIDGE, NAME) == [first]  # nobody has answered since
    played.fault('ok')
    second = first.replace('4711', '4712')
    identity_becomes(client, second)
    assert one.node.drives['conveyor'].session.statistics.exchanges > before
    [descriptor] = client.call(
        f'{BRIDGE}/describe_parameters', DescribeParameters,
        DescribeParameters.Request(names=[NAME])).descriptors
    assert descriptor.read_only and 'Found out by the bridge' in descriptor.description
    [(success, reason)] = client.set(BRIDGE, **{NAME: 'somebody else'})
    assert not success and 'read-only' in reason
    assert client.get(BRIDGE, NAME) == [second]
    # what lets the bridge write this one lets nobody write nonsense elsewhere
    [(success, reason)] = client.set(BRIDGE, drives__conveyor__command_timeout=-1.0)
    assert not success and reason


def test_what_cannot_be_read_is_left_out(bridge: StartBridge, client: Client, tmp_path: Path,
                                         keys: dict[str, object]) -> None:
    path = tmp_path / 'who.yaml'
    path.write_text(SPEED.replace('[firmware, ', '[').replace('  firmware:', '  # firmware:'))
    one = bridge(parameters(conveyor={**keys, 'parameter_timeout': 0.2, 'parameter_retries': 0}),
                 autostart=False)
    path.write_text(SPEED)  # the drive that is played lacks a parameter of the bridge's profile
    give(one, serial_number=4711, supply=0, factory_made=False)
    assert one.node.start()
    identity_becomes(client, 'serial_number=4711 supply=0 factory_made=false')


def test_a_drive_that_answers_none_of_it_is_left_alone(
        bridge: StartBridge, client: Client, tmp_path: Path, keys: dict[str, object],
        capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / 'who.yaml'
    lines = [line for line in SPEED.splitlines() if 'speed' in line or not line.startswith('  ')]
    path.write_text('\n'.join(line for line in lines if 'identity' not in line))
    one = bridge(parameters(conveyor={**keys, 'parameter_timeout': 0.2, 'parameter_retries': 0}),
                 autostart=False)
    path.write_text(SPEED)
    assert one.node.start()
    told = ''

    def given_up() -> bool:
        nonlocal told
        told += capfd.readouterr().err
        return told.count('identity: ') == 2

    wait_until(given_up)
    one.played['conveyor'].set_value('actual_speed', 12.5)
    assert client.get('/conveyor', 'actual_speed') == [12.5]
    assert client.get(BRIDGE, NAME) == ['']
    told += capfd.readouterr().err
    assert told.count('identity: ') == 2


def test_a_profile_without_identity_asks_nothing(bridge: StartBridge, client: Client) -> None:
    one = bridge().online()
    assert client.get(BRIDGE, NAME) == ['']
    assert one.node.drives['conveyor'].session.statistics.requests_ok == 0
