# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``~/enable``, ``~/reset_fault`` and ``~/quick_stop``."""

from typing import Any

from bridges import HASTY, LIFT, parameters, StartBridge
from clients import Client, wait_until
import pytest
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger
from waiting import clock

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control_machine import ControlMachine

DRIVE = 'drive_can_bridge: drive lift'
FAULT = '7 overcurrent'
#: why a drive that falls silent is offline
SILENT = sentences.silent_for_cycles('no cyclic response', HASTY['missed_limit'])
#: the control word has a slot, or is written on change
WITH_SLOT = LIFT
BY_HAND = {**LIFT, 'cyclic_request': ['speed_setpoint']}
#: neither word has one
BLIND = {**BY_HAND, 'cyclic_response': ['actual_speed']}


def enable(client: Client, value: bool = True) -> tuple[bool, str]:
    answer = client.call('/lift/enable', SetBool, SetBool.Request(data=value))
    return answer.success, answer.message


def trigger(client: Client, name: str, drive: str = '/lift') -> tuple[bool, str]:
    answer = client.call(f'{drive}/{name}', Trigger)
    return answer.success, answer.message


@pytest.mark.parametrize('lift', [WITH_SLOT, BY_HAND, BLIND], ids=['slot', 'by hand', 'blind'])
def test_enable_and_disable(bridge: StartBridge, client: Client, lift: dict[str, Any]) -> None:
    one = bridge(parameters(lift=lift))
    one.online()
    drive = one.played['lift']
    assert drive.value('control_word') == 0
    assert enable(client, False)[0]
    success, message = enable(client)
    assert success and message == 'enabled', message
    assert drive.value('control_word') == 1
    assert int(drive.value('status_word')) & 2
    assert enable(client)[0]  # it is already
    success, message = enable(client, False)
    assert success, message
    assert not int(drive.value('status_word')) & 2
    assert drive.value('control_word') == 0


def test_a_drive_that_runs_on_under_disable_is_an_error(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(parameters(lift=LIFT))
    one.online()
    disregards = sentences.disregards('enabled', sentences.status_word(2), 'disable', 0)
    monkeypatch.setattr(ControlMachine, 'disregard', disregards)
    status = client.diagnostics(DRIVE, lambda drive: drive['code'] == 'disregards')
    assert status['level'] == 'ERROR'
    assert status['message'].startswith(disregards)


def test_a_drive_that_still_runs_is_no_disabled_one(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(parameters(lift=LIFT))
    one.online()
    monkeypatch.setattr(ControlMachine, 'unconfirmed', True)
    status = client.diagnostics(DRIVE, lambda drive: drive['code'] == 'still_running')
    assert (status['level'], status['state']) == ('WARN', 'disabled')
    assert status['message'].startswith(f'{sentences.still_running("ready")}; disabled: ')


def test_a_drive_that_stands_in_a_quick_stop_is_not_said_to_run(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(parameters(lift=LIFT))
    one.online()
    monkeypatch.setattr(ControlMachine, 'unconfirmed', True)
    holds = sentences.quick_stop_holds('quick stop active')
    monkeypatch.setattr(ControlMachine, 'holds', holds)
    status = client.diagnostics(DRIVE, lambda drive: drive['code'] == 'quick_stop_holds')
    assert (status['level'], status['state']) == ('WARN', 'disabled')
    assert status['message'].startswith(f'{holds}; disabled: ')


def test_the_control_word_has_no_topic(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(
        lift=LIFT, conveyor={**LIFT, 'station': 3, 'profile': 'datamodel_example',
                             'cyclic_request': ['speed_setpoint']}))
    client.find(one.node, 'lift', 'conveyor')
    topics = dict(client.node.get_topic_names_and_types())
    assert '/lift/command/speed_setpoint' in topics
    assert '/lift/command/control_word' not in topics
    services = dict(client.node.get_service_names_and_types())
    assert '/lift/enable' in services
    assert '/conveyor/enable' not in services


@pytest.mark.parametrize('lift', [WITH_SLOT, BY_HAND], ids=['slot', 'by hand'])
def test_fault_and_reset(bridge: StartBridge, client: Client, lift: dict[str, Any]) -> None:
    one = bridge(parameters(lift=lift))
    one.online()
    drive = one.played['lift']
    assert trigger(client, 'reset_fault')[0]  # without a fault it succeeds
    assert enable(client)[0]
    drive.fault('trip')
    status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'fault'
                                and drive['fault_code'] == FAULT)
    assert status['level'] == 'ERROR'
    assert '~/reset_fault' in status['message'] and '~/enable' in status['message']
    wait_until(lambda: drive.value('control_word') == 0)
    assert enable(client) == (False, sentences.reset_first(FAULT))
    assert trigger(client, 'quick_stop')[0]
    success, message = trigger(client, 'reset_fault')
    assert success, message
    wait_until(lambda: drive.value('control_word') == 0)
    assert not int(drive.value('status_word')) & 2  # nothing but a new enable starts it
    client.diagnostics(DRIVE, lambda drive: drive['state'] == 'disabled')
    assert enable(client)[0]
    client.diagnostics(DRIVE, lambda drive: drive['state'] == 'not armed')


def test_a_fault_that_lasts_cannot_be_reset(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift={**LIFT, 'control_timeout': 0.5}))
    one.online()
    one.played['lift'].fault('trip=3600')
    client.diagnostics(DRIVE, lambda drive: drive['state'] == 'fault')
    raw = int(one.played['lift'].value('status_word'))
    assert trigger(client, 'reset_fault') == (
        False, sentences.fault_present(0.5, sentences.status_word(raw)))


def test_a_fault_says_which_it_is(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift=LIFT))
    one.online()
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


