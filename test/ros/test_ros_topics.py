# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a drive publishes: values, samples, bits, ``~/online``, a joint."""

import math
from typing import Any

from bridges import CONVEYOR, HASTY, parameters, StartBridge
from clients import Client, wait_until
import pytest
from rcl_interfaces.msg import ParameterEvent
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Int64
from waiting import clock

from drive_can_bridge.core.events import StationLost

PROFILE = """
protocols: [datamodel_extended]
parameters:
  speed_setpoint: {number: 50, type: int16, scale: 0.1, unit: rpm, storage: ram}
  counts: {number: 51, type: uint16, storage: ram}
  brake: {number: 52, type: bool, storage: ram}
  actual_speed: {number: 209, type: int16, scale: 0.1, unit: rpm, access: ro}
  actual_counts: {number: 210, type: uint16, access: ro}
  braked: {number: 211, type: bool, access: ro}
  hours: {number: 212, type: uint16, unit: h, access: ro}
"""


def test_types_follow_the_one_rule(bridge: StartBridge, client: Client, tmp_path: Any) -> None:
    profile = tmp_path / 'typed.yaml'
    profile.write_text(PROFILE, encoding='utf-8')
    one = bridge(parameters(conveyor={
        **CONVEYOR, 'profile': str(profile), 'cyclic_request': ['speed_setpoint', 'counts'],
        'cyclic_response': ['actual_speed', 'actual_counts', 'braked', 'hours']}))
    topics = [client.topic(f'/conveyor/{name}', kind) for name, kind in (
        ('actual_speed', Float64), ('actual_counts', Int64), ('braked', Bool),
        ('hours', Float64))]
    response = client.topic('/conveyor/response', ParameterEvent)
    drive = one.played['conveyor']
    for name, value in (('actual_speed', -12.3), ('actual_counts', 65535), ('braked', True),
                        ('hours', 7.0)):
        drive.set_value(name, value)
    for topic, value in zip(topics, (-12.3, 65535, True, 7.0)):
        topic.wait(lambda message, value=value: message.data == pytest.approx(value))
        assert type(topic.last.data) is type(value)
    sample = response.wait(lambda message: message.changed_parameters[2].value.bool_value)
    assert [(entry.name, entry.value.type) for entry in sample.changed_parameters] == [
        ('actual_speed', 3), ('actual_counts', 2), ('braked', 1), ('hours', 3)]
    assert sample.changed_parameters[0].value.double_value == pytest.approx(-12.3)
    assert sample.changed_parameters[1].value.integer_value == 65535
    client.find(one.node, 'conveyor')
    types = dict(client.node.get_topic_names_and_types())
    assert types['/conveyor/command/speed_setpoint'] == ['std_msgs/msg/Float64']
    assert types['/conveyor/command/counts'] == ['std_msgs/msg/Int64']


def test_a_lost_drive_leaves_no_sample_behind(bridge: StartBridge) -> None:
    """Else all joints in one message would show it once more in the instant it is found again."""
    drive = bridge(parameters(), simulated=False).node.drives['conveyor']
    with drive.exchange.lock:
        drive.samples.publish((1, 2, 3), clock().now())
        assert drive.samples.last is not None
        drive.handle_event(StationLost('no answer'))
        assert drive.samples.last is None


