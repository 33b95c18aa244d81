# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Clocks say what they like while drives move: nothing happens."""

from collections.abc import Callable
import time
from typing import Any

from bridges import Bridge, CONVEYOR, parameters, StartBridge
from builtin_interfaces.msg import Time
from clients import Client, Topic, wait_until
from clocks import REAL
from diagnostic_msgs.msg import DiagnosticArray
from extent import some
import pytest
from rcl_interfaces.msg import ParameterEvent
from rclpy.clock import Clock
from repeating import again_and_again
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from waiting import clock

from drive_can_bridge.clock import SteadyClock
from drive_can_bridge.ros.stamps import Stamps


@pytest.mark.parametrize('hours', [-48.0, 48.0], ids=['back', 'forward'])
def test_clock_that_is_set(bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch,
                           hours: float) -> None:
    offset = [0.0]
    set_clock(monkeypatch, lambda true: true + int(offset[0] * 1e9))
    one = bridge(parameters(conveyor=CONVEYOR)).online()
    session = one.node.drives['conveyor'].session
    client.publish('/conveyor/command/torque_limit', Float64(data=0.0))
    client.publish('/conveyor/command/speed_setpoint', Float64(data=0.0))
    client.publish('/conveyor/command/speed_setpoint', Float64(data=150.0))
    wait_until(lambda: session.setpoints.items[0].raw == 1500 and not session.setpoints.waiting)
    for step in (hours, -hours, hours):
        missed, wanted = session.statistics.missed, session.statistics.exchanges + 20
        offset[0] += 3600.0 * step
        wait_until(lambda wanted=wanted: session.statistics.exchanges >= wanted)
        assert session.statistics.missed <= missed + 5
        assert session.online
        # neither armed again nor timed out
        assert session.setpoints.items[0].raw == 1500
        assert not session.setpoints.waiting
    assert client.get('/conveyor', 'ramp_time') != [None]
    assert not one.errors


def set_clock(monkeypatch: pytest.MonkeyPatch, shown: Callable[[int], int]) -> None:
    """Have the time of the day shown otherwise from now on: ns since 1970."""
    true = clock().stamp
    monkeypatch.setattr(clock(), 'stamp', lambda: shown(true()))


def silent(_: str) -> None:
    raise AssertionError('nothing is to be told')


def test_a_stamp_is_that_of_the_moment_not_of_the_look() -> None:
    before = time.time()
    seconds, nanoseconds = Stamps(Clock, silent, REAL).at(REAL.now() - 1000.0)
    assert before - 1000.001 <= seconds + 1e-9 * nanoseconds <= time.time() - 999.999


def test_a_sample_has_one_stamp_when_the_clock_is_set_behind_it(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """In all messages with that sample, and as long as it is the last one."""
    content = parameters(conveyor={**CONVEYOR, 'missed_limit': 1000, 'joint': {
        'name': 'belt', 'velocity': 'actual_speed'}})
    one = bridge(content).online()
    topics = [client.topic(name, kind) for name, kind in (
        ('/conveyor/response', ParameterEvent), ('/conveyor/joint_state', JointState),
        ('/drive_can_bridge/joint_states', JointState))]
    for topic in topics:
        topic.wait()
    one.played['conveyor'].fault('silent')
    statistics = one.node.drives['conveyor'].session.statistics
    wait_until(lambda: statistics.missed > 5)
    before = clock().stamp()
    set_clock(monkeypatch, lambda true: true + 3_600_000_000_000)
    topics[2].wait()
    response, joint, joints = (topic.last for topic in topics)
    assert response.stamp == joint.header.stamp == joints.header.stamp
    assert response.stamp.sec <= before * 1e-9


#: s since 1970 that fit into no stamp: int32, and nothing in ROS takes a negative one
@pytest.mark.parametrize('seconds', [2 ** 31 + 60, 2 ** 33, -60], ids=['2038', '2242', '1969'])
def test_a_time_that_no_stamp_holds_is_0_and_told_once(monkeypatch: pytest.MonkeyPatch,
                                                       seconds: int) -> None:
    told: list[str] = []
    machine = SteadyClock()
    stamps = Stamps(Clock, told.append, machine)
    monkeypatch.setattr(machine, 'stamp', lambda: seconds * 10 ** 9)
    moment = machine.now()
    assert [stamps.at(moment + step) for step in (0.0, -0.1, 1.0)] == [(0, 0)] * 3
    assert stamps.now() == Time()
    assert len(told) == 1 and 'system clock' in told[0]
    monkeypatch.undo()
    assert stamps.now().sec > 0


def test_drives_go_on_when_the_system_clock_says_what_no_stamp_holds(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(with_joint()).online()
    client.listen()
    topics = stamped_topics(client)
    set_clock(monkeypatch, lambda _: -5 * 10 ** 9)
    goes_on_without_stamps(one, client, topics)


@pytest.mark.parametrize(('seconds', 'nanoseconds'), some([
    (2 ** 31 - 1, 2 ** 32 - 1), (-1, 0), (-2 ** 31, 0)], 3))
def test_drives_go_on_whatever_simulated_time_is_published(
        bridge: StartBridge, client: Client, seconds: int, nanoseconds: int) -> None:
    one = bridge({**with_joint(), 'use_sim_time': True}).online()
    client.listen()
    topics = stamped_topics(client)
    said = [Time(sec=1000)]
    with again_and_again(lambda: client.publish('/clock', ClockMessage(clock=said[0])), 0.02):
        have_stamp(topics, Time(sec=1000))
        said[0] = Time(sec=seconds, nanosec=nanoseconds)
        goes_on_without_stamps(one, client, topics)
        said[0] = Time(sec=2000)
        have_stamp(topics, Time(sec=2000))


def with_joint() -> dict[str, Any]:
    return parameters(conveyor={**CONVEYOR, 'joint': {'name': 'belt', 'velocity': 'actual_speed'}})


def stamped_topics(client: Client) -> list[Topic]:
    return [client.topic(name, kind) for name, kind in (
        ('/conveyor/response', ParameterEvent), ('/conveyor/request', ParameterEvent),
        ('/conveyor/joint_state', JointState), ('/drive_can_bridge/joint_states', JointState),
        ('/diagnostics', DiagnosticArray))]


def stamp_of(message: Any) -> Time:
    return message.stamp if hasattr(message, 'stamp') else message.header.stamp


def have_stamp(topics: list[Topic], stamp: Time) -> None:
    """Wait until each of them has a message with this stamp."""
    for topic in topics:
        topic.wait(lambda message: stamp_of(message) == stamp)


def goes_on_without_stamps(one: Bridge, client: Client, topics: list[Topic]) -> None:
    """Check that stamps are 0, that this is told once, and that the drive can be used."""
    have_stamp(topics, Time())
    client.wait_logged('since 1970')
    statistics = one.node.drives['conveyor'].session.statistics
    wanted = statistics.exchanges + 20
    wait_until(lambda: statistics.exchanges >= wanted)
    assert client.set('/conveyor', ramp_time=1.5) == [(True, '')]
    assert client.set('/drive_can_bridge', drives__conveyor__command_timeout=30.0) == [(True, '')]
    assert sum('since 1970' in line for line in client.logged()) == 1
    assert not one.fatal and not one.errors
