# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The conversation with an 11-bit drive: literal times, literal bytes."""

from functools import partial
import math
from typing import Any

from builders import (
    ACTUAL, CONTROL, CURRENT, DAMPING, drive, frame, GAIN, parameter, RAMP, read, RO, SPEED,
    STATUS, TABLE, WORD, write,
)
from conversation import Conversation
import pytest
from saying import may_run, says
from standard_builders import (
    ANSWER, ASK, LIMIT_ZERO, online, polling, round_of, SPEED_ZERO,
)
from stops import written_again
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import (
    AnswerLate, DriveState, ForeignMasterSeen, Noted, ProcessDataReceived,
    StationFound, StationLost,
)
from drive_can_bridge.core.parameters import Parameter

FAR = parameter('heat', 220, access=RO)
GAP = parameter('torque', 213, access=RO)


# -- rounds ---------------------------------------------------------------------------------------


def running(**options: Any) -> Conversation:
    """Return a drive that was told 100 rpm, and asked for its round at 10.021 s."""
    talk = online(rearm_immediate=True, **options)
    talk.commands(0, 100.0, 10.01)
    assert talk.until(10.0215) == [(10.02, '3F1#063200E803000000'), (10.021, ASK)]
    return talk


def test_answer_to_an_older_question_does_not_show_that_a_stop_arrived() -> None:
    talk = running(command_timeout=0.05)
    assert talk.until(10.09) == [(10.06, SPEED_ZERO)]
    assert talk.hears(ANSWER, 10.091) == []
    assert talk.session.duty.unacknowledged
    assert talk.until(10.105) == [(10.1, ASK)]
    assert talk.hears(ANSWER, 10.106) == []
    assert not talk.session.duty.unacknowledged


def test_answer_that_finds_a_drive_does_not_show_that_a_stop_arrived() -> None:
    talk = running(command_timeout=0.05)
    talk.until(12.0)
    assert not talk.session.online
    talk.events()
    assert talk.until(12.0215) == [(12.021, ASK)]
    assert talk.hears(ANSWER, 12.022) == []
    assert talk.session.online
    talk.bus_down(12.0221)
    assert [note.text for note in talk.events(Noted) if note.warning] == [
        says('may_still_be_running', why=says('bus_lost_before_stop'))]


def test_answer_that_finds_a_drive_behind_a_stall_does_not_show_that_either() -> None:
    """It has just said that it does not have what stops it."""
    talk = running()
    talk.hears(ANSWER, 10.023)
    talk.commands(0, 0.0, 10.03)
    assert talk.until(10.0415) == [(10.04, SPEED_ZERO), (10.041, ASK)]
    talk.handle_stall(10.2)
    told = talk.served(10.3145, {ASK_SPEED: '7F1#E803000000000000',
                                 ASK_LIMIT: '7F1#0000000000000000'}.get)
    assert told[-1] == (10.314, ASK)
    talk.events()
    talk.hears(ANSWER, 10.315)
    assert talk.session.online
    talk.bus_down(10.3151)
    assert [note.text for note in talk.events(Noted) if note.warning] == [
        may_run('bus_lost_before_stop')]


def deaf_for_a_round(**options: Any) -> Conversation:
    """Return one of a drive that runs, and misses its round of 10.04 s and what is sent then."""
    talk = running(refresh_interval=0.0, **options)
    talk.hears(ANSWER, 10.023)
    assert talk.until(10.0405) == [(10.04, ASK)]
    return talk


def test_a_quick_stop_of_a_missed_round_is_written_again_behind_an_answer() -> None:
    talk = deaf_for_a_round()
    assert talk.asks(ControlAction.QUICK_STOP, 10.05) == [SPEED_ZERO]
    assert talk.until(10.2405) == [(10.051, LIMIT_ZERO), (10.24, ASK)]
    assert talk.hears(ANSWER, 10.242) == []
    assert talk.control_outcomes() == []
    assert talk.until(10.2605) == [(10.243, SPEED_ZERO), (10.244, LIMIT_ZERO), (10.26, ASK)]
    talk.hears(ANSWER, 10.262)
    assert talk.control_outcomes() == [('quick_stop', True, says('neutral_without_control'))]


