# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whatever was told to run is told to stop, soon, and by frames that really left."""

from builders import read
from cannord_session_builders import (
    ACTUAL, commanded, ENABLED, exchange, FREQUENCY, inverter, MONITORING, OFFSET, online, READY,
    READY_FRAME, RUNNING, SETPOINTS, STANDING, TICK, VALUES,
)
from conversation import Conversation
import pytest
from saying import says

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import DriveState, Noted
from drive_can_bridge.core.setpoints import CommandOutcome

ENABLE, DISABLE = ControlAction.ENABLE, ControlAction.DISABLE
QUICK_STOP = ControlAction.QUICK_STOP
HALF_FRAME = '002#7F040020'
STANDING_FRAME = '002#7F040000'


def running() -> Conversation:
    """Return a drive that runs at 25 Hz since 10.04 s; the next cycle is due at 10.06 s."""
    talk = commanded(25.0)
    assert exchange(talk, 10.04, RUNNING) == HALF_FRAME
    talk.events()
    return talk


def slow() -> Conversation:
    """Return the same with a period of 0.1 s: it runs since 10.2 s."""
    talk = online(period=0.1)
    assert talk.asks(ENABLE, 10.003) == []
    assert exchange(talk, 10.1, ENABLED) == STANDING_FRAME
    talk.commands(0, 0.0, 10.15)
    talk.commands(0, 25.0, 10.15)
    assert exchange(talk, 10.2, RUNNING) == HALF_FRAME
    talk.control_outcomes()
    talk.events()
    return talk


def warnings(talk: Conversation) -> list[str]:
    return [note.text for note in talk.events(Noted)
            if note.warning and not note.text.startswith('enable withdrawn')]


# -- in every state -------------------------------------------------------------------------------


def test_what_is_under_way_during_a_stall_is_not_missed() -> None:
    talk = running()
    talk.at(10.06)
    missed = talk.session.statistics.missed
    talk.handle_stall(15.0)
    assert exchange(talk, 15.0) == READY_FRAME
    assert talk.session.statistics.missed == missed


def test_after_a_stall_nobody_waits_for_the_beat() -> None:
    talk = online(period=2.0)
    talk.asks(ENABLE, 10.003)
    exchange(talk, 12.0, ENABLED)
    talk.commands(0, 0.0, 13.8)
    talk.commands(0, 25.0, 13.8)
    assert exchange(talk, 14.0, RUNNING) == HALF_FRAME
    assert talk.handle_stall(15.2) == []
    assert talk.until(17.1) == [(15.2, READY_FRAME)]


# -- frames that the bus refuses ------------------------------------------------------------------


@pytest.mark.parametrize(('answers', 'said'), [
    ([READY], []),
    ([], [says('may_still_be_running', why=says('stop_not_possible'))]),
])
def test_one_stop_frame_that_left_is_a_word_if_it_is_answered(
        answers: list[str], said: list[str]) -> None:
    talk = running()
    talk.refusing = lambda text: True
    talk.deactivate(10.05)
    talk.until(10.061)
    talk.refusing = lambda text: False
    assert talk.until(10.081) == [(10.08, READY_FRAME)]
    talk.refusing = lambda text: True
    for answer in answers:
        talk.hears(answer, 10.082)
    talk.until(10.5)
    assert not talk.session.stopped, 'three were due'
    talk.session.give_up(10.6)
    assert warnings(talk) == said


def test_additional_frame_that_is_refused_is_half_a_stop() -> None:
    """Setpoints 4 and 5 travel in it."""
    talk = online('003#310B000000000000', request=SETPOINTS, response=VALUES,
                  extra_setpoints=True)
    talk.asks(ENABLE, 10.003)
    talk.until(10.021)
    talk.hears('003#370B000000000000', 10.022)
    talk.commands(4, 0.0, 10.023)
    talk.commands(4, 50.0, 10.024)
    assert talk.until(10.041) == [(10.04, '002#7F04000000000000'), (10.04, '002#0000002000')]
    talk.events()
    talk.refusing = lambda text: len(text) == 14
    talk.deactivate(10.05)
    assert talk.until(10.3) == [
        (round(10.06 + 0.02 * place, 6), '002#7E04000000000000') for place in range(13)]
    assert not talk.session.stopped
    talk.session.give_up(10.31)
    assert warnings(talk) == [says('may_still_be_running', why=says('stop_not_possible'))]


