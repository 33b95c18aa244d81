# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The example for ros2_control: its files agree with each other."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import JointConfiguration

FOLDER = Path(__file__).parents[2] / 'config' / 'ros2_control'
ROBOTS = ['arm', 'base', 'servo']
KINDS = ('position', 'velocity', 'effort')


def joints_of(robot: str) -> dict[str, JointConfiguration]:
    """Return the joints of the bridge's file, by name."""
    configuration = configuration_from_file(FOLDER / f'{robot}.yaml')
    assert configuration.warnings == ()
    return {drive.joint.name: drive.joint for drive in configuration.drives.values()
            if drive.joint is not None}


def systems_of(robot: str) -> list[ElementTree.Element]:
    return ElementTree.parse(FOLDER / f'{robot}.urdf').getroot().findall('ros2_control')


def interfaces(joint: ElementTree.Element, tag: str) -> set[str]:
    return {str(entry.get('name')) for entry in joint.findall(tag)}


def controllers_of(robot: str) -> dict[str, Any]:
    text = (FOLDER / f'{robot}_controllers.yaml').read_text(encoding='utf-8')
    return {name: section['ros__parameters'] for name, section in yaml.safe_load(text).items()}


def test_there_are_no_others() -> None:
    assert {path.name for path in FOLDER.iterdir()} == {
        f'{robot}{tail}' for robot in ROBOTS for tail in ('.yaml', '.urdf', '_controllers.yaml')}


@pytest.mark.parametrize('robot', ROBOTS)
def test_interfaces_are_those_of_the_bridge(robot: str) -> None:
    joints = joints_of(robot)
    root = ElementTree.parse(FOLDER / f'{robot}.urdf').getroot()
    described = {str(joint.get('name')) for joint in root.findall('joint')}
    assert described == set(joints)
    for system in systems_of(robot):
        commanded = [interfaces(joint, 'command_interface') for joint in system.findall('joint')]
        # one kind, and all of them commanded: else the arrays of commands have gaps
        assert len(set(map(frozenset, commanded))) == 1 and len(commanded[0]) == 1
        for joint in system.findall('joint'):
            mine = joints[str(joint.get('name'))]
            assert interfaces(joint, 'command_interface') == {
                kind for kind in KINDS if getattr(mine, f'{kind}_command')}
            # whatever is published needs an interface, and what is commanded, too
            assert interfaces(joint, 'state_interface') == {
                kind for kind in KINDS if getattr(mine, kind)}
            assert interfaces(joint, 'command_interface') <= interfaces(joint, 'state_interface')
        parameters = {entry.get('name'): (entry.text or '').strip()
                      for entry in system.findall('hardware/param')}
        assert parameters == {'joint_states_topic': '/robot_joint_states',
                              'joint_commands_topic': '/robot_joint_commands',
                              'trigger_joint_command_threshold': '-1'}


@pytest.mark.parametrize('robot', ROBOTS)
def test_controllers_name_these_joints(robot: str) -> None:
    controllers = controllers_of(robot)
    own = controllers[f'{robot}_controller']
    named = own.get('joints') or [*own['left_wheel_names'], *own['right_wheel_names']]
    assert set(named) == set(joints_of(robot))
    rate = controllers['controller_manager']['update_rate']
    configuration = configuration_from_file(FOLDER / f'{robot}.yaml')
    assert configuration.joint_state_rate == rate
    for drive in configuration.drives.values():
        assert drive.command_timeout > 5 / rate     # survives a few late cycles
    if robot != 'base':
        assert own['set_last_command_interface_value_as_state_on_activation'] is False
        assert own['command_interfaces'] == ['position']
        assert {name for name in own['constraints'] if name.endswith('_joint')} == set(named)
    else:
        # the odometry is made of positions, which go on where a counter begins again
        assert own['position_feedback'] is True and own['open_loop'] is False
        assert [joint.continuous for joint in joints_of(robot).values()] == [True, True]


def test_axes_stay_where_they_are() -> None:
    for robot in ('arm', 'servo'):
        for drive in configuration_from_file(FOLDER / f'{robot}.yaml').drives.values():
            assert [parameter.neutral_from for parameter in drive.cyclic_request] == [
                *[''] * (robot == 'arm'), 'actual_position']