def test_what_expired_in_a_missed_round_is_written_again_behind_an_answer() -> None:
    talk = deaf_for_a_round(command_timeout=0.05)
    assert talk.until(10.2405) == [(10.06, SPEED_ZERO), (10.24, ASK)]
    talk.hears(ANSWER, 10.242)
    assert talk.session.unacknowledged
    assert talk.until(10.2605) == [(10.243, SPEED_ZERO), (10.26, ASK)]
    talk.hears(ANSWER, 10.262)
    assert not talk.session.unacknowledged


def test_a_setpoint_of_a_missed_round_is_written_again_behind_an_answer() -> None:
    talk = deaf_for_a_round(command_timeout=0.0)
    talk.commands(0, 10.0, 10.05)
    assert talk.until(10.2405) == [(10.06, '3F1#0632006400000000'), (10.24, ASK)]
    talk.hears(ANSWER, 10.242)
    talk.commands(0, 9.0, 10.2425)
    assert talk.until(10.2605) == [(10.243, '3F1#0632005A00000000'), (10.26, ASK)]
    talk.hears(ANSWER, 10.262)
    assert talk.until(10.2905) == [(10.28, ASK)], 'and not once more'


def test_a_missed_round_in_which_nothing_left_has_nothing_written_again() -> None:
    talk = deaf_for_a_round(command_timeout=0.0)
    assert talk.until(10.2405) == [(10.24, ASK)]
    talk.hears(ANSWER, 10.242)
    assert talk.until(10.2605) == [(10.26, ASK)]


def test_a_round_cut_short_by_the_end_does_not_keep_the_next_from_beginning() -> None:
    talk = polling()
    assert talk.deactivate(10.001) == []
    assert talk.session.stopped
    assert talk.activate(10.5) == []
    assert [text for _, text in talk.until(10.515)] == [ASK]


def test_a_round_is_published_with_the_time_of_its_last_answer() -> None:
    talk = polling()
    talk.session.receive_frame(frame('7F1#18FC06FF01000000'), 10.003, age=0.001)
    assert talk.events(StationFound, ProcessDataReceived) == [
        StationFound(), ProcessDataReceived((-1000, -250, 1), pytest.approx(10.002))]
    assert talk.session.statistics.exchanges == 1
    assert talk.session.statistics.latency.maximum == pytest.approx(0.002)


def test_several_reads_are_one_sample() -> None:
    talk = polling(table=(*TABLE, FAR), response=(FAR, ACTUAL, CURRENT, STATUS))
    assert talk.hears(ANSWER, 10.002) == []
    assert talk.samples() == []
    assert talk.until(10.01) == [(10.003, '3F1#03DC000100000000')]
    talk.hears('7F1#2A00FFFFFFFFFFFF', 10.004)
    assert talk.samples() == [(42, 1000, 250, 1)]
    assert talk.session.statistics.exchanges == 1


def test_a_gap_is_bridged_over_listed_parameters() -> None:
    first = polling_of(table=(*TABLE, parameter('hidden', 212, access=RO), GAP),
                       response=(CURRENT, GAP))
    assert first == ['3F1#03D2000400000000']
    # without an entry in the profile nobody knows whether the drive has 212
    assert polling_of(table=(*TABLE, GAP), response=(STATUS, GAP)) == ['3F1#03D3000100000000']


def polling_of(**options: object) -> list[str]:
    talk = Conversation(drive('datamodel_standard', **options)).begun()
    return talk.at(10.0)


