# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Setpoints from topics to the wire: arming, ageing, refusals."""

import math
from pathlib import Path

from bridges import Bridge, CONVEYOR, HASTY, late, parameters, Recorder, StartBridge
from clients import Client, wait_until, WARN
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int64
from waiting import pause

from drive_can_bridge.core import sentences

SPEED = '/conveyor/command/speed_setpoint'
TWO_SETPOINTS = {**CONVEYOR, 'cyclic_request': ['speed_setpoint', 'position_setpoint']}
DRIVE = 'drive_can_bridge: drive conveyor'


def until_sent(recorder: Recorder, slot: int, raw: int) -> None:
    wait_until(lambda: recorder.words()[slot:slot + 1] == (raw,),
               what=f'{raw} in slot {slot}; last: {recorder.words()}')


def refused(one: Bridge) -> int:
    return one.node.drives['conveyor'].session.statistics.commands_refused


def cycles_pass(one: Bridge, count: int = 5) -> None:
    """Wait until that many further exchanges are over."""
    statistics = one.node.drives['conveyor'].session.statistics
    start = statistics.exchanges
    wait_until(lambda: statistics.exchanges >= start + count)


def arm(client: Client, recorder: Recorder, speed: float = 100.0) -> None:
    client.publish(SPEED, Float64(data=0.0))
    client.publish(SPEED, Float64(data=speed))
    until_sent(recorder, 0, round(10 * speed))


def test_newest_wins(bridge: StartBridge, client: Client) -> None:
    one = bridge().online()
    with one.record() as recorder:
        arm(client, recorder)
        for value in range(200):
            client.publish(SPEED, Float64(data=float(value)))
        until_sent(recorder, 0, 1990)
        cycles_pass(one)
        assert recorder.words()[0] == 1990


def test_a_time_out_is_told_and_wants_arming_again(bridge: StartBridge,
                                                   client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'command_timeout': 2.0})).online()
    with one.record() as recorder:
        arm(client, recorder)
        until_sent(recorder, 0, 0)
        told = 'conveyor: no command for 2 s: speed_setpoint neutral until armed again'
        client.wait_logged(told, WARN)
        client.publish(SPEED, Float64(data=100.0))
        cycles_pass(one)
        assert recorder.words()[0] == 0
        status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'not armed')
        assert status['level'] == 'WARN'
        assert sentences.not_armed([f'0 to {SPEED}']) in status['message']


def test_commands_that_wait_for_a_late_exchange_are_thrown_away_and_counted(
        bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor=CONVEYOR)).online()
    with one.record() as recorder:
        arm(client, recorder)
        exchange, = one.node.exchanges.values()
        with late(exchange):
            client.publish(SPEED, Float64(data=200.0))
            pause(0.5)
        wait_until(lambda: refused(one))
        client.wait_logged('1 command thrown away: the exchange was 0')
        cycles_pass(one)
        assert refused(one) == 1
        assert recorder.words()[0] == 1000


PROFILE = """
protocols: [datamodel_extended]
parameters:
  counts: {number: 51, type: int16, storage: ram, neutral: 5}
  actual: {number: 209, type: int16, access: ro}
"""


def test_a_neutral_that_is_not_zero(bridge: StartBridge, client: Client, tmp_path: Path) -> None:
    profile = tmp_path / 'typed.yaml'
    profile.write_text(PROFILE, encoding='utf-8')
    one = bridge(parameters(conveyor={
        **CONVEYOR, 'profile': str(profile), 'cyclic_request': ['counts'],
        'cyclic_response': ['actual']})).online()
    topic = '/conveyor/command/counts'
    status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'not armed')
    assert sentences.not_armed([f'5 to {topic}']) in status['message']
    with one.record() as recorder:
        until_sent(recorder, 0, 5)
        client.publish(topic, Int64(data=6))
        client.wait_logged('command counts has no effect: not armed, send 5 once first')
        assert recorder.words()[0] == 5
        client.publish(topic, Int64(data=5))
        client.publish(topic, Int64(data=6))
        until_sent(recorder, 0, 6)


