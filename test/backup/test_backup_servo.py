# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Backups of CiA 402 drives: no commands of any mode, and what a drive does not have.

The drive at the other end is bytes: a ``restore`` of a stepper in pv wrote 607Ah := 1.5 rev, and
no drive of the field has all objects of the shipped profile.
"""

from collections.abc import Callable
from pathlib import Path

from backup_builders import Command, Said
from drives import ServoDrive
import pytest
import world

from drive_can_bridge.backup.document import read_backup
from drive_can_bridge.core.requests import FailureKind, kind_of

Run = Callable[..., Said]

CHANNEL = 'backup_servo'
FILE = f"""/**/drive_can_bridge:
  ros__parameters:
    buses:
      main: {{interface: virtual, channel: {CHANNEL}, bitrate: 500000}}
    drives:
      axis:
        bus: main
        protocol: cia402
        station: 5
        profile: servo.yaml
        mode: pv
        cyclic_request: [target_velocity]
        cyclic_response: [actual_velocity]
"""
#: setpoints and offsets of all modes, the mode, the control word, of all axes
COMMANDS = {
    'target_position': (0x607A, 0, 'int32'), 'target_velocity': (0x60FF, 0, 'int32'),
    'target_torque': (0x6071, 0, 'int16'), 'vl_target': (0x6042, 0, 'int16'),
    'interpolation': (0x60C1, 1, 'int32'), 'interpolation_2': (0x60C1, 2, 'int32'),
    'position_offset': (0x60B0, 0, 'int32'), 'velocity_offset': (0x60B1, 0, 'int32'),
    'torque_offset': (0x60B2, 0, 'int16'), 'mode': (0x6060, 0, 'int8'),
    'control': (0x6040, 0, 'uint16'), 'left_wheel': (0x60FF, 1, 'int32'),
    'control_2': (0x6840, 0, 'uint16'), 'mode_3': (0x7060, 0, 'int8'),
    'target_8': (0x98FF, 0, 'int32')}
SETTINGS = {
    'acceleration': (0x6083, 0, 'uint32'), 'deceleration': (0x6084, 0, 'uint32'),
    'max_torque': (0x6072, 0, 'uint16'), 'window': (0x6067, 0, 'uint32'),
    'gain': (0x60F9, 1, 'uint16')}
WIDTHS = {'int32': 4, 'uint32': 4, 'int16': 2, 'uint16': 2, 'int8': 1}
CONTENT = {'acceleration': 1000, 'deceleration': 2000, 'max_torque': 300, 'window': 10, 'gain': 7}


def profile() -> str:
    lines = ['protocols: [cia402]', 'parameters:',
             '  actual_velocity: {index: 0x606C, subindex: 0, type: int32, access: ro}']
    lines += [f'  {name}: {{index: {index}, subindex: {subindex}, type: {kind}, access: rw, '
              f'storage: ram{", neutral: 0" * name.startswith("target_velocity")}}}'
              for name, (index, subindex, kind) in {**COMMANDS, **SETTINGS}.items()]
    return '\n'.join(lines) + '\n'


@pytest.fixture(name='axis')
def axis_fixture(tmp_path: Path, bench: object) -> ServoDrive:
    """Have a literal servo on its own bus."""
    (tmp_path / 'servo.yaml').write_text(profile())
    (tmp_path / 'axis.params').write_text(FILE.replace('servo.yaml', str(tmp_path / 'servo.yaml')))
    axis = ServoDrive(5, {(index, subindex): CONTENT.get(name, 0).to_bytes(WIDTHS[kind], 'little')
                          for name, (index, subindex, kind) in {**COMMANDS, **SETTINGS}.items()})
    assert world.current is not None
    wire = world.current.wires.of(CHANNEL)
    wire.watchers.append(lambda sent: [wire.carry(each) for each in axis.takes(sent)] and None)
    return axis


@pytest.fixture(name='run')
def run_fixture(axis: ServoDrive, command: Command) -> Run:
    """Run a command on it."""
    return lambda *words: command(*words, '--params-file', 'axis.params', direct=False)


def without(axis: ServoDrive, *names: str) -> None:
    """Take settings away: they are refused with 06020000h."""
    for name in names:
        del axis.objects[SETTINGS[name][:2]]


class TestCommandsOfAnyMode:

    def test_are_not_in_a_backup(self, run: Run) -> None:
        assert run('backup', 'axis', '-o', 'a.yaml').code == 0
        assert read_backup(Path('a.yaml')).values == CONTENT

    def test_are_left_alone_in_a_file_of_before(self, axis: ServoDrive, run: Run) -> None:
        run('backup', 'axis', '-o', 'a.yaml')
        with Path('a.yaml').open('a') as file:
            file.write('    target_position: 15000\n    position_offset: 3\n')
        Path('a.yaml').write_text(Path('a.yaml').read_text().replace('gain: 7', 'gain: 8'))
        said = run('restore', 'a.yaml', '--yes')
        assert said.code == 0, said
        assert axis.number(0x607A) == axis.number(0x60B0) == 0
        assert axis.number(0x60F9, 1) == 8
        assert [line for line in said.errors if 'left alone' in line] == [
            f'axis: {name} is left alone: a setpoint or a control word, in some mode: no setting'
            for name in ('target_position', 'position_offset')]

    def test_are_not_compared(self, axis: ServoDrive, run: Run) -> None:
        run('backup', 'axis', '-o', 'a.yaml')
        axis.objects[0x607A, 0] = b'\1\0\0\0'
        axis.objects[0x6060, 0] = b'\3'
        assert run('compare', 'a.yaml', 'axis') == (0, ['the same'], [])


class TestWhatADriveDoesNotHave:

    def test_is_left_out_of_a_backup(self, axis: ServoDrive, run: Run) -> None:
        without(axis, 'window')
        axis.fixed[0x60F9, 1] = 0x06090011
        axis.instead['40f96001'] = '80f9600111000906'   # 06090011h: no such sub-index
        said = run('backup', 'axis', '-o', 'a.yaml')
        assert said == (0, ['axis: 3 settings in a.yaml'], [
            f'axis: does not have 2 of the 5 settings of {Path("servo.yaml").resolve()} '
            '(window, gain): left out'])
        assert list(read_backup(Path('a.yaml')).values) == [
            'acceleration', 'deceleration', 'max_torque']
        assert '# left out, the drive does not have them: window, gain' in Path(
            'a.yaml').read_text().splitlines()
        assert run('compare', 'a.yaml', 'axis') == (0, ['the same'], [])

    def test_more_than_half_of_a_profile_is_another_one(self, axis: ServoDrive, run: Run) -> None:
        without(axis, 'window', 'gain', 'max_torque')
        said = run('backup', 'axis', '-o', 'a.yaml')
        assert (said.code, said.lines, len(said.errors)) == (1, [], 1)
        assert said.errors[0].startswith('axis: does not have 3 of the 5 settings of ')
        assert said.errors[0].endswith(
            ' (max_torque, window, gain): is this its profile? No file was written')
        assert not Path('a.yaml').exists()

    def test_other_refusals_are_errors(self, axis: ServoDrive, run: Run) -> None:
        axis.instead['40f96001'] = '80f9600122000008'   # 08000022h: not in this state
        said = run('backup', 'axis', '-o', 'a.yaml')
        assert said.code == 1
        assert not Path('a.yaml').exists()

    def test_is_a_difference_where_one_side_lacks_it(self, axis: ServoDrive, run: Run) -> None:
        run('backup', 'axis', '-o', 'a.yaml')
        without(axis, 'window')
        said = run('compare', 'a.yaml', 'axis', '--json')
        assert said.code == 1
        assert said.documents == [{'parameter': 'window', 'unit': '', 'a': 10, 'b': None}]

    def test_is_not_as_in_the_file_when_it_is_restored(self, axis: ServoDrive, run: Run) -> None:
        run('backup', 'axis', '-o', 'a.yaml')
        without(axis, 'window')
        axis.objects[0x6083, 0] = bytes(4)
        said = run('restore', 'a.yaml', '--yes')
        assert said.code == 1
        assert axis.number(0x6083) == 1000
        assert said.errors[-2:] == [
            'axis: confirmed: acceleration; not as in the file:',
            '  window: not there instead of 10: refused by the drive: 06020000h (no such register '
            'or object)']
        # nothing is left to be written, and still it is not as in the file
        said = run('restore', 'a.yaml', '--yes')
        assert said.code == 1
        assert said.lines[1].split()[:4] == ['window', '-', '10', 'not']
        said = run('restore', 'a.yaml', '--dry-run', '--json')
        assert (said.code, said.documents) == (0, [
            {'drive': 'axis', 'parameter': 'window', 'unit': '', 'found': None, 'wanted': 10,
             'left_alone': 'absent'}])


@pytest.mark.parametrize('text, absent', [
    ('refused by the drive: 06020000h (no such register or object)', True),
    ('refused by the drive: 06090011h (no such sub-index)', True),
    ('refused by the drive: 06090030h (value out of range)', False)])
def test_a_bridge_tells_it_by_its_text(text: str, absent: bool) -> None:
    assert (kind_of(text) is FailureKind.ABSENT) is absent