def test_a_silent_drive_is_asked_again_and_again_and_gets_nothing_else() -> None:
    talk = polling()
    sent = talk.until(12.0)
    assert {text for _, text in sent} == {ASK}
    # 0.1 s for the answer, 0.1 s of quarantine
    assert [when for when, _ in sent[:3]] == pytest.approx([10.2, 10.4, 10.6])
    assert talk.session.state is DriveState.OFFLINE
    assert talk.session.statistics.missed == 10
    assert talk.session.offline_advice == says('reads_unanswered')


def test_three_failed_rounds_are_the_end_of_online() -> None:
    talk = online()
    assert [text for _, text in talk.until(10.12)] == [ASK]
    assert talk.session.statistics.missed == 1
    assert talk.session.online
    talk.until(10.6)
    assert talk.events(StationLost) == [
        StationLost(says('no_round', periods=3))]
    assert talk.session.statistics.missed == 3


def test_one_failed_read_of_a_round_publishes_nothing() -> None:
    talk = polling(table=(*TABLE, FAR), response=(ACTUAL, CURRENT, STATUS, FAR))
    talk.hears(ANSWER, 10.002)
    talk.until(10.15)
    assert talk.samples() == []
    assert not talk.session.online
    assert talk.session.statistics.missed == 1


ASK_SPEED, ASK_LIMIT = '3F1#0332000100000000', '3F1#0333000100000000'
#: what is told of a stop that nobody has answered
UNHEARD = may_run('stop_failed', what=[
    says('write_unanswered', what='speed_setpoint (P50)'),
    says('write_unanswered', what='torque_limit (P51)')])


def warnings(talk: Conversation) -> list[str]:
    return [note.text for note in talk.events(Noted) if note.warning]


def test_a_lost_drive_is_told_three_times_to_stand_still() -> None:
    talk = running(command_timeout=0.0, refresh_interval=0.0)
    told = [text for _, text in talk.until(12.0) if text != ASK]
    assert told == [SPEED_ZERO, LIMIT_ZERO, ASK_SPEED] * 3
    assert warnings(talk) == [UNHEARD]


def test_a_lost_drive_that_says_it_stands_is_told_once() -> None:
    talk = running(command_timeout=0.0, refresh_interval=0.0)
    stands = dict.fromkeys((ASK_SPEED, ASK_LIMIT), '7F1#0000000000000000')
    told = [text for _, text in talk.served(16.0, stands.get) if text != ASK]
    assert not talk.session.online
    assert told == [SPEED_ZERO, LIMIT_ZERO, ASK_SPEED, ASK_LIMIT]
    assert warnings(talk) == []
    assert not talk.session.duty.stop_pending


# -- setpoints ------------------------------------------------------------------------------------


def test_setpoints_are_written_on_change_one_per_frame() -> None:
    talk = online(rearm_immediate=True)
    talk.commands(0, 150.0, 10.011)
    talk.commands(1, 100.0, 10.012)
    assert talk.until(10.0235) == [
        (10.02, '3F1#063200DC05000000'), (10.021, '3F1#063300E803000000'), (10.022, ASK)]
    talk.hears(ANSWER, 10.024)
    assert round_of(talk, 10.04) == []


def test_setpoints_go_out_while_a_read_is_unanswered() -> None:
    talk = online(rearm_immediate=True)
    assert talk.until(10.0205) == [(10.02, ASK)]
    talk.commands(0, 150.0, 10.03)
    assert talk.until(10.05) == [(10.04, '3F1#063200DC05000000')]
    talk.commands(0, 160.0, 10.05)
    assert talk.until(10.07) == [(10.06, '3F1#0632004006000000')]
    # and in quarantine
    talk.until(10.13)
    talk.commands(0, 170.0, 10.13)
    assert talk.until(10.15) == [(10.14, '3F1#063200A406000000')]


