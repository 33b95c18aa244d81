# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A drive with 11-bit identifiers beside one with 29 bits: processes on one bus and one graph."""

import json
from pathlib import Path
import sys
import time

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Processes
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
SECONDS = 6.0


@pytest.mark.real
def test_both_hold_their_periods(processes: Processes, client: Client, namespace: str,
                                 tmp_path: Path) -> None:
    """While other processes read and write parameters of both drives without pause."""
    file = bridge_file(tmp_path, drives={'long': LONG, 'short': SHORT})
    simulator = processes.simulator(file)
    bridge = processes.bridge(file, namespace)
    drives = f'/{namespace}/long', f'/{namespace}/short'

    def facts() -> dict[str, dict[str, str]]:
        return {drive: client.diagnostics(status_of(drive)) for drive in drives}
    for drive in drives:
        client.online(drive)
        client.publish(f'{drive}/command/speed_setpoint', 0.0)
        client.diagnostics(status_of(drive), state='^online$')
        client.publish(f'{drive}/command/speed_setpoint', 30.0)
        client.value(f'{drive}/actual_speed', 29.5, 30.5)
    script = Path(__file__).with_name('flood_client.py')
    floods = [processes.start(
        [sys.executable, str(script), 'parameters', drive, str(SECONDS * SLOWNESS)], 'flood')
        for drive in drives]
    for flood in floods:
        flood.line('^ready$')
    before = facts()
    begin = time.monotonic()
    for flood in floods:
        assert flood.wait() == 0
    after = facts()
    elapsed = time.monotonic() - begin

    for flood in floods:
        result = json.loads(flood.lines[-1])
        assert result['rounds'] > 10
        assert result['failed'] == 0
        assert result['wrong'] == 0
    for drive in drives:
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
    assert not bridge.losses()
    assert not [line for line in simulator.lines if 'violation' in line]
    assert bridge.end() == 0
    assert simulator.end() == 0
