# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can backup``, ``restore`` and ``compare`` as a user types them, directly on a bus."""

from collections.abc import Callable, Iterator
import json
import os
from pathlib import Path
import signal
import sys
from typing import Any, NamedTuple

from backup_builders import BY_HAND, Shop
import pytest

from drive_can_bridge.backup.document import read_backup
from drive_can_bridge.cli import restore
from drive_can_bridge.cli.main import main
from drive_can_bridge.client.direct import DirectDrive
from drive_can_bridge.client.drive import WriteOutcome


class Said(NamedTuple):
    """What a command said, and its exit code."""

    code: int
    lines: list[str]
    errors: list[str]

    @property
    def documents(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.lines]


Command = Callable[..., Said]


@pytest.fixture(name='command')
def command_fixture(shop: Shop, capsys: pytest.CaptureFixture[str],
                    monkeypatch: pytest.MonkeyPatch) -> Iterator[Command]:
    """Run a command on the drives of the shop, where nobody can be asked."""
    monkeypatch.chdir(shop.folder)
    with open(os.devnull, encoding='ascii') as nobody:
        monkeypatch.setattr(sys, 'stdin', nobody)

        def run(*words: str, direct: bool = True) -> Said:
            way = ['--params-file', str(shop.file), '--nmt-start'] if direct else []
            code = main([*words, *way])
            found = capsys.readouterr()
            return Said(code, found.out.splitlines(), found.err.splitlines())
        yield run


class TestOneDriveOfEachFamily:

    @pytest.mark.parametrize('name', BY_HAND)
    def test_backup_and_back(self, shop: Shop, command: Command, name: str) -> None:
        if name == 'pump':      # as one that is in operation
            shop.drives[name].set_value('general_configuration', 0)
        said = command('backup', name, '-o', 'b.yaml')
        assert said.code == 0, said
        count = len(read_backup(Path('b.yaml')).values)
        assert said.lines == [f'{name}: {count} settings in b.yaml']
        before = shop.values(name, *BY_HAND[name])
        assert command('compare', 'b.yaml', name) == (0, ['the same'], [])
        changed = shop.change_by_hand(name)
        said = command('compare', name, 'b.yaml', '--json')
        assert said.code == 1
        assert {each['parameter']: (each['a'], each['b']) for each in said.documents} == {
            parameter: (value, old) for (parameter, value), old in zip(changed.items(), before)}
        wear = shop.drives[name].wear
        said = command('restore', '--dry-run', 'b.yaml', '--json')
        assert said.code == 0
        assert {each['parameter']: (each['found'], each['wanted']) for each in said.documents} == {
            parameter: (value, old) for (parameter, value), old in zip(changed.items(), before)}
        assert shop.values(name, *changed) == tuple(changed.values())
        assert shop.drives[name].wear == wear
        said = command('restore', 'b.yaml', '--yes', '--json')
        assert said.code == 0, said
        assert {each['parameter'] for each in said.documents if 'ok' in each} == set(changed)
        assert shop.values(name, *changed) == before
        assert set(shop.drives[name].wear) <= {*changed, 'general_configuration'}
        assert command('compare', name, 'b.yaml') == (0, ['the same'], [])
        assert shop.drives[name].violations == {}

    def test_all_at_once(self, shop: Shop, command: Command) -> None:
        said = command('backup', '*', '-o', 'all/', '--json')
        assert said.code == 0
        assert [each['file'] for each in said.documents] == [
            f'all/{name}.yaml' for name in shop.drives]
        assert [each['settings'] for each in said.documents] == [
            len(read_backup(Path(f'all/{name}.yaml')).values) for name in shop.drives]
        # it has a bit of a mode, and is to be written last by whoever takes the file as it is
        assert list(read_backup(Path('all/pump.yaml')).values)[-1] == 'general_configuration'
        head = read_backup(Path('all/pump.yaml')).head
        assert head.protocol == 'canopen_pkw'
        assert head.station == '5'
        assert head.profile == 'tesys_t_ltmr'
        assert 'serial_number_4=5 ' in head.identity
        assert head.identity == said.documents[3]['identity']

    def test_files_alone_need_no_drive(self, shop: Shop, command: Command) -> None:
        command('backup', 'conveyor', '-o', 'a.yaml')
        text = Path('a.yaml').read_text().replace('ramp_time: 1.0', 'ramp_time: 1.5')
        Path('b.yaml').write_text(text)
        assert command('compare', 'a.yaml', 'a.yaml', direct=False) == (0, ['the same'], [])
        assert command('compare', 'a.yaml', 'b.yaml', direct=False) == (1, [
            'parameter  a.yaml  b.yaml  unit', 'ramp_time       1     1.5  s'], [])
        Path('b.yaml').write_text('\n'.join(
            line for line in text.splitlines() if not line.startswith('#')))
        assert command('compare', 'b.yaml', './a.yaml', direct=False).lines[1] == (
            'ramp_time     1.5         1  s')