def test_setpoints_of_unknown_storage_know_no_eeprom_pause() -> None:
    speed = parameter('speed', 50)
    talk = polling(table=(*TABLE[1:], speed), request=(speed,), rearm_immediate=True)
    talk.hears(ANSWER, 10.002)
    assert talk.until(10.01) == [(10.003, SPEED_ZERO)]
    talk.commands(0, 7, 10.011)
    assert talk.until(10.0215) == [(10.02, '3F1#0632000700000000'), (10.021, ASK)]


# -- quarantine -----------------------------------------------------------------------------------


def test_a_late_answer_is_not_the_next_one() -> None:
    talk = online()
    assert talk.until(10.0205) == [(10.02, ASK)]
    talk.submits(read(GAIN), 10.03)
    assert [text for _, text in talk.until(10.12)] == []
    # 150 ms after its request: nobody waits for it any more, and it begins the silence anew
    assert talk.hears(ANSWER, 10.17) == []
    assert (talk.session.statistics.late, talk.session.statistics.rejected) == (1, 0)
    assert talk.events(AnswerLate) == [AnswerLate(pytest.approx(0.05))]
    assert [when for when, text in talk.until(10.3) if text.startswith('3F1#03')] == [
        pytest.approx(10.27)]
    assert talk.samples() == []


def test_an_answer_that_nobody_asked_for_is_followed_by_silence() -> None:
    talk = online()
    assert talk.hears(ANSWER, 10.015) == []
    assert talk.samples() == []
    assert talk.session.statistics.rejected == 1
    assert [when for when, text in talk.until(10.2) if text == ASK] == [pytest.approx(10.115)]


def test_a_second_answer_does_not_meet_the_next_read() -> None:
    talk = polling(table=(*TABLE, FAR), response=(ACTUAL, CURRENT, STATUS, FAR))
    talk.hears(ANSWER, 10.002)
    assert talk.hears(ANSWER, 10.0025) == []
    assert talk.session.statistics.rejected == 1
    assert talk.samples() == []


def test_disturbance_without_end_is_offline() -> None:
    talk = online()
    now = 10.015
    while now < 13.0:
        talk.hears(ANSWER, now)
        talk.until(now + 0.05)
        now += 0.05
    assert not talk.session.online
    assert talk.session.statistics.missed >= 3


def test_other_identifiers_and_formats_are_nobodys_answer() -> None:
    talk = polling()
    for text in ('000007F1#E803FA0001000000', '7F2#E803FA0001000000', '103FFFF0#0000000000000000'):
        talk.hears(text, 10.001)
    assert talk.samples() == []
    assert talk.session.statistics.rejected == 3
    talk.hears(ANSWER, 10.002)
    assert talk.samples() == [(1000, 250, 1)]


@pytest.mark.parametrize(('policy', 'data', 'samples', 'rejected', 'short'), [
    ('lenient', 'E803FA000100', [(1000, 250, 1)], 0, 1), ('strict', 'E803FA000100', [], 1, 0),
    ('lenient', 'E803FA0001', [], 1, 0)])
def test_length_policy(policy: str, data: str, samples: list[object], rejected: int,
                       short: int) -> None:
    talk = polling(length_policy=policy)
    talk.hears(f'7F1#{data}', 10.002)
    assert talk.samples() == samples
    assert (talk.session.statistics.rejected, talk.session.statistics.missed) == (rejected, 0)
    assert talk.session.facts() == {'short_frames': str(short)}


def test_a_second_master_is_reported() -> None:
    talk = online()
    talk.hears('3F1#0632006400000000', 10.01)
    seen, = talk.events(ForeignMasterSeen)
    assert '3F1#0632006400000000' in seen.text
    assert talk.session.statistics.rejected == 0


# -- parameter requests ---------------------------------------------------------------------------


