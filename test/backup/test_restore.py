# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Restoring a drive: order, refusals, modes, what goes away, what is interrupted."""

from collections.abc import Callable
from pathlib import Path

from backup_builders import Shop
import pytest
import waiting

from drive_can_bridge.backup.document import read_backup
from drive_can_bridge.backup.restore import (
    names_to_read, plan_restore, problems_in, RestorePlan, strangers,
)
from drive_can_bridge.backup.restore import Restorer, RestoreResult
from drive_can_bridge.client.drive import Drive

#: what is said while a drive is away, and of backups of another one
TOLD = {
    'away': 'pump: answers no more; waiting up to 10 s for it, so that general_configuration is '
            'set back',
    'serial number': 'it is a backup of serial_number_4=77, the drive is serial_number_4=5',
    'profile': 'it is a backup with profile tesys_t_ltmr (abababababab…), the drive has '
               'tesys_t_ltmr ({}…)',
}
MODE = 0x0001


def planned(drive: Drive, file: Path, *, include_protected: bool = False) -> RestorePlan:
    backup = read_backup(file)
    assert problems_in(backup, drive) == []
    return plan_restore(backup, drive, drive.read(*names_to_read(backup, drive)),
                        include_protected=include_protected)


def restored(drive: Drive, file: Path, *, stopped: Callable[[], bool] = lambda: False,
             wait: Callable[[float], object] = lambda seconds: None,
             clock: Callable[[], float] = lambda: waiting.clock().now(),
             hints: list[str] | None = None,
             **options: bool) -> RestoreResult:
    return Restorer(drive, planned(drive, file, **options), stopped=stopped, clock=clock,
                    wait=wait, hint=(hints if hints is not None else []).append).run()


class TestSettings:

    @pytest.mark.parametrize(('name', 'first', 'second', 'value'), [
        ('mixer', 'acceleration_time', 'torque_current_limit', 12),
        ('pump', 'motor_trip_class', 'network_fallback', 10),
        ('lift', 'ramp_time', 'maximum_speed', 30),
        ('conveyor', 'maximum_speed', 'minimum_speed', 600),
    ])
    def test_one_that_is_taken_after_another_one(self, shop: Shop, name: str, first: str,
                                                 second: str, value: int) -> None:
        if name == 'pump':
            shop.drives[name].set_value('general_configuration', 0)
        shop.drives[name].fault(f'needs={first}:{second}')
        file = shop.write_backup(name, **{first: value, second: value})
        with shop.reached(name) as drive:
            result = restored(drive, file)
        assert (result.complete, result.written) == (True, [second, first])
        assert shop.values(name, first, second) == (value, value)

    def test_maps_are_restored_directly(self, shop: Shop) -> None:
        shop.drives['conveyor'].set_value('p126', 210)
        file = shop.write_backup('conveyor', p126=209)
        with shop.reached('conveyor') as drive:
            result = restored(drive, file)
        assert (result.complete, result.written) == (True, ['p126'])
        assert shop.values('conveyor', 'p126') == (209,)


