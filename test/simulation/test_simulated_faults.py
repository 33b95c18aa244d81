# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Scripted faults: how they are written, and what they do to a drive's answers."""

import math

from builders import CONTROL, frame, parameter, RAM, WORD
from hypothesis import given, strategies as st
import pytest
from simulation_builders import ask, bridge, configuration, drive, EXAMPLE

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.simulation.faults import Fault, FaultKind, parse_fault
from drive_can_bridge.simulation.simulation import make_drives, SIMULATED_DRIVES

POLL = '003FFFF0#0000000000000000'
ANSWER = '103FFFF0#000000C80003A5A5'


class TestWriting:

    @pytest.mark.parametrize(('text', 'fault'), [
        ('silent', Fault(FaultKind.SILENT)), ('late=0.15', Fault(FaultKind.LATE, 0.15)),
        (' drop = 3 ', Fault(FaultKind.DROP, 3)), ('length=0', Fault(FaultKind.LENGTH, 0)),
        ('stuck=ramp_time', Fault(FaultKind.STUCK, 'ramp_time')),
        ('trip', Fault(FaultKind.TRIP)), ('trip=2', Fault(FaultKind.TRIP, 2.0)),
        ('ok', Fault(FaultKind.OK)), ('cut_at=2', Fault(FaultKind.CUT_AT, 2)),
        ('needs=a:b', Fault(FaultKind.NEEDS, 'a:b')),
        ('set= a : 1 ', Fault(FaultKind.SET, 'a:1')),
    ])
    def test_read(self, text: str, fault: Fault) -> None:
        assert parse_fault(text) == fault
        assert parse_fault(str(fault)) == fault

    @pytest.mark.parametrize(('text', 'message'), [
        ('silnt', r"unknown fault 'silnt' \(nearest: silent\); allowed: silent, late=SECONDS"),
        ('', "unknown fault ''; allowed"),
        ('late', "'late' is not a fault, write late=SECONDS"),
        ('late=', "'late=' is not a fault, write late=SECONDS"),
        ('late=soon', "'soon' is not possible, write late=SECONDS: answers that much later"),
        ('late=-1', 'not possible'), ('late=nan', 'not possible'), ('late=inf', 'not possible'),
        ('drop=0', 'not possible'), ('drop=1.5', 'not possible'), ('length=9', 'not possible'),
        ('silent=3', "'silent=3' is not a fault, write silent"),
        ('stuck', 'write stuck=PARAMETER'), ('cut_at=0', 'not possible'),
        ('needs=a', "'a' is not possible, write needs=PARAMETER:OTHER"),
        ('set=:1', 'not possible'), ('set=a:', 'not possible'),
    ])
    def test_refused(self, text: str, message: str) -> None:
        with pytest.raises(ValueRefused, match=message):
            parse_fault(text)

    @given(st.text(max_size=20))
    def test_any_text_is_read_or_refused(self, text: str) -> None:
        try:
            parse_fault(text)
        except ValueRefused as error:
            assert '\n' not in repr(str(error))


class TestAnswers:

    def test_silent(self) -> None:
        made = drive()
        made.fault('silent', 0.0)
        assert ask(made, '003FFFF0#3A98000000000000', 0.0) == []
        # it obeys nevertheless
        assert made.value('speed_setpoint') == 1500.0
        made.fault('ok', 1.0)
        assert len(ask(made, POLL, 1.0)) == 1

    def test_late(self) -> None:
        made = drive()
        made.fault('late=0.15', 0.0)
        assert made.next_timer() == math.inf
        assert ask(made, POLL, 1.00) == []
        assert ask(made, POLL, 1.02) == []
        assert made.next_timer() == 1.15
        made.handle_timer(1.14)
        assert made.take_frames() == []
        made.handle_timer(1.15)
        assert [str(f) for f in made.take_frames()] == [ANSWER]
        assert made.next_timer() == pytest.approx(1.17)
        made.handle_timer(1.2)
        assert len(made.take_frames()) == 1
        assert made.next_timer() == math.inf

    def test_drop(self) -> None:
        made = drive()
        made.fault('drop=3', 0.0)
        assert [len(ask(made, POLL, 0.01 * n)) for n in range(7)] == [1, 1, 0, 1, 1, 0, 1]
        made.fault('drop=1', 1.0)
        assert ask(made, POLL, 1.0) == []

    @pytest.mark.parametrize(('length', 'data'), [
        (0, ''), (3, '000000'), (8, '000000C80003A5A5')])
    def test_length(self, length: int, data: str) -> None:
        made = drive()
        made.fault(f'length={length}', 0.0)
        assert ask(made, POLL, 0.0) == [f'103FFFF0#{data}']

    def test_duplicate(self) -> None:
        made = drive()
        made.fault('duplicate', 0.0)
        assert ask(made, POLL, 0.0) == [ANSWER, ANSWER]

    def test_foreign(self) -> None:
        made = drive()
        made.fault('foreign', 0.0)
        assert [ask(made, POLL, 0.0) for _ in range(4)] == [
            ['105FFFF0#5A5A5A5A5A5A5A5A', ANSWER],      # station 2
            ['7F0#5A5A5A5A5A5A5A5A', ANSWER],           # 11 bits of the same identifier
            ['103001E1#5A5A5A5A5A5A5A5A', ANSWER],      # acknowledgement of a write
            ['105FFFF0#5A5A5A5A5A5A5A5A', ANSWER],
        ]

    def test_foreign_keeps_clear_of_the_neighbours(self) -> None:
        made = make_drives(bridge(
            configuration(name='a', station=1), configuration(name='b', station=2),
            configuration(name='c', station=3)))['a']
        made.fault('foreign', 0.0)
        made.receive_frame(frame(POLL), 0.0)
        assert str(made.take_frames()[0]) == '109FFFF0#5A5A5A5A5A5A5A5A'

    def test_faults_add_up(self) -> None:
        made = drive()
        for text in ('duplicate', 'length=2', 'late=0.1', 'late=0.2'):
            made.fault(text, 0.0)
        assert made.faults_text.split(', ') == ['duplicate', 'length=2', 'late=0.2']
        ask(made, POLL, 1.0)
        made.handle_timer(1.2)
        assert [str(f) for f in made.take_frames()] == ['103FFFF0#0000', '103FFFF0#0000']
        made.fault('ok', 2.0)
        assert made.faults_text == 'ok'


