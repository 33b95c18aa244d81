# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameter channel of the simulated CANnord inverter, in literal bytes."""

from cannord_builders import asks, FREQUENCY, inverter, says, TABLE
import pytest
from simulation_builders import parameter

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.simulation.cannord import SimulatedCannordInverter


def made_with(**values: float) -> SimulatedCannordInverter:
    made = inverter()
    for name, value in values.items():
        made.set_value(name, value)
    return made


class TestReading:

    def test_word(self) -> None:
        made = made_with(acceleration_time=1.03)
        assert asks(made, '66 10 00 00 00 00 00 00') == '66 10 00 00 00 00 67 00'

    def test_negative_word_fills_the_upper_half(self) -> None:
        made = made_with(offset=-5)
        assert asks(made, '9B 11 00 00 00 00 00 00') == '9B 11 00 00 FF FF FB FF'

    def test_double_word(self) -> None:
        made = made_with(distance=100000)
        assert asks(made, '58 12 00 00 00 00 00 00') == '58 22 00 00 01 00 A0 86'
        made.set_value('distance', -2)
        assert asks(made, '58 12 00 00 00 00 00 00') == '58 22 00 00 FF FF FE FF'

    def test_array_element(self) -> None:
        made = made_with(position_1=70000)
        assert asks(made, '65 62 01 00 00 00 00 00') == '65 52 01 00 01 00 70 11'

    def test_number_of_elements(self) -> None:
        made = inverter()
        assert asks(made, '65 92 00 00 00 00 00 00') == '65 62 00 00 00 00 05 00'
        assert asks(made, '66 90 00 00 00 00 00 00') == '66 60 00 00 00 00 04 00'

    def test_no_task(self) -> None:
        assert asks(inverter(), '66 00 00 00 12 34 56 78') == '66 00 00 00 00 00 00 00'

    def test_sub_index_counts_in_plain_tasks_and_in_array_tasks(self) -> None:
        """BU 0050 page 48 reads P102 of set 2 by the plain task with index 1: 3E8h is 10.00 s."""
        made = made_with(acceleration_time=1.0, acceleration_time_set_2=10.0)
        assert asks(made, '66 10 01 00 00 00 00 00') == '66 10 01 00 00 00 E8 03'
        assert asks(made, '66 10 00 00 00 00 00 00') == '66 10 00 00 00 00 64 00'
        made = made_with(acceleration_time=1.0, acceleration_time_set_2=2.0)
        assert asks(made, '66 60 01 00 00 00 00 00') == '66 40 01 00 00 00 C8 00'
        assert asks(made, '66 60 00 00 00 00 00 00') == '66 40 00 00 00 00 64 00'

    def test_write_only_parameter(self) -> None:
        assert asks(inverter(), '03 10 00 00 00 00 00 00') == '03 70 00 00 00 00 CA 00'


