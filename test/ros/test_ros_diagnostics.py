# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What ``/diagnostics`` says, and that it says what to do."""

import math
from pathlib import Path
from typing import Any

from bridges import Bridge, CONVEYOR, HASTY, parameters, StartBridge
from clients import Client, ERROR, wait_until
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
from std_msgs.msg import Float64
from waiting import clock

from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.core.sentences import answer_late, NOTHING
from drive_can_bridge.ros.diagnostics import BusReporter, DriveReporter
from drive_can_bridge.transport import link
from drive_can_bridge.transport.end_point import Counts

BUS, DRIVE = 'drive_can_bridge: bus main', 'drive_can_bridge: drive conveyor'
BUS_KEYS = {
    'state', 'code', 'load_percent', 'frames_sent', 'frames_received', 'frames_rejected',
    'error_frames',
    'bus_off_count', 'reconnections', 'send_failures'}
DRIVE_KEYS = {
    'state', 'code', 'exchanges', 'missed_exchanges', 'latency_mean_ms', 'latency_p99_ms',
    'latency_max_ms', 'period_error_mean_ms', 'period_error_p99_ms', 'period_error_max_ms',
    'command_age_s', 'commands_refused', 'frames_rejected', 'late_answers',
    'parameter_requests_ok', 'parameter_requests_failed', 'last_parameter_error', 'short_frames',
    'fault_code'}


def test_names_and_keys(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor=CONVEYOR, other={**CONVEYOR, 'station': 2}))
    one.online()
    message = client.topic('/diagnostics', DiagnosticArray).wait()
    assert [status.name for status in message.status] == [
        BUS, DRIVE, 'drive_can_bridge: drive other']
    assert message.header.stamp.sec > 0
    for status, keys in zip(message.status, (BUS_KEYS, DRIVE_KEYS, DRIVE_KEYS)):
        assert keys == {pair.key for pair in status.values}
        assert status.message and status.hardware_id == status.name.rsplit(' ', 1)[1]


def test_a_drive_that_works(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'cyclic_request': ['speed_setpoint']}))
    one.online()
    status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'not armed')
    assert status['level'] == 'WARN' and status['command_age_s'] == 'nan'
    assert 'publish 0 to /conveyor/command/speed_setpoint' in status['message']
    client.publish('/conveyor/command/speed_setpoint', Float64(data=0.0))
    # a warning that an answer came too late goes by; busy machines have some
    status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'online'
                                and drive['level'] == 'OK')
    assert float(status['command_age_s']) >= 0.0
    status = client.diagnostics(DRIVE, lambda drive: int(drive['exchanges']) > 10)
    for name in ('latency', 'period_error'):
        values = [float(status[f'{name}_{what}_ms']) for what in ('mean', 'p99', 'max')]
        assert all(math.isfinite(value) for value in values) and values[2] >= values[0]
    bus = client.diagnostics(BUS, lambda bus: int(bus['frames_received']) > 10)
    assert bus['level'] == 'OK' and bus['state'] == 'up'
    assert 0.0 < float(bus['load_percent']) < 100.0
    assert int(bus['frames_sent']) >= 10


def test_rearm_immediate_takes_any_command(bridge: StartBridge, client: Client) -> None:
    bridge(parameters(conveyor={**CONVEYOR, 'rearm': 'immediate'}))
    status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'not armed')
    assert 'publish a command to /conveyor/command/speed_setpoint' in status['message']


def test_offline_says_where_to_look(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, **HASTY}), autostart=False)
    one.played['conveyor'].fault('off')
    assert client.transition(1) and client.transition(3)
    status = client.diagnostics(DRIVE, lambda drive: 'no answer' in drive['message'])
    assert (status['state'], status['level']) == ('offline', 'STALE')
    assert 'not seen since start' in status['message'] and 'station' in status['message']
    one.played['conveyor'].fault('ok')
    client.diagnostics(DRIVE, lambda drive: drive['state'] == 'not armed')
    one.played['conveyor'].fault('off')
    status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'offline')
    assert status['level'] == 'ERROR' and 'check' in status['message']
    assert int(status['missed_exchanges']) >= 5