def test_every_parameter_once_per_exchange(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'missed_limit': 25}))
    one.online()
    values = [client.topic('/conveyor/actual_speed', Float64),
              client.topic('/conveyor/motor_current', Float64),
              client.topic('/conveyor/status_word', Int64)]
    response = client.topic('/conveyor/response', ParameterEvent)
    statistics = one.node.drives['conveyor'].session.statistics
    # all subscribers are known from the moment on when the last of them gets something
    wait_until(lambda: all(len(topic.messages) > 20 for topic in (*values, response)))
    one.played['conveyor'].fault('silent')
    wait_until(lambda: not one.node.drives['conveyor'].session.online)
    starts = [len(topic.messages) for topic in (*values, response)]
    before = statistics.exchanges
    one.played['conveyor'].fault('ok')
    one.online()
    wait_until(lambda: statistics.exchanges > before + 30)
    one.played['conveyor'].fault('silent')
    wait_until(lambda: not one.node.drives['conveyor'].session.online)
    exchanges = statistics.exchanges - before

    def counts() -> list[int]:
        return [len(topic.messages) - start
                for topic, start in zip((*values, response), starts)]
    # the first response of a drive that is only just back has it looked at, and is not published
    wait_until(lambda: len(set(counts())) == 1 and exchanges - 1 <= counts()[0] <= exchanges,
               what=f'{exchanges} messages each')
    stamps = [(message.stamp.sec, message.stamp.nanosec) for message in response.messages]
    assert len(set(stamps)) == len(stamps)


def test_response_is_consistent_and_stamped(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    response = client.topic('/conveyor/response', ParameterEvent)
    speeds = client.topic('/conveyor/actual_speed', Float64)
    one.played['conveyor'].set_value('actual_speed', 100.0)
    one.played['conveyor'].set_value('motor_current', 1.0)
    before = clock().stamp() * 1e-9
    message = response.wait(
        lambda sample: sample.changed_parameters[0].value.double_value == pytest.approx(100.0)
        and sample.changed_parameters[1].value.double_value == pytest.approx(1.0))
    assert message.node == '/conveyor'
    assert [entry.name for entry in message.changed_parameters] == [
        'actual_speed', 'motor_current', 'status_word']
    assert not message.new_parameters and not message.deleted_parameters
    stamps = [sample.stamp.sec + 1e-9 * sample.stamp.nanosec for sample in response.messages]
    assert before - 20.0 < stamps[-1] < clock().stamp() * 1e-9 + 0.1
    assert all(later > earlier for earlier, later in zip(stamps, stamps[1:]))
    wait_until(lambda: pytest.approx(100.0) in speeds.values)


@pytest.mark.parametrize('where', ['bridge', 'everybody', 'later'])
def test_simulated_time(bridge: StartBridge, client: Client, where: str) -> None:
    content = parameters()
    arguments: tuple[str, ...] = ()
    if where == 'bridge':
        content['use_sim_time'] = True
    elif where == 'everybody':
        arguments = ('-p', 'use_sim_time:=true')
    one = bridge(content, arguments=arguments)
    one.online()  # without any clock: the exchange does not need one
    if where == 'later':
        assert client.set('/drive_can_bridge', use_sim_time=True) == [(True, '')]
    response = client.topic('/conveyor/response', ParameterEvent)
    message = Clock()
    message.clock.sec = 1234

    def stamped() -> Any:
        client.publish('/clock', message)
        return next((sample for sample in list(response.messages)
                     if sample.stamp.sec == 1234), None)
    wait_until(stamped, what='a stamp of simulated time')
    statistics = one.node.drives['conveyor'].session.statistics
    before = statistics.exchanges
    wait_until(lambda: statistics.exchanges > before + 20)  # although that clock stands still


def test_bits_are_latched_and_published_on_change(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    drive = one.played['conveyor']
    drive.set_value('status_word', 0b0001)
    ready = client.latched('/conveyor/status_word/ready', Bool)
    fault = client.latched('/conveyor/status_word/fault', Bool)
    wait_until(lambda: ready.values[-1:] == [True] and fault.values[-1:] == [False])
    count = len(ready.values), len(fault.values)
    drive.set_value('status_word', 0b1001)
    wait_until(lambda: fault.values[-1:] == [True])
    drive.set_value('status_word', 0b0001)
    wait_until(lambda: fault.values[-1:] == [False])
    assert fault.values[count[1]:] == [True, False]
    assert len(ready.values) == count[0]
    late = client.latched('/conveyor/status_word/ready', Bool)
    wait_until(lambda: late.values == [True])


def test_bits_are_told_anew_when_the_drive_is_back(bridge: StartBridge, client: Client) -> None:
    """What was known of it was nobody's knowledge any more, although it is the same again."""
    one = bridge(parameters(conveyor={**CONVEYOR, **HASTY}))
    one.online()
    one.played['conveyor'].set_value('status_word', 0b0001)
    ready = client.latched('/conveyor/status_word/ready', Bool)
    wait_until(lambda: ready.values[-1:] == [True])
    count = len(ready.values)
    one.played['conveyor'].fault('silent')
    wait_until(lambda: not one.node.drives['conveyor'].session.online)
    one.played['conveyor'].fault('ok')
    wait_until(lambda: ready.values[count:] == [True])


def test_online_is_false_from_the_start(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, **HASTY}), autostart=False)
    one.played['conveyor'].fault('silent')
    assert client.transition(1)
    online = client.latched('/conveyor/online', Bool)
    wait_until(lambda: online.values == [False])
    assert client.transition(3)
    client.diagnostics('drive_can_bridge: drive conveyor',
                       lambda drive: 'no answer' in drive['message'])
    one.played['conveyor'].fault('ok')
    wait_until(lambda: online.values == [False, True])
    one.played['conveyor'].fault('silent')
    wait_until(lambda: online.values == [False, True, False])
    late = client.latched('/conveyor/online', Bool)
    wait_until(lambda: late.values == [False])


