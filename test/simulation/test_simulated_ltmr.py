# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations with the simulated LTMR, in literal bytes and literal times. Its node-ID is 5."""

import json
from pathlib import Path
from typing import Any

from hypothesis import given, strategies as st
from ltmr_builders import configuration, LTMR, Ltmr, NODE
import pytest
from simulation_builders import RULES

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.frame import EXTENDED_IDENTIFIER_MAX, Frame
from drive_can_bridge.core.parameters import AccessMode, Parameter, ParameterType
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.simulation.canopen_pkw import SimulatedPkwDrive

VECTORS = json.loads((Path(__file__).parents[1] / 'vectors' / 'canopen_pkw.json').read_text(
    encoding='utf-8'))

START = '000#0105'
READ_455 = '505#C701002500000000'
READ_455_TOGGLED = '505#C70100A500000000'
NOT_OPERATIONAL = 'request while the node is not operational (ignored)'


def prepared(**options: Any) -> Ltmr:
    """Return a controller with the registers of the vectors: 455 = 2083h, 501 = 900."""
    made = Ltmr(**options)
    for name, value in (('system_status_1', 0x2083), ('system_status_2', 0),
                        ('average_current', 9.0), ('flc1_ratio', 33.0)):
        made.drive.set_value(name, value)
    return made


class TestVectors:

    @pytest.mark.parametrize('row', VECTORS['exchanges'], ids=lambda row: str(row['name']))
    def test_exchange(self, row: dict[str, Any]) -> None:
        made = prepared()
        expected: list[str] = []
        for step in row['frames']:
            direction, text = step.split()
            if direction == '>':
                assert expected == []
                expected = made.ask(text, 1.0)
            else:
                assert expected.pop(0) == text
        assert expected == []

    @pytest.mark.parametrize('row', VECTORS['sdo'], ids=lambda row: str(row['name']))
    def test_sdo(self, row: dict[str, Any]) -> None:
        assert prepared().ask(row['request'], 1.0) == [row['response']]

    @pytest.mark.parametrize(('layout', 'request_text', 'response'), [
        ('dword_swapped', '0025C70100000000', '0025C70100008320'),
        ('dword_swapped', '00AAC70100003412', '00CEC70101060200'),
        ('word_be', '01C7250000000000', '01C7250020830000'),
        ('word_be', '01C7AA0012340000', '01C7CE0000020601'),
    ])
    def test_layouts(self, layout: str, request_text: str, response: str) -> None:
        made = prepared(layout=layout)
        assert made.ask(f'505#{request_text}', 1.0) == [f'485#{response}']


