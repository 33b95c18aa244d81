# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
One contract for the drives of all protocols: every topic and service, used by a plain client.

What is special about a protocol stands in :mod:`families`, one row each; no test in here knows
which one it runs with.
"""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

from bridges import Bridge, parameters, StartBridge
from clients import Client, ERROR, from_value, wait_until, WARN
from families import Facts, FAMILIES, KEYS, SETTINGS
import pytest
from rcl_interfaces.msg import ParameterEvent, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameterTypes, ListParameters
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Int64
from std_srvs.srv import SetBool, Trigger
from waiting import clock

from drive_can_bridge.core import sentences
from drive_can_bridge.protocols.families import FAMILIES as TABLE

DRIVE = '/conveyor'
STATUS = 'drive_can_bridge: drive conveyor'
HOW_TO_ENABLE = 'call ~/enable (drive_can enable conveyor)'
REFUSED_WHOLE = 'nothing was written'
JOINT = {'name': 'belt', 'velocity': 'actual_speed', 'velocity_command': 'speed_setpoint',
         'gear_ratio': 2.0}
#: rad/s of the joint for one rpm of the motor
FACTOR = 2.0 * 3.141592653589793 / 60.0 / 2.0
VALUES = {'actual_speed': (Float64, 'std_msgs/msg/Float64'),
          'counts': (Int64, 'std_msgs/msg/Int64'), 'braked': (Bool, 'std_msgs/msg/Bool'),
          'status_word': (Int64, 'std_msgs/msg/Int64')}
COMMANDS = {'speed_setpoint': Float64, 'mode': Int64, 'brake': Bool}

Start = Callable[..., Bridge]


@pytest.fixture(params=FAMILIES, ids=lambda row: row.protocol, name='facts', scope='module')
def _facts(request: pytest.FixtureRequest) -> Facts:
    found: Facts = request.param
    return found


@pytest.fixture(name='start')
def _start(facts: Facts, bridge: StartBridge, tmp_path: Path) -> Start:
    def start(*, online: bool = True, **keys: Any) -> Bridge:
        one = bridge(parameters(conveyor=facts.drive(tmp_path, joint=JOINT, **keys)))
        if online:
            one.online()
        return one
    return start


@pytest.fixture(name='shared')
def _shared_by_the_family(facts: Facts, shared_bridge: StartBridge,
                          tmp_path_factory: pytest.TempPathFactory) -> Bridge:
    directory = tmp_path_factory.getbasetemp() / 'contract'
    directory.mkdir(exist_ok=True)
    return shared_bridge(parameters(conveyor=facts.drive(directory, joint=JOINT,
                                                         parameter_timeout=0.2)))


def settle(one: Bridge) -> None:
    """Wait for an exchange that began after what was done before."""
    statistics = one.node.drives['conveyor'].session.statistics
    before = statistics.exchanges
    wait_until(lambda: statistics.exchanges >= before + 2)


def fill(one: Bridge, facts: Facts) -> None:
    for name, value in SETTINGS.items():
        if name in facts.listed:
            one.played['conveyor'].set_value(name, value)


def enable(client: Client, wanted: bool = True) -> tuple[bool, str]:
    answer = client.call(f'{DRIVE}/enable', SetBool, SetBool.Request(data=wanted))
    return bool(answer.success), str(answer.message)


def trigger(client: Client, service: str) -> tuple[bool, str]:
    answer = client.call(f'{DRIVE}/{service}', Trigger)
    return bool(answer.success), str(answer.message)


def command(client: Client, **values: Any) -> None:
    for name, value in values.items():
        client.publish(f'{DRIVE}/command/{name}', COMMANDS[name](data=value))


def keyword(name: str) -> str:
    """Return a name as a keyword for ``Client.set``."""
    return name.replace('.', '__')


def test_every_family_has_a_row() -> None:
    assert {row.protocol for row in FAMILIES} == set(TABLE)


# -- what there is --------------------------------------------------------------------------------

def test_topics_and_services(shared: Bridge, client: Client, facts: Facts) -> None:
    node = client.node
    client.find(shared.node, 'conveyor')
    expected = {
        '/parameter_events': ['rcl_interfaces/msg/ParameterEvent'],
        f'{DRIVE}/response': ['rcl_interfaces/msg/ParameterEvent'],
        f'{DRIVE}/request': ['rcl_interfaces/msg/ParameterEvent'],
        f'{DRIVE}/joint_state': ['sensor_msgs/msg/JointState'],
        f'{DRIVE}/online': ['std_msgs/msg/Bool'],
        **{f'{DRIVE}/{name}': [kind] for name, (_, kind) in VALUES.items()},
        **{f'{DRIVE}/status_word/{bit}': ['std_msgs/msg/Bool'] for bit in facts.bits}}
    assert dict(node.get_publisher_names_and_types_by_node('conveyor', '/')) == expected
    assert dict(node.get_subscriber_names_and_types_by_node('conveyor', '/')) == {
        f'{DRIVE}/joint_command': ['sensor_msgs/msg/JointState'],
        f'{DRIVE}/command/speed_setpoint': ['std_msgs/msg/Float64'],
        f'{DRIVE}/command/mode': ['std_msgs/msg/Int64'],
        f'{DRIVE}/command/brake': ['std_msgs/msg/Bool']}
    assert dict(node.get_service_names_and_types_by_node('conveyor', '/')) == {
        f'{DRIVE}/get_parameters': ['rcl_interfaces/srv/GetParameters'],
        f'{DRIVE}/set_parameters': ['rcl_interfaces/srv/SetParameters'],
        f'{DRIVE}/set_parameters_atomically': ['rcl_interfaces/srv/SetParametersAtomically'],
        f'{DRIVE}/list_parameters': ['rcl_interfaces/srv/ListParameters'],
        f'{DRIVE}/describe_parameters': ['rcl_interfaces/srv/DescribeParameters'],
        f'{DRIVE}/get_parameter_types': ['rcl_interfaces/srv/GetParameterTypes'],
        f'{DRIVE}/enable': ['std_srvs/srv/SetBool'],
        f'{DRIVE}/reset_fault': ['std_srvs/srv/Trigger'],
        f'{DRIVE}/quick_stop': ['std_srvs/srv/Trigger']}
    latched = {f'{DRIVE}/online', *(f'{DRIVE}/status_word/{bit}' for bit in facts.bits)}
    for topic in expected:
        if topic == '/parameter_events':
            continue
        [info] = node.get_publishers_info_by_topic(topic)
        assert info.qos_profile.reliability is ReliabilityPolicy.RELIABLE, topic
        assert info.qos_profile.durability is (
            DurabilityPolicy.TRANSIENT_LOCAL if topic in latched
            else DurabilityPolicy.VOLATILE), topic
    assert not shared.fatal


# -- what it says ---------------------------------------------------------------------------------

def test_samples(shared: Bridge, client: Client, facts: Facts) -> None:
    drive = shared.played['conveyor']
    topics = {name: client.topic(f'{DRIVE}/{name}', kind) for name, (kind, _) in VALUES.items()}
    response = client.topic(f'{DRIVE}/response', ParameterEvent)
    joint = client.topic(f'{DRIVE}/joint_state', JointState)
    for name, value in (('actual_speed', -12.3), ('counts', 65535), ('braked', True)):
        drive.set_value(name, value)
    before = clock().stamp() * 1e-9
    for name, value in (('actual_speed', -12.3), ('counts', 65535), ('braked', True)):
        wait_until(lambda topic=topics[name], value=value: [  # type: ignore[misc]
            entry for entry in topic.values[-1:] if entry == pytest.approx(value)])
        assert type(topics[name].values[-1]) is type(value)
    sample = response.wait()
    assert sample.node == DRIVE
    assert [entry.name for entry in sample.changed_parameters] == facts.response
    assert not sample.new_parameters and not sample.deleted_parameters
    values = {entry.name: entry.value for entry in sample.changed_parameters}
    assert values['actual_speed'].type == ParameterType.PARAMETER_DOUBLE
    assert values['actual_speed'].double_value == pytest.approx(-12.3)
    assert values['counts'].type == ParameterType.PARAMETER_INTEGER
    assert values['counts'].integer_value == 65535
    assert values['braked'].type == ParameterType.PARAMETER_BOOL
    assert values['braked'].bool_value is True
    message = joint.wait()
    assert list(message.name) == ['belt']
    assert message.velocity == pytest.approx([-12.3 * FACTOR])
    assert not message.position and not message.effort
    stamps = [entry.stamp.sec + 1e-9 * entry.stamp.nanosec for entry in list(response.messages)]
    assert before - 60.0 < stamps[-1] < clock().stamp() * 1e-9 + 0.1
    assert all(later > earlier for earlier, later in zip(stamps, stamps[1:]))
    wait_until(lambda: topics['status_word'].messages)


def test_bits_and_online_are_latched(start: Start, client: Client, facts: Facts) -> None:
    one = start(**facts.hasty)
    drive = one.played['conveyor']
    bits = {bit: client.latched(f'{DRIVE}/status_word/{bit}', Bool) for bit in facts.bits}
    words = client.topic(f'{DRIVE}/status_word', Int64)
    wait_until(lambda: all(topic.messages for topic in bits.values()) and words.messages)
    assert bits['fault'].values == [False]
    drive.fault('trip=3600')
    wait_until(lambda: bits['fault'].values == [False, True])
    assert words.wait().data & 8
    late = client.latched(f'{DRIVE}/status_word/fault', Bool)
    wait_until(lambda: late.values == [True])
    drive.fault('ok')
    wait_until(lambda: bits['fault'].values == [False, True, False])
    for bit, topic in bits.items():     # on change only
        assert all(one != other for one, other in pairwise(topic.values)), bit

    online = client.latched(f'{DRIVE}/online', Bool)
    wait_until(lambda: online.values == [True])
    drive.fault('off')
    wait_until(lambda: online.values == [True, False])
    count = len(words.messages)
    late = client.latched(f'{DRIVE}/online', Bool)
    wait_until(lambda: late.values == [False])
    assert len(words.messages) == count  # no value that did not arrive
    drive.fault('ok')
    wait_until(lambda: online.values == [True, False, True])
    wait_until(lambda: len(words.messages) > count)
    # all of them again: nobody knows what changed meanwhile
    wait_until(lambda: bits['fault'].values == [False, True, False, False])


def after_exchanges(client: Client, status: dict[str, str]) -> dict[str, str]:
    """Wait for a status with more exchanges that were answered."""
    return client.diagnostics(STATUS, lambda drive: (
        int(drive['exchanges']) > int(status['exchanges'])))


def test_diagnostics(start: Start, client: Client, facts: Facts) -> None:
    one = start(**facts.hasty)
    drive = one.played['conveyor']
    # a warning that an answer came too late goes by; busy machines have some
    status = client.diagnostics(STATUS, lambda drive: drive['state'] == 'disabled'
                                and drive['level'] == 'OK')
    assert set(status) == KEYS | facts.diagnostics | {'control_state', 'level', 'message'}
    assert (status['level'], status['message']) == ('OK', sentences.disabled(HOW_TO_ENABLE))
    client.listen()
    command(client, speed_setpoint=0.0)
    client.wait_logged('disabled, call ~/enable', WARN)
    client.diagnostics(STATUS, lambda drive: drive['level'] == 'WARN'
                       and drive['code'] == 'disabled_and_commanded')
    assert enable(client) == (True, facts.states[0])
    status = client.diagnostics(STATUS, lambda drive: drive['state'] == 'not armed')
    assert status['level'] == 'WARN' and status['command_age_s'] == 'nan'
    for name, neutral in (('speed_setpoint', '0'), ('mode', '0'), ('brake', 'false')):
        assert f'{neutral} to {DRIVE}/command/{name}' in status['message']
    command(client, speed_setpoint=0.0, mode=0, brake=False)
    status = client.diagnostics(STATUS, lambda drive: drive['state'] == 'online'
                                and drive['level'] == 'OK')
    assert status['code'] == 'online'
    assert float(status['latency_mean_ms']) > 0.0 and float(status['command_age_s']) < 60.0
    later = after_exchanges(client, status)
    while later['missed_exchanges'] != status['missed_exchanges']:  # an answer that came too late
        status, later = later, after_exchanges(client, later)
    drive.fault('trip=3600')
    status = client.diagnostics(STATUS, lambda drive: drive['state'] == 'fault')
    assert status['level'] == 'ERROR' and status['control_state'] == 'fault'
    assert '~/reset_fault' in status['message'] and '~/enable' in status['message']
    drive.fault('ok')
    client.diagnostics(STATUS, lambda drive: drive['state'] != 'fault')
    drive.fault('off')
    status = client.diagnostics(STATUS, lambda drive: drive['state'] == 'offline')
    assert (status['level'], status['code']) == ('ERROR', 'silent_since')
    drive.fault('ok')
    one.online()
    assert client.transition(4)
    status = client.diagnostics(STATUS, lambda drive: drive['code'] == 'activate_bridge')
    assert (status['state'], status['level']) == ('offline', 'STALE')


# -- setpoints and control ------------------------------------------------------------------------

def test_commands(start: Start, client: Client, facts: Facts) -> None:
    one = start()
    drive, session = one.played['conveyor'], one.node.drives['conveyor'].session
    assert enable(client) == (True, facts.states[0])
    client.publisher(f'{DRIVE}/command/speed_setpoint', Float64)
    command(client, speed_setpoint=300.0, mode=3, brake=True)  # not neutral: arms nothing
    settle(one)
    assert [item.armed for item in session.setpoints.items] == [False, False, False]
    assert drive.value('speed_setpoint') == 0.0
    command(client, speed_setpoint=0.0, mode=0, brake=False)
    command(client, speed_setpoint=-250.0, mode=3, brake=True)
    wait_until(lambda: (drive.value('speed_setpoint'), drive.value('mode'), drive.value('brake'))
               == (pytest.approx(-250.0), 3, True))
    # refused, not clamped: the last good value stays
    refused = session.statistics.commands_refused
    client.listen()
    command(client, speed_setpoint=3000.5, mode=10)
    command(client, speed_setpoint=float('nan'), mode=-1)
    client.diagnostics(STATUS, lambda drive: int(drive['commands_refused']) == refused + 4)
    client.wait_logged('3000.5 is out of range: -3000 to 3000 rpm', WARN)
    settle(one)
    assert drive.value('speed_setpoint') == pytest.approx(-250.0) and drive.value('mode') == 3
    client.publish(f'{DRIVE}/joint_command', JointState(name=['x', 'belt'],
                                                        velocity=[9.0, 500.0 * FACTOR]))
    wait_until(lambda: drive.value('speed_setpoint') == pytest.approx(500.0))
    assert client.transition(4)  # on the way out: neutral
    wait_until(lambda: (drive.value('mode'), drive.value('brake')) == (0, False))
    assert drive.value('speed_setpoint') == 0.0
    assert not drive.violations


def test_what_was_last_sent(start: Start, client: Client, facts: Facts) -> None:
    one = start()
    drive = one.played['conveyor']
    topic = client.topic(f'{DRIVE}/request', ParameterEvent)

    def sent(message: ParameterEvent) -> dict[str, Any]:
        return {entry.name: from_value(entry.value) for entry in message.changed_parameters}
    # once a second without a change, as soon as all of it was sent
    first = topic.wait(lambda message: len(message.changed_parameters) == 4)
    second = topic.wait()
    neutral = {'speed_setpoint': 0.0, 'mode': 0, 'brake': False}
    word = sent(first)['control_word']
    assert sent(first) == sent(second) == {**neutral, 'control_word': word}
    assert first.node == DRIVE and not first.new_parameters and not first.deleted_parameters
    assert enable(client)[0]
    running = wait_until(lambda: [
        message for message in topic.messages
        if sent(message).get('control_word', word) != word])  # the first may be without it
    assert {type(value) for value in sent(running[-1]).values()} == {float, int, bool}
    command(client, speed_setpoint=0.0, mode=0, brake=False)
    command(client, speed_setpoint=-250.0, mode=3, brake=True)
    moving = wait_until(lambda: [message for message in topic.messages if sent(message) == {
        'control_word': facts.word or drive.value('control_word'),
        'speed_setpoint': pytest.approx(-250.0), 'mode': 3, 'brake': True}])
    stamps = [message.stamp.sec + 1e-9 * message.stamp.nanosec for message in topic.messages]
    assert stamps == sorted(stamps) and abs(stamps[-1] - clock().stamp() * 1e-9) < 60.0
    assert moving
    assert client.transition(4)
    wait_until(lambda: sent(topic.last) == {**neutral, 'control_word': word})
    assert not drive.violations


def test_control(start: Start, client: Client, facts: Facts) -> None:
    one = start(**facts.hasty)
    drive = one.played['conveyor']
    enabled, disabled = facts.states
    topic = client.latched(f'{DRIVE}/status_word/enabled', Bool)
    # an inverter leaves 'switch-on disabled' with the first control word
    wait_until(lambda: trigger(client, 'reset_fault') == (True, disabled))
    assert trigger(client, 'quick_stop') == (True, disabled)
    assert enable(client) == (True, enabled)
    wait_until(lambda: topic.values[-1:] == [True])
    assert enable(client) == (True, enabled)
    assert enable(client, False) == (True, disabled)
    wait_until(lambda: topic.values[-1:] == [False])
    assert enable(client)[0]
    success, message = trigger(client, 'quick_stop')
    assert success and message != enabled
    wait_until(lambda: topic.values[-1:] == [False])
    assert enable(client)[0]

    drive.fault('trip')
    client.diagnostics(STATUS, lambda drive: drive['state'] == 'fault')
    assert enable(client) == (False, sentences.reset_first())
    assert trigger(client, 'quick_stop')[0]
    success, message = trigger(client, 'reset_fault')
    assert success and message not in ('fault', enabled)
    settle(one)
    assert topic.values[-1] is False  # nothing but a new enable starts it
    assert enable(client) == (True, enabled)

    drive.fault('silent')
    wait_until(lambda: not one.node.drives['conveyor'].session.online)
    for answer in (enable(client), enable(client, False), trigger(client, 'quick_stop'),
                   trigger(client, 'reset_fault')):
        assert answer == (False, sentences.drive_offline())
    drive.fault('ok')
    one.online()
    wait_until(lambda: topic.values[-1] is False)
    assert not drive.violations


# -- the drive's parameters -----------------------------------------------------------------------

def test_list_describe_and_types(shared: Bridge, client: Client, facts: Facts) -> None:
    listed = client.call(f'{DRIVE}/list_parameters', ListParameters).result
    assert (list(listed.names), list(listed.prefixes)) == (facts.listed, [])
    assert client.call(f'{DRIVE}/list_parameters', ListParameters,
                       ListParameters.Request(depth=1)).result == listed
    found = client.call(f'{DRIVE}/list_parameters', ListParameters, ListParameters.Request(
        prefixes=['gain', 'ramp', 'nothing'], depth=1)).result
    assert list(found.names) == ['gain']
    names = ['speed_setpoint', 'counts', 'flag', 'order', 'actual_ramp', 'nothing',
             facts.raw_name('gain')]
    kinds = [ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_INTEGER,
             ParameterType.PARAMETER_BOOL, ParameterType.PARAMETER_INTEGER,
             ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_NOT_SET,
             ParameterType.PARAMETER_INTEGER]
    assert list(client.call(f'{DRIVE}/get_parameter_types', GetParameterTypes,
                            GetParameterTypes.Request(names=names)).types) == kinds
    described = client.call(f'{DRIVE}/describe_parameters', DescribeParameters,
                            DescribeParameters.Request(names=names)).descriptors
    assert [entry.name for entry in described] == names
    kinds[names.index('order')] = ParameterType.PARAMETER_NOT_SET  # there is no value to be had
    assert [entry.type for entry in described] == kinds
    assert [entry.read_only for entry in described] == [
        False, True, False, False, True, False, False]
    speed, counts, flag, order, actual_ramp, nothing, raw = described
    assert speed.description.split(' (')[0] == 'Speed reference'
    assert 'unit rpm' in speed.description
    [limits] = speed.floating_point_range
    assert (limits.from_value, limits.to_value, limits.step) == (-3000.0, 3000.0, 0.1)
    [limits] = counts.integer_range
    assert (limits.from_value, limits.to_value, limits.step) == (0, 65535, 1)
    assert not flag.integer_range and not flag.floating_point_range
    assert facts.address_of('flag') in flag.description and 'storage ram' in flag.description
    assert 'integer, write-only' in order.description
    [limits] = actual_ramp.floating_point_range
    assert (limits.from_value, limits.to_value, limits.step) == (-10.0, 32757.5, 0.5)
    assert not nothing.description
    assert raw.description.split(' (')[0] == 'raw access'
    assert raw.description.split(' (')[1].startswith(facts.address_of('gain'))


def test_get(shared: Bridge, client: Client, facts: Facts) -> None:
    fill(shared, facts)
    shared.played['conveyor'].set_value('actual_speed', 12.3)
    settle(shared)
    wanted = {**{name: SETTINGS[name] for name in facts.listed if name in SETTINGS},
              'order': None, 'actual_speed': 12.3,
              **{name: value for name, (_, value) in facts.raw.items()}}
    values = client.get(DRIVE, *wanted)
    assert values == [value if value is None else pytest.approx(value)
                      for value in wanted.values()]
    assert [type(value) for value in values] == [type(value) for value in wanted.values()]
    assert client.get(DRIVE) == []
    before = client.diagnostics(STATUS)
    client.listen()
    absent, reason = facts.absent
    # one bad name takes no other along; one may stand twice; nobody asks for what is write-only
    assert client.get(DRIVE, 'gain', absent, 'gian', *facts.no_names, 'order', 'flag', 'gain') == [
        7, None, None, *[None] * len(facts.no_names), None, True, 7]
    client.wait_logged(f'conveyor: read {absent} ({facts.address(absent)}): {reason}', WARN)
    client.wait_logged('conveyor: read gian: unknown parameter gian, did you mean gain?', WARN)
    failed = int(before['parameter_requests_failed']) + 2 + len(facts.no_names)
    status = client.diagnostics(
        STATUS, lambda drive: int(drive['parameter_requests_failed']) >= failed)
    assert int(status['parameter_requests_failed']) == failed
    assert int(status['parameter_requests_ok']) > int(before['parameter_requests_ok'])
    assert status['last_parameter_error'].startswith('read ')
    assert not shared.played['conveyor'].violations


def test_set(shared: Bridge, client: Client, facts: Facts) -> None:
    drive = shared.played['conveyor']
    fill(shared, facts)
    events = client.parameter_events(DRIVE)
    good = {'ramp_time': 2.5, 'gain': 8, 'damping': -6, 'flag': False}
    assert client.set(DRIVE, **good) == [(True, '')] * 4
    assert {name: drive.value(name) for name in good} == {
        name: pytest.approx(value) for name, value in good.items()}
    wait_until(lambda: events)
    assert events == [{name: pytest.approx(value) for name, value in good.items()}]
    assert client.set(DRIVE, ramp_time=3) == [(True, '')]  # an integer is a double, too
    assert drive.value('ramp_time') == pytest.approx(3.0)
    wait_until(lambda: type(events[-1].get('ramp_time')) is float)
    assert client.set(DRIVE, order=3) == [(True, facts.order_note)]
    wait_until(lambda: events[-1] == {'order': 3})
    assert client.set(DRIVE) == []
    for name, (parameter, _) in facts.raw.items():
        if parameter != 'ramp_time':
            assert client.set(DRIVE, **{keyword(name): 1}) == [(True, '')], name
            assert drive.value(parameter) == 1
    damping = facts.raw_name('damping')
    assert client.set(DRIVE, **{keyword(damping): -7}) == [(True, '')]
    assert drive.value('damping') == -7
    wait_until(lambda: events[-1] == {damping: 0x10000 - 7})
    announced = len(events)
    refused = {
        'gain': (70000, '70000 is not representable: uint16 carries 0 to 65535'),
        'ramp_time': (60.5, '60.5 is out of range: 0.01 to 60 s'),
        'actual_ramp': (1.0, 'read-only'),
        'flag': (1, 'wrong type: integer, expected bool'),
        facts.raw_name('gain'): (1.0, 'wrong type: double, expected integer'),
        facts.raw_name('ramp_time'): (0, 'raw 0 of ramp_time: 0 is out of range: 0.01 to 60 s'),
        'gian': (1, 'unknown parameter gian, did you mean gain?'),
        'speed_setpoint': (1.0, 'sent cyclically: publish ~/command/speed_setpoint')}
    assert client.set(DRIVE, **{keyword(name): value for name, (value, _) in refused.items()}) == [
        (False, reason) for _, reason in refused.values()]
    if facts.status_mapped:
        assert client.set(DRIVE, control_word=1) == [(False, sentences.use_enable())]
    absent, reason = facts.absent
    assert client.set(DRIVE, **{keyword(absent): 1}) == [(False, reason)]
    if facts.stuck:
        drive.set_value('gain', 7)
        drive.fault('stuck=gain')
        assert client.set(DRIVE, gain=9, far_away=10) == [(False, facts.stuck), (True, '')]
        client.wait_logged(
            f"conveyor: set gain ({facts.address_of('gain')}): {facts.stuck}", WARN)
        wait_until(lambda: events[announced:] == [{'far_away': 10}])
    else:
        assert len(events) == announced
    assert not drive.violations


def test_set_atomically(shared: Bridge, client: Client, facts: Facts) -> None:
    drive = shared.played['conveyor']
    fill(shared, facts)
    assert client.set_atomically(DRIVE) == (True, '')
    events = client.parameter_events(DRIVE)
    assert client.set_atomically(DRIVE, **facts.atomic) == (True, '')
    assert {name: drive.value(name) for name in facts.atomic} == facts.atomic
    wait_until(lambda: events == [facts.atomic])
    before = {name: drive.value(name) for name in facts.scattered}
    success, reason = client.set_atomically(DRIVE, **facts.scattered)
    assert not success and REFUSED_WHOLE in reason and facts.scattered_reason in reason
    success, reason = client.set_atomically(DRIVE, gain=5, actual_ramp=1.0)
    assert (success, reason) == (
        False, sentences.nothing_written(f'actual_ramp: {sentences.read_only()}'))
    assert {name: drive.value(name) for name in facts.scattered} == before
    assert len(events) == 1


def test_a_drive_that_is_not_there(start: Start, client: Client, facts: Facts) -> None:
    one = start(online=False, **facts.hasty)
    one.online()
    one.played['conveyor'].fault('off')
    wait_until(lambda: not one.node.drives['conveyor'].session.online)
    client.listen()
    # the first is tried, the others fail at once
    assert client.get(DRIVE, 'gain', 'flag', 'ramp_time') == [None, None, None]
    client.wait_logged(f"conveyor: read gain ({facts.address_of('gain')}) and 2 more: "
                       f'{sentences.no_answer_offline()}', WARN)
    assert len([line for line in client.logged() if 'conveyor: read ' in line]) == 1
    assert client.set(DRIVE, gain=1, flag=True) == [
        (False, sentences.no_answer_offline())] * 2
    assert not client.set_atomically(DRIVE, **facts.atomic)[0]
    assert client.transition(4)
    assert client.get(DRIVE, 'gain') == [None]
    assert client.set(DRIVE, gain=1) == [(False, sentences.bridge_inactive())]
    assert enable(client) == (False, sentences.bridge_inactive())
    one.played['conveyor'].fault('ok')
    assert client.transition(3)
    one.online()
    wait_until(lambda: client.set(DRIVE, gain=1) == [(True, '')])
    assert not client.logged(ERROR)
