# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can jog``: a setpoint held by hand, through a bridge."""

from collections.abc import Callable
from errno import EIO
import json
from typing import Any

from bridges import CONVEYOR, LIFT, parameters, StartBridge
from clients import Client
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from drive_can_bridge.cli.main import main
from drive_can_bridge.client import jog
from drive_can_bridge.core import sentences

#: as long as jog allows; the bench does not depend on how busy the machine is
DRIVE = {**LIFT, 'command_timeout': 2.0}
Run = Callable[..., tuple[int, list[str], str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a command; return exit code, lines, and standard error."""
    def started(*words: str) -> tuple[int, list[str], str]:
        capsys.readouterr()
        try:
            code = main(words)
        except SystemExit as end:   # of argparse
            code = int(str(end.code))
        told = capsys.readouterr()
        return code, told.out.splitlines(), told.err
    return started


def enabled(bridge: StartBridge, run: Run, **keys: Any) -> Any:
    """Return a bridge whose lift is enabled."""
    one = bridge(parameters(lift={**DRIVE, **keys})).online()
    assert run('enable', 'lift')[0] == 0
    return one


def speeds(bridge: Any, name: str = 'lift') -> list[float]:
    """Return what the drive was told, without repetitions."""
    setpoints = bridge.node.drives[name].session.setpoints
    return [item.parameter.value_from_raw(item.raw) for item in setpoints.items]


def test_holds_the_value_and_ends_with_neutral(bridge: StartBridge, run: Run) -> None:
    one = enabled(bridge, run)
    code, lines, errors = run('jog', 'lift', '300', '--yes')
    assert (code, errors) == (0, '')
    assert lines[-1] == 'lift: 300 rpm was sent and answered, then neutral'
    assert len(lines) > 3 and all('actual_speed' in line for line in lines[:-1])
    assert speeds(one) == [0.0]


def test_neutral_is_a_value_too(bridge: StartBridge, run: Run) -> None:
    enabled(bridge, run)
    code, lines, errors = run('jog', 'lift', '0', '--yes', '--for', '1')
    assert (code, lines[-1], errors) == (0, 'lift: 0 rpm was sent and answered, then neutral', '')


def test_no_line_is_empty_before_the_first_values(
        bridge: StartBridge, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    enabled(bridge, run)
    looks = 0

    def values(_: jog.Jog) -> dict[str, Any]:
        nonlocal looks
        looks += 1
        return {} if looks == 1 else {'actual_speed': 1.0}
    monkeypatch.setattr(jog.Jog, 'values', property(values, lambda *_: None), raising=False)
    code, lines, _ = run('jog', 'lift', '300', '--yes', '--for', '1')
    assert code == 0 and looks > 1
    assert len(lines) > 1 and all('actual_speed' in line for line in lines[:-1])


def test_the_log_says_who_armed_it(bridge: StartBridge, client: Client, run: Run) -> None:
    enabled(bridge, run)
    assert run('jog', 'lift', '300', '--yes', '--for', '1')[0] == 0
    told = client.wait_logged('lift: speed_setpoint armed, commanded by /_drive_can_jog_')
    assert told not in client.logged()


def test_its_end_is_no_warning(bridge: StartBridge, client: Client, run: Run) -> None:
    enabled(bridge, run)
    assert run('jog', 'lift', '300', '--yes', '--for', '1')[0] == 0
    told = client.wait_logged('no command for 2 s: speed_setpoint neutral until armed again')
    assert told not in client.logged()


def test_json(bridge: StartBridge, run: Run) -> None:
    enabled(bridge, run)
    code, lines, _ = run('jog', '/lift', 'speed_setpoint', '-300', '--yes', '--json', '--for', '1')
    documents = [json.loads(line) for line in lines]
    assert code == 0
    assert documents[-1] == {'drive': 'lift', 'ok': True, 'code': 'jog_done',
                             'message': '-300 rpm was sent and answered, then neutral'}
    assert documents[0].keys() == {'drive', 'seconds', 'values'}


@pytest.mark.parametrize(('words', 'code', 'said'), [
    (('lift', '300'), 2, 'nobody can be asked here'),
    (('300',), 2, 'write DRIVE VALUE, or DRIVE NAME VALUE'),
    (('lift', 'fast', '--yes'), 2, "'fast' is no value"),
    (('lift', '300', '--yes', '--for', '61'), 2, 'allowed are up to 60 s'),
    (('l*', '300', '--yes'), 2, 'takes a full name, no patterns'),
    (('lift', '300', '--yes', '-p', 'a.yaml'), 2, 'leave --params-file away'),
    (('crane', '300', '--yes'), 2, "no drive 'crane'; there are: lift"),
    (('lift', 'speed', '300', '--yes'), 1, 'speed cannot be commanded; there are: speed_setpoint'),
    (('lift', 'inf', '--yes'), 1, 'inf is not a finite number'),
    (('lift', '-inf', '--yes'), 1, '-inf is not a finite number'),
    (('lift', 'nan', '--yes'), 1, 'nan is not a finite number'),
    (('lift', '-3001', '--yes'), 1, '-3001 is out of range: -3000 to 3000 rpm'),
    (('lift', '-1e4', '--yes'), 1, '-10000 is out of range: -3000 to 3000 rpm'),
    (('--yes', 'lift', '-1e4'), 1, '-10000 is out of range: -3000 to 3000 rpm'),
    (('lift', '-x', '--yes'), 2, 'unrecognized arguments: -x'),
    (('lift', '', '--yes'), 2, "'' is no value"),
    (('lift', '300', '--yes', '--for', 'inf'), 2, 'inf: allowed is a number above 0'),
    (('lift', '300', '--yes', '--for', 'long'), 2, 'long: allowed is a number above 0'),
    (('lift', '3001', '--yes'), 1, '3001 is out of range: -3000 to 3000 rpm'),
    (('lift', 'true', '--yes'), 1, 'True is a bool, not a number'),
])
def test_bad_input(bridge: StartBridge, run: Run, words: tuple[str, ...], code: int,
                   said: str) -> None:
    enabled(bridge, run)
    found = run('jog', *words)
    assert (found[0], found[1]) == (code, []) and said in found[2], found
    assert found[2].count('\n') == 1


def test_what_is_not_enabled_is_refused(bridge: StartBridge, run: Run) -> None:
    bridge(parameters(lift=DRIVE)).online()
    assert run('jog', 'lift', '300', '--yes')[::2] == (
        1, 'lift: is disabled: drive_can enable lift\n')


@pytest.mark.parametrize(('keys', 'words', 'said'), [
    ({'command_timeout': 0.0}, ('300',), 'its command_timeout is 0 s'),
    ({'command_timeout': 2.5}, ('300',), 'its command_timeout is 2.5 s'),
    ({}, ('torque_limit', '50'), 'torque_limit is a limit, and moves nothing'),
])
def test_what_jog_must_not_move(bridge: StartBridge, run: Run, keys: dict[str, Any],
                                words: tuple[str, ...], said: str) -> None:
    bridge(parameters(conveyor={**CONVEYOR, 'command_timeout': 2.0, **keys})).online()
    code, lines, errors = run('jog', 'conveyor', *words, '--yes')
    assert (code, lines) == (1, []) and said in errors


def test_a_position_is_not_for_jog(bridge: StartBridge, run: Run) -> None:
    axis = {'bus': 'main', 'protocol': 'datamodel_extended', 'station': 1,
            'profile': 'datamodel_axis_example', 'cyclic_request': ['position_setpoint'],
            'cyclic_response': ['actual_position', 'status_word'], 'command_timeout': 2.0,
            'missed_limit': 100, 'parameter_timeout': 2.0, 'control_timeout': 20.0}
    one = bridge(parameters(axis=axis)).online()
    assert run('enable', 'axis')[0] == 0
    where = one.played['axis'].value('actual_position')
    code, lines, errors = run('jog', 'axis', 'position_setpoint', '5', '--yes')
    assert (code, lines) == (1, []) and errors.count('\n') == 1
    assert 'position_setpoint is a position, and where it would go' in errors
    assert '/axis/command/position_setpoint' in errors
    assert one.played['axis'].value('actual_position') == where


def test_a_drive_that_is_not_there_is_refused(bridge: StartBridge, run: Run) -> None:
    bridge(parameters(lift=DRIVE), simulated=False)
    code, lines, errors = run('jog', 'lift', '300', '--yes')
    assert (code, lines) == (1, []) and 'is offline' in errors


def test_a_drive_in_fault_is_refused_with_its_fault(bridge: StartBridge, client: Client,
                                                   run: Run) -> None:
    one = enabled(bridge, run)
    one.played['lift'].fault('trip')
    client.diagnostics('drive_can_bridge: drive lift',
                       lambda drive: drive['fault_code'] == '7 overcurrent')
    code, lines, errors = run('jog', 'lift', '300', '--yes')
    assert (code, lines) == (1, [])
    assert errors.endswith(
        'lift: has fault 7 overcurrent: remove its cause, then: drive_can reset lift\n')
    code, lines, _ = run('explain', 'jog_fault')
    assert code == 0 and 'remove its cause, reset it, enable the drive' in ' '.join(lines)


def test_somebody_who_commands_all_joints(bridge: StartBridge, client: Client, run: Run) -> None:
    joint = {'name': 'lift', 'velocity': 'actual_speed', 'velocity_command': 'speed_setpoint'}
    enabled(bridge, run, joint=joint)
    for topic in ('/lift/joint_command', '/drive_can_bridge/joint_commands'):
        publisher = client.node.create_publisher(JointState, topic, 1)
        code, lines, errors = run('jog', 'lift', '300', '--yes')
        assert (code, lines) == (1, []) and topic in errors, errors
        client.node.destroy_publisher(publisher)


def test_somebody_else_commands_already(bridge: StartBridge, client: Client, run: Run) -> None:
    enabled(bridge, run)
    client.node.create_publisher(Float64, '/lift/command/speed_setpoint', 1)
    code, _, errors = run('jog', 'lift', '300', '--yes')
    assert code == 1
    assert 'is commanded by others: /' in errors and '/lift/command/speed_setpoint' in errors


def test_somebody_else_begins_to_command(bridge: StartBridge, client: Client, run: Run,
                                         monkeypatch: pytest.MonkeyPatch) -> None:
    one = enabled(bridge, run)
    publisher: list[Any] = []

    def interfere(found: jog.Jog, now: float) -> None:
        judge(found, now)
        if found.values and not publisher:
            publisher.append(client.node.create_publisher(
                Float64, '/lift/command/speed_setpoint', 1))
    judge = jog.Jog._judge
    monkeypatch.setattr(jog.Jog, '_judge', interfere)
    code, _, errors = run('jog', 'lift', '300', '--yes')
    assert code == 1 and 'is commanded by others' in errors
    assert speeds(one) == [0.0]


def test_ends_when_the_drive_is_disabled(bridge: StartBridge, run: Run,
                                         monkeypatch: pytest.MonkeyPatch) -> None:
    one = enabled(bridge, run)
    stopped: list[int] = []

    def stop(found: jog.Jog, now: float) -> None:
        judge(found, now)
        if found._value_answered and not stopped:
            stopped.append(1)
            one.node.drives['lift'].session.setpoints.disarm()
    judge = jog.Jog._judge
    monkeypatch.setattr(jog.Jog, '_judge', stop)
    code, lines, errors = run('jog', 'lift', '300', '--yes', '--for', '20')
    assert code == 1 and 'the bridge sends 0 rpm instead of 300 rpm' in errors
    assert speeds(one) == [0.0] and len(lines) < 10


def test_ends_when_the_bridge_alone_says_that_it_is_disarmed(
        bridge: StartBridge, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its bus is lost, and ``~/online`` is called otherwise."""
    one = enabled(bridge, run)

    def lose(found: jog.Jog, now: float) -> None:
        if found._value_answered and found._inboxes:
            found._inboxes = ()
            one.node.drives['lift'].session.setpoints.disarm()
        judge(found, now)
    judge = jog.Jog._judge
    monkeypatch.setattr(jog.Jog, '_judge', lose)
    code, _, errors = run('jog', 'lift', '300', '--yes', '--for', '5')
    assert code == 1 and errors == f'lift: {sentences.jog_no_longer("armed")}\n'
    assert speeds(one) == [0.0]


def test_never_the_value_again_after_a_standstill(bridge: StartBridge, run: Run,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    one = enabled(bridge, run)
    published: list[float] = []
    stalled: list[int] = []

    def publish(box: Any, message: Any) -> None:
        published.append(message.data)
        send(box, message)

    def stall(found: jog.Jog, now: float) -> None:
        if found._value_answered and not stalled:
            stalled.append(len(published))
            found._published_at -= 5.0
        judge(found, now)
    judge, send = jog.Jog._judge, jog.NewestPublisher.publish
    monkeypatch.setattr(jog.Jog, '_judge', stall)
    monkeypatch.setattr(jog.NewestPublisher, 'publish', publish)
    code, _, errors = run('jog', 'lift', '300', '--yes')
    assert code == 1 and 'this process stood still for 5.' in errors
    assert set(published[stalled[0]:]) == {0.0} and 300.0 in published
    assert speeds(one) == [0.0]


@pytest.mark.parametrize('seconds', ['60', '1'])    # it goes before the time, or at its end
def test_a_bridge_that_was_killed_ends_it(bridge: StartBridge, run: Run,
                                          monkeypatch: pytest.MonkeyPatch, seconds: str) -> None:
    enabled(bridge, run)
    judge = jog.Jog._judge

    def kill(self: jog.Jog, now: float) -> None:
        if self._value_answered:        # a SIGKILL takes no leave
            self._inboxes = ()
            monkeypatch.setattr(self._calls, 'look', lambda now: None)
        judge(self, now)
    monkeypatch.setattr(jog.Jog, '_judge', kill)
    code, _, errors = run('jog', 'lift', '300', '--yes', '--for', seconds)
    assert code == 1
    assert errors.rstrip() == 'lift: ' + sentences.jog_bridge_silent(
        jog.SILENCE if seconds == '60' else 0.5 * jog.SILENCE)


def test_a_terminal_that_was_closed_ends_it(bridge: StartBridge, run: Run,
                                       monkeypatch: pytest.MonkeyPatch) -> None:
    one = enabled(bridge, run)

    def gone(_: str) -> None:
        raise OSError(EIO, 'the terminal is closed')
    monkeypatch.setattr('drive_can_bridge.cli.jog.say', gone)
    assert run('jog', 'lift', '300', '--yes', '--for', '20')[0] != 0
    assert speeds(one) == [0.0]
