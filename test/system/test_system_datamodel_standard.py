# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A drive with 11-bit identifiers beside one with 29 bits: three processes on one bus and one graph.

The simulated drives log every frame and are thereby witnesses of what was on the bus; what is
compared here are literal bytes of the manual's tables, not of our codec.
"""

import json
from pathlib import Path
import sys
import time

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Process, Processes, Simulator
import pytest
from test_system_reconnection import status_of
from waiting import SLOWNESS

#: a machine that is busy lets simulated drives answer too late for their period
LONG = {**CONVEYOR, 'missed_limit': 250}
#: the same station number, with 11 bits: 3F1h and 7F1h
SHORT = {**CONVEYOR, 'protocol': 'datamodel_standard',
         # an answer that is later than both together cannot be told from the next one: generous
         'parameter_timeout': 1.0, 'quarantine': 1.0,
         # longer than the drive needs: it begins to count when it gets round to it
         'eeprom_write_gap': 0.2}
#: Reg.209 to 211 in one read
ASK = r'^3F1#03D1000300000000 R$'
ANSWER = r'^7F1#.{12}A5A5 T$'
NEUTRAL = r'^3F1#06(320{12}|3300E8030{6}) R$'
MOVING = r'^3F1#063200(?!0000)'
SECONDS = 6.0


class Bench:
    """A bridge with both drives."""

    def __init__(self, processes: Processes, client: Client, namespace: str, directory: Path,
                 **options: object) -> None:
        self.client = client
        self.processes = processes
        self.long, self.short = f'/{namespace}/long', f'/{namespace}/short'
        file = bridge_file(directory, drives={'long': LONG, 'short': {**SHORT, **options}})
        self.simulator: Simulator = processes.simulator(file)
        self.bridge: Process = processes.bridge(file, namespace)
        client.online(self.long)
        client.online(self.short)

    def arm(self, drive: str) -> None:
        """Send neutral until nothing waits for it."""
        self.client.publish(f'{drive}/command/speed_setpoint', 0.0)
        self.client.diagnostics(status_of(drive), state='^online$')

    def move(self, drive: str, speed: float) -> None:
        self.client.publish(f'{drive}/command/speed_setpoint', speed)
        self.client.value(f'{drive}/actual_speed', speed - 0.5, speed + 0.5)

    def facts(self, drive: str, **conditions: str) -> dict[str, str]:
        return self.client.diagnostics(status_of(drive), **conditions)

    def end(self) -> None:
        assert self.bridge.end() == 0
        assert self.simulator.end() == 0


@pytest.fixture(name='start')
def _start(processes: Processes, client: Client, namespace: str, tmp_path: Path) -> object:
    return lambda **options: Bench(processes, client, namespace, tmp_path, **options)


@pytest.mark.real
@pytest.mark.alone
def test_both_hold_their_periods(start: type[Bench]) -> None:
    """While other processes read and write parameters of both drives without pause."""
    bench = start()
    client = bench.client
    for drive in (bench.long, bench.short):
        bench.arm(drive)
        bench.move(drive, 30.0)
    script = Path(__file__).with_name('flood_client.py')
    floods = [bench.processes.start(
        [sys.executable, str(script), 'parameters', drive, str(SECONDS * SLOWNESS)], 'flood')
        for drive in (bench.long, bench.short)]
    for flood in floods:
        flood.line('^ready$')
    before = {drive: bench.facts(drive) for drive in (bench.long, bench.short)}
    begin = time.monotonic()
    for flood in floods:
        assert flood.wait() == 0
    after = {drive: bench.facts(drive) for drive in (bench.long, bench.short)}
    elapsed = time.monotonic() - begin

    for flood in floods:
        result = json.loads(flood.lines[-1])
        assert result['rounds'] > 10
        assert result['failed'] == 0
        assert result['wrong'] == 0
    for drive in (bench.long, bench.short):
        exchanges = int(after[drive]['exchanges']) - int(before[drive]['exchanges'])
        missed = int(after[drive]['missed_exchanges']) - int(before[drive]['missed_exchanges'])
        # Generous: this machine may have other things to do, and a simulated drive that gets no
        # time answers too late. A period that is not held at all would be a round per request.
        expected = elapsed / 0.02
        assert 0.5 * expected / SLOWNESS < exchanges + missed < 1.5 * expected, (drive, missed)
        assert exchanges > 0.3 * expected / SLOWNESS, (drive, exchanges, missed, elapsed)
        assert after[drive]['state'] == 'online'
        assert after[drive]['parameter_requests_failed'] == '0'
        client.value(f'{drive}/actual_speed', 29.5, 30.5)
    assert not bench.bridge.losses()
    assert not [line for line in bench.simulator.lines if 'violation' in line]
    bench.end()


def test_answers_that_are_150_ms_late(start: type[Bench]) -> None:
    """They never become a value; the drive goes offline, and comes back when it behaves."""
    bench = start(parameter_timeout=0.1, missed_limit=3)
    client, simulator, drive = bench.client, bench.simulator, bench.short
    names = ('ramp_time', 'maximum_speed', 'rated_current', 'speed_gain', 'jog_speed')
    right = client.get(drive, *names)
    assert None not in right
    bench.arm(drive)
    bench.move(drive, 150.0)
    client.value(f'{drive}/actual_speed', 149.9, 150.1)

    simulator.write('short late=0.15')
    simulator.line('short: fault late=0.15')
    for _ in range(2):
        found = client.get(drive, *names)
        assert all(value in (None, known) for value, known in zip(found, right)), found
    client.online(drive, wanted=False)
    bench.bridge.error('short: offline: no complete round of reads for 3 periods')
    assert client.values(f'{drive}/actual_speed')[-1] <= 150.1
    assert client.values(f'{drive}/actual_speed')[0] >= 149.9
    facts = bench.facts(drive, state='^offline$', late_answers='^[1-9]')
    assert facts['level'] == '2'
    assert client.get(drive, 'ramp_time', 'maximum_speed') == [None, None]
    # the late answers do come, and are thrown away
    count = int(facts['late_answers'])
    while int(bench.facts(drive)['late_answers']) < count + 2:
        pass
    # the other one does not mind
    assert bench.facts(bench.long)['state'] in ('online', 'not armed')
    assert client.get(bench.long, 'ramp_time') != [None]

    since = len(simulator.frames())
    simulator.write('short ok')
    client.online(drive)
    # nothing moves before somebody has armed it again; the publisher went on all the time
    bench.facts(drive, message='not armed: .*/speed_setpoint')
    simulator.frame(NEUTRAL, since, count=2)
    assert not simulator.frames(MOVING, since)
    bench.arm(drive)
    bench.move(drive, 50.0)
    assert client.get(drive, *names) == right
    assert not bench.bridge.losses('long: offline')
    bench.end()
