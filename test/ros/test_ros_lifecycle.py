# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The bridge as a managed node."""

from collections import Counter
import gc
import itertools
from pathlib import Path
import random
from typing import Any

from bridges import Bridge, CONVEYOR, LIFT, parameters, StartBridge
from clients import Client, ERROR, to_messages, wait_until
from leaks import drive_nodes, threads
from lifecycle_msgs.msg import Transition, TransitionEvent
import pytest
from rcl_interfaces.srv import GetParameters, SetParameters
from repeating import again_and_again
from std_msgs.msg import Bool, Float64
from std_srvs.srv import SetBool
from waiting import clock, pause

from drive_can_bridge.core import sentences
from drive_can_bridge.ros.diagnostics import PresenceCheck
from drive_can_bridge.ros.drive_node import DriveNode

CONFIGURE, ACTIVATE = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE
DEACTIVATE, CLEANUP = Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP
UNCONFIGURED_SHUTDOWN = Transition.TRANSITION_UNCONFIGURED_SHUTDOWN
INACTIVE_SHUTDOWN = Transition.TRANSITION_INACTIVE_SHUTDOWN
ACTIVE_SHUTDOWN = Transition.TRANSITION_ACTIVE_SHUTDOWN
DRIVE = 'drive_can_bridge: drive conveyor'

LEGAL = {
    'unconfigured': {CONFIGURE: 'inactive', UNCONFIGURED_SHUTDOWN: 'finalized'},
    'inactive': {ACTIVATE: 'active', CLEANUP: 'unconfigured', INACTIVE_SHUTDOWN: 'finalized'},
    'active': {DEACTIVATE: 'inactive', ACTIVE_SHUTDOWN: 'finalized'},
    'finalized': {},
}
WAY = {'unconfigured': (), 'inactive': (CONFIGURE,), 'active': (CONFIGURE, ACTIVATE),
       'finalized': (UNCONFIGURED_SHUTDOWN,)}


def waiting(bridge: StartBridge, content: Any = None, **options: Any) -> Bridge:
    return bridge(content, autostart=False, **options)


@pytest.mark.parametrize('state', LEGAL)
def test_illegal_transitions_fail_and_do_no_harm(bridge: StartBridge, client: Client,
                                                 state: str) -> None:
    waiting(bridge)
    client.listen()
    for transition in WAY[state]:
        assert client.transition(transition)
    assert client.state() == state
    illegal = {CONFIGURE, ACTIVATE, DEACTIVATE, CLEANUP, UNCONFIGURED_SHUTDOWN,
               INACTIVE_SHUTDOWN, ACTIVE_SHUTDOWN, Transition.TRANSITION_CREATE,
               Transition.TRANSITION_DESTROY, Transition.TRANSITION_ON_CONFIGURE_SUCCESS,
               99} - set(LEGAL[state])
    for transition in illegal:
        assert not client.transition(transition)
        client.wait_logged(f'transition number {transition} is not possible in state {state}')
    assert not client.transition(label='dance')
    client.wait_logged(f'transition dance is not possible in state {state}')
    assert client.state() == state


@pytest.mark.parametrize('state, transition, target', [
    (state, transition, target) for state, targets in LEGAL.items()
    for transition, target in targets.items()])
def test_legal_transitions(bridge: StartBridge, client: Client, state: str, transition: int,
                           target: str) -> None:
    one = waiting(bridge)
    for step in WAY[state]:
        assert client.transition(step)
    assert client.transition(transition)
    assert client.state() == target
    present = target in ('inactive', 'active')
    wait_until(lambda: ('/conveyor' in client.nodes()) is present)
    wait_until(lambda: bool(one.node.drives) is present and bool(one.node.exchanges) is present)
    if target == 'active':
        one.online()


def test_labels_and_repetition(bridge: StartBridge, client: Client) -> None:
    one = waiting(bridge)
    for label, state in (('configure', 'inactive'), ('activate', 'active'),
                         ('deactivate', 'inactive'), ('activate', 'active'),
                         ('deactivate', 'inactive'), ('cleanup', 'unconfigured'),
                         ('configure', 'inactive'), ('activate', 'active'),
                         ('shutdown', 'finalized')):
        assert client.transition(label=label), label
        assert client.state() == state
        if state == 'active':
            one.online()
    client.wait_logged(sentences.shut_down())


