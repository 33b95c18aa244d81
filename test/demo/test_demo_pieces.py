# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the demo is made of: numbers as they are written, hints, log lines, environment, frames."""

import os
from pathlib import Path
import re
import shlex
import subprocess
import sys

import pytest
from waiting import wait_for

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.configuration import BridgeConfiguration, BusConfiguration
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Access, Parameter, ParameterType
from drive_can_bridge.process import environment
from drive_can_bridge.resources import config_file
from drive_can_bridge.ros.demo.frame_log import FrameLog
from drive_can_bridge.ros.demo.hints import Hint, hints
from drive_can_bridge.ros.demo.log_lines import LogCapture, parse
from drive_can_bridge.ros.demo.snapshot import as_assignment, show
from drive_can_bridge.transport.port import open_port

SPEED = Parameter('speed', ParameterType.INT16, scale=0.1, unit='rpm', scaled=True)
WORD = Parameter('word', ParameterType.UINT16, bits=(('ready', 0),))
COUNT = Parameter('count', ParameterType.INT16)
FLAG = Parameter('flag', ParameterType.BOOL)


# -- numbers --------------------------------------------------------------------------------------

@pytest.mark.parametrize(('parameter', 'value', 'text', 'width', 'assignment'), [
    (SPEED, 12.300000001, '12.3', 7, 'speed=12.3 rpm'),
    (SPEED, -0.0, '0.0', 7, 'speed=0.0 rpm'),
    (Parameter('x', ParameterType.UINT16, scale=0.125, scaled=True), 1.5, '1.500', 8, 'x=1.500'),
    (Parameter('x', ParameterType.INT16, scale=100 / 16384, scaled=True), 50.0, '50.00000', 10,
     'x=50.00000'),
    (Parameter('x', ParameterType.UINT16, unit='h', scaled=True), 7.0, '7', 5, 'x=7 h'),
    (WORD, 3, '0x0003', 6, 'word=3'),
    (COUNT, -7, '-7', 6, 'count=-7'),
    (FLAG, True, 'true', 5, 'flag=true'),
])
def test_values_are_written_with_the_decimals_they_have(
        parameter: Parameter, value: float, text: str, width: int, assignment: str) -> None:
    shown = show(parameter, value)
    assert (shown.text, shown.width, shown.unit) == (text, width, parameter.unit)
    assert as_assignment(parameter, value) == assignment


def test_no_value_is_no_text() -> None:
    assert show(SPEED, None).text == ''


# -- hints ----------------------------------------------------------------------------------------

def demo_hints(commanded: bool = False, prefix: str = '') -> list[Hint]:
    return hints(configuration_from_file(config_file('demo.yaml')),
                 bridge=f'{prefix}/drive_can_bridge', namespace=prefix or '/',
                 environment='export ROS_DOMAIN_ID=7', commanded=commanded)


def test_hints_are_commands_for_the_drives_of_the_configuration() -> None:
    commands = [hint.command for hint in demo_hints()]
    assert commands[0] == 'export ROS_DOMAIN_ID=7'
    assert ("ros2 topic pub -r 10 /conveyor/command/speed_setpoint std_msgs/msg/Float64 "
            "'{data: 300.0}'") in commands
    assert "ros2 service call /lift/enable std_srvs/srv/SetBool '{data: true}'" in commands
    assert 'ros2 param set /conveyor ramp_time 2.0' in commands
    assert 'ros2 param list /conveyor' in commands
    assert 'ros2 topic echo /conveyor/response' in commands
    assert all(len(shlex.split(command)) > 1 for command in commands)


def test_nobody_is_told_to_command_what_the_demo_commands() -> None:
    assert not any('/command/' in hint.command for hint in demo_hints(commanded=True))


def test_hints_know_the_namespace() -> None:
    commands = [hint.command for hint in demo_hints(prefix='/cell')]
    assert 'ros2 param list /cell/conveyor' in commands
    assert 'ros2 param set /cell/drive_can_bridge drives.conveyor.rearm immediate' in commands


def test_without_drives_there_is_little_to_say() -> None:
    assert hints(BridgeConfiguration(), bridge='/b', namespace='/', environment='',
                 commanded=False) == []


# -- log ------------------------------------------------------------------------------------------