class TestNetwork:

    def test_boot_up_comes_first_and_heartbeats_follow(self) -> None:
        made = Ltmr(started=False)
        assert made.drive.next_timer() < 0.0
        assert made.at(10.0) == ['705#00']
        assert made.until(13.5) == [(11.0, '705#7F'), (12.0, '705#7F'), (13.0, '705#7F')]

    @pytest.mark.parametrize(('command', 'state'), [('01', '05'), ('02', '04'), ('80', '7F')])
    @pytest.mark.parametrize('node', ['05', '00'])
    def test_commands(self, command: str, state: str, node: str) -> None:
        made = Ltmr()
        assert made.ask(f'000#{command}{node}', 0.5) == []
        assert made.until(1.0) == [(1.0, f'705#{state}')]

    @pytest.mark.parametrize('text', ['000#0206', '000#027F', '000#7705', '000#0285'])
    def test_commands_for_others(self, text: str) -> None:
        made = Ltmr()
        made.ask(text, 0.5)
        assert made.until(1.0) == [(1.0, '705#05')]
        assert not made.drive.violations

    @pytest.mark.parametrize('command', ['', '000#8005', '000#0205'])
    def test_requests_count_in_operational_only(self, command: str) -> None:
        made = Ltmr(started=False)
        made.at(0.0)
        if command:
            made.ask(START, 0.0)
            made.ask(command, 0.0)
        assert made.ask('505#C002002A01000000', 0.1) == []
        assert made.drive.violations == {NOT_OPERATIONAL: 1}
        made.ask(START, 0.2)
        assert made.drive.value('control_register_1') == 0
        # what came before was not taken, so that the same function byte is news
        assert made.ask('505#C002002A01000000', 0.3) == ['485#C002002A00000000']

    def test_reset_of_the_node(self) -> None:
        made = Ltmr()
        made.write(704, 1, 0.5)
        assert made.drive.value('control_register_1') == 1
        assert made.ask('000#8105', 1.0) == []
        assert made.ask(READ_455, 1.02) == []
        assert made.until(1.5) == [(1.05, '705#00')]
        assert made.drive.value('control_register_1') == 0
        assert made.ask(READ_455, 1.5) == []
        made.ask(START, 1.6)
        assert len(made.ask(READ_455, 1.7)) == 1

    def test_heartbeats_as_often_as_they_are_watched(self) -> None:
        made = Ltmr(heartbeat_timeout=0.6)
        assert made.until(0.65) == [(0.2, '705#05'), (0.4, '705#05'), (0.6, '705#05')]

    def test_heartbeats_are_set_by_sdo(self) -> None:
        made = Ltmr()
        assert made.ask('605#2B171000FA000000', 0.1) == ['585#6017100000000000']
        assert made.until(0.7) == [(0.35, '705#05'), (0.6, '705#05')]
        assert made.ask('605#4017100000000000', 0.7) == ['585#4B171000FA000000']
        made.ask('605#2B17100000000000', 0.7)
        assert made.until(100.0) == []
        # lost with the power
        made.fault('restart', 100.0)
        assert made.until(101.6) == [(100.5, '705#00'), (101.5, '705#7F')]

    def test_other_identifiers(self) -> None:
        made = Ltmr(request_cob_id=0x123, response_cob_id=0x456)
        assert made.ask(READ_455, 0.1) == []
        assert made.ask('123#C701002500000000', 0.1)[0].startswith('456#C7010025')
        assert made.ask('605#4003140100000000', 0.2) == ['585#4303140123010000']
        assert made.ask('605#4003180100000000', 0.2) == ['585#4303180156040000']

    @pytest.mark.parametrize('text', ['485#C701002500000000', '705#05', '085#0000000000000000',
                                      '585#6017100000000000'])
    def test_a_second_device_with_this_node_id(self, text: str) -> None:
        made = Ltmr()
        assert made.ask(text, 0.1) == []
        assert made.drive.violations == {RULES['alone']: 1}


