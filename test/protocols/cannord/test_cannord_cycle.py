# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The exchange of process data with one inverter: literal bytes, literal times."""

import math
from typing import Any

from builders import frame
from cannord_session_builders import (
    ACTUAL, commanded, CURRENT, ENABLED, enabled, exchange, FAULT, FREQUENCY, INPUTS, online,
    READY, READY_FRAME, RUNNING, SECOND, SETPOINTS, started, THIRD, VALUES,
)
from conversation import Conversation
import pytest
from saying import says, status_word
from stops import STOP_CYCLES, UNANSWERED_CYCLES

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import (
    DriveState, ForeignMasterSeen, FrameRejected, Noted, ProcessDataReceived, StationFound,
    StationLost)
from drive_can_bridge.core.setpoints import CommandOutcome


def test_sample_parameters() -> None:
    talk = started(request=(), response=(ACTUAL, INPUTS))
    status, *mapped = talk.session.sample_parameters
    assert (status.name, status.kind.value, status.bits[3]) == (
        'status_word', 'integer', ('fault', 3))
    assert len(status.bits) == 14
    assert mapped == [ACTUAL, INPUTS]


@pytest.mark.parametrize(('hertz', 'data'), [
    (0.0, '0000'), (25.0, '0020'), (50.0, '0040'), (-25.0, '00E0'), (-50.0, '00C0')])
def test_setpoint(hertz: float, data: str) -> None:
    talk = enabled()
    assert talk.session.state is DriveState.NOT_ARMED
    assert talk.commands(0, 0.0, 10.023) is CommandOutcome.ARMED
    assert talk.commands(0, hertz, 10.024) is CommandOutcome.ACCEPTED
    assert talk.session.state is DriveState.ONLINE
    assert exchange(talk, 10.04, ENABLED) == f'002#7F04{data}'


@pytest.mark.parametrize(('requests', 'responses', 'sent'), [
    (0, 0, '002#7E040000'), (1, 0, '002#7E040000'), (0, 1, '002#7E040000'),
    (2, 1, '002#7E04000000000000'), (1, 2, '002#7E04000000000000'),
    (3, 3, '002#7E04000000000000'), (0, 3, '002#7E04000000000000')])
def test_the_longer_list_decides_the_length(requests: int, responses: int, sent: str) -> None:
    talk = started(request=SETPOINTS[:requests], response=VALUES[:responses])
    assert talk.at(10.0) == [sent]


@pytest.mark.parametrize(('swapped', 'sent', 'heard'), [
    (False, '002#7F040040002000F0', '003#370F00C0CEFF1F80'),
    (True, '002#7F04004000F00020', '003#370F00C01F80CEFF')])
def test_three_values_each_way(swapped: bool, sent: str, heard: str) -> None:
    talk = enabled('003#310B000000000000', request=(FREQUENCY, SECOND, THIRD),
                   response=(ACTUAL, CURRENT, INPUTS), swap_setpoints_2_3=swapped)
    for index, value in enumerate((50.0, 50.0, -25.0)):
        talk.commands(index, 0.0, 10.023)
        talk.commands(index, value, 10.024)
    assert talk.until(10.041) == [(10.04, sent)]
    talk.hears(heard, 10.042)
    assert talk.samples() == [(0x0F37, -16384, -50, 0x801F)]


def test_with_two_entries_the_swapped_second_is_in_the_last_word() -> None:
    talk = enabled('003#310B000000000000', request=(FREQUENCY, SECOND),
                   response=(ACTUAL, CURRENT), swap_setpoints_2_3=True)
    talk.commands(1, 0.0, 10.023)
    talk.commands(1, 50.0, 10.024)
    assert talk.until(10.041) == [(10.04, '002#7F04000000000020')]
    talk.hears('003#310B00000000CEFF', 10.042)
    assert talk.samples() == [(0x0B31, 0, -50)]


@pytest.mark.parametrize(('extended', 'sent', 'answer', 'others'), [
    (True, '03200000#7E040000', '03240000#310B0020', ['0C9#310B0000']),
    (False, '0C8#7E040000', '0C9#310B0020', ['03240000#310B0020', '000000C9#310B0020'])])
