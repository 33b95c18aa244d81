# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations with the simulated DataModel drive, in literal bytes and literal times."""


from builders import ACTUAL, CONTROL, EEPROM, parameter, RAM, STATUS, WO, WORD
from hypothesis import given, strategies as st
import pytest
from simulation_builders import ask, drive, EXAMPLE, RULES, SPEED_SETPOINT

from drive_can_bridge.core.frame import EXTENDED_IDENTIFIER_MAX, Frame

# station 1
CYCLIC = '003FFFF0'
ANSWER = '103FFFF0'
READ_30 = '002001E1#0000000000000000'
READ_50 = '00200321#0000000000000000'

LOST = 'EEPROM write less than 20 ms after the one before (lost)'
TOO_EARLY = 'read while an EEPROM write is under way (not answered)'


class TestCyclicExchange:

    def test_setpoint_beyond_the_limits_is_clamped(self) -> None:
        made = drive(response=(SPEED_SETPOINT,))
        # 3276.7 rpm becomes 3000.0 = 7530h
        assert ask(made, f'{CYCLIC}#7FFF000000000000', 0.0)[0][9:13] == '7530'
        assert ask(made, f'{CYCLIC}#8000000000000000', 0.0)[0][9:13] == '8AD0'

    def test_read_only_and_map_parameters_are_not_written(self) -> None:
        made = drive()
        made.set_value('p122', 211)
        made.set_value('p123', 126)
        assert ask(made, f'{CYCLIC}#FFFFFFFF00000000', 0.0) == [f'{ANSWER}#000000C80003A5A5']
        assert made.value('p126') == 209
        assert list(made.violations) == [RULES['map']]

    def test_empty_maps(self) -> None:
        made = drive(mapping='configure')
        assert ask(made, f'{CYCLIC}#3A98000000000000', 0.0) == [f'{ANSWER}#A5A5A5A5A5A5A5A5']
        assert made.value('speed_setpoint') == 0.0

    def test_eeprom_parameter_in_the_request_map_wears_out(self) -> None:
        made = drive()
        made.set_value('p123', 30)
        for now in (0.0, 0.005, 0.010):
            ask(made, f'{CYCLIC}#0000006400000000', now)
        assert made.eeprom_writes == 3
        assert made.violations == {RULES['wear']: 3}

    def test_offset_moves_everything_on_the_wire(self) -> None:
        made = drive(parameter_offset=-1)
        # maps at 121 and 125, with the numbers 49, 50 and 208, 209, 210
        assert ask(made, '00200794#0000000000000000', 0.0) == ['10200794#0031003200000000']
        assert ask(made, '002007D4#0000000000000000', 0.0) == ['102007D4#00D000D100D20000']
        assert ask(made, '002001D1#0000000000000000', 0.0) == ['102001D1#0064A5A5A5A5A5A5']
        assert made.value('p122') == 49
        assert made.value('p30') == 1.0

    def test_map_bases(self) -> None:
        made = drive(request_map_base=300, response_map_base=310)
        assert ask(made, '002012C4#0000000000000000', 0.0) == ['102012C4#0032003300000000']
        assert ask(made, '00201364#0000000000000000', 0.0) == ['10201364#00D100D200D30000']
        assert ask(made, '002007A4#0000000000000000', 0.0) == []


