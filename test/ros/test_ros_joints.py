# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""All joints of a bridge in one message, both ways."""

import math
from typing import Any

from bridges import Bridge, CONVEYOR, late, parameters, StartBridge
from clients import Client, wait_until
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from waiting import clock, pause

from drive_can_bridge.core import sentences
from drive_can_bridge.exchange.member import Member

STATES, COMMANDS = '/drive_can_bridge/joint_states', '/drive_can_bridge/joint_commands'
RPM = 2 * math.pi / 60
BUS = {'interface': 'virtual', 'bitrate': 1_000_000, 'reconnect_period': 0.1}


def wheel(station: int, joint: dict[str, Any] | None, **keys: Any) -> dict[str, Any]:
    """Return a drive with speed and position that goes offline soon."""
    return {**CONVEYOR, 'station': station, 'missed_limit': 20, 'parameter_timeout': 0.2,
            'cyclic_response': ['actual_speed', 'actual_position', 'motor_current'],
            **({} if joint is None else {'joint': joint}), **keys}


def two(**further: Any) -> dict[str, Any]:
    """Return two joints on one bus, of which the second is no speed, and one on another bus."""
    return {**parameters(
        buses={'main': dict(BUS), 'side': dict(BUS)},
        # not in the order of the alphabet, nor of the buses
        west=wheel(1, {'name': 'wj', 'velocity': 'actual_speed', 'position': 'actual_position',
                       'velocity_command': 'speed_setpoint', 'gear_ratio': 2.0}),
        north=wheel(2, {'name': 'nj', 'effort': 'motor_current',
                        'velocity_command': 'speed_setpoint'}, bus='side'),
        east=wheel(3, {'name': 'ej', 'position': 'actual_position',
                       'velocity_command': 'speed_setpoint'}),
        south=wheel(4, {'name': 'sj', 'velocity_command': 'speed_setpoint'}),
        plain=wheel(5, None)), **further}


def same(values: Any, expected: list[float]) -> bool:
    return list(values) == pytest.approx(expected, nan_ok=True)


def speeds(one: Bridge) -> dict[str, int]:
    """Return the speed setpoints as they were sent last, by drive."""
    return {name: drive.session.sent.raws[0] or 0 for name, drive in one.node.drives.items()}


def test_all_joints_in_the_order_of_the_drives(bridge: StartBridge, client: Client) -> None:
    one = bridge(two()).online()
    for name, speed, position in (('west', 600.0, 90.0), ('east', 1.0, 45.0)):
        one.played[name].set_value('actual_speed', speed)
        one.played[name].set_value('actual_position', position)
    one.played['north'].set_value('motor_current', 2.5)
    topic = client.topic(STATES, JointState)
    message = topic.wait(lambda m: list(m.name) == ['wj', 'nj', 'ej'] and same(m.position, [
        math.pi / 4, math.nan, math.pi / 4]) and same(m.effort, [math.nan, 2.5, math.nan]))
    assert same(message.velocity, [300 * RPM, math.nan, math.nan])
    assert abs(message.header.stamp.sec - clock().stamp() * 1e-9) < 60


def test_a_drive_that_is_gone_has_nan_and_keeps_its_place(bridge: StartBridge,
                                                          client: Client) -> None:
    names = ['wj', 'nj', 'ej']
    one = bridge(two())
    topic = client.topic(STATES, JointState)
    one.online()
    for name in ('west', 'east'):
        one.played[name].set_value('actual_position', 45.0)
    one.played['north'].set_value('motor_current', 2.5)
    topic.wait(lambda m: same(m.effort, [math.nan, 2.5, math.nan]) and same(
        m.position, [math.pi / 8, math.nan, math.pi / 4]))
    for name in ('north', 'west'):
        one.played[name].fault('off')
    message = topic.wait(lambda m: same(m.effort, [math.nan] * 3) and same(
        m.position, [math.nan, math.nan, math.pi / 4]))
    assert same(message.velocity, [math.nan] * 3)
    one.played['north'].fault('ok')
    topic.wait(lambda m: math.isfinite(m.effort[1]))    # without power it forgot what it was
    assert [list(message.name) for message in topic.messages] == [names] * len(topic.messages)
    for kind in ('position', 'velocity', 'effort'):
        assert {len(getattr(message, kind)) for message in topic.messages} == {3}


