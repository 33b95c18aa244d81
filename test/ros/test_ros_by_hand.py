# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can stop``, ``enable``, ``disable``, ``reset``: told by hand, through bridges."""

import json
import os
from pathlib import Path
import re
from typing import Any

from bridges import LIFT, parameters, StartBridge
from by_hand import Lines, no_ros, no_way, Run
from clients import Client, LATCHED, wait_until
from graph_builders import answer, hang, offer
import pytest
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from transcripts import replayed, shown, stories
import waiting

from drive_can_bridge.cli.main import main
from drive_can_bridge.process import local_stop
from drive_can_bridge.process.presence import Presence

HOIST = {**LIFT, 'station': 3}
STORIES = stories(__file__, 'by_hand.yaml')


def replay(story: str, run: Run) -> None:
    """Run the commands of a story, and compare what they show."""
    def step(step: str) -> list[str]:
        code, lines, errors = run(*step.split())
        return [re.sub(r'domain \d+', 'domain N', line)
                for line in shown(lines, errors.splitlines(), code)]
    assert replayed(STORIES[story], step) == STORIES[story]


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have nobody look for a bridge."""
    no_ros(monkeypatch)
    monkeypatch.setattr(local_stop, 'bridges', no_way)


def pause() -> None:
    """Let a quarter of a second pass."""
    clock = waiting.clock()
    clock.wait(clock.now() + 0.25)


def states(bridge: Any, *names: str) -> list[str]:
    """Return whether drives run: 'online' where they are enabled, armed or not."""
    return [{'not armed': 'online'}.get(state, state) for state in (
        bridge.node.drives[name].session.state.value for name in names)]


def test_stop_stops_every_drive_of_every_bridge(bridge: StartBridge, run: Run) -> None:
    one = bridge(parameters(lift=LIFT, hoist=HOIST), arguments=('-r', '__ns:=/a')).online()
    two = bridge(parameters(lift=LIFT), arguments=('-r', '__ns:=/b')).online()
    assert run('enable', '/a/lift', '/a/hoist', '/b/lift')[0] == 0
    assert states(one, 'lift', 'hoist') == states(two, 'lift') * 2 == ['online'] * 2
    code, lines, errors = run('stop')
    assert (code, errors) == (0, '')
    assert sorted(line.partition(':')[0] for line in lines) == ['a/hoist', 'a/lift', 'b/lift']
    assert {*states(one, 'lift', 'hoist'), *states(two, 'lift')} == {'disabled'}


def test_names_patterns_and_namespaces(
        bridge: StartBridge, run: Run, locally: Lines) -> None:
    one = bridge(parameters(lift=LIFT, hoist=HOIST), arguments=('-r', '__ns:=/a')).online()
    two = bridge(parameters(lift=LIFT), arguments=('-r', '__ns:=/b')).online()

    def run_all() -> None:
        assert run('enable', '/a/lift', '/a/hoist', '/b/lift')[0] == 0
    run_all()
    replay('an unknown name keeps nobody from being stopped', run)
    assert states(one, 'lift', 'hoist') == ['online', 'disabled']
    assert run('stop', '--namespace', 'b', '--yes')[0] == 0
    assert (states(one, 'lift'), states(two, 'lift')) == (['online'], ['disabled'])
    run_all()
    assert run('stop', '/a/*')[0] == 0
    assert (states(one, 'lift', 'hoist'), states(two, 'lift')) == (['disabled'] * 2, ['online'])
    run_all()
    assert run('stop', 'l*')[0] == 0
    assert (states(one, 'lift', 'hoist'), states(two, 'lift')) == (
        ['disabled', 'online'], ['disabled'])
    replay('which lift, and no crane', run)
    locally(one, two)
    replay('which lift, and no crane', run)
    run_all()
    assert run('disable', '--namespace', 'a', '*')[0] == 0
    assert (states(one, 'lift', 'hoist'), states(two, 'lift')) == (['disabled'] * 2, ['online'])


def test_one_that_hangs_is_named_first_and_the_others_are_stopped(
        bridge: StartBridge, client: Client, run: Run) -> None:
    one = bridge(parameters(lift=LIFT)).online()
    assert run('enable', 'lift')[0] == 0
    hang(client, '/b/bridge')
    replay('one bridge hangs', run)
    assert states(one, 'lift') == ['disabled']


def test_where_online_is_called_otherwise_diagnostics_say_it(
        bridge: StartBridge, run: Run) -> None:
    bridge(parameters(lift=LIFT), arguments=('-r', 'lift:~/online:=/belt/on')).online()
    assert run('stop') == (0, ['lift: ready'], '')


def test_a_name_that_is_none_keeps_nobody_from_being_stopped(
        bridge: StartBridge, client: Client, run: Run) -> None:
    one = bridge(parameters(lift=LIFT)).online()
    answer(client, '/a/bridge', others=['/b b/bridge', ''], drives='-')()
    liar = Presence(one.context.get_domain_id(), '/-/bridge')   # any user may say so
    try:
        code, lines, _ = run('stop')
        assert (code, lines) == (1, [
            '-/bridge: NOT STOPPED: this bridge of this host '
            f'(process {os.getpid()}) does not answer here: its drives may still be running',
            'lift: ready'])
    finally:
        liar.withdraw()


def test_nobody_knows_which_drives_there_are_where_no_bridge_answers(
        client: Client, run: Run) -> None:
    hung = Presence(client.node.context.get_domain_id(), '/a/bridge')
    try:
        code, lines, _ = run('stop', 'lift')
        assert code == 1 and len(lines) == 1
        assert lines[0].startswith('a/bridge: NOT STOPPED: this bridge of this host ')
    finally:
        hung.withdraw()


def test_one_that_another_one_sees_is_named(
        client: Client, run: Run) -> None:
    answer(client, '/a/bridge', others=['/b/bridge'], drives='')()
    replay('another bridge sees one', run)


def test_one_that_holds_drives_of_this_host_is_named(
        bridge: StartBridge, run: Run) -> None:
    one = bridge(parameters(lift=LIFT)).online()
    domain = one.context.get_domain_id()
    here, elsewhere = Presence(domain, '/b/bridge'), Presence(domain + 1, '/drive_can_bridge')
    try:
        code, lines, _ = run('stop', '--json')
        documents = [json.loads(line) for line in lines]
        assert code == 1
        assert [(each.get('bridge'), each.get('drive'), each['ok']) for each in documents] == [
            ('b/bridge', None, False), ('drive_can_bridge', None, False), (None, 'lift', True)]
        assert f'domain {domain + 1}' in documents[1]['message']
        assert [each['code'] for each in documents] == ['drives_may_run', 'drives_may_run', '']
        # with a name, or a namespace, only what was named counts: nobody else cries
        assert run('stop', '/lift') == (0, ['lift: ready'], '')
        assert run('stop', '--namespace', '') == (0, ['lift: ready'], '')
        # a drive of the other one may be called so
        assert [line.partition(':')[0] for line in run('stop', 'lift')[1]] == ['b/bridge', 'lift']
    finally:
        here.withdraw()
        elsewhere.withdraw()
    assert run('stop') == (0, ['lift: ready'], '')


@pytest.mark.parametrize(('word', 'may'), [
    ('/*', True), ('/cell*/lift', True), ('/cell1/lift', True), ('/cell1/l*', True),
    ('/cell1*', True), ('lift', True), ('l*', True),
    ('/cell2/*', False), ('/cell/lift', False), ('/cell1/hall/lift', False), ('/lift', False)])
def test_which_hung_bridge_may_have_a_drive_that_is_meant(
        client: Client, run: Run, word: str, may: bool) -> None:
    answer(client, '/x/bridge', drives='lift')()
    drive(client, '/x/lift')
    hung = Presence(client.node.context.get_domain_id(), '/cell1/drive_can_bridge')
    try:
        _, lines, _ = run('stop', word)
    finally:
        hung.withdraw()
    assert any(line.startswith('cell1/drive_can_bridge: NOT STOPPED') for line in lines) is may


def test_patterns_of_namespaces(bridge: StartBridge, client: Client, run: Run) -> None:
    one = bridge(parameters(lift=LIFT, hoist=HOIST), arguments=('-r', '__ns:=/a1')).online()
    two = bridge(parameters(lift=LIFT), arguments=('-r', '__ns:=/a2')).online()
    assert run('enable', '/a1/lift', '/a1/hoist', '/a2/lift')[0] == 0
    assert run('disable', '/a*/lift')[0] == 0
    assert (states(one, 'lift', 'hoist'), states(two, 'lift')) == (
        ['disabled', 'online'], ['disabled'])
    hang(client, '/a3/bridge')
    replay('a pattern, and one that hangs', run)


def test_a_bridge_that_is_not_configured(client: Client, run: Run) -> None:
    answer(client, '/bridge', drives='')()
    replay('no drives', run)


def drive(client: Client, name: str, message: str = 'stopped', online: bool = True) -> None:
    """Be a drive that can be stopped."""
    def stop(_: Any, response: Any) -> Any:
        response.success, response.message = True, message
        return response
    offer(client, name, 'quick_stop', Trigger, stop)
    client.node.create_publisher(Bool, f'{name}/online', LATCHED).publish(Bool(data=online))


def test_a_drive_that_is_not_online_is_a_failure(
        client: Client, run: Run) -> None:
    answer(client, '/bridge', drives='gone lift mute')()
    drive(client, '/lift')
    drive(client, '/gone', 'nothing is commanded', online=False)
    replay('not online', run)


@pytest.mark.usefixtures('bench')
def test_no_bridge_at_all(run: Run) -> None:
    replay('no bridge at all', run)


@pytest.mark.usefixtures('bench')
@pytest.mark.parametrize('words', [
    ('read',), ('read', '--namespace', 'cell'), ('write', 'ramp_time=1'),
    ('backup', '-o', 'x.yaml'), ('restore', 'kept.yaml', '--dry-run'),
    ('compare', 'lift', 'hoist'), ('enable', 'lift'), ('disable', '/c*/lift')], ids=' '.join)
def test_one_that_hangs_and_has_left_the_graph_is_named(
        run: Run, words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path('kept.yaml').write_text('/lift: {ros__parameters: {ramp_time: 1.0}}\n')
    domain = int(os.environ['ROS_DOMAIN_ID'])
    failed = 2 if words[0] == 'compare' else 1      # calls every trouble 2
    hung, elsewhere = Presence(domain, '/cell/bridge'), Presence(domain + 1, '/cell/other')
    try:
        code, lines, errors = run(*words)
        assert (code, lines) == (failed, [])
        assert '/cell/bridge' in errors and f'process {os.getpid()}' in errors
        assert '/cell/other' not in errors
        assert run('read', '--namespace', 'hall')[0] == 1
        hung.withdraw()
        assert run(*words)[0] == failed
    finally:
        hung.withdraw()
        elsewhere.withdraw()


@pytest.mark.usefixtures('nowhere')
@pytest.mark.parametrize('words', [
    ('stop', '--params-file', 'robot.yaml'), ('stop', '-p', 'robot.yaml'), ('enable',),
    ('reset',), ('disable',), ('enable', 'l*'), ('reset', 'l?ft'), ('enable', '[ab]'),
    ('stop', '--namespace', 'a b'), ('stop', '--unknown')])
def test_wrong_usage_is_told_before_anybody_is_looked_for(words: tuple[str, ...]) -> None:
    try:
        code = main(words)
    except SystemExit as ended:
        code = int(ended.code or 0)
    assert code == 2


@pytest.mark.parametrize('listens', [False, True])
def test_a_fault_is_reset(
        bridge: StartBridge, run: Run, locally: Lines, listens: bool) -> None:
    one = bridge(parameters(lift=LIFT)).online()
    if listens:
        locally(one)
    one.played['lift'].fault('trip')
    wait_until(lambda: states(one, 'lift') == ['fault'])
    for _ in range(2):      # and then there is nothing to be reset
        assert run('reset', 'lift') == (0, ['lift: reports no fault: ready'], '')
        assert states(one, 'lift') == ['disabled']


@pytest.mark.parametrize('locals_listen', [False, True])
def test_bridges_of_one_namespace_stand_together(
        bridge: StartBridge, client: Client, run: Run, tmp_path: Path, locally: Lines,
        locals_listen: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    one, two = (bridge(parameters(**drives), key='/**', arguments=(
        '-r', '__ns:=/cell', '-r', f'__node:={name}'))
        for name, drives in (('left', {'hoist': HOIST}), ('right', {'lift': LIFT})))
    for each in (one, two):
        each.online()
    if locals_listen:   # what is shown is the same, word for word
        locally(one, two)
        with monkeypatch.context() as patch:
            no_ros(patch)
            replay('a bridge a bus', run)
    else:
        replay('a bridge a bus', run)
    assert [played.value('ramp_time') for each in (one, two) for played in each.played.values()
            ] == [1.0, 3.25]
    hang(client, '/cell/mute')
    pause()     # bridges look at the graph a few times a second
    replay('a bridge a bus, and one that does not answer', run)
    answer(client, '/b/bridge')()
    pause()
    replay('a bridge a bus, and one elsewhere', run)


def test_drives_of_one_name_are_not_told_apart(client: Client, run: Run) -> None:
    for name in ('/left', '/right'):
        answer(client, name, drives='lift')()
    replay('two with drives of one name', run)
