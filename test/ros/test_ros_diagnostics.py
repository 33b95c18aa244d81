# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What ``/diagnostics`` says, and that it says what to do."""

import ast
import math
from pathlib import Path
import re
from typing import Any

from bridges import Bridge, CONVEYOR, HASTY, parameters, StartBridge
from clients import Client, ERROR, facts, wait_until
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from families import BUS_KEYS, FAMILIES, KEYS, SOMETIMES
import pytest
from saying import says
from waiting import clock

from drive_can_bridge.core import sentences
from drive_can_bridge.core.adapter import AdapterTraits
from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.core.events import AnswerLate
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.ros import diagnostics
from drive_can_bridge.ros.diagnostics import BusReporter, DriveReporter
from drive_can_bridge.transport import link
from drive_can_bridge.transport.end_point import Counts
from drive_can_bridge.transport.failures import with_outlook

BUS, DRIVE = 'drive_can_bridge: bus main', 'drive_can_bridge: drive conveyor'
OTHER = 'drive_can_bridge: drive other'
PACKAGE = Path(diagnostics.__file__).parents[1]
#: where they are described: a table, keys in its first column
PAGE = PACKAGE.parent / 'docs' / 'ros_interface.md'


def test_names_and_keys(bridge: StartBridge, client: Client) -> None:
    bridge(parameters(conveyor=CONVEYOR, other={**CONVEYOR, 'station': 2})).online()
    message = client.topic('/diagnostics', DiagnosticArray).wait()
    assert [status.name for status in message.status] == [BUS, DRIVE, OTHER]
    assert message.header.stamp.sec > 0
    of_drive = KEYS | {'short_frames', 'fault_code'}
    for status, keys in zip(message.status, (BUS_KEYS, of_drive, of_drive)):
        assert keys == {pair.key for pair in status.values}
        assert status.message and status.hardware_id == status.name.rsplit(' ', 1)[1]


def keys_in_the_page() -> list[str]:
    """Return the keys that the page describes, in its order."""
    table = PAGE.read_text(encoding='utf-8').partition('\n## Diagnostics\n')[2].partition(
        '\n| key | meaning |\n')[2].partition('\n\n')[0]
    return [key for row in table.splitlines() for key in re.findall('`(.+?)`', row.split('|')[1])]


def keys_in_the_sources() -> set[str]:
    """Return the keys of all that makes or adds to a status."""
    found = set[str]()
    for source in PACKAGE.rglob('*.py'):
        wanted = 'report' if source == Path(diagnostics.__file__) else 'facts'
        for function in ast.walk(ast.parse(source.read_text(encoding='utf-8'))):
            if isinstance(function, ast.FunctionDef) and function.name == wanted:
                found |= {key.value for table in ast.walk(function) if isinstance(table, ast.Dict)
                          for key in table.keys
                          if isinstance(key, ast.Constant) and isinstance(key.value, str)}
    return found


def test_the_page_describes_every_key() -> None:
    described = keys_in_the_page()
    families = set[str]().union(*(family.diagnostics for family in FAMILIES))
    assert set(described) == BUS_KEYS | KEYS | families | SOMETIMES
    # of a bus and of a drive it is not the same
    assert {key for key in described if described.count(key) > 1} == {'frames_rejected'}
    times = {f'{name}_{what}_ms' for name in ('latency', 'period_error')
             for what in ('mean', 'p99', 'max')}
    assert keys_in_the_sources() == set(described) - times


def test_times_and_frames_of_a_drive_that_works(bridge: StartBridge, client: Client) -> None:
    bridge().online()
    status = client.diagnostics(DRIVE, lambda drive: int(drive['exchanges']) > 10)
    for name in ('latency', 'period_error'):
        values = [float(status[f'{name}_{what}_ms']) for what in ('mean', 'p99', 'max')]
        assert all(math.isfinite(value) for value in values) and values[2] >= values[0]
    bus = client.diagnostics(BUS, lambda bus: int(bus['frames_received']) > 10)
    assert bus['level'] == 'OK' and bus['state'] == 'up'
    assert 0.0 < float(bus['load_percent']) < 100.0
    assert int(bus['frames_sent']) >= 10


def test_one_that_was_never_seen_is_stale(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, **HASTY}), autostart=False)
    one.played['conveyor'].fault('off')
    assert client.transition(1) and client.transition(3)
    status = client.diagnostics(DRIVE, lambda drive: 'no answer' in drive['message'])
    assert (status['state'], status['level']) == ('offline', 'STALE')
    assert status['code'] == 'never_seen'


def test_a_drive_slower_than_its_period_is_told(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={
        **CONVEYOR, 'protocol': 'datamodel_standard', 'period': 0.1, 'parameter_timeout': 0.5}))
    one.online()
    one.played['conveyor'].fault('late=0.2')
    status = client.diagnostics(DRIVE, lambda drive: drive['code'] == 'slow_exchange')
    assert status['level'] == 'WARN'
    one.played['conveyor'].fault('ok')
    client.diagnostics(DRIVE, lambda drive: drive['code'] == 'not_armed')