def test_joint_command(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={
        **TWO_SETPOINTS, 'joint': {
            'name': 'belt', 'velocity': 'actual_speed', 'velocity_command': 'speed_setpoint',
            'effort_command': 'position_setpoint', 'gear_ratio': 10.0}})).online()
    topic = '/conveyor/joint_command'
    one_rpm = 2 * math.pi / 60 / 10
    with one.record() as recorder:
        client.publish(topic, JointState(name=['belt'], velocity=[0.0], effort=[0.0]))
        client.publish(topic, JointState(name=['other', 'belt'], velocity=[9.0, 120 * one_rpm],
                                         effort=[9.0, 25.0]))
        wait_until(lambda: recorder.words()[:2] == (1200, 250))
        client.publish(topic, JointState(name=['belt'], velocity=[60 * one_rpm]))
        wait_until(lambda: recorder.words()[:2] == (600, 250))
        assert refused(one) == 0
        client.listen()
        for count in range(1, 4):
            client.publish(topic, JointState(name=['chain'], velocity=[0.0]))
            wait_until(lambda count=count: refused(one) == count)
        client.publish(topic, JointState(name=['other', 'belt'], velocity=[1.0]))
        wait_until(lambda: refused(one) == 4)
        client.wait_logged('conveyor: joint_command has fewer velocity values than names')
        for _ in range(3):
            client.publish(topic, JointState(name=['belt'], position=[1.0]))
        client.wait_logged('joint_command has a position, which is ignored')
        client.publish(topic, JointState(name=['belt'], velocity=[math.inf]))
        client.wait_logged('command speed_setpoint refused: inf')
        wait_until(lambda: refused(one) == 5)
        told = [text for text in client.logged(0) if 'which is ignored' in text]
        assert told == [f'conveyor: {sentences.joint_quantity_ignored("position")}']
        assert not [text for text in client.logged() if text in told]
        warnings = [text for text in client.logged() if 'without an entry' in text]
        assert warnings == [f'conveyor: {sentences.joint_not_named("belt")}']
        client.publish(topic, JointState(name=['belt']))
        client.publish(topic, JointState(name=['belt'], velocity=[30 * one_rpm]))
        wait_until(lambda: recorder.words()[:2] == (300, 250))
        # NaN leaves it alone, and refreshes no age
        before = one.node.drives['conveyor'].session.setpoints.items[0].commanded_at
        client.publish(topic, JointState(name=['belt'], velocity=[math.nan], effort=[30.0]))
        wait_until(lambda: recorder.words()[:2] == (300, 300))
        assert one.node.drives['conveyor'].session.setpoints.items[0].commanded_at == before
        assert refused(one) == 5


def test_commands_while_offline_have_no_effect_later(bridge: StartBridge,
                                                     client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, **HASTY, 'rearm': 'immediate'})).online()
    with one.record() as recorder:
        client.publish(SPEED, Float64(data=100.0))
        until_sent(recorder, 0, 1000)
        one.played['conveyor'].fault('silent')
        wait_until(lambda: not one.node.drives['conveyor'].session.online)
        client.publish(SPEED, Float64(data=300.0))
        client.publish(SPEED, Float64(data=math.nan))
        wait_until(lambda: refused(one) == 1)
        recorder.clear()
        one.played['conveyor'].fault('ok')
        one.online()
        cycles_pass(one)
        assert {words[0] for words in recorder.cycles()} == {0}
        client.publish(SPEED, Float64(data=200.0))
        until_sent(recorder, 0, 2000)


@pytest.mark.parametrize('reliability', list(ReliabilityPolicy)[1:3])
def test_any_publisher_will_do(bridge: StartBridge, client: Client,
                               reliability: ReliabilityPolicy) -> None:
    one = bridge().online()
    with one.record() as recorder:
        client.publisher(SPEED, Float64, QoSProfile(depth=1, reliability=reliability))
        arm(client, recorder)


def test_another_publisher_has_another_clock(bridge: StartBridge, client: Client) -> None:
    """How quick the last one was says nothing about who comes when it has gone."""
    one = bridge(parameters(conveyor={**CONVEYOR, 'cyclic_request': ['speed_setpoint']})).online()
    with one.record() as recorder:
        quick, slow = (client.node.create_publisher(Float64, SPEED, 1) for _ in range(2))
        slow.handle.behind = 10_000_000_000
        wait_until(lambda: quick.publish(Float64(data=0.0)) or not waiting_setpoints(one))
        before = refused(one)
        wait_until(lambda: slow.publish(Float64(data=0.0)) or refused(one) > before)
        client.wait_logged(f'conveyor: command on {SPEED} thrown away: it came 10')
        for publisher in (quick, slow):
            client.node.destroy_publisher(publisher)
        wait_until(lambda: client.node.count_publishers(SPEED) == 0)
        cycles_pass(one)        # it is looked up every 0.05 s
        client.publisher(SPEED, Float64).handle.behind = 20_000_000_000
        before = refused(one)
        arm(client, recorder)
    assert refused(one) == before


def waiting_setpoints(one: Bridge) -> list[str]:
    """Return which setpoints of the conveyor are not armed."""
    setpoints = one.node.drives['conveyor'].session.setpoints
    return [setpoint.parameter.name for setpoint in setpoints.waiting]


JOINT = {'name': 'belt', 'velocity': 'actual_speed', 'velocity_command': 'speed_setpoint'}


