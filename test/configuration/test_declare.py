# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameters that the node declares, and those that may change while it runs."""

import hashlib
from pathlib import Path

from configuration_builders import changed, FILE, load
import pytest
from saying import says

from drive_can_bridge.configuration.load import (
    check_dynamic, configuration_from_overrides, declared_parameters,
)


def test_all_effective_values(tmp_path: Path) -> None:
    text = changed(FILE, 'rearm: neutral', 'joint: {name: belt, velocity: actual}')
    text = changed(text, 'bitrate: 125000', 'rx_queue_size: 5')
    text = changed(text, '[speed, limit]', '[]')
    text = text[:text.index('      lift:')]
    declared = declared_parameters(load(tmp_path, text))
    sha256 = hashlib.sha256((tmp_path / 'table.yaml').read_bytes()).hexdigest()
    assert [(name, value) for name, value, _, _ in declared] == [
        ('autostart', True),
        ('diagnostics_period', 1.0),
        ('joint_state_rate', 50.0),
        ('memory_limit_mb', 1024),
        ('profile_directories', [str(tmp_path)]),
        ('buses.main.interface', 'virtual'),
        ('buses.main.channel', 'demo'),
        ('buses.main.bitrate', 125000),
        ('buses.main.adapter', ''),
        ('buses.main.reconnect_period', 1.0),
        ('buses.main.trace_seconds', 0.0),
        ('buses.main.trace_directory', ''),
        ('buses.main.trace_files', 20),
        ('buses.main.rx_queue_size', 5),
        ('drives.conveyor.bus', 'main'),
        ('drives.conveyor.protocol', 'datamodel_extended'),
        ('drives.conveyor.station', 1),
        ('drives.conveyor.profile', 'table'),
        ('drives.conveyor.period', 0.02),
        ('drives.conveyor.cyclic_request', []),
        ('drives.conveyor.cyclic_response', ['actual', 'current', 'status']),
        ('drives.conveyor.missed_limit', 3),
        ('drives.conveyor.command_timeout', 0.5),
        ('drives.conveyor.rearm', 'neutral'),
        ('drives.conveyor.parameter_timeout', 0.1),
        ('drives.conveyor.control_timeout', 2.0),
        ('drives.conveyor.parameter_retries', 2),
        ('drives.conveyor.verify_writes', True),
        ('drives.conveyor.identity', ''),
        ('drives.conveyor.setpoints', ''),
        ('drives.conveyor.commanders', ''),
        ('drives.conveyor.profile_sha256', sha256),
        ('drives.conveyor.restore', '{"before": [], "after": []}'),
        ('drives.conveyor.mapping', 'verify'),
        ('drives.conveyor.request_map_base', 122),
        ('drives.conveyor.response_map_base', 126),
        ('drives.conveyor.parameter_offset', 0),
        ('drives.conveyor.eeprom_write_gap', 0.02),
        ('drives.conveyor.length_policy', 'lenient'),
        ('drives.conveyor.allow_fast_cycle', False),
        ('drives.conveyor.joint.name', 'belt'),
        ('drives.conveyor.joint.velocity', 'actual'),
        ('drives.conveyor.joint.gear_ratio', 1.0),
        ('drives.conveyor.joint.pole_pairs', 1),
        ('drives.conveyor.joint.continuous', False),
    ]
    assert all(parameter.description for parameter in declared)
    assert [parameter.name for parameter in declared if parameter.dynamic] == [
        'diagnostics_period', 'drives.conveyor.command_timeout', 'drives.conveyor.rearm',
        'drives.conveyor.parameter_timeout']


def test_what_was_declared_configures_the_same(tmp_path: Path) -> None:
    text = changed(FILE, 'rearm: neutral', 'joint: {name: belt, velocity: actual}\n'
                                           '        rearm: immediate')
    configuration = load(tmp_path, text)
    again = configuration_from_overrides({
        parameter.name: parameter.value for parameter in declared_parameters(configuration)})
    assert again == configuration


@pytest.mark.parametrize(('name', 'value', 'problem'), [
    ('diagnostics_period', 2.0, None),
    ('diagnostics_period', 2, None),
    ('diagnostics_period', 0.0, '0.0 is out of range, allowed is a number of 0.01 to 3600'),
    ('diagnostics_period', True, 'true is a bool, allowed is a number of 0.01 to 3600'),
    ('drives.conveyor.command_timeout', 0, None),
    ('drives.conveyor.command_timeout', -0.1,
     '-0.1 is out of range, allowed is a number of 0 to 3600'),
    ('drives.conveyor.command_timeout', float('inf'),
     'inf is not a finite number, allowed is a number of 0 to 3600'),
    ('drives.conveyor.command_timeout', '1',
     "'1' is a string, allowed is a number of 0 to 3600: write 1"),
    ('drives.conveyor.rearm', 'immediate', None),
    ('drives.conveyor.rearm', 'imediate',
     "'imediate' is unknown (did you mean 'immediate'?), allowed is neutral or immediate"),
    ('drives.conveyor.parameter_timeout', 0.2, None),
    ('drives.conveyor.parameter_timeout', None,
     'no value, allowed is a number of 0.001 to 60'),
    ('drives.conveyor.station', 2, says('not_while_running', name='drives.conveyor.station')),
    ('autostart', False, says('not_while_running', name='autostart')),
])
def test_dynamic(name: str, value: object, problem: object) -> None:
    assert check_dynamic(name, value) == problem