class TestAcyclicAccess:

    def test_map_entry_that_the_profile_lists(self) -> None:
        made = drive([*EXAMPLE, parameter('first_slot', 122)])
        assert made.value('first_slot') == made.value('p122') == 50

    def test_read_of_a_window_with_an_unknown_register(self) -> None:
        made = drive()
        # 209 to 211 exist, 212 does not
        assert ask(made, '00200D13#0000000000000000', 0.0) == ['10200D13#000000C80003A5A5']
        assert ask(made, '00200D14#0000000000000000', 0.0) == []
        assert not made.violations

    def test_read_only_register_keeps_its_value(self) -> None:
        made = drive()
        assert ask(made, '00300D11#1234000000000000', 0.0) == []
        assert made.value('actual_speed') == 0.0
        assert made.eeprom_writes == 0

    def test_write_only_register_is_not_read(self) -> None:
        made = drive([*EXAMPLE, parameter('user_command', 70, access=WO, storage=RAM)])
        ask(made, '00300461#0001000000000000', 0.0)
        assert made.value('user_command') == 1
        assert ask(made, '00200461#0000000000000000', 0.0) == []

    def test_what_is_not_for_this_drive(self) -> None:
        made = drive()
        for text in ('005FFFF0#0000000000000000', '3F1#03D1000100000000',
                     '7F0#0000000000000000'):
            assert ask(made, text, 0.0) == []
        assert not made.violations
        assert made.requests == 0

    @pytest.mark.parametrize('text', [
        f'{CYCLIC}#0000', f'{CYCLIC}#', '003001E1#00C8', '002001E1#', '002001E1#00000000',
        f'{ANSWER}#0000000000000000',
    ])
    def test_wrong_length_or_direction(self, text: str) -> None:
        made = drive()
        assert ask(made, text, 0.0) == []
        assert sum(made.violations.values()) == 1
        assert made.value('ramp_time') == 1.0

    def test_read_request_with_data_is_answered_and_noted(self) -> None:
        made = drive()
        assert len(ask(made, '002001E1#0000000000000001', 0.0)) == 1
        assert made.violations == {RULES['read data']: 1}


class TestEeprom:

    def test_second_write_too_early_is_lost(self) -> None:
        made = drive()
        ask(made, '003001E1#00C8000000000000', 5.000)
        ask(made, '003001E1#012C000000000000', 5.017)
        assert made.value('ramp_time') == 2.0
        assert made.violations == {LOST: 1}
        assert made.eeprom_writes == 1

    def test_reads_wait_too(self) -> None:
        made = drive()
        ask(made, '003001E1#00C8000000000000', 0.0)
        assert ask(made, READ_50, 0.010) == []
        assert len(ask(made, READ_50, 0.020)) == 1
        assert made.violations == {TOO_EARLY: 1}

    def test_map_parameters_are_eeprom(self) -> None:
        made = drive()
        ask(made, '003007A1#0000000000000000', 0.000)
        ask(made, '003007B1#0000000000000000', 0.005)
        assert (made.value('p122'), made.value('p123')) == (0, 51)
        assert made.violations == {LOST: 1}

    def test_one_frame_is_one_write(self) -> None:
        made = drive()
        ask(made, '003007A4#0033003200000000', 0.0)
        assert [made.value(f'p{number}') for number in range(122, 126)] == [51, 50, 0, 0]
        assert made.eeprom_writes == 4
        assert not made.violations

    @pytest.mark.parametrize(('storage', 'writes'), [(RAM, 0), (EEPROM, 2), (None, 2)])
    def test_what_is_not_known_counts_as_eeprom(self, storage: object, writes: int) -> None:
        made = drive([parameter('gain', 60, storage=storage)], request=(), response=())
        ask(made, '003003C1#0001000000000000', 0.0)
        ask(made, '003003C1#0002000000000000', 0.02)
        assert made.eeprom_writes == writes
        assert made.value('gain') == 2

    def test_ram_is_written_while_eeprom_is_busy(self) -> None:
        made = drive([*EXAMPLE, parameter('gain', 60, storage=RAM)])
        ask(made, '003001E1#00C8000000000000', 0.0)
        ask(made, '003003C1#0007000000000000', 0.001)
        assert made.value('gain') == 7
        assert not made.violations


