# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can backup``, ``restore`` and ``compare`` as a user types them, directly on a bus."""

import os
from pathlib import Path

from backup_builders import BY_HAND, Command, Shop
import pytest

from drive_can_bridge.backup.document import read_backup


class TestOneDriveOfEachFamily:

    @pytest.mark.parametrize('name', BY_HAND)
    def test_backup_and_back(self, shop: Shop, command: Command, name: str) -> None:
        if name == 'pump':      # as one that is in operation
            shop.drives[name].set_value('general_configuration', 0)
        said = command('backup', name, '-o', 'b.yaml')
        assert said.code == 0, said
        count = len(read_backup(Path('b.yaml')).values)
        assert said.lines[0].split()[:2] == [f'{name}:', str(count)]
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


class TestBackup:

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

    def test_two_drives(self, shop: Shop, command: Command) -> None:
        said = command('compare', 'conveyor', 'lift', '--json')
        assert said.code == 1
        found = {each['parameter']: each for each in said.documents}
        assert 'ramp_time' not in found
        assert found['torque_limit'] == {
            'parameter': 'torque_limit', 'unit': '%', 'a': None, 'b': 100.0}