def reporters(one: Bridge) -> tuple[BusReporter, DriveReporter]:
    """Return what reports on the bus and the drive, when we ask for it and nobody else."""
    diagnostics = one.node.diagnostics
    assert diagnostics is not None
    return diagnostics.buses[0], diagnostics.drives[0]


def told(reporter: DriveReporter) -> list[Sentence]:
    """Return all that a report says."""
    message = reporter.report(clock().now()).message
    return list(message.fields.get('parts', [message]))


def by_hand(**keys: Any) -> dict[str, Any]:
    """Return parameters of a bridge that reports once, at its start."""
    return {**parameters(conveyor={**CONVEYOR, **keys}), 'diagnostics_period': 3600.0}


def test_a_round_that_users_held_up_is_no_slow_drive(bridge: StartBridge,
                                                     client: Client) -> None:
    one = bridge(by_hand(protocol='datamodel_standard', period=0.1)).online()
    _, reporter = reporters(one)
    statistics = one.node.drives['conveyor'].session.statistics

    def told_of_a_long_round() -> list[Sentence]:
        with one.node.exchanges['main'].lock:
            statistics.latency.add(100.0)
        return told(reporter)
    assert says('slow_exchange', period=0.1) in told_of_a_long_round()
    assert client.get('/conveyor', 'ramp_time') != [None]
    assert says('slow_exchange') not in told_of_a_long_round()
    assert says('slow_exchange', period=0.1) in told_of_a_long_round()