@pytest.mark.parametrize('topic', [SPEED, '/conveyor/joint_command',
                                   '/drive_can_bridge/joint_commands'])
def test_a_publisher_whose_clock_is_set_back_arms_again(bridge: StartBridge, client: Client,
                                                        topic: str) -> None:
    """What its topic commands is disarmed, nothing else is; and it counts again from there."""
    one = bridge(parameters(conveyor={**CONVEYOR, 'joint': JOINT})).online()
    client.listen()

    def send(speed: float) -> None:
        client.publish(topic, Float64(data=speed) if topic == SPEED else JointState(
            name=['belt'], velocity=[speed * 2 * math.pi / 60]))
    with one.record() as recorder:
        client.publish('/conveyor/command/torque_limit', Float64(data=0.0))
        send(0.0)
        send(100.0)
        until_sent(recorder, 0, 1000)
        wait_until(lambda: not waiting_setpoints(one))
        client.publisher(topic, Float64).handle.behind = 3_600_000_000_000
        send(100.0)
        until_sent(recorder, 0, 0)
        client.wait_logged(f'{topic}: the clock of its publisher was set back by ')
        assert waiting_setpoints(one) == ['speed_setpoint']
        send(100.0)
        cycles_pass(one)
        assert recorder.words()[0] == 0
        send(0.0)
        send(200.0)
        until_sent(recorder, 0, 2000)
        assert not refused(one)


def test_a_publisher_that_is_steadily_late_is_obeyed_after_10_s(bridge: StartBridge,
                                                                client: Client) -> None:
    """Its clock was set back by less than what lies between two of its commands."""
    one = bridge(parameters(conveyor={**CONVEYOR, 'cyclic_request': ['speed_setpoint']})).online()
    client.listen()
    with one.record() as recorder:
        arm(client, recorder)
        client.publisher(SPEED, Float64).handle.behind = 1_000_000_000
        pause(2.0)
        for _ in range(8):
            client.publish(SPEED, Float64(data=200.0))
            pause(1.6)
        client.wait_logged(f'{SPEED}: all that came for 10 s was 1.00 s later')
        until_sent(recorder, 0, 0)
        assert refused(one) == 7
        arm(client, recorder, 300.0)
    assert refused(one) == 7


def test_of_two_publishers_the_one_behind_can_only_stop(bridge: StartBridge,
                                                        client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'cyclic_request': ['speed_setpoint']})).online()
    client.listen()
    with one.record() as recorder:
        arm(client, recorder)
        behind = client.node.create_publisher(Float64, SPEED, 1)
        behind.handle.behind = 400_000_000
        for count in range(1, 4):
            behind.publish(Float64(data=200.0))
            wait_until(lambda count=count: refused(one) == count)
            client.publish(SPEED, Float64(data=100.0))
            cycles_pass(one)
        client.wait_logged('the clocks of its publishers differ by 0.40 s: '
                           'synchronise the clocks of the hosts')
        assert recorder.words()[0] == 1000
        behind.publish(Float64(data=0.0))
        until_sent(recorder, 0, 0)


def test_an_integer_in_a_float_field_stops_and_says_why(bridge: StartBridge,
                                                        client: Client) -> None:
    """Message classes check no types: what stands in its place arrives."""
    one = bridge(parameters(conveyor={**CONVEYOR, 'joint': JOINT})).online()
    client.listen()
    with one.record() as recorder:
        arm(client, recorder)
        client.publish(SPEED, Float64(data=300))
        until_sent(recorder, 0, 0)
        client.wait_logged('is what arrives when an integer was put into a float field: '
                           'write 300.0, not 300')
        assert refused(one) == 1
        client.publish(SPEED, Float64(data=100.0))
        cycles_pass(one)
        assert recorder.words()[0] == 0
        arm(client, recorder)
        client.publish('/conveyor/joint_command', JointState(name=['belt'], velocity=[5e-324]))
        until_sent(recorder, 0, 0)
        assert refused(one) == 2
        # one that is neutral in everything else arms nothing either
        client.publish('/conveyor/joint_command', JointState(name=['belt'], velocity=[5e-324]))
        client.publish(SPEED, Float64(data=100.0))
        cycles_pass(one)
        assert recorder.words()[0] == 0
    assert client.set('/conveyor', ramp_time=5e-324) == [
        (False, sentences.misplaced_integer(5e-324))]


def test_incompatible_publishers_are_told_about(bridge: StartBridge, client: Client) -> None:
    content = parameters()
    content['qos_overrides'] = {SPEED: {'subscription': {'reliability': 'reliable'}}}
    bridge(content).online()
    client.node.create_publisher(Float64, SPEED, QoSProfile(
        depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
    client.wait_logged(f'conveyor: a publisher of {SPEED} offers incompatible quality of service '
                       f'(RELIABILITY): nothing is received from it')