class TestMode:
    """An LTMR takes settings while a bit of its general configuration is set."""

    @pytest.fixture(autouse=True)
    def _not_in_configuration_mode(self, shop: Shop) -> None:
        shop.drives['pump'].set_value('general_configuration', 0x0010)

    def mode(self, shop: Shop) -> float:
        return shop.values('pump', 'general_configuration')[0]

    def test_around_the_settings(self, shop: Shop) -> None:
        file = shop.write_backup('pump', flc1_ratio=50.0)
        with shop.reached('pump') as drive:
            result = restored(drive, file)
        assert (result.complete, result.written) == (True, ['flc1_ratio'])
        assert self.mode(shop) == 0x0010
        assert shop.drives['pump'].wear == {'flc1_ratio': 1, 'general_configuration': 2}

    def test_its_other_bits_are_a_setting_and_come_last(self, shop: Shop) -> None:
        file = shop.write_backup('pump', general_configuration=0x0021, flc1_ratio=50.0)
        with shop.reached('pump') as drive:
            result = restored(drive, file)
            assert planned(drive, file).changes == ()
        assert (result.complete, result.written) == (True, ['flc1_ratio', 'general_configuration'])
        assert self.mode(shop) == 0x0020
        assert shop.drives['pump'].wear['general_configuration'] == 2

    @pytest.mark.parametrize('after', [0, 1, 2])
    def test_interrupted(self, shop: Shop, after: int) -> None:
        wanted = {'motor_trip_class': 10, 'flc1_ratio': 50, 'network_fallback': 2}
        file = shop.write_backup('pump', general_configuration=0x0020, **wanted)
        pump = shop.drives['pump']

        def stopped() -> bool:
            return len(set(pump.wear) - {'general_configuration'}) >= after
        with shop.reached('pump') as drive:
            result = restored(drive, file, stopped=stopped)
            assert result.written == list(wanted)[:after]
            assert result.stopped == [*list(wanted)[after:], 'general_configuration']
            assert self.mode(shop) == 0x0010        # out of the mode, and nothing else
            again = restored(drive, file)
        assert again.complete
        assert again.written == result.stopped
        assert self.mode(shop) == 0x0020

    def test_taken_back_is_written_when_interrupted(self, shop: Shop) -> None:
        shop.drives['pump'].set_value('general_configuration', 0x0011)
        file = shop.write_backup('pump', flc1_ratio=50.0)
        with shop.reached('pump') as drive:
            result = restored(drive, file, stopped=lambda: True)
        assert self.mode(shop) == 0x0010
        assert (result.written, result.stopped) == (['general_configuration'], ['flc1_ratio'])

    def test_power_cut_in_the_middle(self, shop: Shop) -> None:
        pump = shop.drives['pump']
        file = shop.write_backup('pump', motor_trip_class=10, flc1_ratio=50, flc2_ratio=51,
                                 network_fallback=2)
        pump.fault('cut_at=2')      # the first is the mode
        waited: list[float] = []
        hints: list[str] = []

        def wait(seconds: float) -> None:
            waited.append(seconds)
            if len(waited) == 1:
                pump.fault('restart=0')
            waiting.pause(seconds / 2)      # until its heartbeat says that it runs
        with shop.reached('pump') as drive:
            result = restored(drive, file, wait=wait, hints=hints)
        assert not result.complete
        assert hints == [TOLD['away']]
        # it came back in the mode, which it keeps in EEPROM
        assert self.mode(shop) == 0x0010
        assert result.steps == []
        assert {each.name for each in result.wrong} == {
            'flc1_ratio', 'flc2_ratio', 'network_fallback'}
        assert result.written == ['motor_trip_class']   # obeyed, though it could not say so

    def test_of_a_drive_whose_answers_get_lost_it_is_ended_all_the_same(self, shop: Shop) -> None:
        pump = shop.drives['pump']
        file = shop.write_backup('pump', motor_trip_class=10, flc1_ratio=50, flc2_ratio=51)
        waited: list[float] = []

        def stopped() -> bool:
            if 'motor_trip_class' in pump.wear:
                pump.fault('silent')
            return False
        with shop.reached('pump') as drive:
            result = restored(drive, file, stopped=stopped, wait=waited.append,
                              clock=lambda: 5.0 * len(waited))
        assert self.mode(shop) == 0x0010
        assert result.steps != []
        assert 'flc2_ratio' not in pump.wear

    def test_in_an_eeprom_that_is_read_back_likewise(self, shop: Shop) -> None:
        shop.describe_conveyor(
            '  service_mode: {number: 33, type: uint16, storage: eeprom}\n'
            '  ramp_time: {number: 30, type: uint16, scale: 0.01, unit: s}\n',
            'restore: {before: {service_mode: 300}, after: {service_mode: 100}}\n')
        conveyor = shop.drives['conveyor']
        file = shop.write_backup('conveyor', ramp_time=7.0)

        def stopped() -> bool:
            if 'rated_current' in conveyor.wear:
                conveyor.fault('silent')
            return False
        with shop.reached('conveyor') as drive:
            restored(drive, file, stopped=stopped, clock=iter(range(0, 1000, 20)).__next__)
        assert shop.values('conveyor', 'rated_current') == (1.0,)

    def test_gone_for_good(self, shop: Shop) -> None:
        pump = shop.drives['pump']
        file = shop.write_backup('pump', motor_trip_class=10, flc1_ratio=50, flc2_ratio=51,
                                 network_fallback=2)
        pump.fault('cut_at=2')
        waited: list[float] = []

        with shop.reached('pump') as drive:
            # each attempt takes 5 s
            result = restored(drive, file, wait=waited.append, clock=lambda: 5.0 * len(waited))
        assert waited == [0.5, 0.5]
        assert result.steps[0].parameter == 'general_configuration'
        assert result.steps[0].unknown
        assert {each.name for each in result.wrong} >= {'flc2_ratio', 'network_fallback'}
        assert all(each.found is None for each in result.wrong)


class TestFile:

    def test_of_another_drive(self, shop: Shop) -> None:
        with shop.reached('pump') as drive:
            identity, digest = drive.identity(), drive.facts.profile_sha256
            same = f'# profile: tesys_t_ltmr\n# profile_sha256: {digest}\n# identity: {identity}\n'
            file = shop.write_backup('pump', same, flc1_ratio=50.0)
            assert strangers(read_backup(file), drive, identity) == []
            other = same.replace('serial_number_4=5', 'serial_number_4=77')
            file = shop.write_backup('pump', other, flc1_ratio=50.0)
            assert strangers(read_backup(file), drive, identity) == [TOLD['serial number']]
            file = shop.write_backup('pump', same.replace(digest, 'ab' * 32), flc1_ratio=50.0)
            assert strangers(read_backup(file), drive, identity) == [
                TOLD['profile'].format(digest[:12])]