def test_identifiers_have_11_or_29_bits(extended: bool, sent: str, answer: str,
                                        others: list[str]) -> None:
    talk = started(station=100, extended_identifiers=extended)
    assert talk.at(10.0) == [sent]
    for text in others:
        talk.hears(text, 10.001)
    assert not talk.session.online
    assert talk.session.statistics.rejected == len(others)
    talk.hears(answer, 10.002)
    assert talk.session.online
    assert talk.samples() == [(0x0B31, 8192)]


# -- the additional frame of SK 54xE --------------------------------------------------------------


def five(**options: Any) -> Conversation:
    talk = started(request=SETPOINTS, response=VALUES, extra_setpoints=True, **options)
    assert talk.at(10.0) == ['002#7E04000000000000', '002#0000000000']
    talk.hears('003#310B000000000000', 10.002)
    assert talk.samples() == []
    talk.hears('003#0000000000', 10.003)
    assert talk.events(ProcessDataReceived) == [
        ProcessDataReceived((0x0B31, 0, 0, 0, 0, 0), 10.002)]
    return talk


def enabled_five() -> Conversation:
    """Return the same, enabled; the next cycle is due at 10.04 s."""
    talk = five()
    talk.asks(ControlAction.ENABLE, 10.004)
    assert talk.until(10.021) == [(10.02, '002#7F04000000000000'), (10.02, '002#0000000000')]
    talk.hears('003#370B000000000000', 10.022)
    talk.hears('003#0000000000', 10.023)
    assert talk.session.state is DriveState.NOT_ARMED
    talk.events()
    return talk


def test_five_values_each_way() -> None:
    talk = enabled_five()
    for index, value in enumerate((50.0, 25.0, 0.0, 50.0, -50.0)):
        talk.commands(index, 0.0, 10.023)
        talk.commands(index, value, 10.024)
    assert talk.until(10.041) == [(10.04, '002#7F04004000100000'), (10.04, '002#002000E000')]
    talk.hears('003#370F000400030002', 10.0415)
    assert talk.samples() == []
    talk.hears('003#3412FFFFA5', 10.042)
    assert talk.events(ProcessDataReceived) == [
        ProcessDataReceived((0x0F37, 0x400, 0x300, 0x200, 0x1234, -1), 10.0415)]
    assert talk.session.statistics.exchanges == 3
    assert talk.session.statistics.rejected == 0
    assert talk.session.warning == ''


def test_four_setpoints_fill_the_fifth_with_zero() -> None:
    talk = started(request=SETPOINTS[:4], response=(ACTUAL,), extra_setpoints=True)
    assert talk.at(10.0) == ['002#7E04000000000000', '002#0000000000']
    talk.hears('003#310B000000000000', 10.002)
    assert talk.samples() == [(0x0B31, 0)]
    talk.hears('003#1111222200', 10.003)     # values that nobody wants
    assert talk.samples() == []
    assert talk.session.statistics.rejected == 0


def test_extra_values_that_do_not_come() -> None:
    talk = five()
    talk.until(10.021)
    talk.hears('003#370F000400030002', 10.022)
    assert talk.samples() == []
    talk.until(10.041)
    assert talk.samples() == [(0x0F37, 0x400, 0x300, 0x200)]
    assert talk.session.warning == says('extra_values_missing')
    assert talk.session.statistics.missed == 0
    talk.hears('003#370F000400030002', 10.042)
    talk.hears('003#0100020000', 10.043)
    assert talk.samples() == [(0x0F37, 0x400, 0x300, 0x200, 1, 2)]
    assert talk.session.warning == ''


def test_a_fault_does_not_wait_for_the_extra_values() -> None:
    talk = five()
    talk.hears('003#380B000000000000', 10.01)
    assert talk.samples() == [(0x0B38, 0, 0, 0)]
    assert talk.session.state is DriveState.FAULT
    talk.until(10.021)
    talk.hears('003#370F000400030002', 10.022)
    talk.hears('003#380B000400030002', 10.0221)
    assert talk.samples() == [(0x0F37, 0x400, 0x300, 0x200), (0x0B38, 0x400, 0x300, 0x200)]


def test_extra_values_that_belong_to_nothing() -> None:
    talk = five()
    talk.hears('003#0100020000', 10.01)
    what = 'additional process data'
    assert talk.events(FrameRejected) == [FrameRejected(says('unasked', what=what))]
    talk.until(10.021)
    talk.hears('003#0100020000', 10.022)     # the main answer was lost
    assert talk.samples() == []
    talk.until(10.041)
    assert talk.session.statistics.missed == 1