def test_a_drive_slower_than_its_period_is_told(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={
        **CONVEYOR, 'protocol': 'datamodel_standard', 'period': 0.1, 'parameter_timeout': 0.5}))
    one.online()
    one.played['conveyor'].fault('late=0.2')
    status = client.diagnostics(DRIVE, lambda drive: 'an exchange takes' in drive['message'])
    assert status['level'] == 'WARN'
    assert 'the period is 100 ms: the drive is slow' in status['message']
    one.played['conveyor'].fault('ok')
    client.diagnostics(DRIVE, lambda drive: 'an exchange takes' not in drive['message'])


def reporters(one: Bridge) -> tuple[BusReporter, DriveReporter]:
    """Return what reports on the bus and the drive, when we ask for it and nobody else."""
    diagnostics = one.node.diagnostics
    assert diagnostics is not None
    return diagnostics.buses[0], diagnostics.drives[0]


def by_hand(**keys: Any) -> dict[str, Any]:
    """Return parameters of a bridge that reports once, at its start."""
    return {**parameters(conveyor={**CONVEYOR, **keys}), 'diagnostics_period': 3600.0}


def test_a_round_that_users_held_up_is_no_slow_drive(bridge: StartBridge,
                                                     client: Client) -> None:
    one = bridge(by_hand(protocol='datamodel_standard', period=0.1))
    one.online()
    _, reporter = reporters(one)
    statistics = one.node.drives['conveyor'].session.statistics

    def told_of_a_long_round() -> str:
        with one.node.exchanges['main'].lock:
            statistics.latency.add(100.0)
        return reporter.report(clock().now()).message
    assert 'an exchange takes' in told_of_a_long_round()
    assert client.get('/conveyor', 'ramp_time') != [None]
    assert 'an exchange takes' not in told_of_a_long_round()
    assert 'an exchange takes' in told_of_a_long_round()


def test_what_is_over_is_not_told_again(bridge: StartBridge) -> None:
    one = bridge(by_hand())
    one.online()
    bus, drive = reporters(one)
    link = one.node.exchanges['main'].link
    with one.record() as recorder:
        recorder.send(0x00200000 | 30 << 4 | 1, bytes(8))
        wait_until(lambda: one.node.drives['conveyor'].foreign_text)
    assert 'there must be one master only' in drive.report(clock().now()).message
    assert 'master' not in drive.report(clock().now()).message
    link.send_failures += 2
    link.last_error = 'send: transmit queue full'
    report = bus.report(clock().now())
    assert (report.level, report.message) == (
        DiagnosticStatus.WARN, '2 frames not sent: send: transmit queue full')
    report = bus.report(clock().now())
    assert (report.level, report.message[:8]) == (DiagnosticStatus.OK, 'virtual ')
    assert report.facts['send_failures'] == '2'


