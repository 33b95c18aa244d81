# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the executable says about configurations that cannot work, and about absent buses.

Its other refusals are in ``ros/test_ros_refusals.py``.
"""

from pathlib import Path
import re

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Processes

#: how rclpy writes a line
LOGGED = re.compile(r'\[(ERROR|FATAL|WARN|INFO)\] \[[0-9.]+\] \[[\w.]+\]: (.*)')


def test_every_problem_is_named(processes: Processes, tmp_path: Path) -> None:
    file = bridge_file(
        tmp_path, bus={'bitrate': 'fast'},
        drives={'conveyor': {**CONVEYOR, 'statoin': 1, 'station': 128},
                'lift': {**CONVEYOR, 'station': 2, 'bus': 'second'},
                'table': {**CONVEYOR, 'station': 3, 'cyclic_request': ['speed_setpiont']}},
        diagnostic_period=1.0)
    bridge = processes.bridge(file)
    assert bridge.wait() == 1
    assert not bridge.lines
    found = [LOGGED.fullmatch(line) for line in bridge.errors]
    assert all(found), 'a line that the logger did not write'
    texts = [match.group(2) for match in found if match and match.group(1) in ('ERROR', 'FATAL')]
    for path, *words in (('buses.main.bitrate', 'fast'),
                         ('drives.conveyor.statoin', 'station'),
                         ('drives.conveyor.station', '128', '127'),
                         ('drives.lift.bus', 'second', 'main'),
                         ('drives.table.cyclic_request', 'speed_setpiont', 'speed_setpoint'),
                         ('diagnostic_period', 'diagnostics_period')):
        text, = [text for text in texts if text.startswith(f'{path}:')]
        assert all(word in text for word in words), text
    assert len(texts) == len(set(texts))


def test_what_is_no_yaml(processes: Processes, tmp_path: Path) -> None:
    file = tmp_path / 'refused.yaml'
    file.write_text('no yaml: [', encoding='utf-8')
    bridge = processes.bridge(file)
    assert bridge.wait() == 1
    assert not bridge.lines
    line, = bridge.errors
    assert line.startswith('drive_can_bridge: ')
    assert str(file) in line


def test_device_that_appears_later(processes: Processes, client: Client, namespace: str,
                                   tmp_path: Path) -> None:
    file = bridge_file(tmp_path)
    bridge = processes.bridge(file, namespace)
    line = bridge.error('bus main: ')
    assert str(tmp_path / 'links' / 'main') in line
    assert 'is not there' in line
    assert 'tried again every 0.2 s' in line
    status = client.diagnostics(f'{namespace}/drive_can_bridge: bus main', state='^down$')
    assert status['level'] == '2'
    assert 'is not there' in status['message']
    drive = f'/{namespace}/conveyor'
    client.online(drive, wanted=False)
    assert client.set(drive, ramp_time=1.0) == [(False, 'bus down')]
    processes.simulator(file)
    client.online(drive)
    assert client.set(drive, ramp_time=2.0) == [(True, '')]
    assert len([line for line in bridge.errors if '[ERROR]' in line and 'bus main' in line]) == 1
    assert bridge.end() == 0
