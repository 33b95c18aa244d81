# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the model makes of what arrives, with literal times."""

from dataclasses import replace
import math
from typing import Any

from hypothesis import given, strategies as st
from monitor_builders import (
    AT, BRIDGE, bus_status, drive_status, ENDED, ENDED_IN_DOUBT, feed, info, model_of, NOT_ARMED,
    NOW, PARAMETERS, seen, three_drives,
)
import pytest
from transcripts import replayed, stories

from drive_can_bridge.monitor.model import Model
from drive_can_bridge.monitor.snapshot import Level, Place, read_status, Status
from drive_can_bridge.monitor.summary import balance, line, Lines

STORIES = stories(__file__, 'lines.yaml')
#: what diagnostics say of the drive
STATES: dict[str, dict[str, Any]] = {
    'diagnosed': {}, 'ended': ENDED, 'ended_in_doubt': ENDED_IN_DOUBT,
    'inactive': {'level': 3, 'state': 'offline', 'code': 'activate_bridge',
                 'message': 'bridge inactive: activate it'},
    'fault': {'level': 2, 'state': 'fault',
              'message': 'fault 7 overcurrent: remove its cause, then reset it'}}


def test_diagnostics_tell_of_bridges_buses_and_drives_in_their_order() -> None:
    snapshot = seen(three_drives())
    assert [bridge.name for bridge in snapshot.bridges] == [BRIDGE]
    assert [drive.name for drive in snapshot.drives] == ['/conveyor', '/lift', '/turntable']
    conveyor, lift, turntable = snapshot.drives
    assert (conveyor.state, conveyor.level, conveyor.online) == ('online', Level.OK, True)
    assert (conveyor.rate, conveyor.exchanges, conveyor.missed) == (50.0, 12345, 3)
    assert conveyor.period_error.p99 == 0.156
    assert conveyor.latency.maximum == 9.876
    assert (lift.state, lift.level, lift.control) == ('not armed', Level.WARN, 'enabled')
    assert lift.advice == NOT_ARMED
    assert (turntable.state, turntable.online) == ('offline', False)
    assert math.isnan(turntable.latency.mean)
    bus, = snapshot.buses
    assert (bus.label, bus.state, bus.load, bus.sent) == ('main', 'up', 36.4, 156.0)


def test_samples_are_written_by_descriptors() -> None:
    conveyor = seen(three_drives()).drives[0]
    assert [(shown.name, shown.text, shown.unit) for shown in conveyor.values] == [
        ('actual_speed', '-550.8', 'rpm'), ('motor_current', '2.44', 'A'),
        ('status_word', '0x0003', '')]
    assert [shown.name for shown in conveyor.setpoints] == ['speed_setpoint', 'torque_limit']
    assert len(conveyor.values[0].points) == 120
    assert conveyor.values[0].points[-1][0] == 0.0
    assert conveyor.readings['ramp_time'].text == '1.50'
    assert conveyor.readings['motor_current'].text == ''


@pytest.mark.parametrize('rate', [50, 0])
def test_no_line_says_online_without_the_values(rate: int) -> None:
    lines, model = Lines(), Model()
    for second in range(20):
        now = NOW + second
        model.diagnosed([drive_status(exchanges=str(100 + rate * second))], AT + second, now)
        model.described('/conveyor', PARAMETERS)
        model.sampled(['/conveyor'], now)
        # the model takes samples that stay away for offline only after some seconds, and never
        # while it does not know how often they should come
        told = lines.look(model.look(now, AT), now)
        assert [text.partition(' (')[0] for text in told] == ['conveyor offline'] * (second > 2)
    model.responded('/conveyor', [('actual_speed', 1.25)], now)
    [online] = lines.look(model.look(now, AT), now)
    assert online.split() == ['conveyor', 'online', 'actual_speed=1.2', 'rpm']







@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str) -> None:
    lines, model = Lines(), model_of([drive_status()])
    three = seen(three_drives())

    def step(step: str) -> list[str]:
        text, what, *words = step.split()
        now = NOW + float(text)
        if what == 'three':
            return [*map(line, three.drives), *balance(three)]
        if what == 'look':
            return list(lines.look(model.look(now, AT), now))
        if what == 'described':
            model.described('/conveyor', PARAMETERS)
        elif what == 'sampled':
            model.sampled(['/conveyor'], now)
        elif what == 'others':
            model.sampled([], now)
        elif what == 'responded':
            model.responded('/conveyor', [(name, float(value)) for name, value in (
                word.split('=') for word in words)], now)
        elif what == 'went':
            model.went_online('/conveyor', words == ['online'], now)
        else:
            model.diagnosed([drive_status(**STATES[what])], AT + float(text), now)
        return []
    assert replayed(STORIES[story], step) == STORIES[story]