def test_a_limit_that_is_not_in_effect_is_an_error(
        bridge: StartBridge, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(by_hand()).online()
    why = sentences.limit_in_vain('torque_limit (6072h.00h) stays 100 % although 30 % is sent')
    monkeypatch.setattr(type(one.node.drives['conveyor'].session), 'error', why)
    report = reporters(one)[1].report(clock().now())
    assert (report.level, report.message) == (DiagnosticStatus.ERROR, why)


def test_what_is_over_is_not_told_again(bridge: StartBridge) -> None:
    one = bridge(by_hand()).online()
    bus, drive = reporters(one)
    link = one.node.exchanges['main'].link
    with one.record() as recorder:
        recorder.send(0x00200000 | 30 << 4 | 1, bytes(8))
        wait_until(lambda: one.node.drives['conveyor'].foreign_text)
    assert says('one_master_only') in told(drive)
    assert says('one_master_only') not in told(drive)
    link.send_failures += 2
    link.last_error = 'send: transmit queue full'
    report = bus.report(clock().now())
    assert (report.level, report.message) == (
        DiagnosticStatus.WARN, says('frames_not_sent', frames=2, why=link.last_error))
    report = bus.report(clock().now())
    assert (report.level, report.message) == (
        DiagnosticStatus.OK, says('bus_up', interface='virtual'))
    assert report.facts['send_failures'] == '2'


def test_frames_that_the_adapter_refused_afterwards_were_not_sent(
        bridge: StartBridge, monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(by_hand()).online()
    bus, _ = reporters(one)
    link = one.node.exchanges['main'].link
    monkeypatch.setattr(type(link), 'counts', Counts(refused=3))
    link.frames_sent, link.send_failures = 1000, 1
    report = bus.report(clock().now())
    assert (report.level, report.message) == (
        DiagnosticStatus.WARN,
        says('frames_not_sent', frames=4, why=says('adapter_refuses_frames')))
    assert report.facts['send_failures'] == '4'
    assert 997 <= int(report.facts['frames_sent']) < 1100
    assert bus.report(clock().now()).level == DiagnosticStatus.OK


def test_the_load_is_that_of_both_directions(bridge: StartBridge) -> None:
    one = bridge(by_hand()).online()
    bus, _ = reporters(one)
    exchange = one.node.exchanges['main']

    def frames() -> tuple[int, int]:
        return exchange.link.frames_sent, exchange.link.frames_received
    sent, received = frames()
    bus.report(100.0)
    wait_until(lambda: frames()[0] > sent + 10 and frames()[1] > received + 10)
    count = sum(frames()) - sent - received
    load = float(bus.report(101.0).facts['load_percent'])
    # 29 bits and 8 bytes: 131 bits, 11 % more with what stuffing adds on average; 1 Mbit/s
    assert load == pytest.approx(100 * count * 131 * 1.11 / 1_000_000, abs=0.06)


def test_strangers_are_counted_and_told(bridge: StartBridge, client: Client) -> None:
    one = bridge().online()
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
    assert sentences.answer_late(seconds).startswith(f'answer {words} after')


def test_late_answers_are_no_second_station(bridge: StartBridge, client: Client) -> None:
    one = bridge().online()
    drive, = one.node.drives.values()
    with drive.exchange.lock:
        drive.session.report.unasked(NOTHING, 0.004, math.inf)
    assert client.wait_logged('answer 4 ms after its period') in client.logged()
    with drive.exchange.lock:
        drive.session.report.note(AnswerLate(0.0004, taken=True))
        drive.session.report.note(AnswerLate(
            0.0005, sentences.longer_period_would_hold(late=0.0005, period=0.023)))
    assert client.wait_logged('answer 0.4 ms after its period') not in client.logged()
    assert client.wait_logged('answer 0.5 ms after its period') == (
        f'conveyor: {sentences.answer_late(0.0005)}; period: 0.023 would have held')
    status = client.diagnostics(DRIVE, lambda drive: int(drive['late_answers']) >= 1)
    assert int(status['frames_rejected']) == 0


def test_an_adapter_that_keeps_what_it_has_received(bridge: StartBridge,
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    one = bridge(by_hand()).online()
    exchange, (drive,) = one.node.exchanges['main'], one.node.drives.values()
    command = 'echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer'
    monkeypatch.setattr(diagnostics, 'traits_of', lambda bus: AdapterTraits(
        'LAWICEL CANUSB', 0.016, command))
    bus = BusReporter(exchange, 0.01)
    report = bus.report(clock().now())
    assert (report.level, report.message) == (DiagnosticStatus.WARN, says(
        'adapter_keeps', adapter='LAWICEL CANUSB', latency=0.016, period=0.01, remedy=command))
    assert report.facts['adapter_latency_ms'] == '16'
    assert BusReporter(exchange, 0.02).report(clock().now()).level == DiagnosticStatus.OK
    reporter = DriveReporter(drive)
    reporter.report(clock().now())
    with drive.exchange.lock:
        drive.session.report.unasked(NOTHING, 0.0001, math.inf)
    period = drive.session.configuration.period
    expected = 'answer_kept' if period + 0.0001 <= 0.021 else 'answer_late'
    assert expected in str(codes_of(reporter.report(clock().now()).message))


def codes_of(message: Sentence) -> list[str]:
    """Return the codes of a sentence, or of all that it is put together of."""
    return [each.code for each in message.fields.get('parts', [message])]


def test_a_bus_that_is_not_there_yet(bridge: StartBridge, client: Client,
                                     monkeypatch: pytest.MonkeyPatch) -> None:
    there, why = False, 'virtual: no such device'
    original = link.open_port

    def open_port(*arguments: Any, **options: Any) -> Any:
        if not there:
            raise BusUnavailable(why)
        return original(*arguments, **options)
    monkeypatch.setattr(link, 'open_port', open_port)
    one = bridge()
    outlook = with_outlook(why, 0.1)
    assert client.wait_logged(why, ERROR) == f'bus main: {outlook}'
    bus = client.diagnostics(BUS)
    assert (bus['state'], bus['level']) == ('down', 'ERROR')
    assert bus['message'] == sentences.bus_not_up('down', outlook)
    drive = client.diagnostics(DRIVE)
    assert (drive['state'], drive['level']) == ('offline', 'STALE')
    assert drive['message'] == sentences.bus_of_drive_down('main')
    assert client.set('/conveyor', ramp_time=1.0) == [(False, sentences.bus_down())]
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
    how = 'request map is 50, 99, configured 50, 51'
    assert client.transition(1)
    with one.record() as recorder:
        assert client.transition(3)
        client.wait_logged(f'conveyor: mapping differs, no cyclic frame is sent: {how}', ERROR)
        status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'mapping differs')
        assert status['level'] == 'ERROR'
        assert status['message'] == sentences.maps_to_correct(sentences.mapping_differs(how))
        # parameter services work meanwhile
        drive.set_value('ramp_time', 1.5)
        assert client.get('/conveyor', 'ramp_time', 'p123') == [pytest.approx(1.5), 99]
        assert client.set('/conveyor', jog_speed=2.0) == [(True, '')]
        assert not recorder.cycles()
        # it is looked at again without being asked
        drive.set_value('p123', 51)
        one.online()
        wait_until(recorder.cycles)


def test_mapping_configure_rewrites(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'mapping': 'configure'})).online()
    client.wait_logged('conveyor: maps of the drive rewritten: request map [50, 51], response map '
                       '[209, 210, 211]')
    drive = one.played['conveyor']
    assert [drive.value(f'p{number}') for number in range(122, 130)] == [
        50, 51, 0, 0, 209, 210, 211, 0]
    assert not drive.violations


def test_the_last_message_says_that_it_is_the_last(bridge: StartBridge, client: Client) -> None:
    one = bridge(parameters(conveyor={**CONVEYOR, 'cyclic_request': []})).online()
    topic = client.topic('/diagnostics', DiagnosticArray)
    topic.wait()
    one.node.stop()
    message = topic.wait(lambda array: array.status[1].level == DiagnosticStatus.STALE)
    assert facts(message.status[1])['code'] == 'bridge_ended'


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
        'parameter_timeout': 2.0})).online()
    status = client.diagnostics(DRIVE, lambda drive: drive['state'] == 'online')
    assert (status['level'], status['message']) == ('OK', 'online')
    table: Any = one.played['conveyor'].drive
    for address in [entry for entry, cell in table.table._cells.items()
                    if cell.parameter.name == 'missing']:
        del table.table._cells[address]
    status = client.diagnostics(DRIVE, lambda drive: drive['level'] != 'OK')
    assert (status['state'], status['level']) == ('online', 'WARN')
    assert status['code'] == 'poll_refused' and 'missing' in status['message']
    assert status['missed_exchanges'] == '0'