def test_quick_stop(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift=LIFT))
    one.online()
    assert trigger(client, 'quick_stop')[0]  # while disabled it succeeds
    assert enable(client)[0]
    client.publish('/lift/command/speed_setpoint', Float64(data=0.0))
    client.publish('/lift/command/speed_setpoint', Float64(data=300.0))
    wait_until(lambda: float(one.played['lift'].value('actual_speed')) > 50.0)
    with one.record() as recorder:
        success, message = trigger(client, 'quick_stop')
        assert success, message
        assert 2 in {words[0] for words in recorder.cycles(2)}
    assert not int(one.played['lift'].value('status_word')) & 2
    wait_until(lambda: one.played['lift'].value('control_word') == 0)


def test_quick_stop_without_a_control_word(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
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
    one.played['conveyor'].fault('off')
    client.diagnostics('drive_can_bridge: drive conveyor',
                       lambda drive: drive['state'] == 'offline')
    assert trigger(client, 'quick_stop', '/conveyor') == (False, sentences.drive_offline())


def test_enable_that_gets_stuck_names_the_state(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift={**LIFT, 'control_timeout': 0.5}))
    one.online()
    one.played['lift'].set_value('status_word', 0)
    assert enable(client) == (False, sentences.stuck(0.5, 'not ready', sentences.status_word(0)))
    wait_until(lambda: one.played['lift'].value('control_word') == 0)  # with the next cycle


def test_all_refuse_while_offline(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift={**LIFT, **HASTY}))
    one.online()
    assert enable(client)[0]
    one.played['lift'].fault('silent')
    wait_until(lambda: not one.node.drives['lift'].session.online)
    assert enable(client) == (False, sentences.drive_offline())
    assert enable(client, False) == (False, sentences.drive_offline())
    assert trigger(client, 'reset_fault') == (False, sentences.drive_offline())
    assert trigger(client, 'quick_stop') == (False, sentences.drive_offline())
    one.played['lift'].fault('ok')
    one.online()
    wait_until(lambda: one.played['lift'].value('control_word') == 0)
    assert not int(one.played['lift'].value('status_word')) & 2


def test_going_offline_answers_what_is_under_way(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift={**LIFT, **HASTY, 'control_timeout': 60.0}))
    one.online()
    one.played['lift'].set_value('status_word', 0)
    future = client.ask('/lift/enable', SetBool, SetBool.Request(data=True))
    wait_until(lambda: one.node.drives['lift'].session.control.pending)
    one.played['lift'].fault('off')
    wait_until(future.done)
    assert (future.result().success, future.result().message) == (
        False, SILENT)


def test_inactive_refuses(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift={**LIFT, 'control_timeout': 60.0}))
    one.online()
    one.played['lift'].set_value('status_word', 0)
    future = client.ask('/lift/enable', SetBool, SetBool.Request(data=True))
    wait_until(lambda: one.node.drives['lift'].session.control.pending)
    assert client.transition(4)
    wait_until(future.done)
    assert (future.result().success, future.result().message) == (
        False, sentences.bridge_inactive())
    assert enable(client) == (False, sentences.bridge_inactive())


def test_a_stop_waits_for_no_other_service(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(lift=LIFT))
    one.online()
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