def test_an_eeprom_write_is_preceded_by_a_read_and_followed_by_a_pause_for_reads() -> None:
    talk = online()
    assert talk.submits(write((RAMP, 300)), 10.005) == ['3F1#031E000100000000']
    talk.hears('7F1#C800000000000000', 10.007)
    assert talk.until(10.009) == [(10.008, '3F1#061E002C01000000')]
    talk.session.frames_left(10.008)
    # the round of 10.02 waits, too; setpoints do not
    talk.commands(0, 0.0, 10.009)
    talk.commands(0, 10.0, 10.009)
    assert talk.until(10.0275) == [(10.02, '3F1#0632006400000000')]
    assert [text for _, text in talk.until(10.0281)] == [ASK]
    talk.hears(ANSWER, 10.03)
    assert talk.until(10.032) == [(10.031, '3F1#031E000100000000')]
    talk.hears('7F1#2C01000000000000', 10.033)
    assert talk.outcomes() == [['written']]
    assert talk.session.statistics.missed == 0


@pytest.mark.parametrize('gap', [0.02, 0.5, 2.0])
def test_a_long_pause_after_an_eeprom_write_is_no_missed_round(gap: float) -> None:
    talk = online(eeprom_write_gap=gap)
    assert talk.submits(write((RAMP, 300)), 10.005) == ['3F1#031E000100000000']
    talk.hears('7F1#C800000000000000', 10.007)
    sent = talk.served(10.1 + gap, {
        ASK: ANSWER, '3F1#031E000100000000': '7F1#2C01000000000000'}.get)
    assert [now for now, text in sent if text == ASK][0] >= 10.008 + gap
    assert talk.session.online
    assert talk.session.statistics.missed == 0
    assert talk.outcomes() == [['written']]


def test_one_parameter_is_all_that_fits_a_frame() -> None:
    talk = online()
    assert talk.submits(write((GAIN, 1), (DAMPING, 2), atomic=True), 10.005) == []
    fits = 'one parameter fits'
    assert talk.outcomes() == [[says('not_in_one_frame', fits=fits)] * 2]
    assert talk.submits(write((GAIN, 1), atomic=True), 10.005) == ['3F1#0628000100000000']


# -- stopping -------------------------------------------------------------------------------------


def moving(**options: object) -> Conversation:
    """Return a drive that was told 150 rpm, at 10.03 s."""
    talk = online(rearm_immediate=True, **options)
    talk.commands(0, 150.0, 10.01)
    round_of(talk, 10.02)
    talk.until(10.03)
    talk.events()
    return talk


def test_the_stop_writes_neutral_and_reads_it_back() -> None:
    talk = moving()
    assert talk.deactivate(10.03) == [SPEED_ZERO]
    assert talk.until(10.033) == [(10.031, LIMIT_ZERO), (10.032, ASK_SPEED)]
    talk.hears('7F1#0000000000000000', 10.034)
    assert talk.until(10.036) == [(10.035, ASK_LIMIT)]
    assert not talk.session.stopped
    talk.hears('7F1#0000000000000000', 10.037)
    assert talk.session.stopped
    assert talk.session.next_timer() == math.inf
    assert warnings(talk) == []


def test_a_stop_that_does_not_take_is_repeated_and_told() -> None:
    talk = moving()
    assert talk.deactivate(10.03) == [SPEED_ZERO]
    sent = [text for _, text in talk.served(11.03, {
        ASK_SPEED: '7F1#DC05000000000000',      # still 150 rpm
        ASK_LIMIT: '7F1#0000000000000000'}.get)]
    assert sent == [LIMIT_ZERO, ASK_SPEED, ASK_LIMIT, *[SPEED_ZERO, ASK_SPEED] * 2]
    assert talk.session.stopped
    assert warnings(talk) == [may_run('stop_failed', what=[
        says('write_read_back', what='speed_setpoint (P50)', found=1500, wanted=0)])]


def test_silence_before_a_stop_is_confirmed_after_a_stall() -> None:
    """The answer to the read before the stall must not be taken for what the stop wrote."""
    talk = moving()
    asked = talk.until(10.0415)[-1]
    assert asked[1] == ASK
    assert talk.handle_stall(12.0) == [SPEED_ZERO]
    assert talk.deactivate(12.0005) == []
    sent = talk.until(12.101)
    assert sent == [(12.001, SPEED_ZERO), (12.002, LIMIT_ZERO), (12.1, ASK_SPEED)]


