# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations with the simulated CANnord inverter, in literal bytes and literal times."""

import math

from cannord_builders import (
    ACTUAL, asks, configuration, FREQUENCY, inverter, run, says,
    SETPOINTS, TABLE, tells, VALUES,
)
from hypothesis import given, strategies as st
import pytest
from simulation_builders import RULES

from drive_can_bridge.configuration.load import configuration_from_file
from drive_can_bridge.core.frame import EXTENDED_IDENTIFIER_MAX, Frame
from drive_can_bridge.resources import config_file
from drive_can_bridge.simulation.cannord import SimulatedCannordInverter
from drive_can_bridge.simulation.simulation import make_drives

READY, RUN, ACKNOWLEDGE = '7E040000', '7F040000', 'FE040000'
# status words at rest, low byte first
DISABLED, IS_READY, SWITCHED_ON, ENABLED = '700B', '310B', '330B', '370B'
FAULT = '380B'


class TestStates:

    def test_way_to_operation_enabled(self) -> None:
        made = inverter()
        answers = [tells(made, word + '0000')[:4] for word in
                   ('7F04', '7E04', '7704', '7F04', '7704', '7F04', '7E04', '7E04')]
        # run does not leave "switch-on disabled"; without bit 3 it is only switched on
        assert answers == [DISABLED, DISABLED, IS_READY, SWITCHED_ON, ENABLED, SWITCHED_ON,
                           ENABLED, IS_READY]

    @pytest.mark.parametrize(('start', 'word', 'state'), [
        ('7E04', '7C04', '600B'),       # OFF2 from ready: bit 4 shows it
        ('7E04', '7A04', '500B'),       # OFF3 from ready: bit 5 shows it
        ('7F04', '7C04', '600B'),       # OFF2 from operation enabled
        ('7F04', '7D04', '600B'),
        ('7704', '7A04', '500B'),
    ])
    def test_switch_on_disabled_by_the_control_word(self, start: str, word: str,
                                                    state: str) -> None:
        made = inverter()
        tells(made, READY)
        tells(made, start + '0000')
        tells(made, word + '0000')
        assert tells(made, word + '0000')[:4] == state
        assert tells(made, READY)[:4] == state
        assert tells(made, READY)[:4] == IS_READY

    def test_word_without_the_valid_bit_is_ignored_but_answered(self) -> None:
        made = inverter()
        run(made)
        assert tells(made, '7E000040', 1.0) == '370B0000'
        assert tells(made, '00000040', 2.0) == '370B0000'
        assert tells(made, RUN, 3.0) == '370B0000'

    def test_reserved_bit(self) -> None:
        made = inverter()
        tells(made, '7E240000')
        assert made.violations == {RULES['reserved bit']: 1}


def at_speed() -> SimulatedCannordInverter:
    """Return one that runs at its full setpoint."""
    made = inverter()
    run(made)
    tells(made, '7F040040', 0.0)
    return made


class TestMotor:

    def test_ramp_to_the_setpoint(self) -> None:
        made = inverter()
        made.set_value('acceleration_time', 2.0)
        run(made)
        tells(made, '7F040020', 10.0)                           # 50 % of 50 Hz
        assert tells(made, '7F040020', 10.5) == '370A0010'      # 25 %, not there yet
        assert tells(made, '7F040020', 11.0) == '370B0020'
        assert made.value('actual_frequency') == 25.0
        assert made.value('actual_relative_frequency') == 50.0

    def test_shutdown_ramps_down_before_it_disables(self) -> None:
        made = at_speed()
        assert tells(made, '7E040040', 2.0) == '370B0040'
        assert tells(made, '7E040040', 2.5) == '370A0020'
        assert tells(made, '7E040040', 3.0) == '310B0000'

    def test_quick_stop_brakes_fast_and_disables(self) -> None:
        made = at_speed()
        tells(made, '7A040040', 2.0)
        assert tells(made, '7A040040', 2.1) == '170A0020'       # 0.2 s from 100 %
        # run again during the stop does not end it
        assert tells(made, '7F040040', 2.15) == '170A0010'
        assert tells(made, '7F040040', 2.3)[:4] == DISABLED
        assert tells(made, '7F040040', 9.0) == '700B0000'

    def test_voltage_off_coasts(self) -> None:
        made = at_speed()
        tells(made, '7C040040', 2.0)
        assert tells(made, '7C040040', 3.0) == '600A0030'       # 4 s from 100 %

    def test_direction_bits(self) -> None:
        made = inverter()
        run(made)
        tells(made, '7F140020', 0.0)                            # left
        assert tells(made, '7F0C0020', 2.0) == '371300E0'       # right
        assert tells(made, '7F1C0020', 5.0) == '370B0020'       # both: right has priority
        assert tells(made, '7F1400E0', 8.0) == '370B0020'       # left of a negative one
        assert tells(made, '7F1400E0', 9.0) == '370B0020'

    def test_ramp_generator_bits(self) -> None:
        made = at_speed()
        tells(made, '5F040040', 0.5)                            # frozen at 50 %
        assert tells(made, '5F040040', 2.0)[4:] == '0020'
        tells(made, '3F040040', 2.0)                            # setpoint 0: normal ramp
        assert tells(made, '3F040040', 2.25)[4:] == '0010'
        assert tells(made, '3F040040', 3.0)[:4] == ENABLED
        tells(made, '7F040040', 3.0)
        tells(made, '6F040040', 5.0)                            # ramp at zero: quick ramp
        assert tells(made, '6F040040', 5.1) == '370A0020'
        assert tells(made, '6F040040', 6.0) == '370B0000'
        tells(made, '7F040040', 6.0)
        assert tells(made, '7F040040', 8.0) == '370B0040'

    def test_ramp_of_the_active_parameter_set(self) -> None:
        made = inverter()
        made.set_value('acceleration_time', 1.0)
        made.set_value('p102.1', 10.0)
        run(made)
        tells(made, '7F440040', 0.0)                            # set 2
        assert tells(made, '7F440040', 1.0) == '374A6606'       # 10 %
        assert made.value('acceleration_time') == 1.0
        tells(made, '7F040040', 1.0)
        assert tells(made, '7F040040', 1.45)[4:] == '3323'      # 55 %
        # the status word tells the set
        tells(made, '7FC40040', 2.0)
        assert tells(made, '7FC40040', 2.0)[:4] == '37CB'


