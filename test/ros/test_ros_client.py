# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The way to drives through a running bridge: the same answers as directly."""

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

from bridges import Bridge, CONVEYOR, HASTY, LIFT, parameters, StartBridge
from builders import RAMP
from clients import Client, wait_until
from graph_builders import answer, hang, offer
from lifecycle_msgs.srv import ChangeState
import plant
import pytest
from rcl_interfaces.srv import GetParameterTypes, ListParameters, SetParameters
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.qos import qos_profile_parameters
from rclpy.task import Future
from waiting import clock, pause

from drive_can_bridge.client import find_source, open_drives
from drive_can_bridge.client.bridge import BridgedDrive
from drive_can_bridge.client.drive import Drive, Enabled
from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import DriveCanError, SilentBridge, WhichBridge
from drive_can_bridge.core.parameters import AccessMode, Storage
from drive_can_bridge.core.roles import Role
from drive_can_bridge.ros.client import calls, graph, search

PUMP = {**plant.PUMP, 'missed_limit': 100}
MIXER = {**plant.MIXER, 'missed_limit': 100, 'parameter_timeout': 2.0}


def reasons(outcomes: dict[str, Any]) -> dict[str, str]:
    return {name: outcome.reason for name, outcome in outcomes.items()}


def test_everything_of_four_families(bridge: StartBridge) -> None:
    one = bridge(parameters(conveyor=CONVEYOR, lift=LIFT, mixer=MIXER, pump=PUMP),
                 arguments=('-r', '__ns:=/cell')).online()
    source = find_source(namespace='/cell')
    assert list(source.names) == ['conveyor', 'lift', 'mixer', 'pump']
    assert 'ramp_time' in source.parameter_names('lift')
    with source.open(source.names) as drives:
        for name, drive in drives.items():
            outcomes = drive.read()
            assert set(reasons(outcomes).values()) == {''}, name
            _compare(drive, one)
        _values(drives['conveyor'], one)
        _refusals(drives['conveyor'], drives['lift'], one)
        assert drives['lift'].enabled() is Enabled.NO
        assert drives['conveyor'].enabled() is Enabled.UNKNOWN
        assert drives['mixer'].enabled() is Enabled.NO
        assert drives['pump'].identity().startswith('controller_reference_1=')
        assert 'actual_frequency' in drives['mixer'].read()     # received as process data
        assert 'frequency_setpoint' not in drives['mixer'].read()


def _compare(drive: Drive, bridge: Bridge) -> None:
    """Compare what the bridge tells of its drive with what it knows."""
    configuration = bridge.node.drives[drive.name].drive
    facts = drive.facts
    assert (facts.bus, facts.interface, facts.bitrate, facts.through) == (
        'main', 'virtual', 1_000_000, '/cell/drive_can_bridge')
    assert (facts.protocol, facts.station, facts.profile, facts.profile_sha256) == (
        configuration.protocol, configuration.station, configuration.profile_key,
        configuration.profile.sha256)
    assert facts.restore == configuration.profile.restore
    assert list(drive.parameters) == list(configuration.profile.parameters)
    for mine, known in zip(drive.parameters.values(), configuration.profile.parameters.values()):
        for key in ('name', 'type', 'number', 'subindex', 'index', 'scale', 'offset', 'unit',
                    'access', 'storage', 'protected', 'scaled', 'kind', 'address', 'listed'):
            assert getattr(mine, key) == getattr(known, key), (known.name, key)
        assert mine.description == known.description
        assert mine.raw_limits == known.raw_limits or known.raw_limits[0] >= known.raw_limits[1]


def _values(conveyor: Drive, bridge: Bridge) -> None:
    written = conveyor.write({'ramp_time': 3.25, 'p31': 15000})
    assert set(reasons(written).values()) == {''}
    assert bridge.played['conveyor'].value('ramp_time') == 3.25
    outcomes = conveyor.read('ramp_time', 'p30', 'maximum_speed', 'brake_enabled')
    assert [(each.raw, each.value) for each in outcomes.values()] == [
        (325, 3.25), (325, 325), (15000, 1500.0), (0, False)]
    raw = conveyor.find('p30')
    assert raw is not None
    assert (raw.listed, raw.access, raw.storage) == (False, AccessMode.READ_WRITE, Storage.EEPROM)


