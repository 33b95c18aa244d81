# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations about control: the word and the status, each with a slot and without."""

from dataclasses import replace
from functools import partial

from builders import (
    ACTUAL, CONTROL, CURRENT, DAMPING, drive, frame, GAIN, INT16, LIMIT, RAMP, read,
    SILENT_CONTROL, SPEED, TABLE, WORD, write,
)
from conversation import Conversation
from extended_builders import (
    ANSWER, ASK_REQUEST_MAP, ASK_WORD, checked, DISABLE, ENABLED, exchange, NEUTRAL, online,
    TICK, ZEROS,
)
import pytest
from saying import says
from stops import written_again
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.control_machine import RESET_CYCLES
from drive_can_bridge.core.events import DriveState, FrameRejected, Noted
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.setpoints import CommandOutcome


READY, FAULT = ANSWER, '103FFFF0#03E800FA00080000'
ENABLE = '00300341#0001000000000000'
QUICK_STOP = '00300341#0002000000000000'
RESET = '00300341#0080000000000000'
ASK_STATUS = f'00200D31#{ZEROS}'
#: nobody said that it is RAM
EEPROM_WORD = replace(WORD, storage=None)


def table_with(word: Parameter) -> tuple[Parameter, ...]:
    """Return the usual profile with another control word."""
    return tuple(word if entry is WORD else entry for entry in TABLE)


def inside(**options: object) -> Conversation:
    """Return an online drive whose control word and status word have slots."""
    return online(control=CONTROL, request=(WORD, SPEED), mapping='assume', **options)


def beside(**options: object) -> Conversation:
    """Return an online drive whose control word is written; disable was, at 10.002 s."""
    options.setdefault('control', CONTROL)
    return online(mapping='assume', **options)


def at_once(talk: Conversation, now: float, answer: str) -> list[str]:
    """Let one cycle pass; return its request and what followed the answer."""
    request = [text for _, text in talk.until(now + TICK)]
    return request + talk.hears(answer, now + 0.002)


# -- in the cyclic request ------------------------------------------------------------------------


def test_slot_in_the_middle() -> None:
    talk = online(control=CONTROL, request=(SPEED, WORD, LIMIT), mapping='assume',
                  rearm_immediate=True)
    talk.asks(ControlAction.ENABLE, 10.003)
    assert exchange(talk, 10.02, READY) == '003FFFF0#0000000100000000'
    exchange(talk, 10.04, ENABLED)
    talk.commands(0, 100.0, 10.043)
    talk.commands(1, 50.0, 10.043)
    assert exchange(talk, 10.06, ENABLED) == '003FFFF0#03E8000101F40000'


def test_word_with_its_top_bit_set_in_a_signed_parameter() -> None:
    signed = replace(WORD, type=INT16)
    talk = online(control=replace(CONTROL, enable=0x8001), request=(signed,), mapping='assume',
                  table=table_with(signed))
    talk.asks(ControlAction.ENABLE, 10.003)
    assert exchange(talk, 10.02, READY) == '003FFFF0#8001000000000000'


def cut(talk: Conversation, now: float) -> str:
    """Let one cycle pass whose response is too short for the status word."""
    (_, sent), = talk.until(now + TICK)
    talk.hears('103FFFF0#03E800FA', now + 0.001)
    return sent


def test_drive_whose_status_is_missing_for_long_is_not_driven_on() -> None:
    talk = inside(rearm_immediate=True)
    talk.asks(ControlAction.ENABLE, 10.003)
    assert cut(talk, 10.02) == '003FFFF0#0001000000000000'
    assert len(talk.events(FrameRejected)) == 1
    assert talk.control_outcomes() == []    # it confirms nothing
    exchange(talk, 10.04, ENABLED)
    talk.commands(0, 100.0, 10.043)
    runs = '003FFFF0#000103E800000000'
    assert cut(talk, 10.06) == cut(talk, 10.08) == runs
    assert exchange(talk, 10.1, ENABLED) == runs, 'counted anew from here'
    talk.events()
    assert cut(talk, 10.12) == cut(talk, 10.14) == cut(talk, 10.16) == runs
    assert [note.text for note in talk.events(Noted)] == [
        says('enable_withdrawn', reason=says('status_missing', answers=3), whom='the drive')]
    assert talk.session.state is DriveState.DISABLED
    assert talk.commands(0, 100.0, 10.162) is CommandOutcome.DISABLED
    assert cut(talk, 10.18) == NEUTRAL
    assert exchange(talk, 10.2, ENABLED) == NEUTRAL
    assert talk.session.state is DriveState.DISABLED, 'nothing but a new ~/enable starts it'