class TestFrames:

    def test_length_of_the_answer_is_that_of_the_request(self) -> None:
        made = inverter(request=(FREQUENCY, *SETPOINTS[:2]), response=(ACTUAL, *VALUES[:2]))
        run(made)
        tells(made, '7F04004000200010', 0.0)
        assert tells(made, '7F04004000200010', 5.0) == '370B004000200010'
        assert tells(made, RUN, 5.0) == '370B0040'

    @pytest.mark.parametrize('data', ['', '7E', '7E04', '7E0400', '7E0400000000',
                                      '7E040000000000'])
    def test_other_lengths(self, data: str) -> None:
        made = inverter(extra_setpoints=True)
        assert says(made, f'0C8#{data}') == []
        assert says(made, '2C8#66100000000000') == []
        assert list(made.violations) == [
            RULES['length'],
            RULES['task length']]

    def test_second_inverter_with_its_address(self) -> None:
        made = inverter()
        assert says(made, '0C9#700B0000') == []
        assert says(made, '2C9#6610000000000000') == []
        assert made.violations == {RULES['alone']: 2}


class TestBroadcast:

    @pytest.mark.parametrize('how', ['group', 'all'])
    @pytest.mark.parametrize('identifier', ['403', '408'])
    def test_obeys_without_an_answer(self, how: str, identifier: str) -> None:
        made = inverter(broadcast=how)
        for data in (READY, RUN, '7F040040'):
            assert says(made, f'{identifier}#{data}', 0.0) == []
        assert tells(made, '7F040040', 5.0) == '370B0040'
        assert says(made, '402#7C040000', 5.0) == []
        assert tells(made, '7F040040', 5.0) == '370B0040'
        assert made.requests == 5

    def test_routes(self) -> None:
        def identifiers(**options: object) -> list[str]:
            routes = SimulatedCannordInverter(configuration(**options)).routes  # type: ignore
            assert {route.mask for route in routes} == {
                0x1FFFFFFF if options.get('extended_identifiers') else 0x7FF}
            return [f'{route.identifier:03X}' for route in routes]
        assert identifiers() == ['0C8', '0C9', '2C8', '2C9']
        assert identifiers(broadcast='group') == ['0C8', '0C9', '2C8', '2C9', '403', '408']
        assert identifiers(broadcast='all', extended_identifiers=True) == [
            '3200000', '3240000', 'B200000', 'B240000', '100C0000', '10200000']


class TestFaults:

    def test_fault_is_told_unasked(self) -> None:
        made = at_speed()
        made.fault('trip', 5.0)
        assert [str(sent) for sent in made.take_frames()] == ['0C9#380A0040']
        assert tells(made, RUN, 5.0) == '380A0040'

    def test_reset_needs_an_edge(self) -> None:
        made = inverter()
        tells(made, ACKNOWLEDGE)            # held already when the fault comes
        made.fault('trip', 1.0)
        made.take_frames()
        tells(made, ACKNOWLEDGE, 1.0)
        assert tells(made, ACKNOWLEDGE, 1.0)[:4] == FAULT
        assert tells(made, READY, 1.0)[:4] == FAULT
        assert tells(made, ACKNOWLEDGE, 1.0)[:4] == FAULT
        assert tells(made, RUN, 1.0)[:4] == DISABLED
        # the run word alone does not start it again
        assert tells(made, RUN, 1.0)[:4] == DISABLED

    def test_reset_works_only_after_the_cause_is_gone(self) -> None:
        made = inverter()
        made.fault('trip=2', 1.0)
        made.take_frames()
        for data, now in ((ACKNOWLEDGE, 2.9), (READY, 3.1), (READY, 3.2), (ACKNOWLEDGE, 3.3)):
            assert tells(made, data, now)[:4] == FAULT
        assert tells(made, READY, 3.4)[:4] == DISABLED

    def test_fault_number(self) -> None:
        made = inverter()
        assert asks(made, 'BC62000000000000') == 'BC42000000000000'
        made.fault('trip', 0.0)
        made.take_frames()
        assert asks(made, 'BC62000000000000') == 'BC42000000004600'     # 7.0
        made.fault('ok', 0.0)
        assert asks(made, 'BC62000000000000') == 'BC42000000000000'
        assert tells(made, READY)[:4] == DISABLED

    def test_foreign(self) -> None:
        made = inverter()
        made.fault('foreign', 0.0)
        assert [says(made, f'0C8#{READY}')[:-1] for _ in range(3)] == [
            ['0CB#5A5A5A5A'],                   # address 101
            ['03240000#5A5A5A5A'],              # 29 bits of the same identifier
            ['2C9#FF17000000005A5A'],           # answer that nobody asked for
        ]


