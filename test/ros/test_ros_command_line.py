# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The commands of docs/first_steps.md, with the real ``ros2`` wherever it is installed."""

from collections.abc import Callable
import importlib.util
from pathlib import Path
import subprocess
import sys

from bridges import Bridge, StartBridge
from clients import Client, patience, wait_until
import pytest
from transcripts import replayed, stories
import yaml

from drive_can_bridge.ros import main as executable

CONFIG = Path(__file__).parents[2] / 'config'
MAIN = 'import sys; from ros2cli.cli import main; sys.exit(main())'
#: no daemon: it would outlive the test
ALONE = ('--no-daemon', '--spin-time', '5')
STORIES = stories(__file__, 'command_line.yaml')

#: runs a command; returns what it says (what its exit code says differs between versions)
Ros2 = Callable[..., str]


@pytest.fixture(name='demo')
def _demo(bridge: StartBridge, client: Client) -> Bridge:
    text = (CONFIG / 'demo.yaml').read_text(encoding='utf-8')
    one = bridge(text.replace('channel: demo', 'channel: ros_test_command_line')).online()
    wait_until(lambda: {'/conveyor', '/lift', '/turntable'} <= set(client.nodes()))
    return one


@pytest.fixture(name='ros2')
def _ros2() -> Ros2:
    for module in ('ros2cli', 'ros2param', 'ros2node', 'ros2service', 'ros2topic',
                   'ros2lifecycle'):
        if importlib.util.find_spec(module) is None:
            pytest.skip(f'{module} is not installed')

    def run(*words: str) -> str:
        for _ in range(5):  # on a busy machine the nodes are not found at once
            done = subprocess.run([sys.executable, '-c', MAIN, *words], capture_output=True,
                                  text=True, timeout=patience(60.0), check=False)
            told = done.stdout + done.stderr
            assert 'Traceback' not in told, told
            if 'Node not found' not in told:
                break
        return told
    return run


@pytest.mark.usefixtures('threads')
@pytest.mark.parametrize(('missing', 'words'), [
    ('rclpy', 'drive_can_bridge: needs ROS 2 (Python module rclpy): source your installation'),
    ('can', 'drive_can_bridge: the Python module can is not installed\n')])
def test_without_what_it_needs(missing: str, words: str, monkeypatch: pytest.MonkeyPatch,
                               capsys: pytest.CaptureFixture[str]) -> None:
    def run(*_: object) -> int:
        raise ModuleNotFoundError(f'No module named {missing!r}', name=missing)
    monkeypatch.setattr(executable, 'run', run)
    assert executable.main(['drive_can_bridge']) == 1
    assert capsys.readouterr().err.startswith(words)


@pytest.mark.usefixtures('threads')
def test_a_defect_of_the_executable_itself(monkeypatch: pytest.MonkeyPatch,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    def run(*_: object) -> int:
        raise KeyError('a defect')
    monkeypatch.setattr(executable, 'run', run)
    assert executable.main(['drive_can_bridge']) == 1
    assert capsys.readouterr().err == (
        "drive_can_bridge: internal error, please report it: KeyError: 'a defect'\n")


def replay(story: str, ros2: Ros2) -> None:
    def step(step: str) -> list[str]:
        return ros2(*step.split(), *ALONE).splitlines()
    assert replayed(STORIES[story], step) == STORIES[story]


def test_nodes(ros2: Ros2, demo: Bridge) -> None:
    assert {'/conveyor', '/drive_can_bridge', '/lift', '/turntable'} <= set(
        ros2('node', 'list', *ALONE).split())
    told = ros2('node', 'info', '/conveyor', *ALONE)
    for line in ('/conveyor/response: rcl_interfaces/msg/ParameterEvent',
                 '/conveyor/command/speed_setpoint: std_msgs/msg/Float64',
                 '/conveyor/set_parameters: rcl_interfaces/srv/SetParameters'):
        assert line in told


def test_parameters(ros2: Ros2, demo: Bridge, tmp_path: Path) -> None:
    drive = demo.played['conveyor']
    listed = ros2('param', 'list', '/conveyor', *ALONE).split()
    assert len(listed) == 25 and 'ramp_time' in listed
    drive.set_value('ramp_time', 1.0)
    replay('parameters', ros2)
    assert drive.value('ramp_time') == pytest.approx(1.5)
    told = ros2('param', 'describe', '/conveyor', 'ramp_time', *ALONE)
    for line in ('Type: double', 'Ramp from standstill to maximum speed (P30, unit s, storage '
                 'eeprom)', 'Min value: 0.01', 'Max value: 60.0', 'Step: 0.01'):
        assert line in told
    dumped = ros2('param', 'dump', '/conveyor', *ALONE)
    values = yaml.safe_load(dumped)['/conveyor']['ros__parameters']
    assert sorted(values) == sorted(listed)
    assert values['ramp_time'] == pytest.approx(1.5) and values['user_command'] is None
    file = tmp_path / 'conveyor.yaml'
    file.write_text(dumped.replace('ramp_time: 1.5', 'ramp_time: 2.5'), encoding='utf-8')
    told = ros2('param', 'load', '/conveyor', str(file), *ALONE)
    assert 'Set parameter ramp_time successful' in told
    assert 'Set parameter actual_speed failed: read-only' in told
    assert drive.value('ramp_time') == pytest.approx(2.5)


def test_topics_and_services(ros2: Ros2, demo: Bridge) -> None:
    assert '/lift/status_word/enabled [std_msgs/msg/Bool]' in ros2(
        'topic', 'list', '-t', *ALONE)
    replay('a topic', ros2)
    sample = next(yaml.safe_load_all(
        ros2('topic', 'echo', '--once', '/conveyor/response', *ALONE)))
    assert sample['node'] == '/conveyor'
    assert [entry['name'] for entry in sample['changed_parameters']] == [
        'actual_speed', 'motor_current', 'status_word', 'dc_link_voltage']
    assert "success=True, message='enabled'" in ros2(
        'service', 'call', '/lift/enable', 'std_srvs/srv/SetBool', '{data: true}')
    ros2('topic', 'pub', '--once', '-w', '1', '/turntable/command/torque_limit',
         'std_msgs/msg/Float64', '{data: 0.0}')
    wait_until(lambda: demo.node.drives['turntable'].session.setpoints.items[1].armed)
    replay('inactive', ros2)