class TestControl:

    request = (SPEED_SETPOINT, WORD)
    response = (ACTUAL, STATUS)

    def exchange(self, made: object, word: int, now: float, speed: str = '7530') -> str:
        answers = ask(made, f'{CYCLIC}#{speed}{word:04X}00000000', now)  # type: ignore[arg-type]
        return answers[0][9:17]

    def made(self) -> object:
        return drive([*EXAMPLE, WORD], control=CONTROL, request=self.request,
                     response=self.response)

    def test_follows_only_while_enabled(self) -> None:
        made = self.made()
        assert self.exchange(made, 0x0000, 0.0) == '00000001'
        assert self.exchange(made, 0x0000, 1.0) == '00000001'
        assert self.exchange(made, 0x0001, 1.0) == '00000003'
        assert self.exchange(made, 0x0001, 1.5) == '3A980003'
        assert self.exchange(made, 0x0000, 1.5) == '3A980001'
        # without torque it coasts: 3000 rpm in 4 s
        assert self.exchange(made, 0x0000, 2.5) == '1D4C0001'

    def test_quick_stop_is_faster_than_the_ramp(self) -> None:
        made = self.made()
        self.exchange(made, 0x0000, 0.0)
        self.exchange(made, 0x0001, 0.0)
        assert self.exchange(made, 0x0001, 1.0) == '75300003'
        assert self.exchange(made, 0x0002, 1.0) == '75300003'
        assert self.exchange(made, 0x0002, 1.1) == '3A980003'
        assert self.exchange(made, 0x0002, 1.21) == '00000001'
        # enable alone does not start it again
        assert self.exchange(made, 0x0001, 1.3) == '00000001'
        assert self.exchange(made, 0x0000, 1.3) == '00000001'
        assert self.exchange(made, 0x0001, 1.3) == '00000003'

    def test_trip_and_reset(self) -> None:
        made = self.made()
        self.exchange(made, 0x0000, 0.0)
        self.exchange(made, 0x0001, 0.0)
        made.fault('trip', 1.0)  # type: ignore[attr-defined]
        assert self.exchange(made, 0x0001, 1.0)[4:] == '0008'
        assert self.exchange(made, 0x0000, 1.1)[4:] == '0008'
        assert self.exchange(made, 0x0001, 1.2)[4:] == '0008'
        assert self.exchange(made, 0x0080, 1.3)[4:] == '0001'
        assert self.exchange(made, 0x0001, 1.4)[4:] == '0003'

    def test_fault_whose_cause_persists(self) -> None:
        made = self.made()
        made.fault('trip=2', 1.0)  # type: ignore[attr-defined]
        assert self.exchange(made, 0x0080, 1.1)[4:] == '0008'
        # the word has to change for another attempt
        assert self.exchange(made, 0x0080, 3.0)[4:] == '0008'
        assert self.exchange(made, 0x0000, 3.1)[4:] == '0008'
        assert self.exchange(made, 0x0080, 3.2)[4:] == '0001'

    def test_ok_without_a_fault_leaves_the_motor_alone(self) -> None:
        made = self.made()
        self.exchange(made, 0x0000, 0.0)
        self.exchange(made, 0x0001, 0.0)
        assert self.exchange(made, 0x0001, 1.0) == '75300003'
        made.fault('ok', 1.0)   # type: ignore[attr-defined]
        # nothing coasts, although no telegram says again that it shall run
        assert self.exchange(made, 0x0001, 1.5) == '75300003'


frames = st.builds(
    Frame, st.integers(0, EXTENDED_IDENTIFIER_MAX), st.binary(max_size=8), st.booleans())
own_frames = st.builds(
    lambda low, direction, data: Frame(direction | 1 << 21 | low, data, True),
    st.integers(0, 0x1FFFFF), st.sampled_from((0, 0x10000000)), st.binary(max_size=8))
read_and_write = st.builds(
    lambda write, number, count, data: Frame(1 << 21 | write | number << 4 | count, data, True),
    st.sampled_from((0, 0x100000)), st.sampled_from((29, 30, 50, 122, 126, 209, 0xFFFF)),
    st.integers(0, 15), st.binary(min_size=8, max_size=8))


@given(st.lists(st.tuples(st.one_of(frames, own_frames, read_and_write),
                          st.floats(-1.0, 100.0)), max_size=30))
def test_no_frame_ever_raises(conversation: list[tuple[Frame, float]]) -> None:
    made = drive([*EXAMPLE, WORD], control=CONTROL)
    for received, now in conversation:
        made.receive_frame(received, now)
        made.handle_timer(now)
        for answer in made.take_frames():
            assert answer.identifier >> 21 == 0x81
            assert len(answer.data) == 8
