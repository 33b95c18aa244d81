# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Conversations that end: neutral cycles, the word for disable, then silence."""

import math

from builders import CONTROL, CURRENT, drive, parameter, SPEED, TABLE, WORD
from conversation import Conversation
from extended_builders import (
    ANSWER, ASK_REQUEST_MAP, ASK_WORD, cycling, DISABLE, ENABLED, exchange, NEUTRAL, online,
    REQUEST_MAP, TICK,
)
import pytest
from saying import may_run, says
from stops import last_cycles, STOP_CYCLES

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import MappingDiffered, Noted

#: an EEPROM cell is the default where the profile does not say
SLOW_WORD = parameter('control_word', 52)
SLOW_TABLE = (*(entry for entry in TABLE if entry.name != 'control_word'), SLOW_WORD)


def silent(talk: Conversation, now: float) -> None:
    """Assert that the session has come to its end."""
    assert talk.session.stopped
    assert talk.session.next_timer() == math.inf
    assert talk.at(now) == []
    assert talk.at(now + 100.0) == []
    assert not talk.session.online


@pytest.mark.parametrize('asked, first', [(10.01, 10.01), (10.003, 10.005), (14.98, 14.98)])
def test_first_neutral_cycle_is_brought_forward(asked: float, first: float) -> None:
    # not under 5 ms after the last one
    talk = online(period=5.0)
    talk.deactivate(asked)
    assert talk.until(16.0) == last_cycles(NEUTRAL, first, 0.1)


def test_drive_that_never_answered_is_stopped_too() -> None:
    talk = cycling()
    talk.deactivate(10.0)
    assert talk.until(11.0) == last_cycles(NEUTRAL, 10.0)


def test_nothing_is_sent_to_a_drive_whose_maps_are_not_known() -> None:
    talk = Conversation(drive())
    assert talk.begins() == [ASK_REQUEST_MAP]
    assert talk.deactivate(10.05) == []
    silent(talk, 10.06)
    # the answer comes late
    assert talk.hears('102007A4#0032003300000000', 10.07) == []
    silent(talk, 10.08)


def test_stop_while_the_drive_is_being_left() -> None:
    talk = online()
    talk.until(10.08 + TICK)
    assert not talk.session.online
    talk.deactivate(10.09)
    assert talk.until(11.0) == last_cycles(NEUTRAL, 10.1)
    silent(talk, 11.0)


@pytest.mark.parametrize('request_map', [REQUEST_MAP, '102007A4#0000000000000000'])
def test_look_that_is_under_way_when_the_stop_begins(request_map: str) -> None:
    talk = online(period=0.1)
    for cycle in range(1, 10):
        exchange(talk, 10.0 + 0.1 * cycle)
    talk.at(11.0)
    assert talk.hears(ANSWER, 11.001) == [ASK_REQUEST_MAP]
    talk.deactivate(11.002)
    assert talk.hears(request_map, 11.003) == []
    assert talk.until(12.0) == last_cycles(NEUTRAL, 11.005, 0.1)
    assert talk.events(MappingDiffered) == []
    silent(talk, 12.0)


# -- with a control word --------------------------------------------------------------------------


def enabled(**options: object) -> Conversation:
    """Return a conversation with a drive that is enabled at 10.1 s, cycled every 0.1 s."""
    talk = online(control=CONTROL, period=0.1, **options)
    talk.asks(ControlAction.ENABLE, 10.01)
    for step in range(10):
        now = 10.1 + 0.1 * step
        talk.until(now + TICK)
        talk.hears(ENABLED if step > 1 else ANSWER, now + 0.002)
        talk.until(now + 0.06)
        if talk.control_outcomes():
            return talk
    raise AssertionError('not enabled')


def test_confirmed_disable_stops_no_setpoint_of_the_cycle() -> None:
    talk = enabled()
    talk.commands(0, 0.0, talk.now)
    talk.commands(0, 100.0, talk.now)
    assert talk.until(10.41)[-1][1] == '003FFFF0#03E8000000000000'
    talk.refusing = lambda text: text.startswith('003FFFF0')
    assert talk.deactivate(10.411) == [DISABLE]
    assert [text for _, text in talk.until(10.413)] == [ASK_WORD]
    assert talk.hears('10200341#0000000000000000', 10.414) == []
    talk.until(11.4)
    assert not talk.session.stopped
    talk.session.give_up(11.4)
    assert talk.sent() == []
    assert [event.text for event in talk.events(Noted) if event.warning] == [
        says('may_still_be_running', why=says('stop_not_possible'))]


def warnings(talk: Conversation) -> list[str]:
    return [note.text for note in talk.events(Noted) if note.warning]


def written_word() -> tuple[Conversation, float]:
    """Return an enabled drive whose control word is written, and the time."""
    talk = enabled(mapping='assume')
    beat = talk.session.next_timer()
    talk.until(beat)
    talk.hears('103FFFF0#03E800FA00030000', beat + 0.002)
    talk.events()
    return talk, beat + 0.05


