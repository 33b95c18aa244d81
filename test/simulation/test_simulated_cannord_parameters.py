# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameter channel of the simulated CANnord inverter, in literal bytes."""

from cannord_builders import asks, inverter, says, TABLE
import pytest
from simulation_builders import RULES

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.simulation.cannord import SimulatedCannordInverter


def made_with(**values: float) -> SimulatedCannordInverter:
    made = inverter()
    for name, value in values.items():
        made.set_value(name, value)
    return made


class TestReading:

    def test_negative_word_fills_the_upper_half(self) -> None:
        made = made_with(offset=-5)
        assert asks(made, '9B11000000000000') == '9B110000FFFFFBFF'

    def test_number_of_elements(self) -> None:
        made = inverter()
        assert asks(made, '6592000000000000') == '6562000000000500'
        assert asks(made, '6690000000000000') == '6660000000000400'

    def test_sub_index_counts_in_plain_tasks_and_in_array_tasks(self) -> None:
        """BU 0050 page 48 reads P102 of set 2 by the plain task with index 1: 3E8h is 10.00 s."""
        made = made_with(acceleration_time=1.0, acceleration_time_set_2=10.0)
        assert asks(made, '6610010000000000') == '661001000000E803'
        assert asks(made, '6610000000000000') == '6610000000006400'
        made = made_with(acceleration_time=1.0, acceleration_time_set_2=2.0)
        assert asks(made, '6660010000000000') == '664001000000C800'
        assert asks(made, '6660000000000000') == '6640000000006400'

    def test_write_only_parameter(self) -> None:
        assert asks(inverter(), '0310000000000000') == '037000000000CA00'


class TestWriting:

    @pytest.mark.parametrize(('task', 'answer', 'name', 'value', 'eeprom'), [
        ('6620000000000F27', '6610000000000F27', 'p102', 99.99, 1),
        ('66E0000000006400', '6610000000006400', 'p102', 1.0, 0),
        ('6620010000006400', '6610010000006400', 'p102.1', 1.0, 1),
        ('6670010000006400', '6640010000006400', 'p102.1', 1.0, 1),
        ('66C0010000006400', '6640010000006400', 'p102.1', 1.0, 0),
        ('66C000000000C800', '664000000000C800', 'p102', 2.0, 0),
        ('583200000100A086', '582200000100A086', 'p600', 100000, 1),
        ('58D20000FFFFFEFF', '58220000FFFFFEFF', 'p600', -2, 0),
        ('658204000100A086', '655204000100A086', 'p613.4', 100000, 1),
        ('65B204000100A086', '655204000100A086', 'p613.4', 100000, 0),
        ('9B210000FFFFFBFF', '9B110000FFFFFBFF', 'p411', -5, 1),
        ('9B2100000000FBFF', '9B110000FFFFFBFF', 'p411', -5, 1),
        ('04E0000000000100', '0410000000000100', 'p4', True, 0),
        ('03E0000000000100', '0310000000000100', 'p3', 1, 0),
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
        for task in ('6620000000006400',     # P102: EEPROM
                     '66C0010000006400',     # P102 in set 2: RAM
                     '5832000000000500',     # P600: EEPROM, and then RAM
                     '58D2000000000600',
                     '9BE1000000000900'):    # P411: RAM
            asks(made, task)
        assert made.eeprom_writes == 2
        made.fault('restart=0', 1.0)
        assert [made.value(name) for name in ('p102', 'p102.1', 'p600', 'p411')] == [
            1.0, 3.0, 5, 7]


class TestRefusals:

    @pytest.mark.parametrize(('task', 'error'), [
        ('E713000000000000', 0),     # P999 does not exist
        ('BC72000000000100', 1),     # P700 is read-only
        ('9B21000000006500', 2),     # P411 = 101
        ('9B210000FFFF9BFF', 2),     # P411 = -101
        ('9B21000001000500', 2),     # P411 = 65541
        ('66200000FFFFFBFF', 2),     # P102 = -5, and has no sign
        ('66C00100FFFFFBFF', 2),     # the same in set 2, which has no limits
        ('0420000000000200', 2),     # P4 is a bool
        ('6660020000000000', 3),     # P102 in set 3 is not in the profile
        ('6610020000000000', 3),
        ('65C2020000000000', 3),
        ('9B61000000000000', 4),     # P411 is not an array
        ('9B91000000000000', 4),
        ('9BC1000000000000', 4),
        ('5822000000000500', 5),     # P600 is a double word
        ('58E2000000000500', 5),
        ('6572010000000500', 5),
        ('6630000000000500', 5),     # P102 is a word
        ('66D0000000000500', 5),
        ('66B0010000000500', 5),
    ])
    def test_error_numbers(self, task: str, error: int) -> None:
        made = inverter()
        before = {parameter.name: made.value(parameter.name) for parameter in TABLE}
        answer = asks(made, task)
        assert answer[:2] == task[:2]
        assert answer[2:] == f'7{task[3]}{task[4:6]}000000{error:02X}00'
        assert made.eeprom_writes == 0
        assert {parameter.name: made.value(parameter.name) for parameter in TABLE} == before
        assert not made.violations

    @pytest.mark.parametrize('task', [4, 5, 10, 15])
    def test_tasks_that_do_not_exist(self, task: int) -> None:
        made = inverter()
        assert asks(made, f'66{task:X}0000000000000') == '667000000000C900'
        assert made.violations == {RULES['task identifier']: 1}

    def test_scripted_refusal(self) -> None:
        made = inverter()
        made.fault('refuse=p411', 0.0)
        assert asks(made, '9B21000000000500') == '9B71000000000100'
        assert asks(made, '9B11000000000000')[:4] == '9B11'
        made.fault('ok', 0.0)
        assert asks(made, '9B21000000000500') == '9B11000000000500'
        assert made.wear == {'offset': 1}

    def test_spontaneous_bit(self) -> None:
        made = inverter()
        assert says(made, '2C8#6618000000000000') == []
        assert made.violations == {
            RULES['task']: 1}

    def test_byte_without_information(self) -> None:
        made = inverter()
        assert asks(made, '6660010100000000')[:8] == '66400100'
        assert made.violations == {
            RULES['sub-index']: 1}


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