def test_a_drive_that_never_answered_gets_nothing_at_the_stop() -> None:
    talk = polling()
    assert talk.deactivate(10.05) == []
    assert talk.session.stopped
    assert talk.until(11.0) == []


# -- control --------------------------------------------------------------------------------------

READY, ENABLED, FAULT = ('7F1#E803FA0001000000', '7F1#E803FA0003000000', '7F1#E803FA0009000000')
RESET_WORD = '3F1#0634008000000000'
DISABLE_WORD, ENABLE_WORD = '3F1#0634000000000000', '3F1#0634000100000000'


def controlled(**options: object) -> Conversation:
    talk = polling(request=(SPEED, WORD), control=CONTROL, **options)
    talk.hears(READY, 10.002)
    assert talk.until(10.01) == [(10.003, DISABLE_WORD), (10.004, SPEED_ZERO)]
    return talk


def enabled(**options: object) -> Conversation:
    """Return a drive that was enabled; the next round is due at 10.06 s."""
    talk = controlled(**options)
    talk.asks(ControlAction.ENABLE, 10.01)
    round_of(talk, 10.02, READY)
    talk.until(10.03)
    round_of(talk, 10.04, ENABLED)
    return talk


@pytest.mark.parametrize('request_, first', [
    ((SPEED, WORD), [DISABLE_WORD, SPEED_ZERO]), ((SPEED,), [SPEED_ZERO, DISABLE_WORD])])
def test_a_status_asked_for_before_the_word_left_confirms_nothing(
        request_: tuple[Parameter, ...], first: list[str]) -> None:
    talk = polling(request=request_, control=CONTROL)
    talk.hears(READY, 10.002)
    assert talk.until(10.01) == list(zip((10.003, 10.004), first))
    talk.asks(ControlAction.ENABLE, 10.01)
    round_of(talk, 10.02, READY)
    assert talk.until(10.03) == [(10.025, SPEED_ZERO), (10.026, ENABLE_WORD)], 'no period later'
    assert talk.control_outcomes() == []
    round_of(talk, 10.04, ENABLED)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    assert talk.until(10.0605) == [(10.06, ASK)]
    assert talk.asks(ControlAction.DISABLE, 10.061) == [DISABLE_WORD]
    talk.hears(READY, 10.062)
    assert talk.control_outcomes() == []
    round_of(talk, 10.08, READY)
    assert talk.control_outcomes() == [('disable', True, 'ready')]


def test_nor_does_it_where_the_status_is_read_by_hand() -> None:
    talk = Conversation(drive('datamodel_standard', request=(SPEED, WORD),
                              response=(ACTUAL, CURRENT), control=CONTROL))
    ask_status, off, on = '3F1#03D3000100000000', '7F1#0100000000000000', '7F1#0300000000000000'
    answers = {'3F1#03D1000200000000': (0.001, ANSWER), ask_status: (0.01, off)}
    line = Timeline(talk, answers.get)
    talk.begins()
    line.live(10.3)
    line.plan(10.3, partial(talk.asks, ControlAction.ENABLE))
    line.live(10.35)
    answers[ask_status] = 0.01, on
    line.live(10.6)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    answers[ask_status] = 0.01, off     # it drops out just before it is told to
    asked = next(end for end in (10.6 + 0.001 * step for step in range(1, 1000))
                 if line.live(end) or line.when(ask_status)[-1] > 10.6)
    line.plan(asked + 0.005, partial(talk.asks, ControlAction.DISABLE))
    line.live(asked + 0.0105)
    assert talk.control_outcomes() == []
    line.live(asked + 0.1)
    assert talk.control_outcomes() == [('disable', True, 'ready')]


