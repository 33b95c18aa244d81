# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The commands of docs/first_steps.md in their order, and the answers that it shows.

What ``ros2`` would do is done by the services and topics that it uses; ``ros2`` itself, where it
is installed, is in ``test_ros_command_line.py``.
"""

from collections.abc import Callable
from pathlib import Path
import re
import shlex
import time
from typing import Any

from bridges import CONVEYOR, parameters, StartBridge
from by_hand import Run
from clients import Client, wait_until
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
from rcl_interfaces.msg import Parameter, ParameterEvent
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
import rclpy
from std_msgs.msg import Float64
import waiting

import drive_can_bridge
from drive_can_bridge.ros.messages import value_of

ROOT = Path(drive_can_bridge.__file__).resolve().parents[1]
PAGE = (ROOT / 'docs' / 'first_steps.md').read_text(encoding='utf-8')
#: message of a topic that is echoed, or whose rate is measured
TYPES = {'/conveyor/actual_speed': Float64, '/conveyor/response': ParameterEvent,
         '/diagnostics': DiagnosticArray}


def commands() -> list[tuple[list[str], list[str]]]:
    """Return what is typed, word by word, and what the page shows of its answer."""
    block, = re.findall(r'```console\n(.*?)```', PAGE, re.DOTALL)
    found: list[tuple[list[str], list[str]]] = []
    for line in block.splitlines():
        if line.startswith('$ '):
            found.append((shlex.split(line[2:], comments=True), []))
        elif line.strip():
            found[-1][1].append(line)
    return found


class Ros2:
    """What the command ``ros2`` does, of what the page types."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._dumped: dict[str, Any] = {}

    def __call__(self, *words: str) -> list[str]:
        """Do it; return what it shows."""
        action: Callable[..., list[str]] = getattr(self, f'_{words[0]}_{words[1]}')
        return action(*words[2:])

    def _node_list(self) -> list[str]:
        return sorted(self._client.nodes())

    def _param_list(self, node: str) -> list[str]:
        answer = self._client.call(f'{node}/list_parameters', ListParameters,
                                   ListParameters.Request())
        return [f'  {name}' for name in sorted(answer.result.names)]

    def _param_get(self, node: str, name: str) -> list[str]:
        value, = self._client.call(f'{node}/get_parameters', GetParameters,
                                   GetParameters.Request(names=[name])).values
        return [f'Double value is: {value_of(value)}']

    def _param_set(self, node: str, name: str, text: str) -> list[str]:
        parameter = Parameter(name=name)
        parameter.value.type, parameter.value.double_value = 3, float(text)
        result, = self._client.call(f'{node}/set_parameters', SetParameters,
                                    SetParameters.Request(parameters=[parameter])).results
        return ['Set parameter successful' if result.successful
                else f'Setting parameter failed: {result.reason}']

    def _param_describe(self, node: str, name: str) -> list[str]:
        found, = self._client.call(f'{node}/describe_parameters', DescribeParameters,
                                   DescribeParameters.Request(names=[name])).descriptors
        return [found.description]

    def _param_dump(self, node: str, *_: str) -> list[str]:
        names = [line.strip() for line in self._param_list(node)]
        values = self._client.call(f'{node}/get_parameters', GetParameters,
                                   GetParameters.Request(names=names)).values
        self._dumped = dict(zip(names, values, strict=True))
        return names

    def _param_load(self, node: str, *_: str) -> list[str]:
        results = self._client.call(f'{node}/set_parameters', SetParameters, SetParameters.Request(
            parameters=[Parameter(name=name, value=value)
                        for name, value in self._dumped.items() if value.type])).results
        assert any(each.successful for each in results)
        return [each.reason for each in results]

    def _topic_hz(self, topic: str) -> list[str]:
        return self._topic_echo('--once', topic)

    def _topic_echo(self, _: str, topic: str) -> list[str]:
        return [str(self._client.topic(topic, TYPES[topic]).wait(lambda _: True))]

    def _lifecycle_set(self, node: str, name: str) -> list[str]:
        assert name == 'deactivate'
        answer = self._client.call(f'{node}/change_state', ChangeState, ChangeState.Request(
            transition=Transition(id=Transition.TRANSITION_DEACTIVATE)))
        return ['Transitioning successful'] if answer.success else ['Transitioning failed']


#: what the page leaves open
OPEN = re.compile(r'…|average rate|^- level|^  name: ')
MESSAGE = re.compile(r"  message: '(.*)'")


def test_each_command_shows_what_the_page_says(bridge: StartBridge, client: Client,
                                               run: Run) -> None:
    text = (ROOT / 'config' / 'demo.yaml').read_text(encoding='utf-8')
    bridge(text.replace('channel: demo', 'channel: ros_test_first_steps')).online()
    wait_until(lambda: {'/conveyor', '/lift', '/turntable'} <= set(client.nodes()))
    ros2 = Ros2(client)
    assert len(commands()) > 12
    for words, shown in commands():
        if words[0] == 'ros2':
            lines = ros2(*(word for word in words[1:] if word != '>'))
        else:
            assert words[0] == 'drive_can', words
            code, lines, errors = run(
                *words[1:], *(['--yes'] if words[1] == 'jog' else []))
            assert (code, errors) == (0, ''), (words, lines, errors)
        for line in shown:
            if message := MESSAGE.fullmatch(line):
                assert message[1] in ''.join(lines), (words, line, lines)
                continue
            assert OPEN.search(line) or line in lines, (words, line, lines)


def test_the_node_of_ones_own_moves_the_drive(bridge: StartBridge, client: Client,
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    code, = re.findall(r'```python\n(.*?)```', PAGE, re.DOTALL)
    one = bridge(parameters(conveyor={**CONVEYOR, 'command_timeout': 2.0})).online()
    setpoint = one.node.drives['conveyor'].session.setpoints.items[0]
    clock = waiting.clock()
    seen: set[int] = set()

    def sleep(seconds: float) -> None:
        clock.wait(clock.now() + seconds)
        seen.add(setpoint.raw)
    monkeypatch.setattr(time, 'sleep', sleep)
    names: dict[str, Any] = {}
    try:
        exec(compile(code, 'first_steps.md', 'exec'), names)
    finally:    # which a program that ends need not do
        if 'node' in names:
            names['node'].destroy_node()
        rclpy.try_shutdown()
    assert seen == {0, 3000} and setpoint.raw == 0
