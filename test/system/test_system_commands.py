# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The command ``drive_can`` by hand: help, usage errors, ``validate``."""

from pathlib import Path
import re

from parameter_files import bridge_file, CONVEYOR
from processes import command_line, Processes, ROOT
import pytest

EXAMPLES = sorted(path.name for path in (ROOT / 'config').glob('*.yaml'))


@pytest.mark.parametrize('name', EXAMPLES)
def test_validate_shipped_examples(processes: Processes, name: str) -> None:
    file = ROOT / 'config' / name
    command = processes.drive_can('validate', str(file))
    assert command.wait() == 0
    text = file.read_text(encoding='utf-8')
    drives = re.findall(r'^      (\w+):', text[text.index('\n    drives:'):], re.MULTILINE)
    assert [line.split(':')[0] for line in command.lines] == drives
    for line in command.lines:
        assert re.fullmatch(
            r'\w+: bus main \(\w+ \S+\), \w+, station [0-9]+, profile \w+, period [0-9.]+ ms, '
            r'request \[[\w, ]*\], response \[[\w, ]+\], load [0-9.]+ %', line)


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


def test_validate_problem_in_a_profile(processes: Processes, tmp_path: Path) -> None:
    profile = tmp_path / 'mine.yaml'
    profile.write_text('protocols: [datamodel_extended]\nparameters:\n'
                       '  speed_setpoint: {number: 50}\n'
                       '  torque_limit: {number: 51}\n'
                       '  actual_speed: {number: 209, type: int8}\n'
                       '  motor_current: {number: 210}\n'
                       '  status_word: {number: 211}\n', encoding='utf-8')
    file = bridge_file(tmp_path, drives={'conveyor': {**CONVEYOR, 'profile': str(profile)}})
    command = processes.drive_can('validate', str(file))
    assert command.wait() == 1
    assert any(line.startswith(f'{profile}:5: parameters.actual_speed.type: ')
               for line in command.errors)


@pytest.mark.parametrize('content', ['a: [', '', 'other: {ros__parameters: {x: 1}}', None])
def test_validate_what_is_no_parameter_file(processes: Processes, tmp_path: Path,
                                            content: str | None) -> None:
    file = tmp_path / 'broken.yaml'
    if content is not None:
        file.write_text(content, encoding='utf-8')
    command = processes.drive_can('validate', str(file))
    assert command.wait() == 1
    assert command.lines == []
    assert command.errors
    assert all(str(file) in line for line in command.errors)


@pytest.mark.parametrize('arguments', [
    [], ['nonsense'], ['validate'], ['validate', 'a', 'b'], ['validate', '--nonsense', 'a'],
    ['simulate'], ['simulate', '--params-file'], ['--nonsense'],
], ids=' '.join)
def test_wrong_usage(processes: Processes, arguments: list[str]) -> None:
    command = processes.start([*command_line('drive_can'), *arguments], 'command')
    assert command.wait() == 2
    assert command.lines == []
    assert command.errors[0].startswith('usage: drive_can')
    assert 'error: ' in command.errors[-1]


@pytest.mark.parametrize(('executable', 'arguments'), [
    ('drive_can', ['--help']), ('drive_can', ['validate', '--help']),
    ('drive_can', ['simulate', '-h']), ('drive_can', ['demo', '--help']),
    ('drive_can_bridge', ['--help']), ('drive_can_bridge', ['-h', '--ros-args']),
], ids=lambda value: value if isinstance(value, str) else ' '.join(value))
def test_help(processes: Processes, executable: str, arguments: list[str]) -> None:
    command = processes.start([*command_line(executable), *arguments], 'command')
    assert command.wait() == 0
    assert command.lines[0].startswith(f'usage: {executable}')
    assert command.errors == []


def test_version(processes: Processes) -> None:
    command = processes.start([*command_line('drive_can'), '--version'], 'command')
    assert command.wait() == 0
    version, = re.findall(r'<version>(.*)</version>',
                          (ROOT / 'package.xml').read_text(encoding='utf-8'))
    assert command.lines == [f'drive_can {version}']