def test_frames_that_the_adapter_refused_afterwards_were_not_sent(
        bridge: StartBridge, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(by_hand())
    one.online()
    bus, _ = reporters(one)
    link = one.node.exchanges['main'].link
    monkeypatch.setattr(type(link), 'counts', Counts(refused=3))
    link.frames_sent, link.send_failures = 1000, 1
    report = bus.report(clock().now())
    assert (report.level, report.message) == (
        DiagnosticStatus.WARN, '4 frames not sent: the adapter refuses frames')
    assert report.facts['send_failures'] == '4'
    assert 997 <= int(report.facts['frames_sent']) < 1100
    assert bus.report(clock().now()).level == DiagnosticStatus.OK


def test_the_load_is_that_of_both_directions(bridge: StartBridge) -> None:
    one = bridge(by_hand())
    one.online()
    bus, _ = reporters(one)
    exchange = one.node.exchanges['main']

    def frames() -> tuple[int, int]:
        return exchange.link.frames_sent, exchange.link.frames_received
    with exchange.lock:
        sent, received = frames()
        bus.report(100.0)
    wait_until(lambda: frames()[0] > sent + 10 and frames()[1] > received + 10)
    with exchange.lock:
        count = sum(frames()) - sent - received
        load = float(bus.report(101.0).facts['load_percent'])
    # 29 bits and 8 bytes: 131 bits, 11 % more with what stuffing adds on average; 1 Mbit/s
    assert load == pytest.approx(100 * count * 131 * 1.11 / 1_000_000, abs=0.06)


def test_strangers_are_counted_and_told(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    with one.record() as recorder:
        for _ in range(3):  # nobody asked for parameter 99
            recorder.send(0x10200000 | 99 << 4 | 1, bytes(8))
        status = client.diagnostics(DRIVE, lambda drive: int(drive['frames_rejected']) >= 3)
        client.wait_logged('conveyor: frame rejected')
        recorder.send(0x00200000 | 30 << 4 | 1, bytes(8))
        client.wait_logged('another master sends requests to station 1')
        recorder.send(0x102, bytes(8), extended=False)
        recorder.send(0x10200000 | 99 << 4 | 1, bytes(3))
    assert status['parameter_requests_failed'] == '0'
    client.diagnostics(DRIVE, lambda drive: int(drive['frames_rejected']) >= 4)


@pytest.mark.parametrize(('seconds', 'words'), [
    (0.004, '4 ms'), (0.0003, '0.3 ms'), (0.1234, '123 ms')])
def test_a_late_answer_in_words(seconds: float, words: str) -> None:
    assert answer_late(seconds) == (
        f'answer {words} after its period: the computer or the drive is too slow')


def test_late_answers_are_no_second_station(bridge: StartBridge, client: Client) -> None:
    one = bridge()
    one.online()
    drive, = one.node.drives.values()
    with drive.exchange.lock:
        drive.session.report.unasked(NOTHING, 0.004, math.inf)
    client.wait_logged('conveyor: answer 4 ms after its period')
    status = client.diagnostics(DRIVE, lambda drive: int(drive['late_answers']) >= 1)
    assert int(status['frames_rejected']) == 0


def test_a_bus_that_is_not_there_yet(bridge: StartBridge, client: Client,
                                     monkeypatch: pytest.MonkeyPatch) -> None:
    there = False
    original = link.open_port

    def open_port(*arguments: Any, **options: Any) -> Any:
        if not there:
            raise BusUnavailable('virtual: no such device')
        return original(*arguments, **options)
    monkeypatch.setattr(link, 'open_port', open_port)
    one = bridge()
    assert client.wait_logged('virtual: no such device', ERROR) == (
        'bus main: virtual: no such device; tried again every 0.1 s')
    bus = client.diagnostics(BUS)
    assert (bus['state'], bus['level']) == ('down', 'ERROR')
    assert 'no such device' in bus['message'] and 'tried again every 0.1 s' in bus['message']
    drive = client.diagnostics(DRIVE)
    assert (drive['state'], drive['level']) == ('offline', 'STALE')
    assert drive['message'] == 'bus main is down'
    assert client.set('/conveyor', ramp_time=1.0) == [(False, 'bus down')]
    assert client.get('/conveyor', 'ramp_time') == [None]
    client.wait_logged('conveyor: read ramp_time (P30): bus down')
    there = True
    one.online()
    client.diagnostics(BUS, lambda bus: bus['state'] == 'up' and bus['level'] == 'OK')
    one.node.exchanges['main'].link._loss = 'unplugged'
    wait_until(lambda: not one.node.drives['conveyor'].session.online)
    one.online()
    client.diagnostics(BUS, lambda bus: bus['reconnections'] == '1')
    assert not one.fatal


def test_mapping_differs(bridge: StartBridge, client: Client) -> None:
    one = bridge(autostart=False)
    drive = one.played['conveyor']
    drive.set_value('p123', 99)
    assert client.transition(1)
    with one.record() as recorder:
        assert client.transition(3)
        client.wait_logged('conveyor: mapping differs, no cyclic frame is sent: request map is '
                           '50, 99, configured 50, 51', ERROR)
        status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'mapping differs')
        assert status['level'] == 'ERROR'
        assert 'request map is 50, 99, configured 50, 51' in status['message']
        assert 'mapping: configure' in status['message']
        # parameter services work meanwhile
        drive.set_value('ramp_time', 1.5)
        assert client.get('/conveyor', 'ramp_time', 'p123') == [pytest.approx(1.5), 99]
        assert client.set('/conveyor', jog_speed=2.0) == [(True, '')]
        assert not recorder.cycles()
        # it is looked at again without being asked
        drive.set_value('p123', 51)
        one.online()
        wait_until(recorder.cycles)


def test_forgotten_maps_stop_the_cycle(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, **HASTY}))
    one.online()
    drive = one.played['conveyor']
    drive.fault('forget=0')
    client.wait_logged('conveyor: mapping differs, no cyclic frame is sent: request map is empty',
                       ERROR)
    status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'mapping differs')
    assert status['level'] == 'ERROR'
    for name, number in (('p126', 209), ('p127', 210), ('p128', 211), ('p122', 50),
                         ('p123', 51)):
        drive.set_value(name, number)
    one.online()


