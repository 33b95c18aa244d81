# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Configurations that are written are read as what they were."""

from pathlib import Path

import pytest
import yaml

from drive_can_bridge.configuration.load import (
    bridge_names, configuration_from_file, of_one_bus, write_parameter_file,
)
from drive_can_bridge.resources import config_file

TWO_BUSES = """
/**/drive_can_bridge:
  ros__parameters:
    buses:
      left: {interface: virtual, channel: left, bitrate: 250000}
      right: {interface: virtual, channel: right}
    drives:
      conveyor: {bus: left, protocol: datamodel_extended, station: 1, profile: datamodel_example,
                 cyclic_request: [speed_setpoint], cyclic_response: [actual_speed]}
      lift: {bus: right, protocol: datamodel_standard, station: 1, profile: datamodel_example,
             cyclic_request: [speed_setpoint], cyclic_response: [actual_speed]}
"""


@pytest.mark.parametrize('name', ['all_families', 'demo', 'example', 'tesys', 'cannord'])
def test_what_is_written_is_read_again(name: str, tmp_path: Path) -> None:
    configuration = configuration_from_file(config_file(f'{name}.yaml'))
    write_parameter_file(configuration, tmp_path / 'written.yaml')
    again = configuration_from_file(tmp_path / 'written.yaml')
    assert (again.buses, again.drives) == (configuration.buses, configuration.drives)


def test_each_bus_by_itself(tmp_path: Path) -> None:
    file = tmp_path / 'both.yaml'
    file.write_text(TWO_BUSES, encoding='utf-8')
    both = configuration_from_file(file)
    found = {}
    for bus in both.buses:
        written = tmp_path / f'{bus}.yaml'
        write_parameter_file(of_one_bus(both, bus), written, f'drive_can_bridge_{bus}')
        assert f'/**/drive_can_bridge_{bus}:' in written.read_text(encoding='utf-8')
        one = configuration_from_file(written)
        assert one.buses == {bus: both.buses[bus]}
        found.update(one.drives)
    assert found == both.drives


@pytest.mark.parametrize('text', [
    'y', 'N', 'inf', 'nan', '1e5', '08', '0x1p3', 'Infinity', 'yes', '010', '1.5', 'null', '~',
    "it's", 'a: b', '- a', ' ', '\N{DEGREE SIGN}'])
def test_text_that_reads_as_something_else_stays_text(text: str, tmp_path: Path) -> None:
    file, written = tmp_path / 'both.yaml', tmp_path / 'written.yaml'
    quoted = "'" + text.replace("'", "''") + "'"
    file.write_text(TWO_BUSES.replace(
        'channel: right', f'channel: {quoted}, unique_hardware_id: {quoted}').replace(
        'cyclic_response: [actual_speed]}', 'cyclic_response: [actual_speed], '
        f'joint: {{name: {quoted}, velocity: actual_speed}}}}', 1), encoding='utf-8')
    both = configuration_from_file(file)
    assert [drive.joint and drive.joint.name for drive in both.drives.values()] == [text, None]
    write_parameter_file(both, written)
    again = configuration_from_file(written)
    assert (again.buses, again.drives) == (both.buses, both.drives)


STANDARD = """
    use_sim_time: false
    start_type_description_service: true
    qos_overrides: {/lift/actual.speed: {publisher: {depth: 3, reliability: best_effort}}}
    qos_overrides./lift/online.publisher.depth: 5
"""


def test_parameters_of_ros_are_carried_over(tmp_path: Path) -> None:
    file, written = tmp_path / 'both.yaml', tmp_path / 'right.yaml'
    file.write_text(TWO_BUSES.rstrip() + STANDARD, encoding='utf-8')
    write_parameter_file(of_one_bus(configuration_from_file(file), 'right'), written)
    content = yaml.safe_load(written.read_text(encoding='utf-8'))
    given = yaml.safe_load(STANDARD)
    assert {name: value for name, value in
            content['/**/drive_can_bridge']['ros__parameters'].items() if name in given} == given
    configuration_from_file(written)


def test_bridges_of_buses_have_names_of_nodes_each_its_own() -> None:
    assert bridge_names(['can-0', 'a-b_c', 'can_0', 'a-b-c', 'left']) == {
        'can-0': 'drive_can_bridge_can_0_', 'can_0': 'drive_can_bridge_can_0',
        'a-b_c': 'drive_can_bridge_a_b_c', 'a-b-c': 'drive_can_bridge_a_b_c_',
        'left': 'drive_can_bridge_left'}