def test_inactive_sends_nothing(bridge: StartBridge, client: Client) -> None:
    one = waiting(bridge)
    assert client.transition(CONFIGURE)
    client.listen()
    with one.record() as recorder:
        client.publish('/conveyor/command/speed_setpoint', Float64(data=0.0))
        assert client.get('/conveyor', 'ramp_time', 'nothing') == [None, None]
        assert client.set('/conveyor', ramp_time=1.0, jog_speed=1.0) == [
            (False, sentences.bridge_inactive())] * 2
        assert client.set_atomically('/conveyor', jog_speed=1.0) == (
            False, sentences.nothing_written(f'jog_speed: {sentences.bridge_inactive()}'))
        status = client.diagnostics(DRIVE)
        assert (status['state'], status['code']) == ('offline', 'activate_bridge')
        client.diagnostics('drive_can_bridge: bus main', lambda bus: bus['state'] == 'up')
        assert not recorder.requests()
    client.wait_logged('read parameters: bridge inactive')
    online = client.latched('/conveyor/online', Bool)
    wait_until(lambda: online.values == [False])


def test_a_broken_configuration_can_be_corrected(bridge: StartBridge, client: Client,
                                                 tmp_path: Path) -> None:
    profile = tmp_path / 'mine.yaml'
    good = ('protocols: [datamodel_extended]\nparameters:\n'
            '  speed: {number: 50, type: int16, storage: ram}\n'
            '  actual: {number: 209, type: int16, access: ro}\n')
    profile.write_text(good, 'utf-8')
    one = waiting(bridge, parameters(conveyor={
        **CONVEYOR, 'profile': str(profile), 'cyclic_request': ['speed'],
        'cyclic_response': ['actual']}))
    before = threads()      # those of the simulated drives
    profile.write_text(good.replace('int16', 'int17'), 'utf-8')
    for _ in range(2):
        assert not client.transition(CONFIGURE)
        assert client.state() == 'unconfigured'
    errors = wait_until(lambda: client.logged(ERROR))
    assert any(str(profile) in text and ':3:' in text and 'int17' in text for text in errors)
    assert not one.node.drives and not one.node.exchanges
    assert sorted(threads()) == sorted(before)
    profile.write_text(good, 'utf-8')
    assert client.transition(CONFIGURE)
    assert client.transition(ACTIVATE)
    one.online()


def test_a_failing_part_leaves_nothing_behind(bridge: StartBridge, client: Client,
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    from drive_can_bridge.ros import drive_node
    one = waiting(bridge, parameters(conveyor=CONVEYOR, lift=LIFT))
    before = threads()
    states = client.topic('/drive_can_bridge/transition_event', TransitionEvent)

    def fail(*_: Any, **__: Any) -> None:
        raise RuntimeError('no more services')
    monkeypatch.setattr(drive_node, 'control_services', fail)
    assert not client.transition(CONFIGURE)
    client.wait_logged('configure failed: RuntimeError: no more services', ERROR)
    # by which managed.launch.py knows it
    wait_until(lambda: [message.goal_state.label for message in states.messages] == [
        'configuring', 'errorprocessing', 'unconfigured'])
    assert client.state() == 'unconfigured'
    wait_until(lambda: not {'/conveyor', '/lift'} & set(client.nodes()))
    assert sorted(threads()) == sorted(before)
    monkeypatch.undo()
    assert client.transition(CONFIGURE) and client.transition(ACTIVATE)
    one.online()


@pytest.mark.parametrize('transition', [DEACTIVATE, ACTIVE_SHUTDOWN])
def test_stopping_sends_neutral_cycles(bridge: StartBridge, client: Client,
                                       transition: int) -> None:
    one = bridge(parameters(conveyor=CONVEYOR, lift=LIFT)).online()
    with one.record() as recorder:
        client.publish('/conveyor/command/speed_setpoint', Float64(data=0.0))
        client.publish('/conveyor/command/speed_setpoint', Float64(data=100.0))
        wait_until(lambda: recorder.words()[:1] == (1000,))
        assert client.transition(transition)
        recorder.catch_up()
        cycles = recorder.cycles()
        neutral = len(cycles) - max(place for place, words in enumerate(cycles) if words[0]) - 1
        assert neutral >= 3
        assert len(recorder.cycles(2)) >= 3
        recorder.clear()
        # some service calls later there still is silence
        for _ in range(20):
            client.state()
        assert not recorder.requests()


def test_drives_that_run_when_activate_fails_are_stopped(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    one = waiting(bridge)
    assert client.transition(CONFIGURE)
    with one.record() as recorder:
        def fail(_: PresenceCheck) -> None:
            one.online()
            for value in (0.0, 100.0):
                client.publish('/conveyor/command/speed_setpoint', Float64(data=value))
            wait_until(lambda: recorder.words()[:1] == (1000,))
            raise RuntimeError("can't start new thread")
        monkeypatch.setattr(PresenceCheck, 'begin', fail)
        assert not client.transition(ACTIVATE)
        client.wait_logged("activate failed: RuntimeError: can't start new thread", ERROR)
        recorder.catch_up()
        assert [words[0] for words in recorder.cycles()[-4:]] == [1000, 0, 0, 0]
    assert client.state() == 'unconfigured'


@pytest.mark.parametrize('steps', [(DEACTIVATE, CLEANUP), (ACTIVE_SHUTDOWN,)],
                         ids=['cleanup', 'shutdown'])
def test_callers_are_answered_before_a_drive_goes(bridge: StartBridge, client: Client,
                                                  steps: tuple[int, ...]) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'missed_limit': 100000,
                                      'parameter_timeout': 60.0})).online()
    one.played['conveyor'].fault('silent')
    futures = [client.ask('/conveyor/get_parameters', GetParameters,
                          GetParameters.Request(names=['ramp_time'])) for _ in range(10)]
    wait_until(lambda: one.node.drives['conveyor'].calls == 10)
    for step in steps:
        assert client.transition(step)
    wait_until(lambda: all(future.done() for future in futures))
    wait_until(lambda: '/conveyor' not in client.nodes())
    wait_until(lambda: not one.node._leaving)