def test_values_of_before_are_not_shown_of_a_drive_that_came_back() -> None:
    model = model_of([drive_status()])
    model.described('/conveyor', PARAMETERS)
    model.responded('/conveyor', [('actual_speed', 1.0)], NOW + 0.1)
    model.went_online('/conveyor', False, NOW + 0.2)
    model.went_online('/conveyor', True, NOW + 0.3)
    assert [shown.text for shown in model.look(NOW + 0.4, AT).drives[0].values] == ['']


def test_without_descriptors_values_are_shown_all_the_same() -> None:
    model = model_of([drive_status()])
    model.responded('/conveyor', [('speed', 1.5), ('count', 7), ('on', True)], NOW)
    assert [shown.text for shown in seen(model).drives[0].values] == ['1.500', '7', 'true']


@pytest.mark.parametrize('step', [-3600.0, 3600.0])
def test_a_clock_that_is_set_hides_no_silent_bridge(step: float) -> None:
    model = Model()
    for second in range(5):
        model.diagnosed([drive_status()], AT + second, NOW + second)
    model.diagnosed([drive_status()], AT + 5.0 + step, NOW + 5.0)
    assert not model.look(NOW + 8.0, AT).bridges[0].silent
    assert model.look(NOW + 8.1, AT).bridges[0].silent


def test_a_silent_bridge_takes_its_drives_along_in_words() -> None:
    model = model_of([bus_status(), drive_status()])
    feed(model, '/conveyor')
    assert model.look(NOW + 2.9, AT).drives[0].online
    snapshot = model.look(NOW + 5.0, AT)
    assert snapshot.bridges[0].silent == 5.0
    drive, = snapshot.drives
    assert (drive.state, drive.level, drive.online) == ('unknown', Level.STALE, False)
    assert drive.silent
    assert snapshot.buses[0].state == 'unknown'
    assert model.doubtful(NOW + 5.0) == (BRIDGE, '/conveyor')
    assert model.doubtful(NOW + 1.0) == ()


def test_a_bridge_with_a_long_period_is_given_time() -> None:
    model = Model()
    for number in range(3):
        model.diagnosed([drive_status()], AT + 30.0 * number, NOW + 30.0 * number)
    assert model.look(NOW + 100.0, AT).drives[0].online
    assert not model.look(NOW + 110.0, AT).drives[0].online


@pytest.mark.parametrize(('told', 'limit'), [
    (10.0, 16.5), (60.0, 91.5), (0.1, 3.0), (math.nan, 3.0), (1e9, 5401.5)])
def test_a_bridge_is_believed_how_often_it_tells(told: float, limit: float) -> None:
    model = model_of([drive_status()])
    # it is asked before it is called silent
    assert model.doubtful(NOW + 1.6) == (BRIDGE,)
    model.paced(BRIDGE, told, NOW + 1.6)
    model.paced('/nobody', told, NOW + 1.6)
    assert model.doubtful(NOW + 1.7) == ()
    assert not model.look(NOW + limit, AT).bridges[0].silent
    assert model.look(NOW + limit + 0.1, AT).bridges[0].silent
    # what it does is what counts
    for second in range(2):
        model.diagnosed([drive_status()], AT + 5.0 + second, NOW + 5.0 + second)
    assert model.look(NOW + 9.1, AT).bridges[0].silent


def test_an_answer_may_take_its_time_at_first() -> None:
    model = Model()
    model.diagnosed([drive_status()], AT, NOW)
    assert not model.look(NOW + 6.0, AT).bridges[0].silent
    assert model.look(NOW + 6.1, AT).bridges[0].silent