def test_a_bus_that_hangs_has_no_actual_values(bridge: StartBridge, client: Client) -> None:
    """What it measured is of before, and nobody can say any more that its drives are there."""
    one = bridge(two(diagnostics_period=3600.0))
    topic = client.topic(STATES, JointState)
    one.online()
    one.played['north'].set_value('motor_current', 2.5)
    topic.wait(lambda m: same(m.effort, [math.nan, 2.5, math.nan]))
    with late(one.node.exchanges['side']):
        pause(2.0)
        message = topic.messages[-1]
        assert same(message.effort, [math.nan] * 3)
        assert math.isfinite(message.position[0])
        stamp = message.header.stamp
        assert clock().stamp() * 1e-9 - stamp.sec - 1e-9 * stamp.nanosec < 0.1
    topic.wait(lambda m: same(m.effort, [math.nan, 2.5, math.nan]))


def unknown(message: JointState) -> bool:
    return all(map(math.isnan, (*message.position, *message.velocity, *message.effort)))


@pytest.mark.parametrize('end', ['power', 'deactivate', 'bridge'])
def test_when_the_last_joint_goes_that_is_told_once(bridge: StartBridge, client: Client,
                                                    end: str) -> None:
    one = bridge(two())
    topic = client.topic(STATES, JointState)
    one.online()
    topic.wait(lambda m: not unknown(m))
    before = clock().stamp() * 1e-9
    if end == 'power':
        for name in ('west', 'north', 'east'):
            one.played[name].fault('off')
    elif end == 'deactivate':
        assert client.transition(label='deactivate')
    else:
        one.close()
    last = wait_until(lambda: topic.messages[-1] if unknown(topic.messages[-1]) else None)
    assert list(last.name) == ['wj', 'nj', 'ej']
    assert last.header.stamp.sec + 1e-9 * last.header.stamp.nanosec >= before
    pause(0.3)     # a second one would have come by now, on most machines
    assert [unknown(message) for message in topic.messages[-2:]] == [False, True]


@pytest.mark.parametrize('name', ['west', 'east'])     # first and last
def test_the_stamp_is_that_of_the_oldest_sample(bridge: StartBridge, client: Client,
                                                name: str) -> None:
    """A drive that answers no more, but is not given up yet, makes the whole message old."""
    content = two()
    content['drives'][name]['missed_limit'] = 1000
    one = bridge(content).online()
    topic = client.topic(STATES, JointState)
    topic.wait()
    one.played[name].fault('silent')
    statistics = one.node.drives[name].session.statistics
    wait_until(lambda: statistics.missed > 5)

    def stamp(message: JointState) -> float:
        return float(message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)
    first = topic.wait()
    missed = statistics.missed
    wait_until(lambda: statistics.missed > missed + 25)     # half a second
    later = topic.wait()
    assert abs(stamp(later) - stamp(first)) < 0.05, 'of one and the same sample'
    one.played[name].fault('ok')
    topic.wait(lambda m: stamp(m) > stamp(first))


def test_empty_without_anybody_who_has_it(bridge: StartBridge, client: Client) -> None:
    bridge(parameters(
        left=wheel(1, {'name': 'l', 'velocity': 'actual_speed'}),
        right=wheel(2, {'name': 'r', 'velocity': 'actual_speed'}))).online()
    message = client.topic(STATES, JointState).wait(lambda m: len(m.name) == 2)
    assert (len(message.position), len(message.velocity), len(message.effort)) == (0, 2, 0)