def test_a_word_of_which_no_notice_is_taken_is_written_again() -> None:
    """Nobody acknowledges it: it may have been lost. Nothing else would write it."""
    talk = enabled(refresh_interval=0.0)
    assert talk.asks(ControlAction.DISABLE, 10.045) == [DISABLE_WORD]
    again = []
    for beat in range(1, 60):
        sent = [text for _, text in talk.until(10.0425 + 0.02 * beat)]
        assert set(sent) <= {DISABLE_WORD, SPEED_ZERO, ASK}
        if DISABLE_WORD in sent:
            again.append(round(10.04 + 0.02 * beat, 2))
        talk.hears(ENABLED, 10.044 + 0.02 * beat)
    first, second, _ = written_again(10.04)     # each with the round behind that
    assert again == pytest.approx([first + 0.02, second + 0.04])
    assert DISABLE_WORD in talk.asks(ControlAction.DISABLE, 12.05), 'at once for who asks again'


def test_of_a_missed_round_only_a_word_that_stops_is_written_again() -> None:
    talk = controlled(refresh_interval=0.0)
    talk.asks(ControlAction.ENABLE, 10.01)
    round_of(talk, 10.02, READY)
    assert talk.until(10.2405) == [
        (10.025, SPEED_ZERO), (10.026, ENABLE_WORD), (10.04, ASK), (10.24, ASK)]
    talk.hears(ENABLED, 10.242)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    assert talk.until(10.2605) == [(10.243, SPEED_ZERO), (10.26, ASK)]
    talk.hears(ENABLED, 10.262)
    assert talk.asks(ControlAction.DISABLE, 10.27) == [DISABLE_WORD]
    assert talk.until(10.4805) == [(10.28, ASK), (10.48, ASK)]
    talk.hears(READY, 10.482)
    assert talk.until(10.5005) == [(10.483, DISABLE_WORD), (10.5, ASK)]



@pytest.mark.parametrize('by_hand', [False, True])
def test_enable_waits_for_setpoints_that_the_bus_refuses(by_hand: bool) -> None:
    """It may have been off for a moment, and have in its registers what somebody put there."""
    talk = polling(request=(SPEED,) if by_hand else (WORD, SPEED), control=CONTROL)
    talk.hears(READY, 10.002)
    talk.until(10.01)
    talk.refusing = lambda text: text == SPEED_ZERO
    talk.asks(ControlAction.ENABLE, 10.01)
    assert SPEED_ZERO not in round_of(talk, 10.02, READY)
    assert ENABLE_WORD not in [text for _, text in talk.until(10.0405)]
    talk.hears(READY, 10.042)
    assert ENABLE_WORD not in [text for _, text in talk.until(10.0605)]
    talk.refusing = lambda text: False
    talk.hears(READY, 10.062)
    assert [text for _, text in talk.until(10.0835) if text != ASK] == [SPEED_ZERO, ENABLE_WORD]


@pytest.mark.parametrize(('period', 'rounds'), [(0.02, 5), (0.5, 3)])
@pytest.mark.parametrize('request_', [(SPEED, WORD), (SPEED,)])
def test_reset_is_a_pulse_of_three_writes(request_: tuple[Parameter, ...], period: float,
                                          rounds: int) -> None:
    """Nobody acknowledges them: three, at most 0.1 s apart, and then ``disable``."""
    talk = polling(request=request_, control=CONTROL, period=period, refresh_interval=60.0)
    talk.hears(FAULT, 10.002)
    talk.until(10.0 + 0.9 * period)
    talk.asks(ControlAction.RESET_FAULT, 10.0 + 0.95 * period)
    sent = []
    for begin in (10.0 + number * period for number in range(1, rounds)):
        sent += talk.until(begin + 0.002)
        sent += [(begin + 0.002, text) for text in talk.hears(FAULT, begin + 0.002)]
        sent += talk.until(begin + 0.9 * period)
    pulse = [(now, text) for now, text in sent if text[4:8] == '0634']
    assert [text for _, text in pulse] == [RESET_WORD] * 3 + [DISABLE_WORD]
    times = [now for now, _ in pulse]
    spacing = min(period, 0.1)
    assert all(0.9 * spacing <= second - first <= spacing + 0.0011
               for first, second in zip(times, times[1:3]))
    round_of(talk, 10.0 + rounds * period, READY)
    assert talk.control_outcomes() == [('reset_fault', True, 'ready')]