def test_samples_that_stay_away_tell_before_diagnostics_do() -> None:
    model = Model()
    for number in range(3):
        model.diagnosed([drive_status(exchanges=str(100 + 1500 * number))], AT + 30.0 * number,
                        NOW + 30.0 * number)
    model.sampled(['/conveyor'], NOW + 60.0)
    model.responded('/conveyor', [('speed', 1.0)], NOW + 61.0)
    assert model.look(NOW + 63.5, AT).drives[0].online
    drive, = model.look(NOW + 66.0, AT).drives
    assert drive.advice.startswith('offline: no sample for 5 s')
    # nobody asks for them any more: that they stay away says nothing
    model.sampled([], NOW + 66.0)
    assert model.look(NOW + 66.0, AT).drives[0].online


def test_online_is_believed_at_once_until_diagnostics_say_more() -> None:
    model = model_of([drive_status()])
    model.went_online('/conveyor', True, NOW + 0.1)
    model.went_online('/conveyor', False, NOW + 0.2)
    assert model.look(NOW + 0.3, AT).drives[0].state == 'offline'
    model.diagnosed([drive_status(level=2, state='offline', message='offline: why')], AT + 1,
                    NOW + 1)
    assert model.look(NOW + 1, AT).drives[0].advice == 'offline: why'
    model.went_online('/conveyor', True, NOW + 1.1)
    assert model.look(NOW + 1.2, AT).drives[0].online


def test_what_a_bridge_does_not_name_any_more_has_gone() -> None:
    model = model_of([bus_status(), drive_status(), drive_status('lift')])
    model.diagnosed([bus_status('other'), drive_status('lift')], AT + 1, NOW + 1)
    snapshot = seen(model)
    assert [drive.name for drive in snapshot.drives] == ['/lift']
    assert [bus.name for bus in snapshot.buses] == ['other']
    model.responded('/conveyor', [('speed', 1.0)], NOW)  # a straggler
    assert model.drives == ('/lift',)


def test_bridges_in_namespaces_are_told_apart() -> None:
    model = Model()
    for cell in ('cell1', 'cell2'):
        model.diagnosed([bus_status(bridge=f'{cell}/drive_can_bridge'),
                         drive_status(bridge=f'{cell}/drive_can_bridge')], AT, NOW)
    snapshot = seen(model)
    assert [drive.label for drive in snapshot.drives] == ['cell1/conveyor', 'cell2/conveyor']
    assert [drive.name for drive in snapshot.drives] == ['/cell1/conveyor', '/cell2/conveyor']
    assert [bus.label for bus in snapshot.buses] == ['cell1 main', 'cell2 main']
    assert model.drives_of('/cell2/drive_can_bridge') == ('/cell2/conveyor',)


@pytest.mark.parametrize(('namespace', 'found'), [
    ('', ['/a/x', '/ab/x', '/a/b/x']), ('/', ['/a/x', '/ab/x', '/a/b/x']),
    ('/a', ['/a/x', '/a/b/x']), ('a/', ['/a/x', '/a/b/x']), ('/nowhere', [])])
def test_a_namespace_limits_what_is_seen(namespace: str, found: list[str]) -> None:
    model = model_of([drive_status('x', bridge=f'{place}/bridge') for place in ('a', 'ab', 'a/b')],
                     namespace)
    assert list(model.drives) == found


def test_the_log_is_that_of_bridges() -> None:
    model = Model()
    model.logged(AT, 'INFO', 'drive_can_bridge', 'before')
    model.logged(AT, 'INFO', 'somebody', 'before, too')
    model.diagnosed([drive_status()], AT, NOW)
    model.logged(AT, 'INFO', 'somebody.else', 'after')
    model.logged(AT, 'WARN', 'drive_can_bridge', 'after')
    assert [(entry.level, entry.text) for entry in seen(model).log] == [
        ('INFO', 'before'), ('WARN', 'after')]


def test_two_bridges_do_not_share_a_drive() -> None:
    model = Model()
    model.diagnosed([drive_status(bridge='one'), drive_status(bridge='two')], AT, NOW)
    assert [(drive.name, drive.bridge) for drive in seen(model).drives] == [('/conveyor', '/one')]


@pytest.mark.parametrize('status', [
    Status('motor temperature', 0, 'ok', {}),
    Status('drive_can_bridge: drive conveyor', 0, 'somebody who sounds alike', {'state': 'x'}),
    Status('drive_can_bridge: motor conveyor', 0, '', {'missed_exchanges': '1'}),
    Status('drive_can_bridge: drive con/../veyor', 0, '', {'missed_exchanges': '1'}),
    Status('a b: drive conveyor', 0, '', {'missed_exchanges': '1'}),
    Status('\x1b[2J: drive conveyor', 0, '', {'missed_exchanges': '1'})])
