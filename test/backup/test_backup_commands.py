# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can backup``, ``restore`` and ``compare`` as a user types them, directly on a bus."""

import errno
from pathlib import Path
import signal
from typing import Any

from backup_builders import BY_HAND, Command, Shop
import pytest

from drive_can_bridge.backup.document import read_backup
from drive_can_bridge.cli import restore
from drive_can_bridge.client.direct import DirectDrive
from drive_can_bridge.client.drive import WriteOutcome
from drive_can_bridge.core.errors import BusUnavailable


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


def test_a_place_where_no_file_can_be_made(shop: Shop, command: Command) -> None:
    said = command('backup', 'conveyor', '-o', '/proc/b.yaml')
    assert (said.code, len(said.errors)) == (1, 1)
    assert '/proc/b.yaml: ' in said.errors[0]   # why depends on who runs it


class TestRestore:

    def test_a_closed_terminal_ends_it_with_the_mode_taken_back(
            self, shop: Shop, command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
        shop.drives['pump'].set_value('general_configuration', 0x10)
        file = shop.write_backup('pump', flc1_ratio=50.0, flc2_ratio=40.0)
        put = DirectDrive.put

        def gone(text: str) -> None:
            raise OSError(errno.EIO, 'Input/output error')

        def closed(drive: Any, name: str, *args: Any, **options: Any) -> WriteOutcome:
            if name == 'flc1_ratio':
                monkeypatch.setattr(restore, 'complain', gone)
                signal.raise_signal(signal.SIGHUP)
            return put(drive, name, *args, **options)
        monkeypatch.setattr(DirectDrive, 'put', closed)
        assert command('restore', str(file), '--yes').code == 128 + signal.SIGHUP
        assert shop.values('pump', 'general_configuration', 'flc1_ratio', 'flc2_ratio') == (
            0x10, 50.0, 33.0)

    @pytest.mark.parametrize('why', ['bus main: is gone', ''], ids=['lost', 'interrupted'])
    def test_documents_say_what_was_not_written(
            self, shop: Shop, command: Command, monkeypatch: pytest.MonkeyPatch, why: str,
    ) -> None:
        file = shop.write_backup('conveyor', ramp_time=2.5, maximum_speed=900.0,
                                 brake_enabled=True)
        put = DirectDrive.put

        def ending(drive: Any, name: str, *args: Any, **options: Any) -> WriteOutcome:
            if name == 'maximum_speed' and why:
                raise BusUnavailable(why)
            if name == 'ramp_time' and not why:
                signal.raise_signal(signal.SIGINT)
            return put(drive, name, *args, **options)
        monkeypatch.setattr(DirectDrive, 'put', ending)
        said = command('restore', str(file), '--yes', '--json')
        assert said.code == (1 if why else 128 + signal.SIGINT)
        reason, code = why or 'interrupted', '' if why else 'interrupted'
        assert [each for each in said.documents if 'ok' in each] == [
            {'drive': 'conveyor', 'parameter': name, 'ok': not unwritten,
             'found': None if unwritten else wanted, 'wanted': wanted,
             'reason': reason if unwritten else '', 'code': code if unwritten else ''}
            for name, wanted, unwritten in (
                ('ramp_time', 2.5, False), ('maximum_speed', 900.0, True),
                ('brake_enabled', True, True))]

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