def test_five_bytes_without_the_option() -> None:
    talk = online()
    talk.until(10.021)
    talk.hears('003#310B000000', 10.022)
    assert talk.samples() == []
    assert talk.session.statistics.rejected == 1


# -- answers that are not as expected -------------------------------------------------------------


def test_short_answer_publishes_what_arrived() -> None:
    talk = online('003#310B000000000000', request=(FREQUENCY,), response=(ACTUAL, CURRENT, INPUTS))
    talk.until(10.021)
    talk.hears('003#310B0020', 10.022)
    assert talk.events() == [
        FrameRejected(says('short_process_data', found=1, needed=3)),
        ProcessDataReceived((0x0B31, 8192), 10.022)]
    assert talk.session.statistics.exchanges == 2
    assert talk.session.statistics.rejected == 1


def test_short_answer_that_holds_what_is_needed() -> None:
    talk = online('003#310B000000000000', request=(FREQUENCY, SECOND), response=(ACTUAL,))
    talk.until(10.021)
    talk.hears('003#310B0020', 10.022)
    assert talk.samples() == [(0x0B31, 8192)]
    assert (talk.session.statistics.short, talk.session.statistics.rejected) == (1, 0)


def test_long_answer_to_a_short_request() -> None:
    talk = online('003#310B002011112222')
    assert talk.session.statistics.rejected == 0
    talk.until(10.021)
    talk.hears('003#310B002011112222', 10.022)
    assert talk.samples() == [(0x0B31, 8192)]


@pytest.mark.parametrize('size', [0, 1, 2, 3, 6, 7])
def test_malformed_answers(size: int) -> None:
    what = f'{size} data bytes: process data have 4 or 8'
    talk = online()
    talk.until(10.021)
    talk.hears('003#' + '31' * size, 10.022)
    assert talk.events() == [FrameRejected(says('malformed', what=what))]
    talk.hears(READY, 10.023)
    assert talk.samples() == [(0x0B31, 0)]


def test_foreign_master() -> None:
    talk = online()
    talk.hears('002#7F040040', 10.003)
    talk.hears('202#6610000000000000', 10.003)
    assert talk.events() == [
        ForeignMasterSeen(says('other_master', frame='002#7F040040', station=1)),
        ForeignMasterSeen(says('other_master', frame='202#6610000000000000', station=1))]


@pytest.mark.parametrize(('options', 'obeyed', 'others'), [
    ({}, ['400#7F040040', '408#7F040040'], ['401#7F040040', '10200000#7F040040']),
    ({'station': 100}, ['403#7F040040', '408#7F040040'], ['400#7F040040']),
    ({'broadcast': 'group'}, ['400#7F040040', '408#7F040040'], ['401#7F040040']),
    ({'broadcast': 'all'}, ['400#7F040040', '408#7F040040'], ['401#7F040040']),
    ({'extended_identifiers': True}, ['10000000#7F040040', '10200000#7F040040'],
     ['400#7F040040', '10040000#7F040040', '10000001#7F040040'])])
def test_foreign_broadcasts(options: dict[str, object], obeyed: list[str],
                            others: list[str]) -> None:
    talk = started(**options)
    for text in (*obeyed, *others):
        talk.hears(text, 10.003)
    station = options.get('station', 1)
    assert talk.events() == [
        *(ForeignMasterSeen(says('other_master_broadcasts', station=station, frame=text))
          for text in obeyed),
        *(FrameRejected(says('not_of_this_drive', frame=text)) for text in others)]


# -- faults told unasked --------------------------------------------------------------------------


def test_a_fault_told_unasked_is_a_sample_at_once() -> None:
    talk = online()
    talk.hears('003#380B0010', 10.011)
    assert talk.events() == [
        Noted(says('fault_came', ran=False, status=status_word(0x0B38)), warning=True),
        ProcessDataReceived((0x0B38, 0x1000), 10.011)]
    assert talk.session.state is DriveState.FAULT
    statistics = talk.session.statistics
    assert (statistics.exchanges, statistics.rejected, statistics.missed) == (1, 0, 0)


def test_a_fault_between_question_and_answer() -> None:
    talk = online()
    talk.until(10.021)
    talk.hears(FAULT, 10.0211)
    talk.hears('003#380B0001', 10.022)
    assert talk.samples() == [(0x0B38, 0), (0x0B38, 256)]
    assert talk.session.statistics.rejected == 0


