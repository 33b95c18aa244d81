# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How the bridge lets go of its drives."""

from typing import Any

from bridges import Bridge, CONVEYOR, late, LIFT, parameters, Recorder, StartBridge
from clients import Client, ERROR, wait_until, WARN
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
import pytest
from std_msgs.msg import Bool, Float64
from std_srvs.srv import SetBool, Trigger
from waiting import clock, pause
import world

from drive_can_bridge.core import messages, sentences
from drive_can_bridge.core.codes import CODES
from drive_can_bridge.core.drive_services import DriveServices
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.exchange.exchange import BusExchange
from drive_can_bridge.ros.diagnostics import GRACE

LIFTS = parameters(lift=LIFT)


def run(bridge: StartBridge, client: Client, content: Any = LIFTS) -> Bridge:
    """Return a bridge with an enabled lift that moves."""
    one = bridge(content).online()
    assert client.call('/lift/enable', SetBool, SetBool.Request(data=True)).success
    for value in (0.0, 100.0):
        client.publish('/lift/command/speed_setpoint', Float64(data=value))
    wait_until(lambda: float(one.played['lift'].value('actual_speed')) > 10.0)
    return one


#: whoever looks at it afterwards must not take it for stopped
DOUBT = DiagnosticStatus.ERROR, 'bridge ended: it may still be running'


def farewell(one: Bridge, client: Client) -> tuple[bytes, str]:
    """End it; return level and message of what diagnostics say last of its drive."""
    topic = client.topic('/diagnostics', DiagnosticArray)
    topic.wait()
    one.node.stop()
    codes = {'bridge_ended', 'bridge_ended_may_run'}
    last = topic.wait(lambda array: codes.intersection(
        value.value for value in array.status[1].values))
    return last.status[1].level, last.status[1].message


@pytest.mark.parametrize('more', [
    {}, {'cyclic_request': ['speed_setpoint']}, {'protocol': 'datamodel_standard'}])
def test_the_farewell_is_without_doubt_where_the_stop_was_confirmed(
        bridge: StartBridge, client: Client, more: dict[str, object]) -> None:
    one = run(bridge, client, parameters(lift={**LIFT, **more}))
    assert farewell(one, client) == (DiagnosticStatus.STALE, 'bridge ended: start it again')


def last_cycles(recorder: Recorder) -> list[tuple[int, ...]]:
    recorder.catch_up()
    return recorder.cycles(2)[-3:]


def test_stop_sends_neutral_and_disable(bridge: StartBridge, client: Client) -> None:
    one = run(bridge, client)
    online = client.latched('/lift/online', Bool)
    with one.record() as recorder:
        wait_until(lambda: recorder.words(2)[:2] == (1, 1000))
        one.node.stop()
        assert last_cycles(recorder) == [(0, 0, 0, 0)] * 3
        wait_until(lambda: online.values[-1:] == [False])
        recorder.clear()
        for _ in range(20):
            client.state()
        assert not recorder.requests()
    wait_until(lambda: one.played['lift'].value('speed_setpoint') == 0.0)
    client.diagnostics('drive_can_bridge: drive lift', lambda drive: drive['state'] == 'offline')


