# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a session has to tell."""

from builders import SPEED
from saying import says

from drive_can_bridge.core.events import (
    AnswerLate, FrameRejected, Noted, SetpointsExpired, StationFound, StationLost,
)
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.setpoints import Setpoints
from drive_can_bridge.core.statistics import DriveStatistics


def test_events_in_order_and_once() -> None:
    statistics = DriveStatistics()
    report = Reporter(statistics, 'not activated')
    report.warn('careful')
    report.reject('too short')
    report.note(Noted('just so'))
    report.expired(Setpoints((SPEED,), timeout=0.5, rearm_immediate=True).items)
    assert statistics.rejected == 1
    assert report.take() == [
        Noted('careful', warning=True), FrameRejected('too short'), Noted('just so'),
        SetpointsExpired(('speed_setpoint',))]
    assert report.take() == []


def test_of_a_danger() -> None:
    report = Reporter(DriveStatistics(), '')
    report.warn('no answer', may_run=True)
    assert report.take() == [
        Noted(says('may_still_be_running', why='no answer'), warning=True, danger=True)]


def test_what_was_taken_stays_as_it_was() -> None:
    report = Reporter(DriveStatistics(), '')
    report.warn('first')
    taken = report.take()
    report.warn('second')
    assert taken == [Noted('first', warning=True)]


def test_advice_while_the_drive_is_offline() -> None:
    report = Reporter(DriveStatistics(), 'not activated')
    assert report.advice == 'not activated'
    report.found()
    assert report.advice == ''
    report.lost('silent', was_online=True)
    report.lost('bus down', was_online=False)
    assert report.advice == 'bus down'
    assert report.take() == [StationFound(), StationLost('silent')], 'nobody is lost twice'


def test_late_answers_that_count_hide_none_that_is_lost() -> None:
    """One event in a while: what was lost since the one before shows in it."""
    report = Reporter(DriveStatistics(), '')
    report.unasked('', 0.001, 10.0, taken=True)
    report.unasked('', 0.002, 12.0)
    report.unasked('', 0.003, 19.9, taken=True)
    assert report.take() == [AnswerLate(0.001, taken=True)]
    report.unasked('', 0.004, 20.0, taken=True)
    report.unasked('', 0.005, 30.0, taken=True)
    assert report.take() == [AnswerLate(0.004), AnswerLate(0.005, taken=True)]