class TestWriting:

    @pytest.mark.parametrize(('task', 'answer', 'name', 'value', 'eeprom'), [
        ('66 20 00 00 00 00 0F 27', '66 10 00 00 00 00 0F 27', 'p102', 99.99, 1),
        ('66 E0 00 00 00 00 64 00', '66 10 00 00 00 00 64 00', 'p102', 1.0, 0),
        ('66 20 01 00 00 00 64 00', '66 10 01 00 00 00 64 00', 'p102.1', 1.0, 1),
        ('66 70 01 00 00 00 64 00', '66 40 01 00 00 00 64 00', 'p102.1', 1.0, 1),
        ('66 C0 01 00 00 00 64 00', '66 40 01 00 00 00 64 00', 'p102.1', 1.0, 0),
        ('66 C0 00 00 00 00 C8 00', '66 40 00 00 00 00 C8 00', 'p102', 2.0, 0),
        ('58 32 00 00 01 00 A0 86', '58 22 00 00 01 00 A0 86', 'p600', 100000, 1),
        ('58 D2 00 00 FF FF FE FF', '58 22 00 00 FF FF FE FF', 'p600', -2, 0),
        ('65 82 04 00 01 00 A0 86', '65 52 04 00 01 00 A0 86', 'p613.4', 100000, 1),
        ('65 B2 04 00 01 00 A0 86', '65 52 04 00 01 00 A0 86', 'p613.4', 100000, 0),
        ('9B 21 00 00 FF FF FB FF', '9B 11 00 00 FF FF FB FF', 'p411', -5, 1),
        ('9B 21 00 00 00 00 FB FF', '9B 11 00 00 FF FF FB FF', 'p411', -5, 1),
        ('04 E0 00 00 00 00 01 00', '04 10 00 00 00 00 01 00', 'p4', True, 0),
        ('03 E0 00 00 00 00 01 00', '03 10 00 00 00 00 01 00', 'p3', 1, 0),
    ])
    def test_every_task(self, task: str, answer: str, name: str, value: float,
                        eeprom: int) -> None:
        made = inverter()
        assert asks(made, task) == answer
        assert made.value(name) == pytest.approx(value)
        assert made.eeprom_writes == eeprom
        assert not made.violations

    def test_eeprom_survives_a_loss_of_power_and_ram_does_not(self) -> None:
        made = made_with(offset=7, acceleration_time_set_2=3.0)
        for task in ('66 20 00 00 00 00 64 00',     # P102: EEPROM
                     '66 C0 01 00 00 00 64 00',     # P102 in set 2: RAM
                     '58 32 00 00 00 00 05 00',     # P600: EEPROM, and then RAM
                     '58 D2 00 00 00 00 06 00',
                     '9B E1 00 00 00 00 09 00'):    # P411: RAM
            asks(made, task)
        assert made.eeprom_writes == 2
        made.fault('restart=0', 1.0)
        assert [made.value(name) for name in ('p102', 'p102.1', 'p600', 'p411')] == [
            1.0, 3.0, 5, 7]

    def test_a_new_inverter_has_the_same_in_all_parameter_sets(self) -> None:
        made = made_with()
        assert [made.value(name) for name in (
            'acceleration_time', 'acceleration_time_set_2', 'acceleration_time_set_4')] == [
            1.0, 1.0, 1.0]

    def test_values_of_parameter_sets_are_independent(self) -> None:
        made = made_with(acceleration_time=1.0, acceleration_time_set_2=2.0,
                         acceleration_time_set_4=4.0)
        asks(made, '66 C0 03 00 00 00 F4 01')
        assert [made.value(name) for name in (
            'acceleration_time', 'acceleration_time_set_2', 'acceleration_time_set_4')] == [
            1.0, 2.0, 5.0]


