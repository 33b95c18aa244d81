# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A stop that came by the local way, passed on to bridges of other hosts."""

from typing import Any

from bridges import Bridge, LIFT, parameters, StartBridge
from by_hand import Line, Lines, no_ros, Run
from clients import Client, LATCHED, wait_until
from graph_builders import answer, hang, offer
import pytest
from rcl_interfaces.msg import ParameterEvent
import rclpy
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
import waiting

from drive_can_bridge.core.sentences import internal_error_in_answer
from drive_can_bridge.ros import passing
from drive_can_bridge.ros.local_way import LocalWayServer


class Far:
    """
    A bridge of another host.

    :param also: a drive that somebody else plays.
    :ivar stops: how often each drive was told to stop.
    """

    def __init__(self, client: Client, name: str, *drives: str, also: str = '') -> None:
        self.stops = dict.fromkeys(drives, 0)
        self.name = name
        answer(client, name, drives=' '.join((*drives, also)))()
        for each in drives:
            node = f'{name.rpartition("/")[0]}/{each}'
            offer(client, node, 'quick_stop', Trigger, lambda _, response, each=each: self._stop(
                each, response))
            client.node.create_publisher(Bool, f'{node}/online', LATCHED).publish(Bool(data=True))

    def _stop(self, drive: str, response: Any) -> Any:
        self.stops[drive] += 1
        response.success, response.message = True, 'stopped'
        return response


@pytest.fixture
def here(bridge: StartBridge) -> Bridge:
    """Start a bridge of this host."""
    one = bridge(parameters(lift=LIFT)).online()
    return one


def seen(here: Bridge, *names: str) -> None:
    """Wait until the bridge sees others."""
    parameter = here.node._node_parameters
    wait_until(lambda: {*names} <= {*parameter.around()[0]})
    waiting.pause(0.3)      # and until it tells so


def ask(here: Bridge, *words: str, trusted: bool = True) -> Line:
    """Ask it."""
    line = Line(here, [], trusted=trusted)
    line.ask(*words)
    return line


def answers(line: Line) -> list[list[str]]:
    """Wait for all that is said."""
    found: list[list[str]] = []

    def ended() -> bool:
        while (message := said(line)) is not None:
            found.append(message)
        return bool(found) and found[-1][0] in ('end', 'no')
    wait_until(ended)
    return found


def said(line: Line) -> list[str] | None:
    """Return the next message that says more than that it lasts."""
    while (message := line.take()) == ['passing']:
        pass
    return message


def test_a_stop_reaches_bridges_of_other_hosts_once(
        here: Bridge, client: Client, run: Run, locally: Lines, monkeypatch: pytest.MonkeyPatch,
        ) -> None:
    far = Far(client, '/far/bridge', 'hoist', 'belt')
    further = Far(client, '/further/bridge', 'arm')
    seen(here, far.name, further.name)
    locally(here)
    no_ros(monkeypatch)
    assert run('stop') == (0, ['lift: ready', 'far/hoist: stopped', 'far/belt: stopped',
                               'further/arm: stopped'], '')
    assert [*far.stops.values(), *further.stops.values()] == [1, 1, 1]
    assert run('stop', 'h*') == (0, ['far/hoist: stopped'], '')
    assert [*far.stops.values(), *further.stops.values()] == [2, 1, 1]


def test_one_of_another_host_that_hangs_is_named_and_the_others_are_stopped(
        here: Bridge, client: Client, run: Run, locally: Lines, monkeypatch: pytest.MonkeyPatch,
        bench: Any) -> None:
    far = Far(client, '/far/bridge', 'hoist')
    hang(client, '/mute/bridge')
    belt = rclpy.create_node('belt', namespace='/mute', context=client.node.context,
                             enable_rosout=False, start_parameter_services=False)
    belt.create_service(Trigger, '~/quick_stop', lambda _, response: response)  # nobody spins it
    belt.create_publisher(ParameterEvent, '~/response', 10)
    seen(here, far.name, '/mute/bridge')
    locally(here)
    no_ros(monkeypatch)
    began = bench.clock.now()
    assert run('stop') == (1, [
        'mute/bridge: NOT STOPPED: this bridge does not answer: its drives may still be running',
        'mute/belt: NOT STOPPED: no answer yet: may still be running',
        'lift: ready', 'far/hoist: stopped'], '')
    belt.destroy_node()
    assert 1.0 <= bench.clock.now() - began < 1.5
    assert far.stops == {'hoist': 1}


def test_what_nobody_sees_costs_a_bridge_nothing(here: Bridge, client: Client) -> None:
    far = Far(client, '/far/bridge', 'hoist')
    seen(here, far.name)
    runtime: Any = here.node._runtime
    names = [f'/n{number}/bridge' for number in range(500)]
    found = answers(ask(here, 'pass', *names, '', '', trusted=False))
    assert found == [['passed', name, '0', 'this bridge does not answer: its drives may still be '
                      'running', '1'] for name in names] + [['end']]
    assert runtime._passing._thread is None   # nothing was begun
    assert far.stops == {'hoist': 0}