# -- written --------------------------------------------------------------------------------------


def test_disable_is_written_as_soon_as_the_drive_is_found_each_time() -> None:
    talk = Conversation(drive(control=CONTROL))
    talk.begins(9.998)
    checked(talk, 9.998)
    assert talk.at(10.0) == [NEUTRAL]
    assert talk.hears(READY, 10.002) == [DISABLE]
    assert exchange(talk, 10.02) == NEUTRAL       # on change only
    talk.bus_down(10.03)
    assert talk.bus_up(11.0) == [ASK_REQUEST_MAP]
    checked(talk, 11.0)
    assert talk.at(11.002) == [NEUTRAL]
    assert talk.hears(READY, 11.004) == [DISABLE]


def test_enable_is_written_on_change() -> None:
    talk = beside()
    exchange(talk, 10.02)
    assert talk.asks(ControlAction.ENABLE, 10.025) == []
    # behind the answer to a neutral cycle: what it was told before, it may have lost
    assert at_once(talk, 10.04, READY) == [NEUTRAL, ENABLE]
    assert at_once(talk, 10.06, ENABLED) == [NEUTRAL]
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    assert talk.asks(ControlAction.QUICK_STOP, 10.07) == [QUICK_STOP]
    # the drive stands: disable follows at once, a millisecond after
    assert at_once(talk, 10.08, READY) == [NEUTRAL, DISABLE]
    assert talk.control_outcomes() == [('quick_stop', True, 'ready')]


def cycles(talk: Conversation, first: int, last: int, answer: str) -> list[tuple[int, str]]:
    """
    Let cycles pass, each answered after 2 ms; return what was written.

    :param first: number of the first cycle, one of 20 ms each since 10 s; the last counts, too.
    :return: the cycle after whose answer it was, and the frame.
    """
    return [(number, text) for number in range(first, last + 1)
            for text in at_once(talk, 10.0 + 0.02 * number, answer)[1:]]


def test_word_that_got_lost_is_written_again() -> None:
    """Nothing acknowledges a write; the status tells that the drive took no notice."""
    talk = beside()
    exchange(talk, 10.02, READY)
    talk.asks(ControlAction.ENABLE, 10.025)
    # lost; then twice more, each behind one more neutral cycle
    first, second = (2 + round(after / 0.02) for after in written_again()[:2])
    end = second + 8
    assert cycles(talk, 2, end, READY) == [
        (2, ENABLE), (first + 1, ENABLE), (second + 2, ENABLE)]
    assert cycles(talk, end + 1, end + 20, ENABLED) == []
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    end += 20
    assert talk.asks(ControlAction.DISABLE, 10.005 + 0.02 * end) == [DISABLE]   # lost
    assert cycles(talk, end + 1, end + first, ENABLED) == [(end + first - 1, DISABLE)]
    assert cycles(talk, end + first + 1, end + first + 18, READY) == []
    assert talk.control_outcomes() == [('disable', True, 'ready')]


def test_word_in_an_eeprom_is_written_again_three_times_only() -> None:
    talk = beside(table=table_with(EEPROM_WORD))
    exchange(talk, 10.02, READY)
    talk.asks(ControlAction.ENABLE, 10.025)
    cycles(talk, 2, 3, ENABLED)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    assert talk.asks(ControlAction.DISABLE, 10.065) == [DISABLE]
    assert len(cycles(talk, 4, 600, ENABLED)) == 3


