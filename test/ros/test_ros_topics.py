# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a drive publishes: values, samples, bits, ``~/online``, a joint."""

import math
from typing import Any

from bridges import CONVEYOR, parameters, StartBridge
from clients import Client, wait_until
import pytest
from rcl_interfaces.msg import ParameterEvent
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Int64
from waiting import clock

from drive_can_bridge.core.events import StationLost



def test_a_lost_drive_leaves_no_sample_behind(bridge: StartBridge) -> None:
    """Else all joints in one message would show it once more in the instant it is found again."""
    drive = bridge(parameters(), simulated=False).node.drives['conveyor']
    with drive.exchange.lock:
        drive.samples.publish((1, 2, 3), clock().now())
        assert drive.samples.last is not None
        drive.handle_event(StationLost('no answer'))
        assert drive.samples.last is None


def test_every_parameter_once_per_exchange(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'missed_limit': 25})).online()
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
                              'effort': 'motor_current'}})).online()
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