def test_strangers_hold_up_nobody(here: Bridge, client: Client) -> None:
    far = Far(client, '/far/bridge', 'hoist')
    hang(client, '/mute/bridge')
    seen(here, far.name, '/mute/bridge')
    strange = [ask(here, 'pass', '/mute/bridge', '', '', f'word{number}', trusted=False)
               for number in range(3 * passing.STRANGERS_AT_ONCE)]
    waiting.pause(0.1)
    runtime: Any = here.node._runtime
    assert len(runtime._passing._under_way) == passing.STRANGERS_AT_ONCE
    ours = ask(here, 'pass', far.name, '', '')
    assert answers(ours)[-2:] == [['passed', '/far/hoist', '1', 'stopped', '0'], ['end']]
    assert not any(said(line) for line in strange)
    for each in strange:
        assert answers(each)[-1] == ['end']


def test_the_same_at_the_same_time_is_passed_on_once_more_at_most(
        here: Bridge, client: Client) -> None:
    far = Far(client, '/far/bridge', 'hoist')
    seen(here, far.name)
    lines = [ask(here, 'pass', far.name, '', '') for _ in range(100)]
    for each in lines:
        assert answers(each) == [['drives', '/far/hoist'],
                                 ['passed', '/far/hoist', '1', 'stopped', '0'], ['end']]
    assert 1 <= far.stops['hoist'] <= 2


def test_the_same_once_more_does_not_wait_for_a_drive_that_hangs(
        here: Bridge, client: Client) -> None:
    """The others of its bridge may have been enabled again meanwhile."""
    far = Far(client, '/far/bridge', 'hoist', also='belt')
    belt = rclpy.create_node('belt', namespace='/far', context=client.node.context,
                             enable_rosout=False, start_parameter_services=False)
    belt.create_service(Trigger, '~/quick_stop', lambda _, response: response)  # nobody spins it
    seen(here, far.name)
    first = ask(here, 'pass', far.name, '', '')
    wait_until(lambda: far.stops['hoist'] == 1)
    waiting.pause(0.3)
    again = ask(here, 'pass', far.name, '', '')
    waiting.pause(0.7)
    assert far.stops['hoist'] == 2
    assert not (said(first) or said(again))     # both wait for the belt
    for _ in range(4):      # and say so
        waiting.pause(0.3)
        assert first.take() == again.take() == ['passing']
    belt.destroy_node()


def test_drives_that_have_theirs_are_left_alone(here: Bridge, client: Client) -> None:
    far = Far(client, '/far/bridge', 'hoist', 'belt')
    seen(here, far.name)
    assert answers(ask(here, 'pass', far.name, '', '/far/hoist', '/lift', '', '/far/*')) == [
        ['drives', '/far/hoist', '/far/belt'], ['passed', '/far/belt', '1', 'stopped', '0'],
        ['end']]
    assert far.stops == {'hoist': 0, 'belt': 1}


def test_a_policy_that_forbids_it_is_told(
        here: Bridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    far = Far(client, '/far/bridge', 'hoist')
    seen(here, far.name)

    def refused(*_: Any, **__: Any) -> None:
        raise RuntimeError('create_client: not found in allow rule, at ./src/client.c:9')
    monkeypatch.setattr(passing, 'StopRequests', refused)
    assert answers(ask(here, 'pass', far.name, '', '')) == [
        ['drives'],
        ['passed', '/far/bridge', '0', 'a stop cannot be passed on to this bridge (create_client: '
         'not found in allow rule): its drives may still be running', '1'], ['end']]


def test_where_it_is_not_passed_on_ros_brings_it(
        here: Bridge, client: Client, run: Run, locally: Lines, monkeypatch: pytest.MonkeyPatch,
        ) -> None:
    far = Far(client, '/far/bridge', 'hoist')
    seen(here, far.name)
    locally(here)
    monkeypatch.setattr(LocalWayServer, '_pass', lambda _, asked: asked.refuse('what is that?'))
    assert run('stop') == (0, ['lift: ready', 'far/hoist: stopped'], '')
    assert far.stops == {'hoist': 1}


def test_a_defect_costs_one_answer_and_not_all_that_come(
        here: Bridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    far = Far(client, '/far/bridge', 'hoist')
    seen(here, far.name)

    def fails(_: Any) -> None:
        raise MemoryError('limit')
    with monkeypatch.context() as patch:
        patch.setattr(passing._Way, 'answer', fails)
        ask(here, 'pass', far.name, '', '')
        client.listen()
        client.wait_logged(internal_error_in_answer('MemoryError', 'limit'))
    assert answers(ask(here, 'pass', far.name, '', ''))[-1] == ['end']
    assert far.stops == {'hoist': 2}


@pytest.mark.parametrize('words', [
    ('stop', '*', *(f'x{number}*' for number in range(17))), ('stop', '*', 257 * '*'),
    ('stop', 257 * '?'),
    ('pass', '/far/bridge', '', '', *(f'x{number}*' for number in range(17)))])
def test_patterns_that_take_long_are_refused(here: Bridge, words: tuple[str, ...]) -> None:
    assert answers(ask(here, *words)) == [['no', 'too many patterns']]