class TestMailbox:

    def test_new_data_with_the_same_function_byte_start_nothing(self) -> None:
        made = Ltmr()
        made.ask('505#C002002A01000000', 0.1)
        assert made.ask('505#C002002A01000000', 0.15) == []     # nor does the same frame again
        assert not made.drive.violations
        assert made.ask('505#C002002A00000000', 0.2) == []
        assert made.drive.value('control_register_1') == 1
        assert made.drive.violations == {
            RULES['function byte']: 1}

    @pytest.mark.parametrize('function', ['00', '80'])
    def test_function_00_is_echoed_and_starts_nothing(self, function: str) -> None:
        made = Ltmr()
        made.ask(READ_455, 0.1)
        assert made.ask(f'505#C00200{function}01000000', 0.2) == [
            f'485#C00200{function}00000000']
        assert made.drive.value('control_register_1') == 0
        assert len(made.ask(READ_455, 0.3)) == 1

    @pytest.mark.parametrize('function', ['01', '24', '2C', '55', '4E', '7F', 'D5'])
    def test_unknown_function(self, function: str) -> None:
        made = Ltmr()
        toggled = 'CE' if function == 'D5' else '4E'
        assert made.ask(f'505#C00200{function}01000000', 0.1) == [
            f'485#C00200{toggled}01000405']
        assert made.drive.value('control_register_1') == 0

    @pytest.mark.parametrize('data', ['', 'C7010025', 'C7010025000000'])
    def test_request_of_another_length(self, data: str) -> None:
        made = Ltmr()
        assert made.ask(f'505#{data}', 0.1) == []
        assert made.drive.violations == {RULES['request length']: 1}

    def test_illegal_value_is_refused_and_the_register_keeps_its_value(self) -> None:
        made = Ltmr()
        before = made.read(652, 0.0)
        assert made.write(652, 0xFFFF, 0.1) == ['485#8C02004E30000906']
        assert made.write(652, 4, 0.2) == ['485#8C02004E30000906']
        # the trip class knows steps of 5 s only
        assert made.write(606, 12, 0.3) == ['485#5E02004E30000906']
        assert made.read(652, 0.4) == before == 33
        assert made.read(606, 0.4) == 5
        assert made.drive.eeprom_writes == 0
        assert made.write(606, 15, 0.5) == ['485#5E02002A00000000']
        assert made.read(606, 0.5) == 15
        assert made.drive.eeprom_writes == 1

    def test_two_registers_are_written_together_or_not_at_all(self) -> None:
        made = Ltmr()
        # 652 := 50, 653 := 60; then 652 := 70, 653 := 200
        assert made.ask('505#8C02002B32003C00', 0.1) == ['485#8C02002B00000000']
        assert (made.read(652, 0.2), made.read(653, 0.2)) == (50, 60)
        assert made.ask('505#8C0200AB4600C800', 0.3) == ['485#8C0200CE30000906']
        assert (made.read(652, 0.4), made.read(653, 0.4)) == (50, 60)

    @pytest.mark.parametrize(('request_text', 'code'), [
        ('0F27002500000000', '00000206'), ('FFFF00A600000000', '00000206'),
        ('C80100A600000000', None), ('FF01002600000000', '00000206'),
        ('0420003500000000', '11000906'), ('04205B3500000000', '11000906'),
        ('0920013500000000', '00000206'), ('0020013500000000', '11000906'),
        ('0820063600000000', '11000906'),
    ])
    def test_registers_that_do_not_exist(self, request_text: str, code: str | None) -> None:
        answer, = Ltmr().ask(f'505#{request_text}', 0.1)
        if code is None:
            assert answer.startswith('485#C80100A6')
        else:
            assert answer[:10] == f'485#{request_text[:6]}'
            assert answer[10:12] in ('4E', 'CE')
            assert answer[12:] == code

    def test_write_only_and_read_only(self) -> None:
        parameters = {'key': Parameter('key', number=10, access=AccessMode.WRITE_ONLY),
                      'name': Parameter('name', number=11, access=AccessMode.READ_ONLY)}
        made = Ltmr(Profile('table', '/table.yaml', '', ('canopen_pkw',), parameters),
                    response=('name',))
        assert made.ask('505#0A00002500000000', 0.1) == ['485#0A00004E01000106']
        assert made.ask('505#0A00002A07000000', 0.2) == ['485#0A00002A00000000']
        assert made.drive.value('key') == 7
        assert made.ask('505#0A0000AB08000900', 0.3) == ['485#0A0000CE02000106']
        assert made.drive.value('key') == 7

    def test_parameters_with_one_address_only_have_the_other_by_the_table(self) -> None:
        parameters = {'left': Parameter('left', number=704),
                      'right': Parameter('right', index=0x2008, subindex=6),
                      'own': Parameter('own', index=0x3100, subindex=1)}
        made = Ltmr(Profile('table', '/table.yaml', '', ('canopen_pkw',), parameters),
                    response=('left',))
        made.ask('505#082005BB22114433', 0.1)
        assert (made.drive.value('left'), made.drive.value('right')) == (0x1122, 0x3344)
        assert made.ask('505#C102002500000000', 0.2) == ['485#C102002544330000']
        assert made.ask('505#0031013A07000000', 0.3) == ['485#0031013A00000000']
        assert made.drive.value('own') == 7
        assert made.ask('505#0031023500000000', 0.4) == ['485#0031024E11000906']

    def test_raw_names(self) -> None:
        made = Ltmr()
        assert made.drive.value('p652') == made.drive.value('x2007.3') == 33.0
        made.drive.set_value('x2007.3', 40.0)
        assert made.drive.value('flc1_ratio') == 40.0
        for name in ('p9999', 'x2007', 'x2007.zz', 'p652.1', 'pump'):
            with pytest.raises(ValueRefused, match=name):
                made.drive.value(name)

    def test_refused_register(self) -> None:
        made = Ltmr()
        made.fault('refuse=flc1_ratio', 0.0)
        # "data cannot be stored in the present state of the device"
        assert made.write(652, 50, 0.1) == ['485#8C02004E22000008']
        assert made.read(652, 0.2) == 33
        made.fault('ok', 0.3)
        assert made.write(652, 50, 0.4) == ['485#8C02002A00000000']