def test_written_word_waits_for_the_cyclic_response() -> None:
    talk = beside()
    exchange(talk, 10.02)
    talk.until(10.04 + TICK)
    assert talk.asks(ControlAction.ENABLE, 10.041) == []
    assert talk.hears(READY, 10.042) == []        # to a cycle of before
    assert at_once(talk, 10.06, READY) == [NEUTRAL, ENABLE]
    assert talk.control_outcomes() == []          # that status was older than the word
    assert at_once(talk, 10.08, ENABLED) == [NEUTRAL]
    assert talk.control_outcomes() == [('enable', True, 'enabled')]


def test_word_that_is_outdated_is_not_sent() -> None:
    talk = beside()
    exchange(talk, 10.02)
    talk.until(10.04 + TICK)
    assert talk.asks(ControlAction.ENABLE, 10.041) == []
    assert talk.asks(ControlAction.DISABLE, 10.0415) == [DISABLE]   # it waits for nobody
    assert ENABLE not in talk.hears(READY, 10.042)
    assert all(text != ENABLE for _, text in talk.until(10.2))


def test_stop_goes_before_everything_that_waits() -> None:
    talk = beside(period=10.0)
    for _ in range(20):
        talk.submits(read(GAIN), 10.1)
    talk.submits(write((RAMP, 5), (DAMPING, 6)), 10.1)
    # not even for the answer to a read
    assert talk.asks(ControlAction.QUICK_STOP, 10.101) == [QUICK_STOP]
    assert talk.asks(ControlAction.DISABLE, 10.12) == [DISABLE]


@pytest.mark.parametrize('word, told_at', [(WORD, 10.103), (EEPROM_WORD, 10.121)])
def test_only_a_word_in_an_eeprom_waits_for_the_eeprom(word: Parameter, told_at: float) -> None:
    talk = beside(period=10.0, table=table_with(word))
    talk.submits(write((RAMP, 5)), 10.1)
    talk.hears('102001E1#0004000000000000', 10.101)
    sent = [(10.103, text) for text in talk.asks(ControlAction.QUICK_STOP, 10.103)]
    assert (sent + talk.until(10.122))[0] == (told_at, QUICK_STOP)


def test_drive_that_reports_nothing() -> None:
    talk = beside(control=SILENT_CONTROL, period=10.0, command_timeout=0.0)
    assert talk.until(10.009) == []     # nor is what it has not run behind written again
    talk.asks(ControlAction.ENABLE, 10.01)
    assert at_once(talk, 10.01, ANSWER) == [NEUTRAL, ENABLE]
    assert talk.control_outcomes() == [('enable', True, says('state_not_reported'))]
    assert talk.until(19.0) == []       # what starts it is written once


def test_reset_pulse_of_a_drive_that_reports_nothing() -> None:
    talk = beside(control=SILENT_CONTROL, period=10.0)
    assert talk.asks(ControlAction.RESET_FAULT, 10.1) == [RESET]
    sent = talk.until(10.1 + 0.1 * RESET_CYCLES)
    assert [text for _, text in sent] == [*[RESET] * (RESET_CYCLES - 1), DISABLE]
    assert [now for now, _ in sent] == pytest.approx([
        *(10.1 + 0.1 * n for n in range(1, RESET_CYCLES)), 10.001 + 0.1 * RESET_CYCLES])
    assert [done[:2] for done in talk.control_outcomes()] == [('reset_fault', True)]


@pytest.mark.parametrize(('action', 'times'), [
    (ControlAction.DISABLE, {DISABLE: [10.5, *written_again(10.5)]}),
    (ControlAction.QUICK_STOP, {     # which keeps its word for 2 s
        QUICK_STOP: [10.5, *written_again(10.5)], DISABLE: [12.5, *written_again(12.5)]})])
def test_a_drive_that_reports_nothing_is_told_to_stop_more_than_once(
        action: ControlAction, times: dict[str, list[float]]) -> None:
    """A write may get lost, nobody acknowledges it, and no status says that it did."""
    talk = beside(control=SILENT_CONTROL, period=10.0, command_timeout=0.0)
    talk.asks(ControlAction.ENABLE, 10.01)
    at_once(talk, 10.01, ANSWER)
    sent = [(10.5, text) for text in talk.asks(action, 10.5)] + talk.until(19.0)
    for text, when in times.items():
        assert [now for now, each in sent if each == text] == pytest.approx(when, abs=0.01)
    assert ENABLE not in [text for _, text in sent]