@pytest.mark.parametrize('answer, state, off', [
    ('7F1#0300000000000000', 'enabled', False), ('7F1#0100000000000000', 'ready', True),
    ('', 'enabled', False)])
def test_stop_ends_with_a_look_at_the_status(answer: str, state: str, off: bool) -> None:
    """What it has in its registers is not what it does."""
    talk = enabled()
    assert talk.deactivate(10.05) == [DISABLE_WORD]
    assert talk.until(10.0525) == [(10.051, SPEED_ZERO), (10.052, '3F1#0334000100000000')]
    assert talk.hears('7F1#0000000000000000', 10.053) == []
    assert talk.until(10.0545) == [(10.054, ASK_SPEED)]
    assert talk.hears('7F1#0000000000000000', 10.055) == []
    assert talk.until(10.0565) == [(10.056, '3F1#03D3000100000000')]
    assert not talk.session.stopped
    if answer:
        assert talk.hears(answer, 10.057) == []
    else:
        assert talk.until(10.157) == [], 'it is waited for 0.1 s'
    assert talk.session.stopped
    assert talk.session.control is not None
    assert (talk.session.control.state, talk.session.control.off) == (state, off)
    assert warnings(talk) == []


@pytest.mark.parametrize('action, word', [
    (ControlAction.DISABLE, DISABLE_WORD), (ControlAction.QUICK_STOP, '3F1#0634000200000000')])
@pytest.mark.parametrize('asked', [10.1301, 10.2301])
def test_a_stop_does_not_wait_for_the_status(action: ControlAction, word: str,
                                             asked: float) -> None:
    """Neither while a read goes unanswered, nor in the silence after it."""
    talk = enabled()
    for begin in (10.06, 10.08, 10.1):
        round_of(talk, begin, ENABLED)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    talk.until(asked)               # nobody answers the round of 10.12
    assert talk.asks(action, asked + 0.001) == [word]


# -- addresses ------------------------------------------------------------------------------------


def test_addresses_with_other_bases() -> None:
    talk = Conversation(drive(
        'datamodel_standard', station=20, request_id_base=0x300, response_id_base=0x380)).begun()
    assert talk.at(10.0) == ['314#03D1000300000000']
    talk.hears('394#E803FA0001000000', 10.002)
    assert talk.samples() == [(1000, 250, 1)]


def test_an_offset_moves_every_number() -> None:
    talk = Conversation(drive('datamodel_standard', parameter_offset=-1)).begun()
    assert talk.at(10.0) == ['3F1#03D0000300000000']
    talk.hears(ANSWER, 10.002)
    assert [text for _, text in talk.until(10.01)] == [
        '3F1#0631000000000000', '3F1#0632000000000000']


def test_word_that_runs_is_refreshed_behind_the_setpoints() -> None:
    """A drive that was off for a moment, unseen, has neutral before it has ``enable``."""
    talk = polling(request=(WORD, SPEED), control=CONTROL, refresh_interval=0.1)
    talk.hears(READY, 10.002)
    assert [text for _, text in talk.until(10.01)] == [DISABLE_WORD, SPEED_ZERO]
    talk.asks(ControlAction.ENABLE, 10.01)
    sent = round_of(talk, 10.02, READY)
    for number in range(2, 10):
        sent += round_of(talk, 10.0 + 0.02 * number, ENABLED)
    assert sent == [SPEED_ZERO, ENABLE_WORD] * 2