class TestConfigurationMode:

    def made(self) -> Ltmr:
        """Return a controller; its profile has register 601."""
        return Ltmr(LTMR)

    def test_settings_are_taken_in_configuration_mode_only(self) -> None:
        made = self.made()
        # as it leaves the factory
        assert made.read(601, 0.0) == 1
        assert made.write(652, 50, 0.1) == ['485#8C02002A00000000']
        assert made.read(652, 0.1) == 50
        made.write(601, 0, 0.2)
        # no exception, but the value stays as it was
        assert made.write(652, 60, 0.3) == ['485#8C02002A00000000']
        assert made.write(606, 10, 0.3) == ['485#5E02002A00000000']
        assert (made.read(652, 0.4), made.read(606, 0.4)) == (50, 5)
        assert made.drive.wear == {'flc1_ratio': 1, 'general_configuration': 1}
        made.write(601, 1, 0.5)
        made.write(652, 60, 0.6)
        assert made.read(652, 0.7) == 60

    def test_the_motor_has_to_be_off(self) -> None:
        made = self.made()
        made.write(704, 1, 0.1)
        assert made.write(652, 50, 0.2) == ['485#8C02002A00000000']
        assert made.read(652, 0.3) == 33
        # commands are no settings
        made.write(704, 0, 0.4)
        assert made.read(458, 0.4) == 0
        made.write(652, 50, 0.5)
        assert made.read(652, 0.5) == 50

    def test_a_power_cut_keeps_the_mode(self) -> None:
        made = self.made()
        made.write(652, 50, 0.1)
        made.write(601, 0, 0.1)
        made.write(704, 1, 0.1)
        made.fault('power_cut=2', 1.0)
        assert made.until(3.5) == [(3.0, '705#00')]
        made.ask(START, 3.6)
        assert [made.read(register, 3.7) for register in (601, 652, 704, 458)] == [0, 50, 0, 0]


class TestFaults:

    def test_foreign(self) -> None:
        made = Ltmr()
        made.drive.set_value('system_status_1', 0x2083)
        made.fault('foreign', 0.0)
        asked = [made.ask(text, 0.1) for text in (READ_455, READ_455_TOGGLED) * 3]
        assert asked[:5] == [
            ['481#C701002583200000', '485#C701002583200000'],
            ['00000485#C70100A583200000', '485#C70100A583200000'],
            ['485#C70100A55A5A5A5A', '485#C701002583200000'],
            ['485#C60100A55A5A5A5A', '485#C70100A583200000'],
            ['481#C701002583200000', '485#C701002583200000']]