def test_lines_of_ros_are_taken_apart() -> None:
    line = parse('\x1b[33m[WARN] [1763700000.250000000] [cell.drive_can_bridge]: lift: x\x1b[0m')
    assert (line.level, line.at, line.logger, line.text) == (
        'WARN', 1763700000.25, 'cell.drive_can_bridge', 'lift: x')


def test_any_other_line_is_text() -> None:
    line = parse('2026-01-01 [RTPS_ERROR]\x07 something')
    assert (line.level, line.logger, line.text) == ('', '', '2026-01-01 [RTPS_ERROR] something')


def test_what_goes_to_descriptor_2_is_caught_and_given_back() -> None:
    capture = LogCapture()
    try:
        os.write(2, b'[INFO] [1.000000000] [a]: one\nno end of line')
        wait_for(lambda: len(capture.lines) == 1, 'line')
        assert capture.lines[0].text == 'one'
    finally:
        capture.close()
    assert capture.lines[-1].text == 'no end of line'
    capture.close()


def test_a_redirected_standard_error_gets_everything_all_the_same() -> None:
    program = ('import os\n'
               'from drive_can_bridge.ros.demo.log_lines import LogCapture\n'
               'capture = LogCapture()\n'
               'os.write(2, b"caught\\n")\n'
               'capture.close()\n'
               'os.write(2, b"after\\n")\n'
               'capture.repeat()\n')
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                          timeout=30, check=True)
    assert done.stderr == 'caught\nafter\n'


# -- environment ----------------------------------------------------------------------------------

@pytest.fixture
def clean(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    # set first, so that what the tests change is undone
    for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOCALHOST_ONLY',
                 'ROS_STATIC_PEERS', 'RMW_IMPLEMENTATION'):
        monkeypatch.setenv(name, '')
    return monkeypatch


def test_traffic_stays_here_by_default(clean: pytest.MonkeyPatch) -> None:
    environment.prepare(None)
    assert environment.in_words() == 'ROS domain 0, on this machine only'
    assert environment.export_command() == 'export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST'


def test_what_the_environment_says_is_obeyed(clean: pytest.MonkeyPatch) -> None:
    clean.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    clean.setenv('ROS_DOMAIN_ID', '5')
    environment.prepare(None)
    assert environment.in_words() == 'ROS domain 5, on the network'
    environment.prepare(7)
    assert environment.export_command() == (
        'export ROS_DOMAIN_ID=7 ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET')


def test_the_older_variable_counts_too(clean: pytest.MonkeyPatch) -> None:
    clean.setenv('ROS_LOCALHOST_ONLY', '1')
    environment.prepare(None)
    assert 'ROS_AUTOMATIC_DISCOVERY_RANGE' not in environment.export_command()
    assert environment.in_words() == 'ROS domain 0, on this machine only'


# -- frames ---------------------------------------------------------------------------------------

def test_the_frame_log_has_every_frame_up_to_its_end(tmp_path: Path) -> None:
    bus = BusConfiguration('main', 'virtual', 'frame-log-test')
    log = FrameLog(tmp_path / 'frames', [bus])
    port = open_port(bus)
    sent = [Frame(0x3FFFF0, bytes([number]), True) for number in range(250)]
    for frame in sent:
        port.send(frame, 1.0)
    port.close()
    log.close()
    lines = (tmp_path / 'frames').read_text(encoding='ascii').splitlines()
    assert [line.split(' ', 1)[1] for line in lines] == [f'main {frame}' for frame in sent]
    assert all(re.match(r'\(\d+\.\d{6}\) ', line) for line in lines)
    assert log.count == len(sent)
    assert log.failure == ''


# -- access ---------------------------------------------------------------------------------------

def test_what_is_only_read_is_no_example_for_writing() -> None:
    configuration = configuration_from_file(config_file('demo.yaml'))
    for drive in configuration.drives.values():
        one = BridgeConfiguration(drives={drive.name: drive})
        for hint in hints(one, bridge='/b', namespace='/', environment='', commanded=False):
            words = hint.command.split()
            if words[:3] == ['ros2', 'param', 'set'] and words[3] != '/b':
                parameter = drive.profile.parameters[words[4]]
                assert parameter.access is Access.READ_WRITE
                assert parameter not in drive.cyclic_request
                parameter.raw_from_value(float(words[5]))