def test_disable_that_the_drive_does_not_have_is_written_again() -> None:
    talk, now = written_word()
    assert talk.deactivate(now) == [DISABLE]
    talk.until(now + 0.002)
    found = talk.hears('10200341#0001000000000000', now + 0.003)
    found += [text for _, text in talk.until(now + 0.0041)]
    assert found == [DISABLE, ASK_WORD]
    talk.hears('10200341#0000000000000000', now + 0.005)
    talk.until(now + 5.0)
    silent(talk, now + 6.0)
    assert warnings(talk) == []


@pytest.mark.parametrize('answer, why', [
    (None, says('write_unanswered', what='control_word (P52)')),
    ('10200341#0001000000000000',
     says('write_read_back', what='control_word (P52)', found=1, wanted=0))])
def test_disable_that_is_not_confirmed_is_told(answer: str | None, why: says) -> None:
    talk, now = written_word()
    assert talk.deactivate(now) == [DISABLE]
    sent = talk.served(now + 1.0, {ASK_WORD: answer}.get)
    assert [text for _, text in sent if text != NEUTRAL] == [
        ASK_WORD, *[DISABLE, ASK_WORD] * 2]
    assert sent[-1][0] < now + 0.6
    silent(talk, now + 6.0)
    assert warnings(talk) == [may_run('stop_failed', what=[why])]


@pytest.mark.parametrize('period, gap', [
    (0.02, 0.02), (0.005, 0.02), (0.02, 0.1),
    (0.02, 60.0)])      # a stop waits for none that takes a minute
def test_control_word_in_an_eeprom_keeps_the_pace(period: float, gap: float) -> None:
    talk = online(control=CONTROL, table=SLOW_TABLE, mapping='assume', period=period,
                  eeprom_write_gap=gap)
    # at the start disable was written; now the stop comes at once
    first = [text for _, text in talk.until(10.0 + period - TICK)]
    assert first.count(DISABLE) <= 1
    end = 10.0 + period - TICK
    found = [(end, text) for text in talk.deactivate(end)] + talk.until(12.0)
    times = [now for now, text in found if text == DISABLE]
    assert len(times) == 3     # nobody confirms it
    assert all(b - a >= min(gap, 0.025) - TICK for a, b in zip(times, times[1:]))
    asked = [now for now, text in found if text == ASK_WORD]
    assert all(b - a >= min(gap, 0.025) - TICK for a, b in zip(times, asked, strict=True))
    cycles = [now for now, text in found if text == NEUTRAL]
    assert len(cycles) == STOP_CYCLES
    assert all(b - a >= period - TICK for a, b in zip(cycles, cycles[1:]))
    assert found[-1][0] < 10.5
    silent(talk, 13.0)


@pytest.mark.parametrize('status, state, off', [(3, 'enabled', False), (1, 'ready', True)])
def test_disable_is_written_at_once_and_read_back(status: int, state: str, off: bool) -> None:
    """And what the last status word said is known behind it."""
    talk, now = written_word()
    assert talk.deactivate(now) == [DISABLE]
    assert [text for _, text in talk.until(now + 0.001 + TICK)] == [NEUTRAL, ASK_WORD]
    talk.hears(f'103FFFF0#000000000{status:03X}0000', now + 0.002)
    talk.hears('10200341#0000000000000000', now + 0.003)
    assert [text for _, text in talk.until(now + 5.0)] == [NEUTRAL] * (STOP_CYCLES - 1)
    silent(talk, now + 6.0)
    assert warnings(talk) == []
    assert talk.session.control is not None
    assert (talk.session.control.state, talk.session.control.off) == (state, off)


@pytest.mark.parametrize('answer, state, off', [
    ('10200D31#0003000000000000', 'enabled', False), ('10200D31#0001000000000000', 'ready', True),
    ('', 'enabled', False)])
def test_status_without_slot_is_read_after_the_last_cycle(
        answer: str, state: str, off: bool) -> None:
    talk = online(control=CONTROL, request=(WORD, SPEED), response=(CURRENT,), mapping='assume')
    assert talk.until(10.003) == [(10.002, '00200D31#0000000000000000')]
    assert talk.hears('10200D31#0003000000000000', 10.004) == []
    talk.deactivate(10.01)
    *before, (last, _) = last_cycles(NEUTRAL, 10.02)
    assert [exchange(talk, now) for now, _ in before] == [NEUTRAL] * len(before)
    assert talk.until(last + TICK) == [(last, NEUTRAL), (last, '00200D31#0000000000000000')]
    assert not talk.session.stopped
    if answer:
        assert talk.hears(answer, last + 0.002) == []
    else:
        assert talk.until(last + 0.101) == [], 'it is waited for 0.1 s'
    silent(talk, last + 0.11)
    assert talk.session.control is not None
    assert (talk.session.control.state, talk.session.control.off) == (state, off)