def test_a_stop_is_not_told_again_behind_a_new_enable() -> None:
    talk = beside(control=SILENT_CONTROL, period=10.0, command_timeout=0.0)
    talk.asks(ControlAction.ENABLE, 10.01)
    at_once(talk, 10.01, ANSWER)
    assert DISABLE in talk.asks(ControlAction.DISABLE, 10.5)
    at_once(talk, 10.5, ANSWER)
    talk.asks(ControlAction.ENABLE, 10.6)
    assert ENABLE in at_once(talk, 10.6, ANSWER)
    assert DISABLE not in [text for _, text in talk.until(19.0)]


def test_a_silent_drive_that_ran_is_told_again_after_as_many_cycles() -> None:
    talk = beside(missed_limit=25)
    talk.asks(ControlAction.ENABLE, 10.003)
    assert at_once(talk, 10.02, READY) == [NEUTRAL]     # ready since it was disabled
    assert at_once(talk, 10.04, READY) == [NEUTRAL, ENABLE]
    assert at_once(talk, 10.06, ENABLED) == [NEUTRAL]
    # with the loss, then as nobody confirms it; and, with all setpoints, anew after 25 more
    assert [round(now, 3) for now, text in talk.until(11.5) if text == DISABLE] == [
        10.58, 10.581, 10.682, 10.783, 11.08, 11.183, 11.286]


# -- a status word without a slot -----------------------------------------------------------------


def apart(**options: object) -> Conversation:
    """Return an online drive whose control and status words both have no slot."""
    return beside(response=(ACTUAL, CURRENT), **options)


def looks(talk: Conversation, end: float, status: str) -> list[float]:
    """Answer everything until ``end``; return when the status was read."""
    answers = {NEUTRAL: ANSWER, ASK_STATUS: f'10200D31#{status}000000000000'}
    return [now for now, text in talk.served(end, answers.get, 0.0) if text == ASK_STATUS]


def test_status_is_read_twice_a_second_and_often_while_something_is_pending() -> None:
    talk = apart()
    calm = looks(talk, 13.0, '0001')
    assert len(calm) in (6, 7)
    talk.asks(ControlAction.ENABLE, 13.001)
    busy = looks(talk, 13.4, '0001')
    assert len(busy) in (8, 9, 10)
    looks(talk, 13.6, '0003')
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    assert len(looks(talk, 15.6, '0003')) in (4, 5)


def test_drive_whose_status_is_not_read_any_more_is_not_driven_on() -> None:
    talk = apart(parameter_retries=0)
    looks(talk, 10.6, '0001')
    talk.asks(ControlAction.ENABLE, 10.601)
    looks(talk, 11.0, '0003')
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    talk.events()
    sent = [text for _, text in talk.served(13.0, {NEUTRAL: ANSWER}.get)]
    assert sent[:sent.index(DISABLE)].count(ASK_STATUS) == 3
    assert [note.text for note in talk.events(Noted)] == [
        says('enable_withdrawn', reason=says('status_missing', answers=3), whom='the drive')]


def test_fault_is_seen_in_a_read_status() -> None:
    talk = apart()
    looks(talk, 10.6, '0008')
    assert talk.session.state is DriveState.FAULT


def test_no_status_is_read_behind_the_disable_of_a_lost_drive() -> None:
    talk = apart()
    looks(talk, 10.6, '0001')
    talk.asks(ControlAction.ENABLE, 10.601)
    looks(talk, 10.8, '0003')
    sent = [text for _, text in talk.until(11.0)]
    assert not talk.session.online
    assert DISABLE in sent
    assert ASK_STATUS not in [text for _, text in talk.until(14.0)]


def test_no_status_is_looked_at_behind_a_word_that_leaves_when_the_end_has_begun() -> None:
    talk = apart()
    looks(talk, 10.6, '0001')
    talk.asks(ControlAction.ENABLE, 10.601)
    talk.until(10.62 + TICK)
    talk.session.receive_frame(frame(ANSWER), 10.622)
    assert ENABLE in map(str, talk.session.take_frames())
    talk.session.deactivate(10.623)
    talk.session.frames_left(10.624)
    sent = talk.sent() + [
        text for _, text in talk.served(11.0, lambda text: {
            NEUTRAL: ANSWER, ASK_WORD: '10200341#0000000000000000',
            ASK_STATUS: '10200D31#0001000000000000'}.get(text))]
    assert DISABLE in sent
    assert sent.count(ASK_STATUS) == 1, 'the last look'
    assert talk.session.stopped