class TestDrive:

    def test_stuck(self) -> None:
        made = drive()
        made.fault('stuck=ramp_time', 0.0)
        made.fault('stuck=p50', 0.0)
        made.fault('stuck=p122', 0.0)
        ask(made, '003001E1#00C8000000000000', 0.0)
        ask(made, '003FFFF0#3A98000000000000', 0.1)
        ask(made, '003007A1#0000000000000000', 0.1)
        assert made.value('ramp_time') == 1.0
        assert made.value('speed_setpoint') == 0.0
        assert made.value('p122') == 50
        # by hand it can be set all the same
        made.set_value('ramp_time', 3.0)
        assert made.value('ramp_time') == 3.0
        made.fault('ok', 1.0)
        ask(made, '003001E1#00C8000000000000', 1.0)
        assert made.value('ramp_time') == 2.0

    def test_refused_write_changes_nothing_and_is_not_told(self) -> None:
        # the protocol has no way to say so
        made = drive()
        made.fault('refuse=ramp_time', 0.0)
        assert ask(made, '003001E1#00C8000000000000', 0.0) == []
        assert made.value('ramp_time') == 1.0
        assert made.eeprom_writes == 0
        assert made.faults_text == 'refuse=ramp_time'
        made.fault('ok', 1.0)
        ask(made, '003001E1#00C8000000000000', 1.0)
        assert made.value('ramp_time') == 2.0

    def test_power_cut(self) -> None:
        made = drive([*EXAMPLE, parameter('gain', 60, storage=RAM)])
        initial = made.value('gain')
        ask(made, '003003C1#0007000000000000', 0.0)
        ask(made, '003001E1#00C8000000000000', 0.0)
        made.fault('power_cut=3', 1.0)
        assert ask(made, POLL, 3.99) == []
        assert ask(made, POLL, 4.0) == [ANSWER]
        assert (made.value('gain'), made.value('ramp_time')) == (initial, 2.0)
        assert made.faults_text == 'ok'
        made.fault('power_cut', 10.0)
        assert ask(made, POLL, 14.99) == []
        assert ask(made, POLL, 15.0) == [ANSWER]

    def test_setting_that_needs_another_one_first(self) -> None:
        made = drive([*EXAMPLE, parameter('gain', 60, storage=RAM, maximum=100)])
        before = made.value('gain')
        made.fault('needs=gain:ramp_time', 0.0)
        assert made.faults_text == 'needs=gain:ramp_time'
        ask(made, '003003C1#0007000000000000', 0.0)
        assert made.value('gain') == before
        ask(made, '003001E1#00C8000000000000', 0.0)
        ask(made, '003003C1#0007000000000000', 0.1)
        assert made.value('gain') == 7
        made.fault('restart=0', 1.0)                        # what was written counts no more
        ask(made, '003003C1#0008000000000000', 1.0)
        assert made.value('gain') == before
        made.fault('ok', 2.0)
        ask(made, '003003C1#0008000000000000', 2.0)
        assert made.value('gain') == 8

    def test_each_fault_of_a_setting_is_told(self) -> None:
        made = drive()
        for fault in ('needs=ramp_time:torque_limit', 'needs=ramp_time:p50', 'stuck=p30'):
            made.fault(fault, 0.0)
        assert made.faults_text.split(', ') == [
            'needs=ramp_time:torque_limit', 'needs=ramp_time:p50', 'stuck=p30']
        made.fault('ok', 0.0)
        assert made.faults_text == 'ok'

    def test_power_is_cut_at_a_write(self) -> None:
        made = drive()
        made.fault('cut_at=2', 0.0)
        ask(made, '003001E1#00C8000000000000', 0.0)
        assert ask(made, '003FFFF0#0BB8000000000000', 0.5) != []    # setpoints do not count
        ask(made, '003001E1#012C000000000000', 1.0)                 # obeyed …
        assert made.value('ramp_time') == 3.0
        assert ask(made, POLL, 1.1) == []                           # … and off it goes
        assert made.faults_text == 'off'
        made.fault('restart=0', 6.0)
        assert ask(made, POLL, 6.0) == [ANSWER]
        ask(made, '003001E1#0190000000000000', 7.0)                 # once only
        assert ask(made, POLL, 7.1) == [ANSWER]

    def test_set_by_hand(self) -> None:
        made = drive()
        made.fault('set=ramp_time:12.5', 0.0)
        made.fault('set=actual_speed:77', 0.0)
        made.fault('set=p211:0x80', 0.0)
        assert (made.value('ramp_time'), made.value('actual_speed')) == (12.5, 77.0)
        assert made.value('status_word') == 128
        assert made.faults_text == 'ok'
        made.fault('ok', 1.0)
        assert (made.value('ramp_time'), made.value('actual_speed')) == (12.5, 0.0)
        for text, message in (('set=ramp_time:long', "'long' is no value of ramp_time, which is "
                                                     'a number'),
                              ('set=status_word:1.5', 'which is an integer'),
                              ('set=ramp:1', "no parameter 'ramp'"),
                              ('set=ramp_time:1e9', 'not representable')):
            with pytest.raises(ValueRefused, match=message):
                made.fault(text, 2.0)

    def test_stuck_needs_a_parameter_of_the_drive(self) -> None:
        with pytest.raises(ValueRefused, match="conveyor has no parameter 'ramp'"):
            drive().fault('stuck=ramp', 0.0)

    def test_trip_without_control_section(self) -> None:
        made = drive([*EXAMPLE, parameter('fault_code', 217)])
        ask(made, '003FFFF0#753003E800000000', 0.0)
        made.fault('trip', 1.0)
        assert ask(made, '003FFFF0#753003E800000000', 1.0) == ['103FFFF0#753000000008A5A5']
        assert made.faults_text == 'tripped'
        assert ask(made, '003FFFF0#753003E800000000', 9.0) == ['103FFFF0#000000000008A5A5']
        made.fault('ok', 9.0)
        assert ask(made, '003FFFF0#753003E800000000', 9.0)[0][17:21] == '0003'

    def test_restart(self) -> None:
        made = drive([*EXAMPLE, WORD, parameter('gain', 60, storage=RAM)],
                     control=CONTROL)
        initial = made.value('gain')
        made.set_value('p126', 210)
        made.set_value('gain', 1000)
        made.set_value('ramp_time', 5.0)
        made.set_value('control_word', 1)
        made.set_value('actual_speed', 77.0)
        made.fault('restart', 10.0)
        assert ask(made, POLL, 10.49) == []
        assert ask(made, POLL, 10.5) == ['103FFFF0#000000000001A5A5']
        assert made.value('p126') == 210
        assert made.value('gain') == initial
        assert made.value('ramp_time') == 5.0
        assert made.value('control_word') == 0
        assert made.value('actual_speed') == 0.0

    def test_forget(self) -> None:
        made = drive()
        made.fault('forget=0.1', 0.0)
        assert ask(made, POLL, 0.05) == []
        assert ask(made, POLL, 0.1) == ['103FFFF0#A5A5A5A5A5A5A5A5']
        assert [made.value(f'p{number}') for number in range(122, 130)] == [0] * 8

    @pytest.mark.parametrize('end', ['ok', 'restart'])
    def test_off(self, end: str) -> None:
        made = drive()
        ask(made, '003FFFF0#7530000000000000', 0.0)
        made.fault('off', 1.0)
        assert made.faults_text == 'off'
        assert ask(made, POLL, 2.0) == []
        made.fault('trip', 2.0)
        made.fault(end, 3.0)
        assert ask(made, POLL, 3.4) == []
        assert ask(made, POLL, 3.5) == [ANSWER]
        assert made.faults_text == 'ok'


def test_every_family_is_simulated() -> None:
    assert SIMULATED_DRIVES.keys() == FAMILIES.keys()