def test_an_answer_from_before_the_fault_is_no_surprise() -> None:
    talk = online()
    talk.until(10.021)
    talk.hears(FAULT, 10.0211)
    talk.hears(READY, 10.022)
    assert talk.samples() == [(0x0B38, 0)]
    assert talk.session.state is DriveState.FAULT
    assert talk.session.statistics.rejected == 0
    talk.hears(READY, 10.023)
    assert talk.session.statistics.rejected == 1


def test_a_short_fault_frame_lacks_values_only() -> None:
    talk = online('003#310B000000000000', request=(FREQUENCY,), response=(ACTUAL, CURRENT))
    talk.hears(FAULT, 10.01)
    assert (0x0B38, 0) in talk.samples()
    assert talk.session.state is DriveState.FAULT


def test_a_fault_before_the_first_exchange_waits_for_it() -> None:
    talk = started()
    talk.hears(FAULT, 9.99)
    assert talk.events() == []
    talk.at(10.0)
    talk.hears(FAULT, 10.002)
    assert talk.events(StationFound, ProcessDataReceived) == [
        StationFound(), ProcessDataReceived((0x0B38, 0), 10.002)]
    assert talk.session.state is DriveState.FAULT


# -- missing answers ------------------------------------------------------------------------------


def test_silence_is_offline_and_cycling_goes_on() -> None:
    talk = commanded(50.0)
    assert talk.until(10.081) == [
        (10.04, '002#7F040040'), (10.06, '002#7F040040'), (10.08, '002#7F040040')]
    assert talk.events(StationLost) == []
    assert talk.until(10.101) == [(10.1, '002#7E040000')]
    lost, = talk.events(StationLost)
    what = 'no answer to process data'
    assert lost.reason == says('silent_for_cycles', cycles=3, what=what)
    assert 'P509' in talk.session.offline_advice
    assert talk.session.statistics.missed == 3
    assert talk.commands(0, 0.0, 10.11) is CommandOutcome.NOT_ARMED
    assert talk.until(10.121) == [(10.12, '002#7E040000')]
    talk.hears(RUNNING, 10.122)
    assert talk.events(StationFound) == [StationFound()]
    assert talk.session.state is DriveState.DISABLED


def test_latency_counts_from_the_frame() -> None:
    talk = online()
    talk.until(10.021)
    talk.session.receive_frame(frame(READY), 10.025, 0.002)
    event, = talk.events(ProcessDataReceived)
    assert event.received_at == pytest.approx(10.023)
    assert talk.session.statistics.latency.maximum == pytest.approx(0.003)


# -- the life of a session ------------------------------------------------------------------------


def test_stop() -> None:
    talk = commanded(50.0)
    assert exchange(talk, 10.04, RUNNING) == '002#7F040040'
    assert talk.deactivate(10.05) == []
    assert exchange(talk, 10.06) == exchange(talk, 10.08) == READY_FRAME
    assert talk.until(11.0) == [(10.1, READY_FRAME)]
    assert talk.session.stopped
    assert talk.session.next_timer() == math.inf
    assert talk.events(StationLost) == [StationLost('deactivated', ordered=True)]
    talk.hears(READY, 10.102)    # the answer to the last frame
    assert talk.events() == []
    talk.hears(READY, 10.11)
    assert talk.events() == [FrameRejected(says('unasked', what='process data'))]


def test_stop_of_a_drive_that_is_not_there() -> None:
    talk = started()
    talk.until(11.0)
    talk.deactivate(11.0)
    assert talk.until(11.021) == [(11.02, READY_FRAME)]
    talk.hears(READY, 11.022)       # now it is
    assert talk.events(StationFound, ProcessDataReceived) == []
    assert [text for _, text in talk.until(12.0)] == [READY_FRAME] * (STOP_CYCLES - 1)
    assert talk.session.stopped


def test_additional_frames_go_with_the_stop() -> None:
    talk = enabled_five()
    for index in range(5):
        talk.commands(index, 0.0, 10.023)
    talk.commands(4, 50.0, 10.024)
    assert talk.until(10.041)[1] == (10.04, '002#0000002000')
    talk.deactivate(10.05)
    assert [text for _, text in talk.until(11.0)] == [
        '002#7E04000000000000', '002#0000000000'] * UNANSWERED_CYCLES