def test_joint_state_in_si_units(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={
        **CONVEYOR, 'cyclic_response': ['actual_position', 'actual_speed', 'actual_torque'],
        'joint': {'name': 'belt', 'position': 'actual_position', 'velocity': 'actual_speed',
                  'effort': 'actual_torque', 'gear_ratio': -10.0}}))
    drive = one.played['conveyor']
    for name, value in (('actual_position', 90.0), ('actual_speed', 600.0),
                        ('actual_torque', 12.5)):
        drive.set_value(name, value)
    joint = client.topic('/conveyor/joint_state', JointState).wait(
        lambda message: message.effort == pytest.approx([12.5]))
    assert list(joint.name) == ['belt']
    assert joint.position == pytest.approx([-math.pi / 20])
    assert joint.velocity == pytest.approx([-600.0 * 2 * math.pi / 60 / 10])
    assert abs(joint.header.stamp.sec - clock().stamp() * 1e-9) < 60


def test_a_truncated_response_publishes_what_arrived(bridge: StartBridge,
                                                     client: Client) -> None:
    one = bridge(parameters(conveyor={
        **CONVEYOR, 'joint': {'name': 'belt', 'velocity': 'actual_speed',
                              'effort': 'motor_current'}}))
    one.online()
    speed = client.topic('/conveyor/actual_speed', Float64)
    word = client.topic('/conveyor/status_word', Int64)
    ready = client.latched('/conveyor/status_word/ready', Bool)
    response = client.topic('/conveyor/response', ParameterEvent)
    joint = client.topic('/conveyor/joint_state', JointState)
    wait_until(lambda: word.messages and joint.messages and ready.messages)
    one.played['conveyor'].set_value('actual_speed', 55.5)
    one.played['conveyor'].fault('length=3')
    response.wait(lambda sample: len(sample.changed_parameters) == 1)
    words, bits = len(word.messages), len(ready.messages)
    speed.wait(lambda message: message.data == pytest.approx(55.5))
    sample = response.wait()
    assert [entry.name for entry in sample.changed_parameters] == ['actual_speed']
    message = joint.wait()
    assert message.velocity == pytest.approx([55.5 * 2 * math.pi / 60])
    assert not message.effort
    assert (len(word.messages), len(ready.messages)) == (words, bits)
    status = client.diagnostics('drive_can_bridge: drive conveyor',
                                lambda drive: int(drive['frames_rejected']) > 0)
    assert status['level'] == 'WARN'
    one.played['conveyor'].fault('ok')
    response.wait(lambda sample: len(sample.changed_parameters) == 3)
    joint.wait(lambda message: message.effort)