class TestBackup:

    def test_what_cannot_be_read_is_an_error(self, shop: Shop, command: Command) -> None:
        shop.drives['conveyor'].fault('silent')
        said = command('backup', 'conveyor', '-o', 'b.yaml')
        assert said.code == 1
        assert said.errors == [
            'conveyor: nothing could be read: no answer; drive offline',
            'conveyor: no file was written']
        assert not Path('b.yaml').exists()
        said = command('backup', 'conveyor', '-o', 'b.yaml', '--partial')
        assert said.code == 1
        assert said.errors[-1] == 'conveyor: has no settings that could be written to a file'
        assert os.listdir() == ['all_families.yaml']

    def test_partial(self, shop: Shop, command: Command) -> None:
        """A table that names what this drive has not."""
        shop.describe_conveyor('  ramp_time: {number: 30, type: uint16, scale: 0.01, unit: s}\n'
                               '  nothing: {number: 999, type: uint16}\n'
                               '  hot: {number: 31, type: uint16, maximum: 5}\n')
        said = command('backup', 'conveyor', '-o', 'b.yaml')
        assert (said.code, Path('b.yaml').exists()) == (1, False)
        said = command('backup', 'conveyor', '-o', 'b.yaml', '--partial')
        assert said.code == 0
        assert said.errors == [
            'warning: conveyor: hot is left out: the drive has 30000, the profile allows at most '
            '5',
            'conveyor: nothing could not be read: no answer in 0.1 s, 3 attempts']
        assert read_backup(Path('b.yaml')).values == {'ramp_time': 1.0}
        lines = Path('b.yaml').read_text().splitlines()
        assert [line for line in lines if 'left out' in line] == [
            '# left out: nothing: no answer in 0.1 s, 3 attempts',
            '# left out: hot: the drive has 30000, the profile allows at most 5']

    def test_a_file_that_exists(self, shop: Shop, command: Command) -> None:
        Path('b.yaml').write_text('mine')
        before = shop.drives['conveyor'].requests
        said = command('backup', 'conveyor', '-o', 'b.yaml')
        assert said.code == 2
        assert said.errors == ['drive_can backup: b.yaml exists. Overwrite? Nothing was read or '
                               'written: nobody can be asked here; --yes overwrites']
        assert Path('b.yaml').read_text() == 'mine'
        assert shop.drives['conveyor'].requests == before
        assert command('backup', 'conveyor', '-o', 'b.yaml', '--yes').code == 0
        assert read_backup(Path('b.yaml')).drive == 'conveyor'

    @pytest.mark.parametrize(('output', 'error'), [
        ('nowhere/b.yaml', 'nowhere: no such directory'),
        ('/proc/b.yaml', '/proc/b.yaml: '), ('/dev/full', '/dev/full: No space left on device'),
    ])
    def test_a_place_that_takes_nothing(self, shop: Shop, command: Command, output: str,
                                        error: str) -> None:
        said = command('backup', 'conveyor', '-o', output)
        assert said.code == 1
        assert len(said.errors) == 1
        assert error in said.errors[0]
        assert os.listdir() == ['all_families.yaml']

    @pytest.mark.parametrize(('words', 'error'), [
        (['-o', 'b.yaml'], "which drive? '*' means all; there are: conveyor, lift, mixer, pump"),
        (['conveyor', 'lift', '-o', 'b.yaml'],
         '2 drives (conveyor, lift) do not go into one file: write -o b.yaml/'),
        (['conv', '-o', 'b.yaml'], "no drive 'conv'; there are: conveyor, lift, mixer, pump"),
    ])
    def test_wrong_usage(self, shop: Shop, command: Command, words: list[str],
                         error: str) -> None:
        said = command('backup', *words)
        assert said.code == 2
        assert error in said.errors[0]
        assert all(drive.requests == 0 for drive in shop.drives.values())


