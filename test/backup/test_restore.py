# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Restoring a drive: order, refusals, modes, what goes away, what is interrupted."""

from collections.abc import Callable
from pathlib import Path

from backup_builders import Shop
import pytest
import waiting

from drive_can_bridge.backup.document import read_backup
from drive_can_bridge.backup.restore import (
    LeftAlone, names_to_read, plan_restore, problems_in, RestorePlan, strangers,
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

    def test_only_what_differs_is_written(self, shop: Shop) -> None:
        file = shop.write_backup('conveyor', ramp_time=1.0, maximum_speed=3000.0, rated_current=5)
        with shop.reached('conveyor') as drive:
            result = restored(drive, file)
        assert (result.complete, result.written) == (True, ['rated_current'])
        assert shop.drives['conveyor'].wear == {'rated_current': 1}
        assert shop.values('conveyor', 'rated_current') == (5.0,)

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

    def test_refused_one_is_listed_and_keeps_nobody_from_being_written(self, shop: Shop) -> None:
        shop.drives['mixer'].fault('refuse=acceleration_time')
        file = shop.write_backup('mixer', acceleration_time=5.0, deceleration_time=6.0)
        with shop.reached('mixer') as drive:
            result = restored(drive, file)
        assert not result.complete
        assert result.written == ['deceleration_time']
        wrong, = result.wrong
        assert (wrong.name, wrong.wanted, wrong.found) == ('acceleration_time', 5.0, 1.0)
        assert 'refused' in wrong.reason

    def test_what_is_not_taken_in_silence_is_listed(self, shop: Shop) -> None:
        shop.drives['pump'].set_value('general_configuration', 0)
        shop.drives['pump'].fault('stuck=network_fallback')     # acknowledged, and nothing happens
        file = shop.write_backup('pump', network_fallback=3, flc2_ratio=40)
        with shop.reached('pump') as drive:
            result = restored(drive, file)
        assert [(each.name, each.found, each.reason) for each in result.wrong] == [
            ('network_fallback', 0, '')]
        assert result.written == ['flc2_ratio', 'network_fallback']

    def test_protected_and_cyclic_ones_are_left_alone(self, shop: Shop) -> None:
        file = shop.write_backup('mixer', can_address=7, acceleration_time=2.0)
        with shop.reached('mixer') as drive:
            plan = planned(drive, file)
            assert [(each.name, each.left_alone) for each in plan.kept] == [
                ('can_address', LeftAlone.PROTECTED)]
            assert restored(drive, file).written == ['acceleration_time']
            result = restored(drive, file, include_protected=True)
        assert (result.complete, result.written) == (True, ['can_address'])
        assert shop.values('mixer', 'can_address') == (7,)
        file = shop.write_backup('conveyor', torque_limit=50.0)
        with shop.reached('conveyor') as drive:
            assert planned(drive, file).words == {}

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

    def test_nothing_to_restore_is_no_reason_for_a_mode(self, shop: Shop) -> None:
        file = shop.write_backup('pump', general_configuration=0x0011, flc1_ratio=33.0)
        with shop.reached('pump') as drive:
            assert planned(drive, file).changes == ()

    @pytest.mark.parametrize(('found', 'values', 'told', 'end'), [
        (0x0011, {'general_configuration': 0x0010}, '', 0x0010),
        (0x0011, {'general_configuration': 0x0011}, 'becomes 16: the mode', 0x0010),
        (0x0011, {'general_configuration': 0x0021}, 'becomes 32: the mode', 0x0020),
        (0x0011, {}, 'becomes 16: the mode', 0x0010),       # whatever is in the file
    ])
    def test_a_drive_that_was_left_in_it_is_taken_out(
            self, shop: Shop, found: int, values: dict[str, object], told: str, end: int) -> None:
        pump = shop.drives['pump']
        pump.set_value('general_configuration', found)
        file = shop.write_backup('pump', flc1_ratio=33.0, **values)
        with shop.reached('pump') as drive:
            change, = planned(drive, file).changes
            assert (change.name, change.found) == ('general_configuration', found)
            assert change.wanted == values.get('general_configuration')
            assert change.note.startswith(told) and bool(change.note) == bool(told)
            result = restored(drive, file)
            assert planned(drive, file).changes == ()
        assert (result.complete, result.written) == (True, ['general_configuration'])
        assert self.mode(shop) == end
        assert pump.wear == {'general_configuration': 1}

    def test_that_does_not_end_is_told(self, shop: Shop) -> None:
        shop.drives['pump'].set_value('general_configuration', 0x0011)
        shop.drives['pump'].fault('stuck=general_configuration')
        file = shop.write_backup('pump', flc1_ratio=33.0)
        with shop.reached('pump') as drive:
            wrong, = restored(drive, file).wrong
        assert (wrong.name, wrong.wanted, wrong.found) == ('general_configuration', 0x10, 0x11)

    def test_in_a_file_it_is_left_alone_and_not_as_in_the_file(self, shop: Shop) -> None:
        file = shop.write_backup('pump', general_configuration=0x0011, flc1_ratio=33.0)
        with shop.reached('pump') as drive:
            plan = planned(drive, file)
        assert [(each.name, each.left_alone) for each in plan.kept] == [
            ('general_configuration', LeftAlone.MODE)]
        assert plan.same == ('flc1_ratio',)

    def test_that_is_refused(self, shop: Shop) -> None:
        shop.drives['pump'].fault('refuse=general_configuration')
        file = shop.write_backup('pump', flc1_ratio=50.0)
        with shop.reached('pump') as drive:
            result = restored(drive, file)
        assert 'general_configuration: ' in result.steps[0]
        assert [each.name for each in result.wrong] == ['flc1_ratio']
        assert result.written == []
        assert shop.drives['pump'].wear == {}

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
        assert result.steps[0].startswith(('general_configuration: no answer',
                                           'general_configuration: drive offline'))
        assert {each.name for each in result.wrong} >= {'flc2_ratio', 'network_fallback'}
        assert all(each.found is None for each in result.wrong)


class TestFile:

    @pytest.mark.parametrize(('values', 'problem'), [
        ({'rampe': 1.0}, 'conveyor.yaml:3: rampe: unknown parameter rampe, did you mean '
                         'ramp_time?'),
        ({'actual_speed': 1.0}, 'conveyor.yaml:3: actual_speed: read-only'),
        ({'ramp_time': True}, 'conveyor.yaml:3: ramp_time: wrong type: bool, expected double'),
        ({'ramp_time': 61.0}, 'conveyor.yaml:3: ramp_time: 61 is out of range: 0.01 to 60 s'),
        ({'torque_limit': True}, 'conveyor.yaml:3: torque_limit: wrong type: true is a bool, '
                                 'allowed is a number'),
        ({'torque_limit': 1e9}, ''),    # whatever it is, it is not written
    ])
    def test_what_is_wrong_is_found_before_anything_is_asked(
            self, shop: Shop, values: dict[str, object], problem: str) -> None:
        file = shop.write_backup('conveyor', **values)
        with shop.reached('conveyor') as drive:
            before = shop.drives['conveyor'].requests
            found = problems_in(read_backup(file), drive)
            assert shop.drives['conveyor'].requests == before
        assert found == ([f'{shop.folder}/{problem}'] if problem else [])

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