def test_maps_that_the_drive_does_not_keep(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'mapping': 'configure'}), autostart=False)
    drive = one.played['conveyor']
    drive.set_value('p123', 99)
    drive.fault('refuse=p123')
    assert client.transition(1) and client.transition(3)
    status = client.diagnostics(DRIVE, lambda drive: drive['code'] == 'maps_not_kept')
    assert status['state'] == 'mapping differs'
    assert status['message'].endswith(
        '; the drive does not keep the maps that are written: correct the drive or the '
        'configuration')


def test_what_no_map_can_mend(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={
        'bus': 'main', 'protocol': 'cia402', 'station': 1, 'profile': 'cia402_servo',
        'mode': 'csp', 'period': 0.02, 'cyclic_request': ['target_position'],
        'cyclic_response': ['actual_position']}), autostart=False)
    one.played['conveyor'].set_value('x6502.0', 0x25)
    assert client.transition(1) and client.transition(3)
    status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'mapping differs')
    assert (status['level'], status['code']) == ('ERROR', 'drive_to_correct')
    assert status['message'] == (
        'mapping differs: mode csp (8) is none of those that 6502h offers (00000025h); '
        'correct the drive or the configuration')


def test_mapping_configure_rewrites(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'mapping': 'configure'}))
    one.online()
    client.wait_logged('conveyor: maps of the drive rewritten: request map [50, 51], response map '
                       '[209, 210, 211]')
    drive = one.played['conveyor']
    assert [drive.value(f'p{number}') for number in range(122, 130)] == [
        50, 51, 0, 0, 209, 210, 211, 0]
    assert not drive.violations


def test_the_last_message_says_that_it_is_the_last(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'cyclic_request': []}))
    one.online()
    topic = client.topic('/diagnostics', DiagnosticArray)
    topic.wait()
    one.node.stop()
    message = topic.wait(lambda array: array.status[1].level == DiagnosticStatus.STALE)
    assert message.status[1].message == 'bridge ended: start it again'


REFUSING = """
protocols: [canopen_pkw]
parameters:
  speed: {number: 100, type: uint16, access: ro}
  missing: {number: 200, type: uint16, access: ro}
"""


def test_what_is_refused_is_never_ok(bridge: StartBridge, client: Client, tmp_path: Path) -> None:
    profile = tmp_path / 'refusing.yaml'
    profile.write_text(REFUSING, encoding='utf-8')
    one = bridge(parameters(conveyor={
        'bus': 'main', 'protocol': 'canopen_pkw', 'station': 1, 'profile': str(profile),
        'period': 0.1, 'cyclic_response': ['speed', 'missing'], 'missed_limit': 100,
        'parameter_timeout': 2.0}))
    one.online()
    status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'online')
    assert (status['level'], status['message']) == ('OK', 'online')
    table: Any = one.played['conveyor'].drive
    for address in [entry for entry, cell in table.table._cells.items()
                    if cell.parameter.name == 'missing']:
        del table.table._cells[address]
    status = client.diagnostics(DRIVE, lambda drive: drive['level'] != 'OK')
    assert (status['state'], status['level']) == ('online', 'WARN')
    assert 'missing' in status['message'] and 'correct cyclic_response' in status['message']
    assert status['missed_exchanges'] == '0'
