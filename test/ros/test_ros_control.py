# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``~/enable``, ``~/reset_fault`` and ``~/quick_stop``."""

from types import SimpleNamespace
from typing import Any

from bridges import HASTY, LIFT, parameters, StartBridge
from clients import Client, wait_until
import pytest
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger
from waiting import clock

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.ros.commands import CommandIntake
from drive_can_bridge.ros.log import FEW

DRIVE = 'drive_can_bridge: drive lift'
FAULT = '7 overcurrent'
#: why a drive that falls silent is offline
SILENT = sentences.silent_for_cycles('no cyclic response', HASTY['missed_limit'])


def enable(client: Client, value: bool = True) -> tuple[bool, str]:
    answer = client.call('/lift/enable', SetBool, SetBool.Request(data=value))
    return answer.success, answer.message


def trigger(client: Client, name: str, drive: str = '/lift') -> tuple[bool, str]:
    answer = client.call(f'{drive}/{name}', Trigger)
    return answer.success, answer.message


DISREGARDS = sentences.disregards('enabled', sentences.status_word(2), 'disable', 0)
HOLDS = sentences.quick_stop_holds('quick stop active')


@pytest.mark.parametrize(('machine', 'code', 'level', 'begin'), [
    ({'disregard': DISREGARDS}, 'disregards', 'ERROR', DISREGARDS),
    ({'unconfirmed': True}, 'still_running', 'WARN',
     f'{sentences.still_running("ready")}; disabled: '),
    ({'unconfirmed': True, 'holds': HOLDS}, 'quick_stop_holds', 'WARN', f'{HOLDS}; disabled: ')])
def test_a_drive_that_does_not_obey_a_stop_is_not_simply_disabled(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch,
        machine: dict[str, object], code: str, level: str, begin: str) -> None:
    bridge(parameters(lift=LIFT)).online()
    for name, value in machine.items():
        monkeypatch.setattr(ControlMachine, name, value)
    status = client.diagnostics(DRIVE, lambda drive: drive['code'] == code)
    assert (status['level'], status['state']) == (level, 'disabled')
    assert status['message'].startswith(begin)


def test_a_fault_says_which_it_is(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift=LIFT)).online()
    client.diagnostics(DRIVE, lambda drive: drive['fault_code'] == '')
    one.played['lift'].fault('trip')
    status = client.diagnostics(DRIVE, lambda drive: drive['fault_code'] == FAULT)
    assert (status['level'], status['code']) == ('ERROR', 'fault')
    assert status['message'].startswith(f'fault {FAULT}: ')
    client.wait_logged('lift: fault 7 overcurrent: remove its cause')
    assert enable(client) == (False, sentences.reset_first(FAULT))
    one.played['lift'].fault('ok')
    assert trigger(client, 'reset_fault')[0]
    client.diagnostics(DRIVE, lambda drive: drive['fault_code'] == '')


def test_the_log_says_what_was_asked_through_ros(bridge: StartBridge, client: Client) -> None:
    bridge(parameters(lift=LIFT)).online()
    assert enable(client)[0] and enable(client, False)[0]
    assert trigger(client, 'quick_stop')[0] and trigger(client, 'reset_fault')[0]
    for action in ('enable', 'disable', 'quick stop', 'reset fault'):
        said = client.wait_logged(f'lift: {sentences.asked_through_ros(action=action)}')
        assert said not in client.logged()


def test_a_flood_of_questions_is_no_flood_of_lines(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift=LIFT)).online()
    client.listen()
    for number in range(50):
        one.node.drives['lift'].command(
            ControlAction.QUICK_STOP, lambda _: None, whom=f'process {number}')
    assert trigger(client, 'quick_stop')[0]
    assert enable(client)[0]
    client.wait_logged(sentences.asked_through_ros(action='enable'))
    assert sum('quick stop, asked' in line for line in client.logged(0)) == FEW


def test_quick_stop_without_a_control_word(bridge: StartBridge, client: Client) -> None:
    one = bridge().online()
    client.publish('/conveyor/command/speed_setpoint', Float64(data=0.0))
    client.publish('/conveyor/command/speed_setpoint', Float64(data=300.0))
    wait_until(lambda: float(one.played['conveyor'].value('speed_setpoint')) == 300.0)
    assert trigger(client, 'quick_stop', '/conveyor') == (
        True, sentences.neutral_without_control())
    assert one.played['conveyor'].value('speed_setpoint') == 0.0
    names = {name for name, _ in client.node.get_service_names_and_types()}
    assert not {'/conveyor/enable', '/conveyor/reset_fault'} & names
    client.publish('/conveyor/command/speed_setpoint', Float64(data=300.0))
    client.diagnostics('drive_can_bridge: drive conveyor',
                       lambda drive: drive['state'] == 'not armed')


def test_going_offline_answers_what_is_under_way(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift={**LIFT, **HASTY, 'control_timeout': 60.0})).online()
    one.played['lift'].set_value('status_word', 0)
    future = client.ask('/lift/enable', SetBool, SetBool.Request(data=True))
    wait_until(lambda: one.node.drives['lift'].session.control.pending)
    one.played['lift'].fault('off')
    wait_until(future.done)
    assert (future.result().success, future.result().message) == (
        False, SILENT)


def test_a_stop_waits_for_no_other_service(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift=LIFT)).online()
    client.service('/lift/quick_stop', Trigger)
    assert enable(client)[0]
    reached, go_on = clock().wake_event(), clock().wake_event()

    def be_busy() -> None:
        reached.ring()
        go_on.wait(clock().now() + 60.0)
    one.spinner.executor.create_task(be_busy)
    assert reached.wait(clock().now() + 60.0)
    try:
        with one.record() as recorder:
            answer = client.ask('/lift/quick_stop', Trigger)
            wait_until(lambda: 2 in [words[0] for words in recorder.cycles(2)],
                       what='a quick stop on the bus')
        wait_until(answer.done, what='the answer')
        assert answer.result().success
    finally:
        go_on.ring()


@pytest.mark.interpreted    # calls a method of what only looks like its object
def test_nodes_whose_names_have_not_arrived_yet_are_left_out() -> None:
    seen: Any = SimpleNamespace(_publishers=lambda _: [
        ('/teleop', '/conveyor/command/speed_setpoint'),
        ('_NODE_NAMESPACE_UNKNOWN_/_NODE_NAME_UNKNOWN_', '/conveyor/command/speed_setpoint')])
    assert CommandIntake.commanding_nodes(seen, []) == ['/teleop']
