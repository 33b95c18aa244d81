# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The executable of the bridge by hand: help, and every problem of a file at once.

What else it says: ``configuration/test_validate_command.py``, ``ros/test_ros_refusals.py``.
"""

from pathlib import Path
import re

from parameter_files import bridge_file, CONVEYOR
from processes import Processes
import pytest
from world import World

from drive_can_bridge.process.signals import SignalWatcher
from drive_can_bridge.ros import main as executable

#: how rclpy writes a line
LOGGED = re.compile(r'\[(ERROR|FATAL|WARN|INFO)\] \[[0-9.]+\] \[[\w.]+\]: (.*)')


def test_a_bridge_names_every_problem(processes: Processes, tmp_path: Path) -> None:
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


def test_help(world: World, capsys: pytest.CaptureFixture[str]) -> None:
    assert executable.run(
        SignalWatcher(world.clock), world.clock, ['drive_can_bridge', '--help']) == 0
    told = capsys.readouterr()
    assert told.out.startswith('usage: drive_can_bridge')
    assert told.err == ''
