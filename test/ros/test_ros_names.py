# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Names: namespaces, remaps, two bridges, qualities."""

from pathlib import Path
import signal
import subprocess
import sys

from bridges import Bridge, CONVEYOR, LIFT, parameters, StartBridge
from clients import Client, ERROR, patience, wait_until
import pytest
from rcl_interfaces.msg import LoggerLevel, ParameterEvent
from rcl_interfaces.srv import SetLoggerLevels
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from std_msgs.msg import Bool, Float64
from std_srvs.srv import SetBool
import yaml


def own_nodes(client: Client) -> set[str]:
    """Return the nodes of bridges, but those whose names begin with an underscore."""
    return {name for name in client.nodes()
            if name != client.full_name and not name.rsplit('/', 1)[1].startswith('_')}


@pytest.mark.parametrize('argument', ['__ns:=/cell1', 'drive_can_bridge:__ns:=/cell1'])
def test_namespace(bridge: StartBridge, client: Client, argument: str) -> None:
    one = bridge(arguments=('-r', argument)).online()
    wait_until(lambda: own_nodes(client) == {'/cell1/drive_can_bridge', '/cell1/conveyor'})
    response = client.topic('/cell1/conveyor/response', ParameterEvent).wait()
    assert response.node == '/cell1/conveyor'
    client.topic('/cell1/conveyor/actual_speed', Float64).wait()
    online = client.latched('/cell1/conveyor/online', Bool)
    wait_until(lambda: online.values[-1:] == [True])
    events = client.parameter_events('/cell1/conveyor')
    assert client.set('/cell1/conveyor', ramp_time=3.0) == [(True, '')]
    wait_until(lambda: events)
    client.diagnostics('cell1/drive_can_bridge: bus main')
    status = client.diagnostics('cell1/drive_can_bridge: drive conveyor',
                                lambda drive: drive['state'] == 'not armed')
    assert '/cell1/conveyor/command/speed_setpoint' in status['message']
    with one.record() as recorder:
        client.publish('/cell1/conveyor/command/speed_setpoint', Float64(data=0.0))
        client.publish('/cell1/conveyor/command/speed_setpoint', Float64(data=1.0))
        wait_until(lambda: recorder.words()[:1] == (10,))


def test_the_bridge_can_be_called_something_else(bridge: StartBridge, client: Client) -> None:
    bridge(arguments=('-r', '__node:=x', '-r', '__ns:=/cell2'), key='/**/x').online()
    wait_until(lambda: own_nodes(client) == {'/cell2/x', '/cell2/conveyor'})
    client.diagnostics('cell2/x: drive conveyor')
    assert client.get('/cell2/x', 'drives.conveyor.station') == [1]
    assert client.get('/cell2/conveyor', 'ramp_time') != [None]


def test_the_bridge_cannot_be_called_like_a_drive(bridge: StartBridge,
                                                  client: Client) -> None:
    bridge(arguments=('-r', '__node:=conveyor'), key='/**/conveyor', autostart=False)
    assert not client.transition(1, node='/conveyor')
    client.wait_logged('drives.conveyor: the name of the bridge itself')


def test_topics_and_services_of_a_drive_are_remapped(bridge: StartBridge,
                                                     client: Client) -> None:
    one = bridge(parameters(conveyor=CONVEYOR, lift=LIFT), arguments=(
        '-r', 'conveyor:~/actual_speed:=/belt/speed',
        '-r', '/conveyor/command/speed_setpoint:=/belt/setpoint',
        '-r', 'lift:~/enable:=/lift_on')).online()
    client.topic('/belt/speed', Float64).wait()
    client.publisher('/belt/setpoint', Float64, host='/conveyor')
    with one.record() as recorder:
        client.publish('/belt/setpoint', Float64(data=0.0))
        client.publish('/belt/setpoint', Float64(data=2.0))
        wait_until(lambda: recorder.words()[:1] == (20,))
    assert client.call('/lift_on', SetBool, SetBool.Request(data=True),
                       host='/lift').success
    client.find(one.node, 'conveyor', 'lift')
    topics = dict(client.node.get_topic_names_and_types())
    assert '/lift/actual_speed' in topics
    assert not {'/conveyor/actual_speed', '/conveyor/command/speed_setpoint'} & set(topics)


def test_two_bridges_in_one_graph(bridge: StartBridge, client: Client) -> None:
    ones: list[Bridge] = [bridge(arguments=('-r', f'__ns:=/cell{number}'))
                          for number in (1, 2)]
    for number, one in enumerate(ones, 1):
        one.online()
        one.played['conveyor'].set_value('ramp_time', float(number))
    for number in (1, 2):
        assert client.get(f'/cell{number}/conveyor', 'ramp_time') == [float(number)]
        client.diagnostics(f'cell{number}/drive_can_bridge: drive conveyor')
    assert client.transition(4, node='/cell1/drive_can_bridge')
    assert client.state('/cell2/drive_can_bridge') == 'active'
    online = client.latched('/cell2/conveyor/online', Bool)
    wait_until(lambda: online.values[-1:] == [True])