def test_diagnostics_of_others_are_none_of_ours(status: Status) -> None:
    assert read_status(status) is None


def test_nothing_that_a_terminal_obeys_gets_through() -> None:
    evil = '\x1b]0;owned\x07\x1b[2J\r\n\u202e\ud800'
    model = model_of([bus_status(message=evil, state=evil),
                      drive_status(state=evil, message=evil, **{evil: evil, 'control_state': evil})
                      ])
    model.logged(AT, 'INFO', 'drive_can_bridge', evil * 1000)
    model.responded('/conveyor', [(evil, 1.0)], NOW)
    model.bit('/conveyor', evil, evil, True)
    assert _all_printable(seen(model))
    assert len(seen(model).log[0].text) < 20000


def _all_printable(value: object) -> bool:
    if isinstance(value, str):
        return value.isprintable()
    if isinstance(value, dict):
        return all(_all_printable(item) for pair in value.items() for item in pair)
    if isinstance(value, (tuple, list)):
        return all(map(_all_printable, value))
    slots = getattr(type(value), '__slots__', ())
    return all(_all_printable(getattr(value, name)) for name in slots)


@given(st.dictionaries(st.sampled_from(
    ['state', 'exchanges', 'missed_exchanges', 'latency_mean_ms', 'command_age_s', 'load_percent',
     'frames_sent']), st.text(max_size=20)), st.integers(), st.text(max_size=30))
def test_whatever_diagnostics_say_there_is_a_snapshot(facts: dict[str, str], level: int,
                                                      message: str) -> None:
    model = Model()
    for kind in ('drive', 'bus'):
        for now in (NOW, NOW + 1.0):
            model.diagnosed([Status(f'bridge: {kind} x', level, message, facts)], now, now)
    assert _all_printable(seen(model))


def test_where_a_drive_is_stays_with_it() -> None:
    model = model_of([drive_status()])
    place = Place('main', '1', 'cannord', 0.02)
    model.placed('/conveyor', place)
    model.placed('/nobody', place)
    model.described('/conveyor', PARAMETERS)
    drive, = seen(model).drives
    assert drive.place == place
    assert drive.parameters == PARAMETERS


def test_what_was_read_before_a_bridge_started_again_is_forgotten() -> None:
    model = model_of([drive_status()])
    model.described('/conveyor', PARAMETERS[:3])
    model.described('/conveyor', PARAMETERS)  # the next of many: nothing is told again
    feed(model, '/conveyor')
    model.read('/conveyor', [('ramp_time', 2.5)], NOW)
    drive, = seen(model).drives
    assert drive.readings['ramp_time'].text == '2.50'
    # the same configuration, but who knows what it has to do with
    model.described('/conveyor', [replace(parameter) for parameter in PARAMETERS])
    drive, = seen(model).drives
    assert drive.readings == {}
    assert drive.values
    # another one: what was in another unit goes, too
    model.described('/conveyor', [info('ramp_time', 'ms', 'uint16', access='rw'),
                                  *map(replace, PARAMETERS[:5])])
    drive, = seen(model).drives
    assert (drive.values, drive.setpoints) == ((), ())


@pytest.mark.parametrize('counts', [
    ({'exchanges': '2'}, {}), ({}, {'frames_sent': '7'}), ({'exchanges': '0'}, {})])
def test_a_bridge_that_counts_from_the_start_was_started_again(
        counts: tuple[dict[str, str], dict[str, str]]) -> None:
    drives = [drive_status(), drive_status('lift')]
    model = model_of([bus_status(), *drives])
    assert model.take_anew() == set()
    of_drive, of_bus = counts
    model.diagnosed([bus_status(**of_bus), drive_status(**of_drive), drives[1]], AT + 1.0,
                    NOW + 1.0)
    assert model.take_anew() == {BRIDGE, '/conveyor', '/lift'}
    assert model.take_anew() == set()


def test_there_is_an_upper_limit_to_what_diagnostics_say() -> None:
    model = model_of([drive_status(**{f'key{number}': '' for number in range(10_000)})])
    drive, = seen(model).drives
    assert len(drive.facts) == 100