def test_what_is_said_of_a_stop_was_made_before_memory_is_short(
        bridge: StartBridge, client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    for rows in CODES.values():
        for row in rows.values():
            for made in ('_variants', 'fields', 'optional'):
                vars(row).pop(made, None)   # as in a process of its own

    def nothing_left(*_: Any) -> Any:
        raise MemoryError
    one = run(bridge, client)
    monkeypatch.setattr(messages, '_Variant', nothing_left)
    assert client.call('/lift/quick_stop', Trigger).success
    for rows in CODES.values():
        for row in rows.values():
            row.make_ready()
    one.node.stop()
    assert one.played['lift'].value('speed_setpoint') == 0.0


def test_a_control_word_without_slot_is_written_at_the_end(bridge: StartBridge,
                                                           client: Client) -> None:
    one = run(bridge, client, parameters(lift={**LIFT, 'cyclic_request': ['speed_setpoint']}))
    assert one.played['lift'].value('control_word') == 1
    with one.record() as recorder:
        one.node.stop()
        assert last_cycles(recorder) == [(0, 0, 0, 0)] * 3
    wait_until(lambda: one.played['lift'].value('control_word') == 0)


def ends_safely(one: Bridge, client: Client, recorder: Recorder) -> None:
    wait_until(lambda: one.fatal)
    defect = sentences.internal_error('RuntimeError', 'a defect')
    assert one.fatal == [f'buses.main: {defect}']
    one.node.stop()
    wait_until(lambda: last_cycles(recorder) == [(0, 0, 0, 0)] * 3)
    client.wait_logged(defect, ERROR)


def test_a_dead_timer_thread_ends_the_bridge_safely(bridge: StartBridge, client: Client,
                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    one = run(bridge, client)
    exchange = one.node.exchanges['main']

    def fail(_: float) -> bool:
        raise RuntimeError('a defect')
    with one.record() as recorder:
        monkeypatch.setattr(exchange._wake, 'wait', fail)
        exchange._wake.ring()
        wait_until(lambda: not exchange._timer_thread.is_alive())
        ends_safely(one, client, recorder)


@pytest.mark.interpreted    # replaces a method
def test_a_dead_reader_ends_the_bridge_safely(bridge: StartBridge, client: Client,
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    one = run(bridge, client)
    original = BusExchange._serve

    def fail(exchange: BusExchange) -> None:    # the reader makes the passes
        monkeypatch.setattr(BusExchange, '_serve', original)
        raise RuntimeError('a defect')
    with one.record() as recorder:
        monkeypatch.setattr(BusExchange, '_serve', fail)
        wait_until(lambda: one.fatal)
        assert one.node.exchanges['main']._timer_thread.is_alive()
        ends_safely(one, client, recorder)


@pytest.mark.parametrize('more', [
    {}, {'cyclic_request': ['speed_setpoint']}, {'protocol': 'datamodel_standard'}])
def test_a_drive_that_says_enabled_to_the_end_is_not_called_stopped(
        bridge: StartBridge, client: Client, more: dict[str, object]) -> None:
    one = run(bridge, client, parameters(lift={**LIFT, **more}))
    client.listen()
    one.played['lift'].fault(f'set=status_word:{one.played["lift"].value("status_word"):g}')
    assert farewell(one, client) == DOUBT
    client.wait_logged('lift: told to stop, and answers, but its last status word does not say '
                       'so: enabled', WARN)
    assert 'lift: stopped' not in client.logged(0)


@pytest.mark.parametrize('content', [parameters(conveyor=CONVEYOR), LIFTS])
def test_a_bus_that_is_lost_during_the_stop_leaves_nobody_called_stopped(
        bridge: StartBridge, client: Client, content: Any) -> None:
    one = bridge(content)
    (name, drive), = one.node.drives.items()
    one.online()
    if drive.session.control is not None:
        assert client.call(f'/{name}/enable', SetBool, SetBool.Request(data=True)).success
    for value in (0.0, 100.0):
        client.publish(f'/{name}/command/speed_setpoint', Float64(data=value))
    wait_until(lambda: float(one.played[name].value('actual_speed')) > 10.0)
    assert world.current is not None
    wire = world.current.wires.of(one.channel())

    def unplug(_: Frame) -> None:
        """Between the first stop cycle and its answer."""
        if not one.node.exchanges['main'].active and not wire.down:
            wire.lose()
    wire.watchers.append(unplug)
    client.listen()
    assert farewell(one, client) == DOUBT
    danger = sentences.may_still_be_running(sentences.bus_lost_before_stop())
    client.wait_logged(f'{name}: {danger}', WARN)
    assert not [line for line in client.logged(0)
                if line.startswith((f'{name}: stopped', f'{name}: told'))]
    one.close()
    one.errors.clear()      # of the simulation, whose bus it is, too


def test_stopping_twice_is_harmless(bridge: StartBridge, client: Client) -> None:
    one = run(bridge, client)
    one.node.stop()
    one.node.stop()
    assert client.state() == 'active'


@pytest.mark.parametrize('taken', [False, True])
@pytest.mark.parametrize('service', ['set_parameters', 'quick_stop'])
@pytest.mark.interpreted    # replaces a method
def test_who_asks_for_what_meets_a_defect_is_answered_once(
        bridge: StartBridge, client: Client, service: str, taken: bool,
        monkeypatch: pytest.MonkeyPatch) -> None:
    one = run(bridge, client)
    drive, submit = one.node.drives['lift'], DriveServices.submit

    def fail(services: DriveServices, request: Any, now: float) -> None:
        monkeypatch.undo()
        if taken:   # the stop for the defect answers it
            submit(services, request, now)
        raise KeyError('a defect')
    monkeypatch.setattr(DriveServices, 'submit', fail)
    if service == 'quick_stop':
        answer = client.call('/lift/quick_stop', Trigger)
        told = answer.success, answer.message
    else:
        told, = client.set('/lift', ramp_time=1.0)
    assert told == (False, sentences.internal_error('KeyError', "'a defect'"))
    wait_until(lambda: drive.session.stopped)
    one.online()
    assert client.set('/lift', ramp_time=1.0) == [(True, '')]
    assert drive.calls == 0
    assert client.transition(Transition.TRANSITION_DEACTIVATE)
    assert client.transition(Transition.TRANSITION_CLEANUP)
    wait_until(lambda: '/lift' not in client.nodes())


def test_a_bus_that_hangs_holds_up_no_stop_of_another(bridge: StartBridge, client: Client) -> None:
    """Its adapter does not come back from a send when somebody looks which drives are missing."""
    bus = parameters()['buses']['main']
    one = bridge(parameters(buses={'hung': bus, 'main': dict(bus)}, lift=LIFT,
                            conveyor={**CONVEYOR, 'bus': 'hung'}), autostart=False)
    one.played['conveyor'].fault('silent')
    assert client.transition(Transition.TRANSITION_CONFIGURE)
    begun = clock().now()
    assert client.transition(Transition.TRANSITION_ACTIVATE)
    one.online('lift')
    assert client.call('/lift/enable', SetBool, SetBool.Request(data=True)).success
    ending = clock().worker(one.node.stop, 'ending')
    with one.record() as recorder, late(one.node.exchanges['hung']):
        pause(begun + GRACE + 0.3 - clock().now())
        assert one.node.drives['lift'].session.active
        ending.start()
        pause(0.3)
        assert last_cycles(recorder) == [(0, 0, 0, 0)] * 3
        assert one.node.drives['lift'].session.stopped
    ending.join()


def test_nor_one_that_is_asked_for_behind_one_of_its_own(bridge: StartBridge,
                                                         client: Client) -> None:
    """Whoever has both stopped, as ``drive_can stop`` does, has that of the other at once."""
    bus = parameters()['buses']['main']
    one = run(bridge, client, parameters(buses={'hung': bus, 'main': dict(bus)}, lift=LIFT,
                                         conveyor={**CONVEYOR, 'bus': 'hung'}))
    client.service('/lift/quick_stop', Trigger)
    client.service('/conveyor/quick_stop', Trigger)
    with one.record() as recorder, late(one.node.exchanges['hung']):
        first = client.ask('/conveyor/quick_stop', Trigger)
        pause(0.02)
        second = client.ask('/lift/quick_stop', Trigger)
        pause(0.1)
        assert not first.done()
        assert [words[0] for words in last_cycles(recorder)] != [1] * 3
        wait_until(lambda: first.done() and second.done())
    assert first.result().message == sentences.bus_hangs('hung')
    assert second.result().success


def test_a_bus_that_hangs_keeps_nobody_else_from_being_served(bridge: StartBridge,
                                                              client: Client) -> None:
    bus = parameters()['buses']['main']
    one = run(bridge, client, parameters(buses={'hung': bus, 'main': dict(bus)}, lift=LIFT,
                                         conveyor={**CONVEYOR, 'bus': 'hung'}))
    refused = sentences.bus_hangs('hung')
    with late(one.node.exchanges['hung']):
        for drive in ('conveyor', 'conveyor', 'lift'):
            answer = client.call(f'/{drive}/quick_stop', Trigger)
            assert answer.success is (drive == 'lift')
            assert drive == 'lift' or answer.message == refused
        assert client.set('/conveyor', ramp_time=1.0) == [(False, refused)]
        assert client.set('/drive_can_bridge', **{'drives.conveyor.command_timeout': 0.5}) == [
            (False, refused)]
        assert client.get('/lift', 'ramp_time') != [None]
        for status in ('bus hung', 'drive conveyor'):
            client.diagnostics(f'drive_can_bridge: {status}', lambda status: (
                status['level'], status['code']) == ('ERROR', 'bus_hangs'))
        client.diagnostics('drive_can_bridge: drive lift',
                           lambda drive: drive['state'] == 'disabled')
    client.diagnostics('drive_can_bridge: bus hung', lambda bus: bus['state'] == 'up')