EVERYTHING = {
    'publisher': ['actual_speed', 'motor_current', 'status_word', 'status_word/ready', 'response',
                  'joint_state', 'online'],
    'subscription': ['command/speed_setpoint', 'command/torque_limit', 'joint_command']}


@pytest.mark.parametrize('key', ['/**/drive_can_bridge', '/**'])
def test_every_quality_can_be_overridden(bridge: StartBridge, client: Client, key: str) -> None:
    joint = {'name': 'belt', 'velocity': 'actual_speed', 'velocity_command': 'speed_setpoint'}
    changes = {'publisher': {'reliability': 'best_effort', 'durability': 'volatile', 'depth': 2},
               'subscription': {'reliability': 'best_effort'}}
    overrides = {f'/conveyor/{topic}': {kind: changes[kind]}
                 for kind, topics in EVERYTHING.items() for topic in topics}
    overrides['/diagnostics'] = {'publisher': changes['publisher']}
    one = bridge({**parameters(conveyor={**CONVEYOR, 'joint': joint}),
                  'qos_overrides': overrides}, key=key).online()
    node = client.node
    client.find(one.node, 'conveyor', 'drive_can_bridge')
    for topic in (*(f'/conveyor/{name}' for name in EVERYTHING['publisher']), '/diagnostics'):
        [info] = node.get_publishers_info_by_topic(topic)
        assert info.qos_profile.reliability is ReliabilityPolicy.BEST_EFFORT, topic
        assert info.qos_profile.durability is DurabilityPolicy.VOLATILE, topic
    for name in EVERYTHING['subscription']:
        [info] = node.get_subscriptions_info_by_topic(f'/conveyor/{name}')
        assert info.qos_profile.reliability is ReliabilityPolicy.BEST_EFFORT, name


def test_a_quality_that_does_not_exist(bridge: StartBridge, client: Client) -> None:
    name = 'qos_overrides./conveyor/actual_speed.publisher.reliability'
    bridge(autostart=False, arguments=('-p', f'{name}:=perhaps'))
    assert not client.transition(1)
    client.wait_logged(f"{name}: 'perhaps'", ERROR)
    assert client.state() == 'unconfigured'
    assert '/conveyor' not in client.nodes()




def test_log_level_by_service(bridge: StartBridge, client: Client) -> None:
    # levels belong to the process: a namespace, and thereby a logger, of its own
    name = 'levelled.drive_can_bridge'
    bridge(autostart=False, arguments=('-r', '__ns:=/levelled'))
    client.listen()
    node = '/levelled/drive_can_bridge'

    def level(number: int) -> None:
        answer = client.call(f'{node}/set_logger_levels', SetLoggerLevels, SetLoggerLevels.Request(
            levels=[LoggerLevel(name=name, level=number)]))
        assert [result.successful for result in answer.results] == [True]
    level(LoggerLevel.LOG_LEVEL_WARN)
    assert client.transition(1, node=node)
    assert not client.transition(1, node=node)
    client.wait_logged('transition number 1 is not possible')
    assert 'bus main: open' not in client.logged(0, name)
    level(LoggerLevel.LOG_LEVEL_INFO)
    assert client.transition(3, node=node)
    client.wait_logged('active: 1 drive on 1 bus')


@pytest.mark.real
def test_log_level_by_argument(client: Client, tmp_path: Path) -> None:
    """In a process of its own: the first context of a process decides."""
    file = tmp_path / 'bridge.yaml'
    file.write_text(yaml.dump({'/**/drive_can_bridge': {'ros__parameters': {
        **parameters(buses={'main': {'interface': 'virtual', 'channel': 'warn'}},
                     conveyor=CONVEYOR)}}}), encoding='utf-8')
    process = subprocess.Popen(
        [sys.executable, '-m', 'drive_can_bridge.ros.main', '--ros-args', '--params-file',
         str(file), '-r', '__ns:=/warn', '--log-level', 'warn'],
        stderr=subprocess.PIPE, text=True)
    try:
        node = '/warn/drive_can_bridge'
        wait_until(lambda: node in client.nodes(), 60.0)
        wait_until(lambda: client.state(node) == 'active', 60.0)
    finally:
        process.send_signal(signal.SIGINT)
        lines = process.communicate(timeout=patience(60.0))[1]
    assert process.returncode == 0
    assert 'active: 1 drive on 1 bus' not in lines
    wait_until(lambda: node not in client.nodes())
