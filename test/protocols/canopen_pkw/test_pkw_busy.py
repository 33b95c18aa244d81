# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Slow, deaf and busy devices: everybody has a turn at the mailbox, and all is judged rightly."""

from collections.abc import Callable

from builders import read, write
from conversation import Conversation
from pkw_builders import (
    CLASS, denied, DISABLE_0, DISABLE_1, driven, echo, FLC, online, running, SPEED, SPEED_1,
    STILL_0, STILL_1, TORQUE,
)
import pytest
from saying import says
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import (
    Noted, ProcessDataReceived, RequestCompleted, StationLost,
)
from drive_can_bridge.core.setpoints import CommandOutcome

DISABLE = ControlAction.DISABLE
#: function bytes of reads
READS = ('26', 'A6', '25', 'A5')


def after(delay: float) -> Callable[[str], tuple[float, str]]:
    """Answer everything so many s later; the motor runs, whatever it is told."""
    return lambda text: (delay, echo(text))


def deaf(text: str) -> None:
    """Answer nothing."""


def operating(talk: Conversation) -> bool:
    assert talk.session.control is not None
    return talk.session.control.operating


# -- setpoints that change places -----------------------------------------------------------------


def swapping(every: float, delay: float) -> Timeline:
    """Return a drive that is commanded 10 Hz and 0, then 0 and 5, and so on; it answers later."""
    talk = driven((SPEED, TORQUE), command_timeout=0.0)
    talk.commands(1, 0, 10.13)
    drive = Timeline(talk, after(delay))
    places = [(10.0, 0), (0.0, 5)]

    def swap(now: float) -> list[str]:
        places.reverse()
        for index, value in enumerate(places[1]):
            talk.commands(index, value, now)
        drive.plan(now + every, swap)
        return talk.at(now)

    drive.plan(10.2, swap)
    return drive


def expiring(every: float, delay: float, timeout: float = 0.01) -> Timeline:
    """Return the same, with commands that are too old after 10 ms; any value arms."""
    drive = swapping(every, delay)
    drive.talk.session.setpoints.timeout = timeout
    drive.talk.session.setpoints.rearm_immediate = True
    return drive


BEGIN = pytest.mark.parametrize('begin', [swapping, expiring])
Begin = Callable[[float, float], Timeline]


@BEGIN
@pytest.mark.parametrize(('every', 'delay'), [
    (0.02, 0.002), (0.02, 0.01), (0.02, 0.06), (0.05, 0.02), (0.08, 0.002), (0.1, 0.01),
    (0.1, 0.06), (0.2, 0.02), (0.2, 0.06)])
def test_a_deaf_drive_is_lost(every: float, delay: float, begin: Begin) -> None:
    drive = begin(every, delay)
    drive.live(12.0)
    drive.answer = deaf
    drive.live(40.0)
    assert len(drive.talk.events(StationLost)) == 1


@pytest.mark.parametrize('every', [0.1, 0.2, 0.4])
def test_a_drive_that_answers_no_reads_is_lost(every: float) -> None:
    drive = swapping(every, 0.002)
    drive.answer = lambda text: None if text[10:12] in READS else (0.002, echo(text))
    drive.live(40.0)
    assert len(drive.talk.events(StationLost)) == 1


@pytest.mark.parametrize(('delay', 'every'), [
    (0.01, 0.02), (0.03, 0.02), (0.06, 0.08), (0.06, 0.1), (0.06, 0.12), (0.06, 0.15),
    (0.1, 0.02)])
@BEGIN
def test_rounds_and_users_have_their_turn(delay: float, every: float, begin: Begin) -> None:
    drive = begin(every, delay)
    drive.live(12.0)
    drive.talk.events()
    drive.took(drive.talk.submits(read(FLC), 12.0))
    drive.live(17.0)
    events = drive.talk.events()
    assert any(isinstance(event, ProcessDataReceived) for event in events)
    assert any(isinstance(event, RequestCompleted) for event in events)


@pytest.mark.parametrize(('delay', 'every', 'timeout'), [
    (0.06, 0.05, 0.0), (0.2, 0.05, 0.0), (0.08, 0.05, 0.0),
    (0.1, 0.08, 0.06)])     # what had to make room has as long as a slow device may take
def test_a_drive_that_answers_everything_goes_on(
        delay: float, every: float, timeout: float) -> None:
    """It answers in time (0.5 s), if not to the first attempts at neutral, of 50 ms each."""
    drive = expiring(every, delay, timeout) if timeout else swapping(every, delay)
    drive.live(20.0)
    assert [note.text for note in drive.talk.events(Noted) if note.warning] == []
    assert operating(drive.talk)