def test_refused_enable_is_no_enable() -> None:
    talk = online()
    talk.refusing = lambda text: text.startswith('002#7F04')
    talk.asks(ENABLE, 10.003)
    assert talk.until(10.021) == []
    talk.hears(RUNNING, 10.022)     # whoever has started it
    assert talk.control_outcomes() == []
    assert talk.session.state is DriveState.DISABLED
    talk.refusing = lambda text: False
    assert exchange(talk, 10.04, RUNNING) == STANDING_FRAME
    assert talk.control_outcomes() == [('enable', True, 'operation enabled')]


def test_refused_disable_goes_on() -> None:
    talk = running()
    talk.refusing = lambda text: text.startswith('002#7E04')
    talk.asks(DISABLE, 10.05)
    assert talk.until(10.061) == []
    talk.hears(READY, 10.062)       # a status of the time before the word
    assert talk.control_outcomes() == []
    talk.refusing = lambda text: False
    assert exchange(talk, 10.08) == READY_FRAME
    assert talk.control_outcomes() == [('disable', True, STANDING)]


def test_refused_read_is_asked_again() -> None:
    talk = online(parameter_timeout=0.03)
    talk.refusing = lambda text: text.startswith('202')
    assert talk.submits(read(OFFSET), 10.003) == []
    talk.refusing = lambda text: False
    assert (10.033, '202#9B11000000000000') in talk.until(10.034)
    talk.hears('203#9B11000000000700', 10.035)
    assert talk.outcomes() == [[7]]


# -- soon -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(('action', 'frame'), [
    (DISABLE, READY_FRAME), (QUICK_STOP, '002#7A040000')])
@pytest.mark.parametrize(('asked', 'left'), [
    (10.22, 10.22), (10.26, 10.26),
    (10.203, 10.205),               # not under 5 ms after the last
    (10.276, 10.3), (10.29, 10.3)])  # soon enough
def test_a_stop_brings_its_cycle_forward(action: ControlAction, frame: str, asked: float,
                                         left: float) -> None:
    talk = slow()
    assert talk.asks(action, asked) == []
    assert talk.until(left + 0.001) == [(left, frame)]
    talk.hears(READY, left + 0.002)
    assert talk.control_outcomes()[0][1]
    if action is DISABLE:
        assert talk.until(left + 0.101) == [(round(left + 0.1, 6), READY_FRAME)]


@pytest.mark.parametrize(('asked', 'left'), [
    (10.22, 10.22), (10.203, 10.205), (10.276, 10.3)])
def test_so_does_a_signal(asked: float, left: float) -> None:
    talk = slow()
    assert talk.deactivate(asked) == []
    assert talk.until(left + 0.25) == [
        (left, READY_FRAME), (round(left + 0.1, 6), READY_FRAME),
        (round(left + 0.2, 6), READY_FRAME)]


def test_and_a_fault() -> None:
    talk = slow()
    assert talk.hears('003#380B0000', 10.22) == []
    assert talk.until(10.23) == [(10.22, READY_FRAME)]


# -- nothing jumps --------------------------------------------------------------------------------


def test_a_drive_that_drops_out_by_itself_is_neutral_at_once() -> None:
    talk = running()
    assert exchange(talk, 10.06, '003#170B0010') == HALF_FRAME
    assert talk.commands(0, 25.0, 10.063) is CommandOutcome.DISABLED
    assert exchange(talk, 10.08) == READY_FRAME


# -- its own requests -----------------------------------------------------------------------------


def test_a_drive_that_comes_and_goes_is_asked_once_for_its_time_out() -> None:
    """It answers every fourth cycle, and no parameters: whoever reads waits for one task only."""
    talk = Conversation(inverter(table=(FREQUENCY, ACTUAL, MONITORING, OFFSET), missed_limit=3))
    talk.begins()
    talk.at(10.0)
    tasks = [(10.002, text) for text in talk.hears(READY, 10.002)]
    assert tasks == [(10.002, '202#0112000000000000')]
    for beat in range(1, 250):      # 5 s
        now = 10.0 + 0.02 * beat
        found = talk.until(now + TICK)
        if beat % 4 == 0:
            found += [(now, text) for text in talk.hears(READY, now + 0.002)]
        tasks += [(when, text) for when, text in found if text.startswith('202')]
    # three attempts, 0.1 s apart, and then not for 10 s
    assert [when for when, _ in tasks] == [10.002, 10.102, 10.202]
    talk.events()
    sent = talk.submits(read(OFFSET), 15.0)
    assert sent == ['202#9B11000000000000']
    talk.hears('203#9B11000000000700', 15.001)
    assert talk.outcomes() == [[7]]