def test_rate_and_quality(bridge: StartBridge, client: Client) -> None:
    bridge(two(joint_state_rate=20.0)).online()
    topic = client.topic(STATES, JointState)
    (info,) = client.node.get_publishers_info_by_topic(STATES)
    assert info.qos_profile.reliability is ReliabilityPolicy.RELIABLE
    topic.wait()
    count, began = len(topic.messages), clock().now()
    wait_until(lambda: len(topic.messages) >= count + 30)
    assert clock().now() - began > 1.2, '30 messages at 20 Hz take 1.5 s'


@pytest.mark.parametrize('content', [
    two(joint_state_rate=0.0), parameters(conveyor=CONVEYOR)], ids=['rate 0', 'no joint'])
def test_there_is_none(bridge: StartBridge, client: Client, content: dict[str, Any]) -> None:
    one = bridge(content).online()
    client.find(one.node, 'drive_can_bridge')
    assert not client.node.count_publishers(STATES)
    joints = any('joint' in drive for drive in content['drives'].values())
    assert bool(client.node.count_subscribers(COMMANDS)) is joints


def test_commands_for_all_of_them(bridge: StartBridge, client: Client) -> None:
    one = bridge(two()).online()
    names = ['nj', 'wj', 'sj']

    def send(*velocity: float, **kinds: list[float]) -> None:
        client.publish(COMMANDS, JointState(name=names, velocity=list(velocity), **kinds))
    send(0.0, 0.0, 0.0)
    send(100 * RPM, 100 * RPM, math.nan)        # NaN: left alone
    wait_until(lambda: speeds(one) == {'west': 2000, 'north': 1000, 'east': 0, 'south': 0,
                                       'plain': 0})
    ages = {name: one.node.drives[name].session.setpoints.items[0].commanded_at
            for name in one.node.drives}
    assert ages['east'] is ages['plain'] is None
    send(math.nan, math.nan, 50 * RPM)          # armed before: goes through, the others stay
    wait_until(lambda: speeds(one) == {'west': 2000, 'north': 1000, 'east': 0, 'south': 500,
                                       'plain': 0})
    assert ages['west'] == one.node.drives['west'].session.setpoints.items[0].commanded_at
    # a joint that is not named is left alone, too
    client.publish(COMMANDS, JointState(name=['wj'], velocity=[10 * RPM]))
    wait_until(lambda: speeds(one)['west'] == 200)
    assert speeds(one)['north'] == 1000