def test_a_users_write_is_answered_although_a_setpoint_passes_zero() -> None:
    """An EEPROM takes 0.2 s: only what has expired has others make room."""
    talk = driven()
    text, = talk.submits(write((CLASS, 20)), 10.113)
    assert text == f'505#5E0200{text[10:12]}14000000'
    drive = Timeline(talk, after(0.2))
    drive.took([text])
    drive.answer = after(0.001)
    drive.live(10.149)
    assert drive.log == [(10.113, text)], 'the round waits for the mailbox'
    talk.commands(0, 0.0, 10.15)
    assert talk.at(10.15) == []
    drive.live(10.6)
    assert talk.outcomes() == [['written']], drive.log


# -- what was refused -----------------------------------------------------------------------------


@pytest.mark.parametrize(('refused', 'meanwhile'), [(20.0, 0.0), (0.0, 10.0)])
def test_a_refused_neutral_disables_and_no_other_setpoint(
        refused: float, meanwhile: float) -> None:
    """Whatever is commanded before the refusal comes: 0 instead of 20 Hz the drive would take."""
    talk = driven()
    talk.commands(0, refused, 10.125)
    text, = talk.at(10.13)
    assert text[4:10] + text[12:16] == 'C60200' + ('C800' if refused else '0000')
    talk.commands(0, meanwhile, 10.131)
    talk.hears(denied(text, '00000602'), 10.132)
    assert operating(talk) is (refused != 0.0), talk.events()


# -- a bus that takes nothing ---------------------------------------------------------------------


@pytest.mark.parametrize('asked', [False, True])
def test_a_repetition_that_the_bus_refused_is_made_up_for(asked: bool) -> None:
    """The motor runs on, whatever it is told."""
    talk = running(control_timeout=1.0, parameter_timeout=0.1)
    control = talk.session.control
    assert control is not None
    drive = Timeline(talk, after(0.001))
    drive.took(talk.asks(DISABLE, 10.1))
    drive.live(12.0)
    assert len(drive.when(DISABLE_0, DISABLE_1)) >= 3, 'it is repeated'
    assert control.disregard
    since: list[float] = []

    def refusing(text: str) -> bool:
        """Take nothing for 0.25 s, from the next repetition on: too short to lose the drive."""
        if not since and text in (DISABLE_0, DISABLE_1):
            since.append(talk.now)
        return bool(since) and talk.now < since[0] + 0.25

    talk.refusing = refusing
    drive.live(14.5)
    assert since
    assert talk.session.online
    drive.log.clear()
    if asked:
        drive.took(talk.asks(DISABLE, 14.5))
    drive.live(24.5)
    assert drive.when(DISABLE_0, DISABLE_1)
    assert control.disregard, 'it still runs, and diagnostics say so'


# -- the answer to what made it run, late ---------------------------------------------------------


def hurried() -> Conversation:
    """
    Return a drive without a control word that runs, or will, and has to stop.

    10 Hz have toggle 1 and are given up, 0 has toggle 0 and is given up, 0 has toggle 1.
    """
    talk = online(request=(SPEED,))
    assert talk.commands(0, 0.0, 10.06) is CommandOutcome.ARMED
    assert talk.commands(0, 10.0, 10.06) is CommandOutcome.ACCEPTED
    assert talk.until(10.0701) == [(10.07, SPEED_1)]
    assert talk.asks(ControlAction.QUICK_STOP, 10.08) == []
    assert talk.until(10.19) == [
        (pytest.approx(10.13), STILL_0), (pytest.approx(10.18), STILL_1)]
    return talk


@pytest.mark.parametrize('late', [0.0, 0.12])
def test_the_answer_to_a_command_proves_no_stop(late: float) -> None:
    """The device, busy with 10 Hz, heard of both 0 the last one, and saw the same function."""
    talk = hurried()
    assert talk.hears(echo(SPEED_1), 10.2) == [STILL_0]
    assert talk.control_outcomes() == []
    assert talk.session.stop_pending
    talk.hears(echo(STILL_0), 10.21 + late)
    assert talk.control_outcomes() == [('quick_stop', True, says('neutral_without_control'))]
    assert not talk.session.stop_pending


def test_a_stop_whose_commands_answer_was_lost_is_written_once_more() -> None:
    talk = hurried()
    assert talk.hears(echo(STILL_1), 10.19) == [STILL_0]
    talk.hears(echo(STILL_0), 10.2)
    assert talk.control_outcomes() == [('quick_stop', True, says('neutral_without_control'))]


def test_a_stop_whose_answers_come_in_order_is_proven_by_its_own() -> None:
    """A device that keeps all requests, and needs 55 ms for each, once."""
    talk = hurried()
    assert talk.hears(echo(STILL_0), 10.185) == []
    talk.hears(echo(STILL_1), 10.24)
    assert talk.control_outcomes() == [('quick_stop', True, says('neutral_without_control'))]