def test_status_that_arrives_after_the_loss_is_not_believed() -> None:
    talk = apart(period=0.1, parameter_timeout=2.0)
    assert (10.003, ASK_STATUS) in talk.until(10.45)
    assert not talk.session.online
    talk.hears('10200D31#0008000000000000', 10.46)
    assert talk.session.control is not None
    assert not talk.session.control.fault


@pytest.mark.parametrize('action', [ControlAction.DISABLE, ControlAction.QUICK_STOP])
def test_status_that_was_asked_for_before_a_stop_left_confirms_nothing(
        action: ControlAction) -> None:
    """The drive was not enabled yet when it was asked, and is about to be."""
    talk = apart(period=10.0)
    assert talk.until(10.004) == [(10.003, ASK_STATUS)]
    talk.hears('10200D31#0001000000000000', 10.005)
    talk.asks(ControlAction.ENABLE, 10.1)
    assert at_once(talk, 10.1, ANSWER) == [NEUTRAL, ENABLE]
    assert talk.until(10.11) == [(10.103, ASK_STATUS)]
    stop = DISABLE if action is ControlAction.DISABLE else QUICK_STOP
    assert talk.asks(action, 10.12) == [stop]
    talk.control_outcomes()
    talk.hears('10200D31#0001000000000000', 10.121)         # answers what was asked at 10.103
    assert talk.control_outcomes() == []
    assert ASK_STATUS in [text for _, text in talk.until(10.13)]
    talk.hears('10200D31#0001000000000000', 10.131)
    assert talk.control_outcomes() == [(action.value, True, 'ready')]


def test_nor_does_a_cycle_that_left_before_it() -> None:
    """The word is written by number, and the status comes with the cycle."""
    talk = beside()
    exchange(talk, 10.02, READY)
    talk.asks(ControlAction.ENABLE, 10.025)
    assert at_once(talk, 10.04, READY) == [NEUTRAL, ENABLE]
    assert talk.until(10.06 + TICK) == [(10.06, NEUTRAL)]
    assert talk.asks(ControlAction.QUICK_STOP, 10.061) == [QUICK_STOP]
    talk.control_outcomes()
    talk.hears(READY, 10.062)       # answers what left at 10.06
    assert talk.control_outcomes() == []
    assert at_once(talk, 10.08, READY) == [NEUTRAL, DISABLE]
    assert talk.control_outcomes() == [('quick_stop', True, 'ready')]


@pytest.mark.parametrize('action', [ControlAction.DISABLE, ControlAction.QUICK_STOP])
def test_nor_does_a_status_by_number_where_cycles_hold_the_word(action: ControlAction) -> None:
    """It is told to stop while the question is under way, and drops out by itself just before."""
    talk = Conversation(drive(request=(WORD, SPEED), response=(ACTUAL, CURRENT), control=CONTROL,
                              mapping='assume'))
    status = [0.03, '10200D31#0001000000000000']
    line = Timeline(talk, lambda text: (0.002, '103FFFF0#03E800FA00000000') if (
        text.startswith('003FFFF0')) else tuple(status) if text == ASK_STATUS else None)
    talk.begins()
    line.plan(10.3, partial(talk.asks, ControlAction.ENABLE))
    line.live(10.35)
    status[1] = '10200D31#0003000000000000'
    line.live(10.8)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    status[1] = '10200D31#0001000000000000'
    now = 10.8
    while line.when(ASK_STATUS)[-1] < 10.8:
        now += 0.001
        line.live(now)
    line.plan(now + 0.001, partial(talk.asks, action))
    line.live(now + 0.032)
    assert talk.control_outcomes() == []
    line.live(now + 0.3)
    assert talk.control_outcomes() == [(action.value, True, 'ready')]