class TestTelegramTimeout:

    def test_silence_is_a_fault(self) -> None:
        made = inverter()
        made.set_value('telegram_timeout', 0.5)
        assert made.next_timer() == math.inf        # the first telegram starts the watch
        run(made, 10.0)
        assert made.next_timer() == pytest.approx(10.5)
        made.handle_timer(10.4)
        assert made.take_frames() == []
        made.handle_timer(10.5)
        assert [str(sent) for sent in made.take_frames()] == ['0C9#380B0000']
        assert made.next_timer() == math.inf
        # E10.2
        assert asks(made, 'BC62000000000000', 20.0) == 'BC42000000006600'
        # the first telegram ends the cause; then a reset helps
        assert tells(made, READY, 20.0)[:4] == FAULT
        assert tells(made, ACKNOWLEDGE, 20.1)[:4] == FAULT
        assert tells(made, READY, 20.2)[:4] == DISABLED
        assert made.take_notices() == ['conveyor: telegram time-out']

    def test_broadcast_counts_and_parameter_tasks_do_not(self) -> None:
        made = inverter(broadcast='group')
        made.set_value('telegram_timeout', 0.5)
        run(made, 10.0)
        says(made, f'403#{RUN}', 10.4)
        assert made.next_timer() == pytest.approx(10.9)
        asks(made, '6610000000000000', 10.8)
        assert made.next_timer() == pytest.approx(10.9)

    @pytest.mark.parametrize('seconds', [0.0, -0.1])
    def test_switched_off(self, seconds: float) -> None:
        made = inverter()
        made.set_value('telegram_timeout', seconds)
        run(made, 10.0)
        assert made.next_timer() == math.inf


def test_shipped_configuration_and_profile() -> None:
    made = make_drives(configuration_from_file(config_file('cannord.yaml')))['conveyor']
    # address 50
    assert says(made, '064#7E040000', 0.0) == ['065#700B0000']
    assert says(made, '064#7F040020', 0.0) == ['065#310B0000']
    assert says(made, '064#7F040020', 5.0) == ['065#370B0020']
    assert made.value('actual_frequency') == 25.0
    # P515, P513, and P102 in set 4
    assert says(made, '264#0312000000000000') == ['265#0312000000003200']
    assert says(made, '264#0112000000000000') == ['265#0112000000000000']
    assert says(made, '264#66C0030000000A00') == ['265#6640030000000A00']
    assert made.value('acceleration_time_set_4') == pytest.approx(0.1)
    assert not made.violations


frames = st.builds(
    Frame, st.integers(0, EXTENDED_IDENTIFIER_MAX), st.binary(max_size=8), st.booleans())
own_frames = st.builds(
    Frame, st.sampled_from((0x0C8, 0x0C9, 0x2C8, 0x2C9, 0x403, 0x408)), st.binary(max_size=8),
    st.just(False))
process_data = st.builds(
    lambda word, value: Frame(0x0C8, word.to_bytes(2, 'little') + value, False),
    st.integers(0, 0xFFFF), st.binary(min_size=2, max_size=2))
tasks = st.builds(
    lambda task, number, index, value: Frame(
        0x2C8, (task << 12 | number).to_bytes(2, 'little') + bytes([index, 0]) + value, False),
    st.integers(0, 15), st.sampled_from((3, 4, 102, 411, 513, 600, 613, 700)),
    st.integers(0, 5), st.binary(min_size=4, max_size=4))


@given(st.lists(st.tuples(st.one_of(frames, own_frames, process_data, tasks),
                          st.floats(-1.0, 100.0)), max_size=30), st.booleans())
def test_no_frame_ever_raises(conversation: list[tuple[Frame, float]], extra: bool) -> None:
    made = inverter(table=TABLE, request=(FREQUENCY, *SETPOINTS), response=(ACTUAL, *VALUES),
                    extra_setpoints=extra, broadcast='all')
    for received, now in conversation:
        made.receive_frame(received, now)
        made.handle_timer(now)
        for answer in made.take_frames():
            assert not answer.extended
            assert (answer.identifier, len(answer.data)) in {
                (0x0C9, 4), (0x0C9, 5), (0x0C9, 8), (0x2C9, 8)}