@pytest.mark.interpreted    # replaces a method
def test_a_defect_of_one_drive_costs_no_other(bridge: StartBridge, client: Client,
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever drive of a bus has its turn takes the message, for all of them."""
    one = bridge(two()).online()
    client.listen()
    names = ['ej', 'wj', 'sj']
    client.publish(COMMANDS, JointState(name=names, velocity=[0.0] * 3))
    wait_until(lambda: all(one.node.drives[name].session.setpoints.items[0].armed
                           for name in ('east', 'west', 'south')))

    def fail(*_: Any) -> None:
        raise KeyError('a defect')
    monkeypatch.setattr(one.node.drives['east'].session.services, 'command', fail)
    for value in (10, 20, 30):
        client.publish(COMMANDS, JointState(name=names, velocity=[value * RPM] * 3))
        wait_until(lambda value=value: speeds(one)['south'] == 10 * value)
    assert speeds(one) == {'west': 600, 'north': 0, 'east': 0, 'south': 300, 'plain': 0}
    assert [name for name, drive in one.node.drives.items() if drive.times_lost] == ['east']
    client.wait_logged('east: offline: ')
    monkeypatch.undo()
    one.online()


@pytest.mark.interpreted    # replaces a method
def test_a_drive_that_begins_anew_behind_a_defect_costs_no_other_its_command(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(two()).online()
    names = ['ej', 'sj']
    client.publish(COMMANDS, JointState(name=names, velocity=[0.0, 0.0]))
    wait_until(lambda: one.node.drives['south'].session.setpoints.items[0].armed)
    publisher = client.node.create_publisher(JointState, COMMANDS, 1)
    wait_until(lambda: publisher.get_subscription_count() == 2)
    again = []
    recover = Member.recover

    def command_and_begin(member: Member, now: float) -> None:
        if not again:
            publisher.publish(JointState(name=names, velocity=[20 * RPM, 20 * RPM]))
        again.append(member.session)
        recover(member, now)
    monkeypatch.setattr(Member, 'recover', command_and_begin)

    def fail(*_: Any) -> None:
        monkeypatch.delattr(east.session.services, 'command')
        raise KeyError('a defect')
    east = one.node.drives['east']
    monkeypatch.setattr(east.session.services, 'command', fail, raising=False)
    client.publish(COMMANDS, JointState(name=names, velocity=[10 * RPM, 10 * RPM]))
    wait_until(lambda: again == [east.session])
    wait_until(lambda: speeds(one)['south'] == 200)
    one.online()
    assert speeds(one)['east'] == 0


def test_commands_that_wait_for_a_late_exchange_are_thrown_away_and_counted(
        bridge: StartBridge, client: Client) -> None:
    one = bridge(two()).online()
    client.publish(COMMANDS, JointState(name=['wj'], velocity=[0.0]))
    wait_until(lambda: one.node.drives['west'].session.setpoints.items[0].armed)
    exchange = one.node.exchanges['main']
    with late(exchange):
        client.publish(COMMANDS, JointState(name=['wj'], velocity=[30 * RPM]))
        pause(0.5)

    def refused() -> int:
        return sum(one.node.drives[name].session.statistics.commands_refused
                   for name in ('west', 'east', 'south', 'plain'))
    wait_until(refused)
    client.wait_logged('1 command thrown away: the exchange was 0')
    assert refused() == 1
    assert speeds(one)['west'] == 0


def test_array_of_another_length_is_refused_whole(bridge: StartBridge, client: Client) -> None:
    one = bridge(two()).online()
    client.listen()
    client.publish(COMMANDS, JointState(name=['wj', 'nj'], velocity=[0.0, 0.0]))
    wait_until(lambda: one.node.drives['north'].session.setpoints.items[0].armed)
    client.publish(COMMANDS, JointState(name=['wj', 'nj'], velocity=[RPM]))
    client.wait_logged('joint_commands refused: 1 velocity values for 2 names; allowed are as '
                       'many as names, with NaN for joints that are to be left alone, or none')
    client.publish(COMMANDS, JointState(name=['wj', 'nj'], velocity=[RPM, RPM],
                                        effort=[1.0, 1.0, 1.0]))
    client.publish(COMMANDS, JointState(name=['wj', 'wj'], velocity=[RPM, RPM]))
    client.wait_logged('joint_commands refused: wj stands twice, allowed is once')
    client.publish(COMMANDS, JointState(name=[], velocity=[RPM]))
    client.wait_logged('joint_commands refused: 1 velocity values and no names')
    wait_until(lambda: one.node.drives['west'].session.statistics.commands_refused == 3)
    wait_until(lambda: one.node.drives['north'].session.statistics.commands_refused == 2)
    assert set(speeds(one).values()) == {0}
    assert one.node.drives['east'].session.statistics.commands_refused == 0


@pytest.mark.parametrize('names', [
    ['wj', *(f'j{number:x}' for number in range(5000)), 'j0'], ['wj'] * 1001],
    ids=['twice in the end', 'all alike'])
def test_more_names_than_anybody_has_are_refused_whole(bridge: StartBridge, client: Client,
                                                       names: list[str]) -> None:
    one = bridge(two()).online()
    client.listen()
    client.publish(COMMANDS, JointState(name=names))
    client.wait_logged(f'command on {COMMANDS} cannot be read: {len(names)} names, at most 1000 '
                       f'are allowed')
    client.publish('/west/joint_command', JointState(name=names))
    client.wait_logged(f'west: command on /west/joint_command cannot be read: {len(names)} names')
    for name, count in (('west', 2), ('north', 1), ('south', 1), ('plain', 0)):
        wait_until(lambda name=name, count=count: one.node.drives[
            name].session.statistics.commands_refused == count)
    assert not any('no joint' in text for text in client.logged(0))


def test_joints_of_others_are_told_once(bridge: StartBridge, client: Client) -> None:
    one = bridge(two()).online()
    client.listen()
    for _ in range(3):
        client.publish(COMMANDS, JointState(name=['head', 'wj'], velocity=[1.0, 0.0]))
    client.wait_logged('joint_commands name head, which is no joint of this bridge: ignored')
    wait_until(lambda: one.node.drives['west'].session.setpoints.items[0].armed)
    assert sum('head' in text for text in client.logged(0)) == 1
    assert one.node.drives['west'].session.statistics.commands_refused == 0


def test_quantity_without_a_command(bridge: StartBridge, client: Client) -> None:
    one = bridge(two()).online()
    client.listen()
    client.publish(COMMANDS, JointState(name=['wj', 'nj'], velocity=[0.0, 0.0],
                                        position=[1.0, math.nan]))
    client.wait_logged('west: joint_command has a position, which is ignored: '
                       'joint.position_command is not configured')
    wait_until(lambda: one.node.drives['north'].session.setpoints.items[0].armed)
    assert not any('north' in text for text in client.logged(0) if 'position' in text)


def test_it_matches_a_queue_of_one(bridge: StartBridge, client: Client) -> None:
    """Reliable or best effort, any depth: the hardware interface asks for a depth of 1."""
    bridge(two()).online()
    for reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT):
        publisher = client.node.create_publisher(
            JointState, COMMANDS, QoSProfile(depth=1, reliability=reliability))
        wait_until(lambda publisher=publisher: publisher.get_subscription_count() == 2)
        client.node.destroy_publisher(publisher)


def test_cleaned_up_and_configured_anew(bridge: StartBridge, client: Client) -> None:
    one = bridge(two()).online()
    topic = client.topic(STATES, JointState)
    topic.wait(lambda m: len(m.name) == 3)
    for label in ('deactivate', 'cleanup'):
        client.transition(label=label)
    wait_until(lambda: not client.node.count_publishers(STATES)
               and not client.node.count_subscribers(COMMANDS))
    for label in ('configure', 'activate'):
        client.transition(label=label)
    topic.wait(lambda m: len(m.name) == 3)
    client.publish(COMMANDS, JointState(name=['wj'], velocity=[0.0]))
    wait_until(lambda: one.node.drives['west'].session.setpoints.items[0].armed)


def test_a_joint_that_turns_on_and_on_goes_on_where_its_counter_wraps(
        bridge: StartBridge, client: Client) -> None:
    """int16 at 0.1 deg: from 3276.7 deg on to -3276.8 deg."""
    one = bridge(parameters(west=wheel(1, {
        'name': 'wj', 'position': 'actual_position', 'continuous': True})))
    both = [client.topic(STATES, JointState), client.topic('/west/joint_state', JointState)]
    one.online()
    client.listen()
    west = one.played['west']
    def lost_and_found(degrees: float) -> None:
        west.fault('silent')
        both[0].wait(unknown)
        both[1].messages.clear()
        west.set_value('actual_position', degrees)
        west.fault('ok')
        for topic in both:
            topic.wait(lambda m: same(m.position, [math.radians(degrees)]))
        client.wait_logged(sentences.position_began_again(
            joint='wj', position=math.radians(degrees)))
    lost_and_found(3000.0)
    for degrees, joint in ((-3000.0, 3553.6), (0.0, 6553.6), (3000.0, 9553.6)):
        west.set_value('actual_position', degrees)
        for topic in both:
            topic.wait(lambda m, joint=joint: same(m.position, [math.radians(joint)]))
    # what everybody else reads is what the drive has
    client.topic('/west/actual_position', Float64).wait(lambda m: abs(m.data - 3000.0) < 1e-6)
    lost_and_found(20.0)