def test_ten_rounds_leak_nothing(bridge: StartBridge, client: Client) -> None:
    one = waiting(bridge, parameters(conveyor=CONVEYOR, lift=LIFT))
    before = threads()
    entities = []
    for _ in range(10):
        assert client.transition(CONFIGURE)
        assert client.transition(ACTIVATE)
        one.online()
        assert client.get('/conveyor', 'ramp_time') != [None]
        assert client.transition(DEACTIVATE)
        assert client.transition(CLEANUP)
        assert sorted(threads()) == sorted(before)
        entities.append(sum(len(list(kind)) for kind in (
            one.node.publishers, one.node.subscriptions, one.node.timers, one.node.services,
            one.node.waitables, one.node.guards)))
    assert len(set(entities)) == 1
    wait_until(lambda: not {'/conveyor', '/lift'} & set(client.nodes()))

    def forgotten() -> bool:
        pause(0.2)
        client.state()  # an executor forgets what it did last when it does something else
        return drive_nodes() == 0
    wait_until(forgotten, what='drive nodes to be forgotten')
    gc.collect()


#: calls that traffic has under way at most
UNDER_WAY = 50


def test_any_order_during_traffic(bridge: StartBridge, client: Client) -> None:
    """Sixty transitions by chance, legal and illegal, while everybody uses the drives."""
    waiting(bridge, parameters(conveyor=CONVEYOR, lift=LIFT))
    commands = [client.node.create_publisher(Float64, f'/{drive}/command/speed_setpoint', 10)
                for drive in ('conveyor', 'lift')]
    reads = [client.node.create_client(GetParameters, f'/{drive}/get_parameters')
             for drive in ('conveyor', 'lift')]
    writes = client.node.create_client(SetParameters, '/conveyor/set_parameters')
    enable = client.node.create_client(SetBool, '/lift/enable')
    futures: list[Any] = []
    numbers = itertools.count(1)

    def traffic() -> None:
        value = next(numbers)
        for publisher in commands:
            publisher.publish(Float64(data=float(value % 3)))
        # what a slow machine cannot answer would keep everybody's calls waiting for minutes
        if sum(not future.done() for future in futures[-UNDER_WAY:]) == UNDER_WAY:
            return
        futures.extend(
            entry.call_async(GetParameters.Request(names=['ramp_time', 'actual_speed']))
            for entry in reads if entry.service_is_ready())
        if writes.service_is_ready():
            futures.append(writes.call_async(SetParameters.Request(
                parameters=to_messages({'jog_speed': float(value % 100)}))))
        if enable.service_is_ready() and value % 10 == 0:
            futures.append(enable.call_async(SetBool.Request(data=value % 20 == 0)))
    with again_and_again(traffic, 0.01):
        state, chance = 'unconfigured', random.Random(6)
        everything = (CONFIGURE, ACTIVATE, DEACTIVATE, CLEANUP)
        taken = Counter[str]()
        for _ in range(60):
            transition = chance.choice(everything)
            target = LEGAL[state].get(transition)
            assert client.transition(transition) is (target is not None)
            state = target or state
            taken[state] += 1
            assert client.state() == state
        assert set(taken) == {'unconfigured', 'inactive', 'active'}
        for transition in {'unconfigured': (CONFIGURE, ACTIVATE), 'inactive': (ACTIVATE,),
                           'active': ()}[state]:
            assert client.transition(transition)
        # and it still works, ~/enable included
        wait_until(lambda: client.get('/conveyor', 'actual_speed') != [None])
        wait_until(lambda: any(getattr(future.result(), 'success', False)
                               for future in list(futures) if future.done()))
    wait_until(lambda: client.get('/lift', 'actual_speed') != [None])
    answers = [future.result() for future in futures if future.done()]
    assert any(getattr(answer, 'success', False) for answer in answers)  # ~/enable
    assert any(values and values[0].type for values in (
        getattr(answer, 'values', None) for answer in answers))