class TestMotor:

    def test_runs_and_stops(self) -> None:
        made = Ltmr()
        # ready, controller power
        assert made.read(455, 0.5) == 0x0041
        assert made.write(704, 1, 1.0) == ['485#C002002A00000000']
        # on, motor running, starting, far above 200 %
        assert made.read(455, 1.0) == 0x8000 | 63 << 8 | 0x80 | 0x43
        assert made.read(458, 1.0) == 1
        assert made.drive.value('average_current', 1.0) == 45.0
        # 6.3 A of 33 % of 27 A are 71 %: 23 of 32
        assert made.read(455, 10.0) == 23 << 8 | 0x80 | 0x43
        assert made.drive.value('average_current', 10.0) == pytest.approx(6.3)
        assert made.read(466, 10.0) == 71
        made.write(704, 0, 11.0)
        assert made.read(455, 11.0) == 0x0041
        assert made.drive.value('average_current', 11.0) == 0.0

    def test_trip_reset_and_run_again(self) -> None:
        made = Ltmr()
        made.write(704, 1, 1.0)
        assert made.fault('trip', 2.0) == ['085#00FF810A00000000']
        # trip, tripped, reset authorised, controller power; not ready, off
        assert made.read(455, 2.1) & 0xFF == 0x74
        assert made.read(451, 2.1) == 10
        assert made.read(452, 2.1) == 1 << 9
        assert made.read(458, 2.1) == 0
        # the run bit still stands: neither it nor its repetition starts the motor
        made.write(704, 1, 2.2)
        assert made.read(458, 2.2) == 0
        assert made.ask('505#C00200AA08000000', 2.3) == [
            '485#C00200AA00000000', '085#0000000000000000']
        assert made.read(455, 2.4) == 0x0041
        assert made.read(451, 2.4) == 0
        made.write(704, 1, 2.5)
        assert made.read(458, 2.5) == 1

    def test_reset_with_the_run_bit_does_not_start(self) -> None:
        made = Ltmr()
        made.write(704, 1, 1.0)
        made.fault('trip', 2.0)
        made.write(704, 9, 2.1)
        assert made.read(455, 2.2) == 0x0041
        made.write(704, 1, 2.3)
        assert made.read(458, 2.3) == 0
        made.write(704, 0, 2.4)
        made.write(704, 1, 2.5)
        assert made.read(458, 2.5) == 1

    def test_thermal_overload_and_the_motor_has_to_cool_down(self) -> None:
        made = Ltmr()
        made.write(704, 1, 0.0)
        made.until(60.0)
        made.drive.take_frames()
        assert 10 < made.read(465, 60.0) < 50
        # 10 % of 27 A: the motor takes 233 %. Over the bus it would have to stand
        made.drive.set_value('flc1_ratio', 10.0, 60.0)
        tripped, = (now for now, text in made.until(120.0) if text == '085#00FF810400000000')
        assert 5.0 < tripped - 60.0 < 60.0
        assert made.read(451, 120.0) == 4
        assert made.read(452, 120.0) == 1 << 3
        assert made.read(458, 120.0) == 0
        wait = made.read(450, 120.0)
        assert wait > 0
        made.write(704, 8, 120.0)
        assert made.read(455, 120.0) & 4
        made.write(704, 0, 121.0)
        made.until(122.0 + wait)
        made.write(704, 8, 122.0 + wait)
        assert made.read(455, 122.0 + wait) == 0x0041

    def test_emergency_waits_for_a_node_that_may_send_it(self) -> None:
        made = Ltmr()
        made.ask('000#0205', 0.1)
        assert made.fault('trip', 0.2) == []
        assert made.ask(START, 0.3) == ['085#00FF810A00000000']
        # and is repeated after communication began anew
        made.ask('000#8205', 1.0)
        assert made.until(1.1) == [(1.05, '705#00'), (1.05, '085#00FF810A00000000')]
        assert made.fault('ok', 1.2) == ['085#0000000000000000']

    def test_another_profile_is_played_by_its_names(self) -> None:
        parameters = {
            'speed_setpoint': Parameter('speed_setpoint', number=10, type=ParameterType.INT16,
                                        minimum=-100.0, maximum=100.0, scaled=True, unit='rpm'),
            'actual_speed': Parameter('actual_speed', number=455, type=ParameterType.INT16,
                                      access=AccessMode.READ_ONLY, scaled=True, unit='rpm')}
        made = Ltmr(Profile('table', '/table.yaml', '', ('canopen_pkw',), parameters),
                    request=('speed_setpoint',), response=('actual_speed',))
        made.write(10, 50, 1.0)
        assert made.read(455, 5.0) == 50