class TestRefusals:

    @pytest.mark.parametrize(('task', 'error'), [
        ('E7 13 00 00 00 00 00 00', 0),     # P999 does not exist
        ('BC 72 00 00 00 00 01 00', 1),     # P700 is read-only
        ('9B 21 00 00 00 00 65 00', 2),     # P411 = 101
        ('9B 21 00 00 FF FF 9B FF', 2),     # P411 = -101
        ('9B 21 00 00 01 00 05 00', 2),     # P411 = 65541
        ('66 20 00 00 FF FF FB FF', 2),     # P102 = -5, and has no sign
        ('66 C0 01 00 FF FF FB FF', 2),     # the same in set 2, which has no limits
        ('04 20 00 00 00 00 02 00', 2),     # P4 is a bool
        ('66 60 02 00 00 00 00 00', 3),     # P102 in set 3 is not in the profile
        ('66 10 02 00 00 00 00 00', 3),
        ('65 C2 02 00 00 00 00 00', 3),
        ('9B 61 00 00 00 00 00 00', 4),     # P411 is not an array
        ('9B 91 00 00 00 00 00 00', 4),
        ('9B C1 00 00 00 00 00 00', 4),
        ('58 22 00 00 00 00 05 00', 5),     # P600 is a double word
        ('58 E2 00 00 00 00 05 00', 5),
        ('65 72 01 00 00 00 05 00', 5),
        ('66 30 00 00 00 00 05 00', 5),     # P102 is a word
        ('66 D0 00 00 00 00 05 00', 5),
        ('66 B0 01 00 00 00 05 00', 5),
    ])
    def test_error_numbers(self, task: str, error: int) -> None:
        made = inverter()
        before = {parameter.name: made.value(parameter.name) for parameter in TABLE}
        answer = asks(made, task)
        assert answer[:2] == task[:2]
        assert answer[3:5] == f'7{task[4]}'
        assert answer[6:] == f'{task[6:8]} 00 00 00 {error:02X} 00'
        assert made.eeprom_writes == 0
        assert {parameter.name: made.value(parameter.name) for parameter in TABLE} == before
        assert not made.violations

    @pytest.mark.parametrize('task', [4, 5, 10, 15])
    def test_tasks_that_do_not_exist(self, task: int) -> None:
        made = inverter()
        assert asks(made, f'66 {task:X}0 00 00 00 00 00 00') == '66 70 00 00 00 00 C9 00'
        assert made.violations == {'task identifier that does not exist (refused)': 1}

    def test_scripted_refusal(self) -> None:
        made = inverter()
        made.fault('refuse=p411', 0.0)
        assert asks(made, '9B 21 00 00 00 00 05 00') == '9B 71 00 00 00 00 01 00'
        assert asks(made, '9B 11 00 00 00 00 00 00')[:5] == '9B 11'
        made.fault('ok', 0.0)
        assert asks(made, '9B 21 00 00 00 00 05 00') == '9B 11 00 00 00 00 05 00'
        assert made.wear == {'offset': 1}

    def test_spontaneous_bit(self) -> None:
        made = inverter()
        assert says(made, '2C8#6618000000000000') == []
        assert made.violations == {
            'parameter task that the manual does not define (ignored)': 1}

    def test_byte_without_information(self) -> None:
        made = inverter()
        assert asks(made, '66 60 01 01 00 00 00 00')[:11] == '66 40 01 00'
        assert made.violations == {
            'byte of the sub-index that holds no information is not 0': 1}


class TestLayouts:

    def test_low_word_first(self) -> None:
        made = inverter(value_order='low_first')
        assert asks(made, '66 20 00 00 0F 27 00 00') == '66 10 00 00 0F 27 00 00'
        assert asks(made, '65 82 04 00 A0 86 01 00') == '65 52 04 00 A0 86 01 00'
        assert asks(made, '9B 21 00 00 65 00 00 00') == '9B 71 00 00 02 00 00 00'
        assert made.value('p102') == pytest.approx(99.99)
        assert made.value('p613.4') == 100000

    def test_index_in_the_high_byte(self) -> None:
        made = inverter(index_byte='high')
        assert asks(made, '66 C0 00 01 00 00 64 00') == '66 40 00 01 00 00 64 00'
        assert made.value('p102.1') == 1.0
        assert not made.violations


class TestByHand:

    @pytest.mark.parametrize('name', ['nonsense', 'p999', 'p102.2', 'p613', 'p', 'p102.', 'p-1'])
    def test_unknown_register(self, name: str) -> None:
        made = inverter(table=[entry for entry in TABLE if entry.name != 'position_0'])
        with pytest.raises(ValueRefused, match=f"no parameter '{name}'"):
            made.value(name)

    def test_leaves_the_factory_with_its_address(self) -> None:
        made = inverter(station=200)
        assert made.value('can_address') == 200
        assert made.value('telegram_timeout') == 0.0

    def test_profile_without_any_parameter(self) -> None:
        made = inverter(table=(FREQUENCY,), response=())
        assert says(made, '0C8#7E040000') == ['0C9#700B0000']
        assert asks(made, '66 10 00 00 00 00 00 00') == '66 70 00 00 00 00 00 00'

    def test_value_that_does_not_fit(self) -> None:
        made = inverter()
        for name in ('p102.1', 'offset'):
            with pytest.raises(ValueRefused):
                made.set_value(name, 1e9)
