# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The executables by hand: help, usage errors, ``validate``.

What else they say: ``configuration/test_validate_command.py``, ``ros/test_ros_refusals.py``.
"""

from pathlib import Path
import re

from parameter_files import bridge_file, CONVEYOR
from processes import command_line, Processes, ROOT
import pytest


def test_validate_problems(processes: Processes, tmp_path: Path) -> None:
    file = bridge_file(tmp_path, drives={
        'conveyor': {**CONVEYOR, 'station': 0, 'peroid': 0.01},
        'lift': {**CONVEYOR, 'station': 2, 'profile': 'no_such_profile'}})
    text = file.read_text(encoding='utf-8').splitlines()
    command = processes.drive_can('validate', str(file))
    assert command.wait() == 1
    assert command.lines == []
    found = {}
    for line in command.errors:
        match = re.fullmatch(rf'{re.escape(str(file))}:([0-9]+): ([\w.]+): (.+)', line)
        assert match, line
        found[match.group(2)] = int(match.group(1)), match.group(3)
    assert set(found) == {'drives.conveyor.station', 'drives.conveyor.peroid',
                          'drives.lift.profile'}
    for path, (number, _) in found.items():
        assert path.rpartition('.')[2] in text[number - 1]
    assert 'allowed' in found['drives.conveyor.station'][1]
    assert 'period' in found['drives.conveyor.peroid'][1]


def test_version(processes: Processes) -> None:
    command = processes.start([*command_line('drive_can'), '--version'], 'command')
    assert command.wait() == 0
    version, = re.findall(r'<version>(.*)</version>',
                          (ROOT / 'package.xml').read_text(encoding='utf-8'))
    assert command.lines == [f'drive_can {version}']


@pytest.mark.parametrize('executable', ['drive_can', 'drive_can_bridge'])
def test_help(processes: Processes, executable: str) -> None:
    command = processes.start([*command_line(executable), '--help'], 'command')
    assert command.wait() == 0
    assert command.lines[0].startswith(f'usage: {executable}')
    assert command.errors == []


def test_wrong_usage(processes: Processes) -> None:
    command = processes.start([*command_line('drive_can'), 'validate'], 'command')
    assert command.wait() == 2
    assert command.lines == []
    assert command.errors == ['drive_can validate: the following arguments are required: FILE; '
                              'see drive_can validate --help']