def test_a_drive_whose_caller_still_waits_is_looked_at_now_and_then(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever answers it has its turn meanwhile: nobody goes round in circles."""
    bridge()
    answered_at = clock().now() + 1.0
    looks: list[float] = []

    def answer_all(_: DriveNode) -> bool:
        looks.append(clock().now())
        return looks[-1] >= answered_at
    monkeypatch.setattr(DriveNode, 'answer_all', answer_all)
    assert client.transition(DEACTIVATE)
    assert client.transition(CLEANUP)
    wait_until(lambda: looks[-1] >= answered_at)
    assert 10 < len(looks) < 500


def test_dynamic_parameters_survive_a_new_configuration(bridge: StartBridge,
                                                        client: Client) -> None:
    content = parameters()
    del content['drives']['conveyor']['command_timeout']
    one = bridge(content)
    assert client.set('/drive_can_bridge', drives__conveyor__command_timeout=7,
                      drives__conveyor__rearm='immediate', diagnostics_period=0.2) == [
        (True, '')] * 3
    for transition in (DEACTIVATE, CLEANUP, CONFIGURE, ACTIVATE):
        assert client.transition(transition)
    setpoints = one.node.drives['conveyor'].session.setpoints
    assert setpoints.timeout == 7.0 and setpoints.rearm_immediate


def test_no_transition_after_the_end_has_begun(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    assert client.transition(DEACTIVATE)
    one.node.stop()
    assert not client.transition(ACTIVATE)
    client.wait_logged('transition number 3 is not possible in state inactive '
                       '(the bridge is being stopped)')


class _Taken:
    """A lock that a transition has for longer than anybody waits."""

    def acquire(self, timeout: float) -> bool:
        return False


def test_the_end_stops_drives_whatever_a_transition_is_at(bridge: StartBridge, client: Client,
                                                          ) -> None:
    one = bridge().online()
    with one.record() as recorder:
        client.publish('/conveyor/command/speed_setpoint', Float64(data=0.0))
        client.publish('/conveyor/command/speed_setpoint', Float64(data=100.0))
        wait_until(lambda: recorder.words()[:1] == (1000,))
        one.node._transition_lock = _Taken()    # type: ignore[assignment]
        one.node.stop()
        recorder.catch_up()
        assert [words[0] for words in recorder.cycles()[-3:]] == [0, 0, 0]
        assert one.node.drives['conveyor'].session.stopped


def test_at_the_end_no_drive_leaves_before_its_callers_have_their_answers(
        bridge: StartBridge, monkeypatch: pytest.MonkeyPatch) -> None:
    """But one whose answer cannot be sent does not keep the process."""
    waits = {'conveyor': 5, 'lift': 1_000_000}
    left: dict[str, int] = {}

    def answer_all(drive: DriveNode) -> bool:
        waits[drive.name] -= 1
        return waits[drive.name] < 0

    def destroy(drive: DriveNode) -> None:
        left[drive.name] = waits[drive.name]
        really(drive)
    really = DriveNode.destroy
    monkeypatch.setattr(DriveNode, 'answer_all', answer_all)
    monkeypatch.setattr(DriveNode, 'destroy', destroy)
    bridge(parameters(conveyor=CONVEYOR, lift=LIFT)).close()
    assert left['conveyor'] < 0 < left['lift']