RAMP_RANGE = '0.01 to 60 s'


def _refusals(conveyor: Drive, lift: Drive, bridge: Bridge) -> None:
    assert reasons(conveyor.write({
        'ramp_tim': 1.0, 'actual_speed': 1.0, 'ramp_time': 99.0, 'speed_setpoint': 5.0,
        'p122': 50})) == {
        'ramp_tim': sentences.unknown_parameter('ramp_tim', 'ramp_time'),
        'actual_speed': sentences.read_only(),
        'ramp_time': sentences.out_of_range('99', RAMP_RANGE),
        'speed_setpoint': sentences.sent_cyclically('speed_setpoint'),
        'p122': sentences.mapping_parameter()}
    assert reasons(lift.write({'control_word': 1})) == {'control_word': 'use ~/enable'}
    assert conveyor.role('speed_setpoint') is Role.CYCLIC
    bridge.played['conveyor'].fault('stuck=jog_speed')
    outcome = conveyor.write({'jog_speed': 12.5})['jog_speed']
    assert (outcome.ok, outcome.reason) == (
        False, sentences.read_back_differs('-100', '12.5'))


def test_what_fails_says_why(bridge: StartBridge) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, **HASTY})).online()
    with open_drives() as drives:
        conveyor = drives['conveyor']
        assert reasons(conveyor.read('p9999', 'ramp_time', 'bogus', '\udcff')) == {
            'p9999': sentences.no_answer(0.2, 3), 'ramp_time': '',
            'bogus': sentences.unknown_parameter('bogus'),
            # as Python takes a word that is no text in the encoding of the terminal
            '\udcff': sentences.unknown_parameter('\\udcff')}
        one.played['conveyor'].fault('silent')
        wait_until(lambda: not one.node.drives['conveyor'].session.online)
        assert reasons(conveyor.read('ramp_time', 'maximum_speed')) == {
            name: sentences.no_answer_offline() for name in ('ramp_time', 'maximum_speed')}
        one.node.trigger_deactivate()
        assert reasons(conveyor.read('ramp_time')) == {'ramp_time': 'bridge inactive'}
        assert conveyor.write({'ramp_time': 2.0})['ramp_time'].reason == 'bridge inactive'


def test_after_the_end(bridge: StartBridge) -> None:
    bridge(parameters()).online()
    with open_drives() as drives:
        conveyor = drives['conveyor']
    for ask in (conveyor.read, conveyor.enabled, conveyor.identity, lambda: conveyor.find('p30'),
                lambda: conveyor.write({'ramp_time': 1.0})):
        with pytest.raises(DriveCanError, match='^the way to the bridge is closed already$'):
            ask()


def test_several_bridges_and_none(bridge: StartBridge, client: Client) -> None:
    with pytest.raises(DriveCanError, match='^no configured bridge is running in namespace /no'):
        open_drives(namespace='no')
    for one in (bridge(parameters(), arguments=('-r', '__ns:=/a')), bridge(
            parameters(), arguments=('-r', '__ns:=/b', '-r', '__node:=other'), key='/**')):
        one.online()    # before it is configured it has no drives
    for name in ('/a/drive_can_bridge', '/b/other'):    # who has begun a moment ago is not known
        wait_until(partial(_sees, client, name, '/a/drive_can_bridge', '/b/other'))
    with pytest.raises(WhichBridge, match='/a/drive_can_bridge, /b/other; choose one with'):
        open_drives()
    with open_drives(namespace='b') as drives:
        assert list(drives) == ['conveyor']
        assert drives['conveyor'].facts.through == '/b/other'


def _sees(client: Client, bridge: str, *others: str) -> bool:
    return client.get(bridge, 'bridges') == [list(others)]


