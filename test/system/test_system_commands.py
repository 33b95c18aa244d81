# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The executables by hand: help, usage errors, ``validate``, and every problem of a file at once.

What else they say: ``configuration/test_validate_command.py``, ``ros/test_ros_refusals.py``.
"""

from collections.abc import Callable
from pathlib import Path
import re

from parameter_files import bridge_file, CONVEYOR
from processes import Processes, ROOT
import pytest
from world import World

from drive_can_bridge.cli.main import main
from drive_can_bridge.process.signals import SignalWatcher
from drive_can_bridge.ros import main as executable

#: how rclpy writes a line
LOGGED = re.compile(r'\[(ERROR|FATAL|WARN|INFO)\] \[[0-9.]+\] \[[\w.]+\]: (.*)')
#: runs a command; returns its exit code, its lines, and those of standard error
Run = Callable[..., tuple[int, list[str], list[str]]]


@pytest.fixture
def run(world: World, capsys: pytest.CaptureFixture[str]) -> Run:
    def begin(name: str, *words: str) -> tuple[int, list[str], list[str]]:
        try:
            if name == 'drive_can':
                code = main(words)
            else:
                code = executable.run(SignalWatcher(world.clock), world.clock, [name, *words])
        except SystemExit as end:
            code = int(end.code or 0)
        told = capsys.readouterr()
        return code, told.out.splitlines(), told.err.splitlines()
    return begin


def test_validate_problems(run: Run, tmp_path: Path) -> None:
    file = bridge_file(tmp_path, drives={
        'conveyor': {**CONVEYOR, 'station': 0, 'peroid': 0.01},
        'lift': {**CONVEYOR, 'station': 2, 'profile': 'no_such_profile'}})
    text = file.read_text(encoding='utf-8').splitlines()
    code, lines, errors = run('drive_can', 'validate', str(file))
    assert (code, lines) == (1, [])
    found = {}
    for line in errors:
        match = re.fullmatch(rf'{re.escape(str(file))}:([0-9]+): ([\w.]+): (.+)', line)
        assert match, line
        found[match.group(2)] = int(match.group(1)), match.group(3)
    assert set(found) == {'drives.conveyor.station', 'drives.conveyor.peroid',
                          'drives.lift.profile'}
    for path, (number, _) in found.items():
        assert path.rpartition('.')[2] in text[number - 1]
    assert 'allowed' in found['drives.conveyor.station'][1]
    assert 'period' in found['drives.conveyor.peroid'][1]


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


def test_version(run: Run) -> None:
    version, = re.findall(r'<version>(.*)</version>',
                          (ROOT / 'package.xml').read_text(encoding='utf-8'))
    assert run('drive_can', '--version') == (0, [f'drive_can {version}'], [])


@pytest.mark.parametrize('name', ['drive_can', 'drive_can_bridge'])
def test_help(run: Run, name: str) -> None:
    code, lines, errors = run(name, '--help')
    assert (code, errors) == (0, [])
    assert lines[0].startswith(f'usage: {name}')


def test_wrong_usage(run: Run) -> None:
    code, lines, errors = run('drive_can', 'validate')
    assert (code, lines, len(errors)) == (2, [], 1)
    assert errors[0].startswith('drive_can validate: ')
    assert 'FILE' in errors[0]