class TestObjects:

    @pytest.mark.parametrize(('request_text', 'response'), [
        ('4000100000000000', '4300100000000000'),           # device type
        ('4001100000000000', '4F01100000000000'),           # error register, one byte
        ('4014100000000000', '4314100085000000'),           # identifier of emergencies
        ('4018100100000000', '4318100100000000'),
        ('4018100200000000', '8018100211000906'),
        ('4003180200000000', '4F031802FF000000'),           # sent on change
        ('4000300000000000', '4F00300004000000'),
        ('4004200000000000', '4F0420003E000000'),           # highest sub-index: 511
        ('4008200500000000', '4B08200500000000'),
        ('2F08200501000000', '8008200513000706'),           # one byte for two
        ('2308200501000000', '8008200512000706'),           # four bytes for two
        ('2B00200001000000', '8000200011000906'),
        ('2314100001000000', '8014100002000106'),           # read-only
        ('2B17100101000000', '8017100111000906'),
        ('2117100004000000', '8017100001000405'),           # segmented write
        ('A017100000000000', '8017100001000405'),           # block transfer
        ('6000000000000000', '8000000001000405'),           # segment without a transfer
    ])
    def test_objects(self, request_text: str, response: str) -> None:
        assert Ltmr().ask(f'605#{request_text}', 0.1) == [f'585#{response}']

    def test_an_address_of_the_profile_is_the_only_one(self) -> None:
        table = {'state': Parameter('state', number=455, index=0x2100, subindex=1)}
        made = Ltmr(Profile('table', '/table.yaml', '', ('canopen_pkw',), table),
                    response=('state',))
        assert made.ask('605#4000210100000000', 0.1)[0].startswith('585#4B002101')
        assert made.ask('605#4004200600000000', 0.1) == ['585#8004200611000906']

    def test_device_name_comes_in_segments(self) -> None:
        made = Ltmr()
        assert made.ask('605#4008100000000000', 0.1) == ['585#410810000E000000']
        assert made.ask('605#6000000000000000', 0.1) == ['585#0073696D756C6174']
        assert made.ask('605#7000000000000000', 0.1) == ['585#116564204C544D52']
        assert made.ask('605#6000000000000000', 0.1) == ['585#8008100001000405']


_ANY_FRAME = st.one_of(
    st.builds(Frame, st.sampled_from([0x000, 0x505, 0x605, 0x485, 0x585, 0x705, 0x085]),
              st.binary(max_size=8), st.just(False)),
    st.builds(Frame, st.just(0x505), st.builds(
        lambda word, low, function, words: word.to_bytes(2, 'little') + bytes((low, function))
        + words, st.sampled_from([455, 500, 652, 704, 705, 606, 0x2004, 0x2008]),
        st.integers(0, 80), st.sampled_from([0x25, 0xA6, 0x2A, 0xAB, 0x35, 0xB6, 0x3A, 0xBB, 0]),
        st.binary(min_size=4, max_size=4)), st.just(False)),
    st.just(Frame(0x000, b'\x01\x05', False)),
    st.builds(Frame, st.integers(0, EXTENDED_IDENTIFIER_MAX), st.binary(max_size=8),
              st.just(True)))


@given(st.lists(st.tuples(st.floats(0.0, 0.6), _ANY_FRAME), max_size=40))
def test_whatever_comes_it_stays_a_good_node(steps: list[tuple[float, Frame]]) -> None:
    made = Ltmr(started=False)
    operational = False
    now = 0.0
    made.at(now)
    for wait, frame in steps:
        now += wait
        for _, text in made.until(now):
            assert text.startswith(('705#', '085#'))
            operational = operational and text != '705#00'
        made.drive.receive_frame(frame, now)
        for answer in made.drive.take_frames():
            assert not answer.extended
            assert answer.identifier in (0x485, 0x585, 0x705, 0x085)
            assert len(answer.data) == (1 if answer.identifier == 0x705 else 8)
            assert answer.identifier != 0x485 or operational
        if frame.identifier == 0 and not frame.extended and len(frame.data) == 2 \
                and frame.data[1] in (0, NODE):
            operational = frame.data[0] == 1 or operational and frame.data[0] not in (
                2, 0x80, 0x81, 0x82)
        raw = made.drive.registers.raw
        assert 5 <= raw('flc1_ratio') <= 100
        assert raw('motor_trip_class') % 5 == 0


class TestIdentity:

    def test_two_controllers_differ_in_their_serial_number(self) -> None:
        made, other = Ltmr(), SimulatedPkwDrive(configuration(station=6))
        text = b''.join(made.read(register, 1.0 + register).to_bytes(2, 'big')
                        for register in range(64, 70))
        assert text == b'LTMR27CFM   '
        assert made.read(76, 80.0) == 25003
        assert (made.read(73, 81.0), other.value('serial_number_4')) == (5, 6)