def test_services_that_are_found_one_by_one(client: Client) -> None:
    def greet(_: Any, response: Any) -> Any:
        def later() -> None:
            pause(0.5)
            tell()
        clock().worker(later, 'later').start()
        return response
    tell = answer(client, '/slow/bridge', drives='conveyor lift', greet=greet)
    source = find_source(namespace='slow')
    assert list(source.names) == ['conveyor', 'lift']
    source.close()


def test_a_bridge_says_which_others_there_are(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(), arguments=('-r', '__ns:=/b'))
    own = '/b/drive_can_bridge'
    assert client.get(own, 'bridges') == [[own]]
    hang(client, '/a/bridge')
    offer(client, '/robot/controller', 'change_state', ChangeState)     # hangs, but is no bridge
    wait_until(partial(_sees, client, own, '/a/bridge', own))
    (changed, _), = client.set(own, bridges=['/c'])
    assert not changed
    one.node.trigger_deactivate()
    one.node.trigger_cleanup()
    assert client.get(own, 'bridges') == [['/a/bridge', own]]


def test_what_can_be_no_name_in_the_graph_keeps_no_answer_back(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """A participant of DDS that is no ROS may call its services anything."""
    one = bridge(parameters())
    own = '/drive_can_bridge'
    told = one.node.get_service_names_and_types()
    odd = [(f'{name}/{service}', [kind])
           for name in ('/9/bridge', '/a b', '//x', '', f'/{240 * "x"}') for service, kind in (
               ('change_state', 'lifecycle_msgs/srv/ChangeState'),
               ('save_trace', 'std_srvs/srv/Trigger'))]
    monkeypatch.setattr(one.node, 'get_service_names_and_types', lambda: [*told, *odd])
    assert client.get(own, 'bridges') == [[own]]


def test_one_that_hangs_counts(bridge: StartBridge, client: Client) -> None:
    """Which of two drives of one name is meant, nobody knows."""
    bridge(parameters()).online()
    hang(client, '/other/bridge')
    wait_until(partial(_sees, client, '/drive_can_bridge', '/drive_can_bridge', '/other/bridge'))
    with pytest.raises(WhichBridge, match='/drive_can_bridge, /other/bridge; choose one with'):
        find_source()


def test_one_that_this_process_has_not_seen_yet_counts(client: Client) -> None:
    answer(client, '/first/bridge', others=['/second/bridge'])()
    with pytest.raises(WhichBridge, match='/first/bridge, /second/bridge; choose one with'):
        find_source()
    source = find_source(namespace='first')
    assert list(source.names) == ['conveyor']
    source.close()


@pytest.mark.parametrize('others', [[], ['/cell/other']])
def test_two_of_one_name_are_two(client: Client, others: list[str]) -> None:
    answer(client, '/cell/bridge', others=['/cell/bridge', *others])()
    with pytest.raises(WhichBridge, match='^2 bridges are called /cell/bridge'):
        find_source(namespace='cell')


def test_somebody_elses_managed_node_that_hangs_blocks_nobody(
        bridge: StartBridge, client: Client) -> None:
    offer(client, '/robot/controller', 'change_state', ChangeState)
    bridge(parameters()).online()
    source = find_source()
    assert list(source.names) == ['conveyor']
    source.close()


def test_an_answer_that_is_lost_is_asked_for_again(
        client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calls, 'AGAIN', 0.3)
    asked: dict[str, int] = {}

    def answers(name: str) -> Callable[[Any, Any], Any]:
        async def answer(_: Any, response: Any) -> Any:
            asked[name] = asked.get(name, 0) + 1
            if asked[name] == 1:
                await Future()   # never
            return response
        return answer
    # each call by itself: others do not wait for what has no end
    services = {'get_parameter_types': GetParameterTypes, **calls.ASKING,
                'set_parameters': SetParameters}
    for name, kind in services.items():
        forgets = name in ('list_parameters', 'set_parameters')
        client.node.create_service(
            kind, f'/forgetful/{name}', answers(name) if forgets else lambda _, given: given,
            qos_profile=qos_profile_parameters, callback_group=ReentrantCallbackGroup())
    here = graph.Graph(clock())
    try:
        here.call('/forgetful', 'list_parameters', ListParameters.Request())
        assert asked['list_parameters'] == 2
        # what changes something is not done twice
        with pytest.raises(graph.NoAnswer, match='does not answer for 1 s') as caught:
            here.call('/forgetful', 'set_parameters', SetParameters.Request(), 1.0)
        assert caught.value.asked
        assert asked['set_parameters'] == 1
        with pytest.raises(graph.NoAnswer) as caught:
            here.call('/nobody', 'set_parameters', SetParameters.Request(), 1.0)
        assert not caught.value.asked
    finally:
        here.close()


@pytest.mark.parametrize('asked', [True, False])
def test_a_write_that_nobody_answers_is_in_doubt_once_it_was_sent(asked: bool) -> None:
    trouble = graph.NoAnswer('/lift has gone', asked=asked)

    def call(*_: Any) -> None:
        raise trouble
    way: Any = SimpleNamespace(set=call)
    unasked: Any = None
    drive = BridgedDrive('lift', way, '/lift', {RAMP.name: RAMP}, {}, unasked)
    told: list[Any] = []
    with pytest.raises(graph.NoAnswer):
        drive.write({RAMP.name: 1.5}, told=told.append)
    assert [outcome.reason.code for outcome in told] == ['write_not_confirmed'] * asked


def test_what_may_be_a_bridge_and_answers_nothing_is_named(
        client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, '_ANSWER_TIMEOUT', 1.0)
    hang(client, '/mute/bridge')
    offer(client, '/mute/bridge', 'get_parameter_types', GetParameterTypes)
    with pytest.raises(SilentBridge, match=r'^no bridge answers in namespace /mute \(ROS domain '
                                           r'\d+\): /mute/bridge does not, for [1-9]\d* s '
                                           r'\(the computer may be busy\)$'):
        find_source(namespace='mute')


def test_a_second_bridge_with_the_same_drive_does_not_configure(bridge: StartBridge) -> None:
    first = bridge()
    text = first.file.read_text()
    second = bridge(text, autostart=False, simulated=False,
                          arguments=('-r', '__ns:=/second'))
    assert second.node.trigger_configure().name == 'FAILURE'
    first.node.trigger_deactivate()
    assert second.node.trigger_configure().name == 'FAILURE'    # held until cleanup
    first.node.trigger_cleanup()
    assert second.node.trigger_configure().name == 'SUCCESS'
    second.node.trigger_cleanup()


@pytest.mark.parametrize(('state', 'control_state', 'enabled'), [
    ('online', 'operation enabled', Enabled.YES),
    ('disabled', 'switch on disabled', Enabled.NO), ('disabled', 'ready', Enabled.NO),
    ('disabled', 'disable sent', Enabled.NO), ('fault', 'fault', Enabled.NO),
    # told to stop, or not enabled yet, and the motor may move
    ('disabled', 'operation enabled', Enabled.YES), ('disabled', 'enabled', Enabled.YES),
    ('disabled', 'quick stop active', Enabled.YES), ('disabled', 'quick stop', Enabled.YES),
    ('fault', 'fault reaction active', Enabled.YES), ('disabled', 'enable sent', Enabled.YES),
    ('disabled', 'mixer: ready to switch on, fan: operation enabled', Enabled.YES),
    ('offline', 'unknown', Enabled.UNKNOWN)])
def test_a_drive_counts_as_enabled_while_its_motor_may_move(
        state: str, control_state: str, enabled: Enabled) -> None:
    way: Any = SimpleNamespace(condition=lambda *_, **__: {
        'state': state, 'control_state': control_state})
    knowledge: Any = SimpleNamespace(period=lambda _: 1.0)
    assert BridgedDrive('lift', way, '/lift', {}, {}, knowledge).enabled() is enabled