class TestRestore:

    def test_nobody_can_be_asked(self, shop: Shop, command: Command) -> None:
        file = shop.write_backup('conveyor', ramp_time=5.0)
        said = command('restore', str(file))
        assert said.code == 2
        assert said.errors == ['drive_can restore: Nothing was written: nobody can be asked here; '
                               '--yes writes without asking']
        assert shop.drives['conveyor'].requests == 0

    def test_a_drive_that_is_enabled(self, shop: Shop, command: Command) -> None:
        shop.drives['lift'].set_value('status_word', 0x0002)
        file = shop.write_backup('lift', ramp_time=5.0)
        said = command('restore', str(file), '--yes')
        assert said.code == 1
        assert said.errors[-1] == ('lift: is enabled: settings are not written while it may move. '
                                   'Disable it first. Nothing was written.')
        assert shop.values('lift', 'ramp_time') == (1.0,)

    def test_a_drive_that_somebody_enables_meanwhile(
            self, shop: Shop, command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
        put = DirectDrive.put

        def enabled_by_now(*args: Any, **options: Any) -> WriteOutcome:
            outcome = put(*args, **options)
            shop.drives['lift'].set_value('status_word', 0x0002)
            return outcome
        monkeypatch.setattr(DirectDrive, 'put', enabled_by_now)
        file = shop.write_backup('lift', ramp_time=5.0, maximum_speed=7.0)
        said = command('restore', str(file), '--yes')
        assert said.code == 1
        assert said.errors[-1] == (
            'lift: was enabled meanwhile. Written: ramp_time. Not written: maximum_speed. Disable '
            'it, then repeat the command to go on')
        assert shop.values('lift', 'ramp_time') == (5.0,)
        assert shop.values('lift', 'maximum_speed') != (7.0,)

    def test_a_second_signal_keeps_from_nobody_what_was_written(
            self, shop: Shop, command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
        put, report = DirectDrive.put, restore._report

        def interrupted(*args: Any, **options: Any) -> WriteOutcome:
            signal.raise_signal(signal.SIGINT)
            return put(*args, **options)

        def interrupted_again(*args: Any) -> int:
            signal.raise_signal(signal.SIGINT)
            return report(*args)
        monkeypatch.setattr(DirectDrive, 'put', interrupted)
        monkeypatch.setattr(restore, '_report', interrupted_again)
        file = shop.write_backup('conveyor', ramp_time=5.0, jog_speed=7.0)
        said = command('restore', str(file), '--yes')
        assert (said.code, said.errors[-1]) == (
            130, 'conveyor: interrupted. Written: ramp_time. Not written: jog_speed. Repeat the '
                 'command to go on')

    def test_whether_it_is_enabled_is_not_known(self, shop: Shop, command: Command) -> None:
        file = shop.write_backup('mixer', acceleration_time=5.0)
        said = command('restore', str(file), '--yes')
        assert said.code == 0
        assert 'mixer: whether it is enabled is not known; it should stand still' in said.errors

    @pytest.mark.parametrize(('persist', 'told'), [
        ('true', []), ('false', ['mixer: gone when it loses power: acceleration_time '
                                 '(persist_writes: true in its configuration would write to '
                                 'EEPROM)'])])
    def test_what_is_gone_when_power_goes_is_told(self, shop: Shop, command: Command,
                                                  persist: str, told: list[str]) -> None:
        shop.file.write_text(shop.file.read_text().replace(
            'protocol: cannord', f'protocol: cannord\n        persist_writes: {persist}'))
        file = shop.write_backup('mixer', acceleration_time=5.0)
        said = command('restore', str(file), '--yes')
        assert said.code == 0
        assert [line for line in said.errors if 'loses power' in line] == told
        shop.drives['mixer'].fault('restart=0')
        assert shop.values('mixer', 'acceleration_time') == (1.0 if told else 5.0,)

    def test_of_another_one(self, shop: Shop, command: Command) -> None:
        command('backup', 'pump', '-o', 'pump.yaml')
        shop.drives['pump'].fault('set=serial_number_4:77')
        shop.drives['pump'].set_value('flc1_ratio', 50.0)
        said = command('restore', 'pump.yaml', '--yes')
        assert said.code == 1
        assert said.errors == [
            'pump.yaml: it is a backup of serial_number_4=5, the drive is serial_number_4=77',
            'Nothing was written; --force restores it all the same.']
        assert shop.values('pump', 'flc1_ratio') == (50.0,)
        said = command('restore', 'pump.yaml', '--yes', '--force')
        assert said.code == 0
        assert shop.values('pump', 'flc1_ratio') == (33.0,)

    def test_what_has_no_value_in_the_file_is_told(self, shop: Shop, command: Command) -> None:
        """As ``ros2 param dump`` writes what the drive did not give."""
        command('backup', 'conveyor', '-o', 'b.yaml')
        text = Path('b.yaml').read_text()
        assert 'ramp_time: 1.0' in text
        Path('b.yaml').write_text(text.replace('ramp_time: 1.0', 'ramp_time: null'))
        said = command('restore', 'b.yaml', '--yes')
        assert said.code == 0
        assert said.errors == ['b.yaml: no value in it, left alone: ramp_time']

    def test_of_another_family(self, shop: Shop, command: Command) -> None:
        command('backup', 'mixer', '-o', 'mixer.yaml')
        for force in ((), ('--force',)):
            assert command('restore', 'mixer.yaml', 'conveyor', '--yes', *force) == (1, [], [
                'mixer.yaml: of another drive type: it is a backup with profile nord_sk500e '
                '(cannord), conveyor has datamodel_example (datamodel_extended)'])
        assert shop.drives['conveyor'].eeprom_writes == 0

    def test_of_another_family_and_nobody_says_so(self, shop: Shop, command: Command) -> None:
        count = len(BY_HAND['mixer'])
        shop.write_backup('mixer', **BY_HAND['mixer'])
        said = command('restore', 'mixer.yaml', 'conveyor', '--yes')
        assert [line.partition(',')[0].partition(': ')[2] for line in said.errors] == [
            f'{name}: unknown parameter {name}' for name in BY_HAND['mixer']]   # a slip or three
        shop.write_backup('mixer', **BY_HAND['mixer'], braking_time=1.0)
        assert command('restore', 'mixer.yaml', 'conveyor', '--yes') == (1, [], [
            'mixer.yaml: of another drive type: conveyor has datamodel_example '
            f'(datamodel_extended), which has none of its {count + 1} names'])
        shop.write_backup('mixer', **BY_HAND['mixer'], braking_time=1.0, ramp_time=1.0)
        said = command('restore', 'mixer.yaml', 'conveyor', '--yes')
        assert len(said.errors) == count + 1

    def test_of_nothing_that_is_written(self, shop: Shop, command: Command) -> None:
        shop.write_backup('conveyor', speed_setpoint=5.0)
        before = shop.drives['conveyor'].requests
        said = command('restore', 'conveyor.yaml', '--yes')
        assert (said.code, said.lines) == (
            0, ['conveyor: nothing to restore, 0 settings are as in conveyor.yaml'])
        assert shop.drives['conveyor'].requests == before

    def test_of_an_older_table_of_the_same_type(self, shop: Shop, command: Command) -> None:
        command('backup', 'conveyor', '-o', 'b.yaml')
        text = Path('b.yaml').read_text()
        digest = next(line for line in text.splitlines() if 'profile_sha256' in line)
        Path('b.yaml').write_text(text.replace(digest, '# profile_sha256: 00').replace(
            '    ramp_time:', '    ramp:'))
        said = command('restore', 'b.yaml', '--yes')
        assert len(said.errors) == 1 and ': ramp: unknown parameter ramp' in said.errors[0]

    def test_not_all_is_as_in_the_file(self, shop: Shop, command: Command) -> None:
        shop.drives['conveyor'].fault('refuse=ramp_time')
        file = shop.write_backup('conveyor', ramp_time=5.0, maximum_speed=100.0)
        said = command('restore', str(file), '--yes')
        assert said.code == 1
        assert said.errors[-2:] == [
            'conveyor: confirmed: maximum_speed; not as in the file:',
            '  ramp_time: 1 s instead of 5 s: read back 1 instead of 5']
        said = command('restore', str(file), '--yes', '--json')
        assert said.documents[-1] == {
            'drive': 'conveyor', 'parameter': 'ramp_time', 'ok': False, 'found': 1.0,
            'wanted': 5.0, 'reason': 'read back 1 instead of 5'}

    def test_what_the_drive_acknowledges_and_does_not_take(self, shop: Shop,
                                                           command: Command) -> None:
        shop.drives['pump'].set_value('general_configuration', 0)
        shop.drives['pump'].fault('stuck=flc1_ratio')
        file = shop.write_backup('pump', flc1_ratio=50, flc2_ratio=40)
        said = command('restore', str(file), '--yes')
        assert said.code == 1
        assert said.errors[-2:] == [
            'pump: confirmed: flc2_ratio; not as in the file:',
            '  flc1_ratio: 33 % instead of 50 %: acknowledged, and not taken']
        said = command('restore', str(file), '--yes', '--json')
        assert said.documents[-1]['reason'] == 'acknowledged, and not taken'

    def test_protected_ones(self, shop: Shop, command: Command) -> None:
        file = shop.write_backup('mixer', can_address=7, acceleration_time=1.0)
        said = command('restore', str(file), '--yes')
        assert said.code == 0
        assert said.lines == [
            'parameter    drive  file',
            'can_address     50     7  protected by its profile: --include-protected restores it',
            f'mixer: nothing to restore, 1 settings are as in {file}']

    def test_a_drive_that_is_not_there(self, shop: Shop, command: Command) -> None:
        shop.drives['conveyor'].fault('off')
        file = shop.write_backup('conveyor', ramp_time=5.0)
        said = command('restore', str(file), '--yes')
        assert said.code == 1
        assert said.errors[-2:] == [
            'conveyor: ramp_time could not be read: no answer; drive offline',
            'Nothing was written.']

    def test_one_that_is_not_there_is_not_said_to_be_another_one(self, shop: Shop,
                                                                 command: Command) -> None:
        command('backup', 'pump', '-o', 'pump.yaml')
        shop.drives['pump'].fault('off')
        assert command('restore', 'pump.yaml', '--yes') == (1, [], [
            'pump: nothing could be read: no answer; drive offline',
            'Nothing was written.'])

    @pytest.mark.parametrize(('words', 'code', 'error'), [
        (['b.yaml'], 1, 'b.yaml: No such file or directory'),
        (['all_families.yaml'], 1, 'all_families.yaml: is a parameter file of a bridge'),
        (['crane.yaml'], 2, 'crane.yaml is of drive crane, which is not here: say which one is '
                            'meant; there are: conveyor, lift, mixer, pump'),
        (['crane.yaml', 'c*', 'x'], 2, 'allowed is FILE [DRIVE]'),
        (['crane.yaml', '*'], 2, "'*' names several drives: conveyor, lift, mixer, pump"),
    ])
    def test_wrong_usage(self, shop: Shop, command: Command, words: list[str], code: int,
                         error: str) -> None:
        shop.write_backup('crane', ramp_time=5.0)
        said = command('restore', *words, '--yes')
        assert said.code == code
        assert error in said.errors[0]
        assert all(drive.requests == 0 for drive in shop.drives.values())


class TestMode:
    """An LTMR that somebody has left in its configuration mode."""

    def test_is_a_difference_and_restored(self, shop: Shop, command: Command) -> None:
        pump = shop.drives['pump']
        pump.set_value('general_configuration', 0)
        command('backup', 'pump', '-o', 'b.yaml')
        pump.set_value('general_configuration', 1)
        assert command('compare', 'b.yaml', 'pump') == (1, [
            'parameter              b.yaml  pump', 'general_configuration       0     1'],
            [])
        row = ['parameter              drive  file', 'general_configuration      1     0']
        assert command('restore', 'b.yaml', '--dry-run') == (0, row, [])
        assert pump.wear == {}
        said = command('restore', 'b.yaml', '--yes')
        assert said == (0, [*row, 'pump: 1 setting written, 6 read back: as in the file'], [])
        assert shop.values('pump', 'general_configuration') == (0,)
        assert command('compare', 'b.yaml', 'pump') == (0, ['the same'], [])

    def test_a_file_of_it_is_not_said_to_be_restored(self, shop: Shop, command: Command) -> None:
        pump = shop.drives['pump']
        pump.set_value('general_configuration', 1)
        command('backup', 'pump', '-o', 'b.yaml')
        said = command('restore', 'b.yaml', '--yes')
        assert said.lines[1].split(maxsplit=3) == [
            'general_configuration', '1', '1', "becomes 0: the mode that the section 'restore' of "
            'its profile sets is ended']
        assert said.lines[2:] == ['pump: 1 setting written, 6 read back: as in the file, but for '
                                  'the mode in general_configuration']
        assert command('compare', 'b.yaml', 'pump').code == 1
        said = command('restore', 'b.yaml', '--yes', '--json')
        assert (said.code, [(each['wanted'], each['left_alone']) for each in said.documents]) == (
            0, [(1, 'mode')])
        said = command('restore', 'b.yaml', '--yes')
        assert said.lines[-1] == 'pump: nothing to restore, 6 settings are as in b.yaml'
        assert shop.values('pump', 'general_configuration') == (0,)

    def test_that_is_a_whole_parameter(self, shop: Shop, command: Command) -> None:
        """It is no setting: no file has it."""
        shop.describe_conveyor('  ramp_time: {number: 30, type: uint16, scale: 0.01, unit: s}\n'
                               '  service_mode: {number: 61, type: uint16}\n',
                               'restore: {before: {service_mode: 3}, after: {service_mode: 1}}\n')
        for value in (1, 3):
            assert command('write', 'conveyor', f'service_mode={value}').code == 0
            command('backup', 'conveyor', '-o', 'b.yaml', '--yes')
            assert list(read_backup(Path('b.yaml')).values) == ['ramp_time']
        assert command('compare', 'b.yaml', 'conveyor') == (1, [
            'parameter     b.yaml  conveyor', 'service_mode       -         3'], [])
        said = command('restore', 'b.yaml', '--yes')
        assert (said.code, said.lines[1].split()[:5]) == (0, [
            'service_mode', '3', '-', 'becomes', '1:'])
        assert said.lines[-1] == 'conveyor: 1 setting written, 2 read back: as in the file'
        assert command('compare', 'b.yaml', 'conveyor') == (0, ['the same'], [])
        assert command('restore', 'b.yaml', '--yes').lines == [
            'conveyor: nothing to restore, 1 settings are as in b.yaml']

    def test_is_told_of_a_file_alone(self, shop: Shop, command: Command) -> None:
        command('backup', 'pump', '-o', 'a.yaml')
        text = Path('a.yaml').read_text()
        Path('b.yaml').write_text(text.replace('general_configuration: 1',
                                               'general_configuration: 0'))
        assert command('compare', 'a.yaml', 'b.yaml', direct=False).code == 1


class TestCompare:

    @pytest.mark.parametrize(('words', 'error'), [
        (['a.yaml', 'b.yaml'], 'a.yaml: No such file or directory'),
        (['conveyor'], 'allowed are two, A and B'),
        (['conveyor', 'crane'], "no drive 'crane'"),
        (['conveyor', 'wrong.yaml'], 'wrong.yaml:3: ramp_time: wrong type: true is a bool'),
    ])
    def test_trouble(self, shop: Shop, command: Command, words: list[str], error: str) -> None:
        shop.write_backup('wrong', ramp_time=True)
        said = command('compare', *words)
        assert said.code == 2
        assert error in said.errors[0]

    def test_an_unreadable_drive(self, shop: Shop, command: Command) -> None:
        file = shop.write_backup('conveyor', ramp_time=5.0)
        shop.drives['conveyor'].fault('silent')
        said = command('compare', 'conveyor', str(file))
        assert said.code == 2
        assert said.errors == ['conveyor: nothing could be read: no answer; drive offline']

    def test_nothing_in_common(self, shop: Shop, command: Command) -> None:
        command('backup', 'mixer', '-o', 'mixer.yaml')
        said = command('compare', 'mixer.yaml', 'pump')
        count = len(read_backup(Path('mixer.yaml')).values)
        assert said.code == 1 and len(said.lines) == 1
        assert said.lines[0].startswith(
            f'mixer.yaml and pump have no setting in common ({count} and ')
        assert said.lines[0].endswith('): they are of different drive types')
        assert len(command('compare', 'mixer.yaml', 'pump', '--json').documents) > count
        shop.write_backup('few', acceleration_time=1.0, braking_time=1.0, torque=1)
        lines = command('compare', 'few.yaml', 'pump').lines
        assert lines[0].startswith('few.yaml and pump have no setting in common (3 and ')
        assert lines[0].endswith('): they are of different drive types, or all names of one are '
                                 'misspelt')
        assert lines[1].startswith('parameter') and len(lines) > 2 + 3
        shop.write_backup('both', acceleration_time=1.0, braking_time=1.0, torque=1,
                          flc1_ratio=50.0)
        assert command('compare', 'both.yaml', 'pump').lines[0].startswith('parameter')

    def test_two_drives(self, shop: Shop, command: Command) -> None:
        said = command('compare', 'conveyor', 'lift', '--json')
        assert said.code == 1
        found = {each['parameter']: each for each in said.documents}
        assert 'ramp_time' not in found
        assert found['torque_limit'] == {
            'parameter': 'torque_limit', 'unit': '%', 'a': None, 'b': 100.0}
