# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``additional_constraints`` of a drive parameter's descriptor: what tools read."""

import shlex
from typing import Any

from bridges import parameters, StartBridge
from builders import EEPROM, parameter, RAM, RO, WO
from clients import Client
from families import Facts, FAMILIES
import pytest
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.srv import DescribeParameters

from drive_can_bridge.core.parameters import Parameter, ParameterType, ValueKind
from drive_can_bridge.core.roles import Role
from drive_can_bridge.ros.messages import facts_of
from drive_can_bridge.ros.monitor.client import parameter_info
from drive_can_bridge.ros.values import constraints, descriptor


@pytest.mark.parametrize(('described', 'role', 'text'), [
    (Parameter('actual_torque', number=209, index=0x2004, subindex=0x10, type=ParameterType.INT16,
               scale=0.1, unit='N m', scaled=True, access=RO, storage=RAM), Role.CYCLIC,
     'unit="N m" number=209 index=0x2004 subindex=0x10 type=int16 scale=0.1 offset=0 '
     'access=ro storage=ram protected=false role=cyclic'),
    (parameter('key', 44, access=WO, storage=EEPROM), None,
     'number=44 type=uint16 access=wo storage=eeprom protected=false'),
    # what does not apply is absent
    (Parameter('p80', ParameterType.UINT32, 80, listed=False, width_known=False), None,
     'number=80 access=rw protected=false'),
    (Parameter('p613.5', number=613, subindex=5, protected=True), None,
     'number=613 subindex=5 type=uint16 access=rw protected=true'),
    (Parameter('frequency', access=RO), Role.CYCLIC,
     'type=uint16 access=ro protected=false role=cyclic')])
def test_as_the_contract_writes_it(described: Parameter, role: Role | None, text: str) -> None:
    assert constraints(described, role) == text


@pytest.mark.parametrize(('described', 'kind'), [
    (parameter('key', 44, access=WO), ValueKind.INTEGER),
    (parameter('release', 45, access=WO, type=ParameterType.BOOL), ValueKind.BOOL),
    (parameter('push', 46, access=WO, unit='%'), ValueKind.DOUBLE),
    (parameter('mode', 47), ValueKind.INTEGER),
    (parameter('brake', 48, type=ParameterType.BOOL), ValueKind.BOOL),
    (parameter('ramp_time', 49, unit='s', scale=0.01), ValueKind.DOUBLE)])
@pytest.mark.parametrize('unreadable', [False, True])
def test_a_monitor_knows_the_kind_of_what_has_no_value_too(
        described: Parameter, kind: ValueKind, unreadable: bool) -> None:
    message = descriptor(described.name, described, unreadable=unreadable)
    assert parameter_info(message).kind is kind


@pytest.mark.parametrize('unit', ['rpm', 'N m', '%', "'", '"', '\\', 'a "b" \\c', '°C', 'a=b',
                                  'line\nfeed'])
def test_whatever_the_unit_is_it_can_be_taken_apart(unit: str) -> None:
    text = constraints(parameter('x', 5, unit=unit, scale=1 / 3, offset=-273.15), None)
    found = dict(pair.split('=', 1) for pair in shlex.split(text))
    assert found['unit'] == unit
    assert (float(found['scale']), float(found['offset'])) == (1 / 3, -273.15)


@pytest.mark.parametrize('facts', FAMILIES, ids=lambda row: row.protocol)
def test_of_every_family(bridge: StartBridge, client: Client, facts: Facts,
                         tmp_path: Any) -> None:
    bridge(parameters(conveyor=facts.drive(tmp_path)))
    raw_gain = facts.raw_name('gain')
    by_index = raw_gain.startswith('x')
    names = [*facts.listed, raw_gain, 'nothing']
    described = client.call('/conveyor/describe_parameters', DescribeParameters,
                            DescribeParameters.Request(names=names)).descriptors
    found = {entry.name: dict(pair.split('=') for pair in shlex.split(
        entry.additional_constraints)) for entry in described}
    assert found.pop('nothing') == {}
    assert {name: fields['role'] for name, fields in found.items() if 'role' in fields} == {
        'speed_setpoint': 'cyclic', 'mode': 'cyclic', 'brake': 'cyclic',
        'actual_speed': 'cyclic', 'counts': 'cyclic', 'braked': 'cyclic',
        **({'control_word': 'control', 'status_word': 'cyclic'} if facts.status_mapped else {})}
    assert found['ramp_time'] == {
        'unit': 's', 'type': 'uint16',
        **({'index': '0x2102'} if by_index else {'number': '102'}),
        'scale': '0.01', 'offset': '0', 'access': 'rw', 'storage': 'eeprom', 'protected': 'false'}
    assert found['actual_ramp']['offset'] == '-10' and 'unit' not in found['actual_ramp']
    # a raw name obeys the rules of the listed one
    assert found[raw_gain] == {
        **found['gain'], 'type': 'uint16', **({'subindex': '0x00'} if by_index else {})}
    if 'ratio' in found:
        assert (found['ratio']['index'], found['ratio']['subindex']) == ('0x2007', '0x03')


def test_constraints_are_read() -> None:
    facts = facts_of(ParameterDescriptor(additional_constraints=(
        'unit="N m" number=209 index=0x2004 subindex=0x10 type=int16 scale=0.1 offset=0 '
        r'access=ro storage=ram protected=false error="of \"4\""')))
    assert facts['unit'] == 'N m'
    assert facts['type'] == 'int16'
    assert facts['protected'] == 'false'
    assert facts['error'] == 'of "4"'
    for text in ('free text, as others write it', 'unit="', 'x' * 10_000_000):
        assert facts_of(ParameterDescriptor(additional_constraints=text)) == {}
