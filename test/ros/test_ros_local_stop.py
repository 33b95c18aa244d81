# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can stop`` by the local way: who is asked, by which way, and what is said of them."""

from collections.abc import Callable, Iterator
import json
import os
from types import SimpleNamespace
from typing import Any

from bridges import LIFT, parameters, StartBridge
from by_hand import Lines, no_ros, Run
from clients import Client, wait_until
import pytest

from drive_can_bridge.cli import hand
from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.process.presence import Presence

HOIST = {**LIFT, 'station': 3}


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no command become part of the graph."""
    no_ros(monkeypatch)


def states(bridge: Any) -> list[str]:
    """Return whether drives run: 'online' where they are enabled, armed or not."""
    return [{'not armed': 'online'}.get(each.session.state.value, each.session.state.value)
            for each in bridge.node.drives.values()]


@pytest.mark.usefixtures('alone')
def test_ros_is_not_needed_where_all_are_here(
        bridge: StartBridge, run: Run, locally: Lines) -> None:
    one = bridge(parameters(lift=LIFT, hoist=HOIST), arguments=('-r', '__ns:=/a'))
    two = bridge(parameters(lift=LIFT), arguments=('-r', '__ns:=/b'))
    for each in (one, two):
        each.online()
        each.node.drives['lift'].command(ControlAction.ENABLE, lambda _: None)
    wait_until(lambda: states(one) + states(two) == ['online', 'disabled', 'online'])
    locally(one, two)
    assert run('stop') == (0, ['a/lift: ready', 'a/hoist: ready', 'b/lift: ready'], '')
    assert states(one) + states(two) == ['disabled'] * 3
    assert sorted(locally.asked) == [['stop', '*']] * 2
    assert run('stop', '--namespace', 'b')[1] == ['b/lift: ready']
    assert run('stop', 'l*', '/a/hoist')[1] == ['a/lift: ready', 'a/hoist: ready', 'b/lift: ready']
    assert run('stop', 'crane', 'hoist') == (1, [
        'crane: NOT STOPPED: no such drive; there are: a/lift, a/hoist, b/lift',
        'a/hoist: ready'], '')


def test_the_log_says_whose_process_asked_for_what(
        bridge: StartBridge, client: Client, run: Run, locally: Lines) -> None:
    one = bridge(parameters(lift=LIFT)).online()
    locally(one)
    for command, action in (('enable', 'enable'), ('stop', 'quick stop'),
                            ('disable', 'disable'), ('reset', 'reset fault')):
        assert run(command, 'lift')[0] == 0
        said = client.wait_logged(sentences.asked_on_host(
            action=action, whom='user robot, process 4321'))
        assert said.startswith('lift: ') and said not in client.logged()


@pytest.mark.usefixtures('alone')
def test_other_domains_are_stopped_too_unless_something_is_named(
        bridge: StartBridge, run: Run, locally: Lines, monkeypatch: pytest.MonkeyPatch) -> None:
    here = bridge(parameters(lift=LIFT), arguments=('-r', '__ns:=/a'))
    domain = here.context.get_domain_id()
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain + 1))
    there = bridge(parameters(lift=LIFT), arguments=('-r', '__ns:=/b'))
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    for each in (here, there):
        each.online()
    locally(here, there)
    assert run('stop') == (0, ['a/lift: ready', f'[domain {domain + 1}] b/lift: ready'], '')
    documents = [json.loads(line) for line in run('stop', '--json')[1]]
    assert documents == [
        {'drive': 'a/lift', 'ok': True, 'message': 'ready', 'code': ''},
        {'drive': 'b/lift', 'ok': True, 'message': 'ready', 'code': '',
         'domain': domain + 1}]
    locally.asked.clear()
    assert run('stop', 'lift') == (0, ['a/lift: ready'], '')
    assert locally.asked == [['stop', '*', 'lift']]


def test_where_only_other_domains_have_bridges_it_is_said_that_this_one_has_none(
        bridge: StartBridge, run: Run, locally: Lines, monkeypatch: pytest.MonkeyPatch) -> None:
    there = bridge(parameters(lift=LIFT), arguments=('-r', '__ns:=/b')).online()
    domain = there.context.get_domain_id()
    locally(there)
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain + 1))
    assert run('stop') == (0, [
        f'[domain {domain}] b/lift: ready',
        f'no configured bridge is running (ROS domain {domain + 1})'], '')
    # a name means this domain: whoever forgot an export is told of the other one
    none = (f'no configured bridge is running (ROS domain {domain + 1}); a bridge of this host '
            f'runs in ROS domain {domain}: `drive_can stop` without a name stops it, too; for the '
            f'rest export ROS_DOMAIN_ID={domain}')
    assert run('stop', 'lift') == (1, [f'NOT STOPPED: {none}'], '')
    assert run('enable', 'lift') == (1, [], f'drive_can enable: {none}\n')
    assert json.loads(run('stop', 'lift', '--json')[1][0])['code'] == 'no_bridge_running'


def test_one_that_hangs_is_named_after_a_second(
        bridge: StartBridge, run: Run, locally: Lines, bench: Any) -> None:
    one = bridge(parameters(lift=LIFT)).online()
    domain = one.context.get_domain_id()
    hung, elsewhere = Presence(domain, '/b/bridge'), Presence(domain + 1, '/c/bridge')
    locally(one, hung=('/b/bridge', '/c/bridge'))
    silent = 'does not answer here: its drives may still be running'
    try:
        began = bench.clock.now()
        assert run('stop') == (1, [
            f'b/bridge: NOT STOPPED: this bridge of this host (process {os.getpid()}) {silent}',
            f'c/bridge: NOT STOPPED: this bridge of this host (process {os.getpid()}, ROS domain '
            f'{domain + 1}) {silent}',
            'lift: ready'], '')
        assert 1.0 <= bench.clock.now() - began < 1.1
        # only what was named counts
        assert run('stop', '/lift') == (0, ['lift: ready'], '')
        assert run('stop', '--namespace', '') == (0, ['lift: ready'], '')
        assert run('stop', 'lift')[0] == 1      # the hung one may have a drive of that name
    finally:
        hung.withdraw()
        elsewhere.withdraw()


@pytest.fixture
def hung(bridge: StartBridge, locally: Lines) -> Iterator[str]:
    """Have two bridges on this host, of which one hangs; what is said of that."""
    one = bridge(parameters(lift=LIFT)).online()
    presence = Presence(one.context.get_domain_id(), '/b/bridge')
    locally(one, hung=('/b/bridge',))
    yield (f'b/bridge: NOT STOPPED: this bridge of this host (process {os.getpid()}) does not '
           'answer here: its drives may still be running')
    presence.withdraw()


def test_one_that_hangs_is_named_though_ros_takes_long_to_begin(
        run: Run, hung: str, bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    began, joined = bench.clock.now(), []

    def slow(_: Any, join: Callable[[Callable[[], Any]], Any]) -> Any:
        bench.clock.wait(began + 5.0)
        try:
            join(lambda: joined.append(True))
        except DriveCanError:
            joined.append(False)
            raise
    monkeypatch.setattr(hand, '_ros', slow)
    assert run('stop') == (1, [hung, 'lift: ready'], '')
    assert 1.0 <= bench.clock.now() - began < 1.1
    wait_until(lambda: joined)
    assert joined == [False]    # nobody becomes part of the graph after the end


def test_without_ros_a_bridge_that_hangs_has_its_second_and_is_named(
        run: Run, hung: str, bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_way(*_: Any) -> Any:
        raise DriveCanError('no ROS')
    monkeypatch.setattr(hand, '_ros', no_way)
    began = bench.clock.now()
    assert run('stop') == (1, [hung, 'lift: ready'], '')
    assert 1.0 <= bench.clock.now() - began < 1.1


@pytest.mark.parametrize(('error', 'why'), [
    (DriveCanError('no ROS'), 'no ROS'), (RuntimeError('no rcl'), 'RuntimeError: no rcl')])
def test_whatever_keeps_ros_from_beginning_what_is_known_without_is_told(
        bridge: StartBridge, run: Run, locally: Lines, monkeypatch: pytest.MonkeyPatch,
        error: Exception, why: str) -> None:
    def no_way(*_: Any) -> Any:
        raise error
    one = bridge(parameters(lift=LIFT)).online()
    older = Presence(one.context.get_domain_id(), '/b/bridge')
    locally(one)
    monkeypatch.setattr(hand, '_ros', no_way)
    try:
        code, lines, errors = run('stop')
    finally:
        older.withdraw()
    assert (code, lines[1:]) == (1, ['lift: ready']) and lines[0].startswith('b/bridge: NOT STOP')
    assert why in errors


def test_where_the_way_through_ros_fails_midway_what_is_known_without_is_told(
        bridge: StartBridge, run: Run, locally: Lines, monkeypatch: pytest.MonkeyPatch) -> None:
    class Stop:
        """Meets a defect of rcl."""

        def __init__(self, *_: Any) -> None:
            self.know = self.leave = lambda *_: None

        def look(self, _: float) -> bool:
            """Look."""
            raise RuntimeError('rcl')

        answers = look
    one = bridge(parameters(lift=LIFT)).online()
    older = Presence(one.context.get_domain_id(), '/b/bridge')
    locally(one)
    node = SimpleNamespace(leave=lambda: None)
    monkeypatch.setattr(hand, '_ros', lambda *_: (
        SimpleNamespace(client_node=node), SimpleNamespace(StopRequests=Stop)))
    try:
        code, lines, errors = run('stop')
    finally:
        older.withdraw()
    assert (code, lines[1:]) == (1, ['lift: ready']) and 'RuntimeError: rcl' in errors
