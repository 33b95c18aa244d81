# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What graphical parameter editors rely on; rqt_reconfigure is the one that people use.

It lists, reads everything in one request, describes everything in one request, waits a second for
each answer, and makes one editor per parameter whose descriptor has a type: with that type, the
value that was read, and the ends of the range in a slider of 32 bits. One value of another type,
one end too large, and it shows none of the parameters that follow.
"""

from pathlib import Path
from typing import Any

from bridges import CONVEYOR, HASTY, parameters, StartBridge
from clients import Client, from_value
import pytest
from rcl_interfaces.msg import ParameterDescriptor, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters

SLIDER = range(-2 ** 31, 2 ** 31)
TYPES = {ParameterType.PARAMETER_BOOL: bool, ParameterType.PARAMETER_INTEGER: int,
         ParameterType.PARAMETER_DOUBLE: float}
WIDE = """
protocols: [canopen_pkw]
parameters:
  energy: {number: 600, type: uint32, access: ro}
  distance: {number: 602, type: int32, access: rw}
  limited: {number: 604, type: uint32, access: rw, maximum: 1000}
  power: {number: 606, type: uint32, scale: 0.1, unit: W, access: ro}
  only: {number: 610, type: uint16, access: rw, minimum: 5, maximum: 5}
"""


def editors(client: Client, node: str) -> dict[str, tuple[Any, ParameterDescriptor]]:
    """Do as the editor does; return value and descriptor of every parameter that it shows."""
    names = list(client.call(f'{node}/list_parameters', ListParameters).result.names)
    values = client.call(f'{node}/get_parameters', GetParameters,
                         GetParameters.Request(names=names)).values
    described = client.call(f'{node}/describe_parameters', DescribeParameters,
                            DescribeParameters.Request(names=names)).descriptors
    shown = {}
    for name, message, entry in zip(names, values, described, strict=True):
        assert entry.name == name
        if entry.type == ParameterType.PARAMETER_NOT_SET:
            continue
        value = from_value(message)
        assert type(value) is TYPES[entry.type], name
        for span in entry.integer_range:
            assert span.from_value in SLIDER and span.to_value in SLIDER
            assert span.from_value < span.to_value and span.step == 1
        for span in entry.floating_point_range:
            assert span.from_value < span.to_value and span.step > 0.0
        shown[name] = value, entry
    return shown


def test_a_drive(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor=CONVEYOR)).online()
    shown = editors(client, '/conveyor')
    assert len(shown) == 24 and 'user_command' not in shown  # write-only: there is no value
    assert [name for name, (_, entry) in shown.items() if entry.read_only] == [
        name for name in shown if one.node.configuration is not None
        and not one.node.configuration.drives['conveyor'].profile.parameters[name].writable]
    # what an editor sets is what the next one reads
    [limits] = shown['ramp_time'][1].floating_point_range
    assert client.set('/conveyor', ramp_time=limits.to_value) == [(True, '')]
    assert editors(client, '/conveyor')['ramp_time'][0] == pytest.approx(limits.to_value)


def test_what_the_drive_does_not_have(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, **HASTY, 'missed_limit': 1000})).online()
    before = list(editors(client, '/conveyor'))
    table: Any = one.played['conveyor'].drive
    entry = table.table._parameters.pop(30)  # ramp_time: an older drive than the profile is for
    after = list(editors(client, '/conveyor'))
    assert after == [name for name in before if name != 'ramp_time']
    table.table._parameters[30] = entry      # the drive was exchanged
    assert list(editors(client, '/conveyor')) == before


def test_wide_integers(bridge: StartBridge, client: Client, tmp_path: Path) -> None:
    profile = tmp_path / 'wide.yaml'
    profile.write_text(WIDE, encoding='utf-8')
    bridge(parameters(conveyor={
        'bus': 'main', 'protocol': 'canopen_pkw', 'station': 1, 'profile': str(profile),
        'period': 0.2, 'cyclic_response': ['power'], 'missed_limit': 100,
        'parameter_timeout': 2.0})).online()
    shown = editors(client, '/conveyor')
    assert list(shown) == ['energy', 'distance', 'limited', 'power', 'only']
    assert not shown['energy'][1].integer_range
    [span] = shown['distance'][1].integer_range
    assert (span.from_value, span.to_value) == (-2 ** 31, 2 ** 31 - 1)
    [span] = shown['limited'][1].integer_range
    assert (span.from_value, span.to_value) == (0, 1000)
    [span] = shown['power'][1].floating_point_range
    assert span.to_value == pytest.approx((2 ** 32 - 1) * 0.1)
    assert not shown['only'][1].integer_range


def test_the_bridge(bridge: StartBridge, client: Client) -> None:
    bridge().online()
    names = list(client.call('/drive_can_bridge/list_parameters', ListParameters).result.names)
    described = client.call('/drive_can_bridge/describe_parameters', DescribeParameters,
                            DescribeParameters.Request(names=names)).descriptors
    free = {entry.name for entry in described
            if not entry.read_only and entry.name.startswith(('drives.', 'buses.', 'diag'))}
    assert free == {'diagnostics_period', *(
        f'drives.conveyor.{key}' for key in ('command_timeout', 'rearm', 'parameter_timeout'))}
    assert all(entry.description for entry in described if entry.name.startswith('drives.'))
