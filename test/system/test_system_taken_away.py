# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Bridge and commands, as processes, with an rclpy that has less than this package uses.

What is gone is hidden by ``taken_away.py`` before they start. What each member is for, and what
there is instead of it: ``docs/rclpy.md``; in one process: ``ros/test_ros_fence.py``.
"""

from collections.abc import Callable
from pathlib import Path
import re
import sys

from parameter_files import bridge_file
from processes import Client, Process, Processes
import pytest
from test_system_parameters import ALL

from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.sentences import (
    commands_by_executor, rclpy_lacks, requests_by_executor, requests_hold_up)

pytestmark = pytest.mark.real

Said = Callable[[str], Sentence]
#: what is gone -> what the bridge says at its start, and why; whether commands say something, too
FALLBACKS: dict[str, tuple[tuple[tuple[Said, str], ...], bool]] = {
    'rcl': (((requests_hold_up, 'undefined symbol: rcl_take_request_with_info'),), False),
    'WaitSet': (((requests_by_executor, 'rclpy has no WaitSet any more'),), False),
    'Node,Client,Subscription,EventHandle': (
        ((commands_by_executor, 'rclpy has no Subscription.take_message any more'),), True),
    'extension': (((commands_by_executor, 'rclpy has no Subscription.take_message any more'),
                   (commands_by_executor, 'rclpy has no Publisher.publish_raw any more'),
                   (requests_by_executor, 'rclpy has no GuardCondition any more')), True)}
#: what there is no other way to, of a class and of its objects -> its name in what a bridge says
NEEDED = {
    'rclpy.parameter_service:ParameterService._get_node': 'ParameterService._get_node',
    'rclpy.lifecycle:LifecycleNode()._state_machine': 'LifecycleNode._state_machine'}


def without(processes: Processes, what: str, module: str, *arguments: str) -> Process:
    """Start a program that finds less in rclpy."""
    name = arguments[0] if module.startswith('cli') else 'bridge'
    return processes.start(
        [sys.executable, str(Path(__file__).with_name('taken_away.py')), what,
         f'drive_can_bridge.{module}', *arguments], name)


@pytest.mark.parametrize('what', FALLBACKS)
def test_bridge_and_commands_go_on_with_a_word(processes: Processes, client: Client,
                                               namespace: str, tmp_path: Path,
                                               what: str) -> None:
    file = bridge_file(tmp_path, drives={'lift': ALL['lift']})
    simulator = processes.simulator(file)
    bridge = without(processes, what, 'ros.start', '--ros-args', '--params-file', str(file),
                     '-r', f'__ns:=/{namespace}')
    client.online(f'/{namespace}/lift')
    warnings, slowly = FALLBACKS[what]
    told = [line for line in bridge.errors if 'rclpy' in line]
    for (said, reason), line in zip(warnings, told, strict=True):
        before, _, behind = said('...').partition('...')
        assert '[WARN]' in line and before in line and line.endswith(f'{reason}{behind}'), told

    def does(*words: str) -> list[str]:
        command = without(processes, what, 'cli.start', *words, '--namespace', namespace)
        assert command.wait() == 0, command.dump()
        said = [line for line in command.errors
                if line.startswith('drive_can: bridges are asked more slowly')]
        assert bool(said) == slowly and command.errors == said, command.dump()
        return command.lines
    assert does('write', 'lift', 'ramp_time=1.5')[1].endswith('  written')
    assert re.match(r'ramp_time +1\.5 ', does('read', 'lift', 'ramp_time')[1])
    assert does('enable', 'lift') == [f'{namespace}/lift: enabled']
    since = len(simulator.frames())
    assert does('stop', 'lift') == [f'{namespace}/lift: ready']
    assert simulator.frames(' R$', since)
    assert bridge.end() == 0


def test_a_bridge_names_what_it_cannot_do_without(processes: Processes, tmp_path: Path) -> None:
    file = bridge_file(tmp_path, drives={'lift': ALL['lift']})
    started = {name: without(processes, what, 'ros.start', '--ros-args', '--params-file',
                             str(file)) for what, name in NEEDED.items()}
    for name, bridge in started.items():
        assert bridge.wait() == 1, bridge.dump()
        told, = (line for line in bridge.errors if 'rclpy' in line)
        assert told.endswith(rclpy_lacks(name)), told
