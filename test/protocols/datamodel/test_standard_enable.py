# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The word that enables an 11-bit drive, while nobody knows what state the drive is in."""

from builders import ACTUAL, CONTROL, CURRENT, drive, LIMIT, SPEED, STATUS, WORD
from conversation import Conversation
from extent import some
import pytest
from saying import says
from standard_builders import ANSWER, ASK, SPEED_ZERO
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.parameters import Parameter

ENABLE = '3F1#0634000100000000'
#: the same with status 0003h: ready, enabled
RUNNING = '7F1#E803FA000300ADDE'
#: of the status alone, which is not in the round
ASK_STATUS = '3F1#03D3000100000000'


def found(until: float, *, parameter_timeout: float) -> Timeline:
    """Return a drive that is found at 10 s, and answers each round."""
    talk = Conversation(drive(
        'datamodel_standard', control=CONTROL, request=(SPEED, LIMIT, WORD), period=0.05,
        refresh_interval=0.0, parameter_timeout=parameter_timeout))
    line = Timeline(talk, {ASK: (0.002, ANSWER)}.get)
    talk.begins()
    line.live(until)
    return line


def test_enable_is_not_repeated_while_a_read_goes_unanswered() -> None:
    """Whoever asks again meanwhile only joins: the drive might have been off, unseen."""
    line = found(10.2, parameter_timeout=1.0)
    line.took(line.talk.asks(ControlAction.ENABLE, 10.2))
    line.live(10.31)
    assert line.when(ENABLE) == [10.202]
    line.answer = lambda text: None
    for at in (10.552, 10.652, 10.752):
        line.live(at)
        line.took(line.talk.asks(ControlAction.ENABLE, at))
    line.live(12.0)
    assert line.when(ENABLE) == [10.202], line.log
    assert [at for at in line.when(ASK) if at > 10.31] == [10.35, 11.45], 'one goes unanswered'


def silent(until: float) -> Timeline:
    """Return a drive that was found at 10 s, and answers nothing from 10.19 s on."""
    line = found(10.19, parameter_timeout=0.1)
    line.answer = lambda text: None
    line.live(until)
    return line


def test_enable_that_the_bus_refused_waits_for_the_answer_that_is_due() -> None:
    line = silent(10.205)
    line.talk.refusing = lambda text: text == ENABLE
    line.took(line.talk.asks(ControlAction.ENABLE, 10.205))
    line.live(10.24)
    line.talk.refusing = lambda text: False
    line.live(10.35)
    assert line.when(ENABLE) == []


def test_setpoints_that_left_in_a_missed_round_do_not_count_for_enable() -> None:
    line = silent(10.31)
    line.took(line.talk.asks(ControlAction.ENABLE, 10.31))
    assert line.log[-1] == (10.31, SPEED_ZERO)
    line.answer = {ASK: (0.002, ANSWER)}.get
    line.live(10.35)
    line.talk.refusing = lambda text: text == SPEED_ZERO
    line.live(10.49)
    assert line.when(ENABLE) == []
    line.talk.refusing = lambda text: False
    line.live(10.51)
    assert line.when(ENABLE) == [10.501]
    assert line.when(SPEED_ZERO)[-1] == 10.5


class Enabled:
    """A drive with an answer to each read, enabled at 10.2 s, with a refresh every 0.5 s."""

    def __init__(self, *setpoints: Parameter, period: float = 0.05,
                 response: tuple[Parameter, ...] = (ACTUAL, CURRENT, STATUS)) -> None:
        self.talk = Conversation(drive(
            'datamodel_standard', control=CONTROL, request=(*setpoints, WORD), period=period,
            response=response, refresh_interval=0.5, parameter_timeout=0.1))
        self.line = Timeline(self.talk, self.answer)
        self.enabled = False
        self.talk.begins()
        self.line.live(10.2)
        self.line.took(self.talk.asks(ControlAction.ENABLE, 10.2))

    def answer(self, text: str) -> tuple[float, str] | None:
        """Do what it is told, and say what it is like now."""
        if text[:10] == ENABLE[:10]:
            self.enabled = text == ENABLE
        if text == ASK_STATUS:
            return 0.01, '7F1#0300ADDEADDEADDE' if self.enabled else '7F1#0100ADDEADDEADDE'
        return (0.01, RUNNING if self.enabled else ANSWER) if text[:6] == ASK[:6] else None

    def never_again(self) -> None:
        """See that nothing but ``disable`` follows, and that it is told."""
        before = len(self.line.log)
        self.line.live(self.talk.now + 3.0)
        assert ENABLE not in [text for _, text in self.line.log[before:]], self.line.log[before:]
        assert says('dropped_out_for_good') in [note.text for note in self.talk.events(Noted)]


@pytest.mark.parametrize('phase', some([0.001 * step for step in range(0, 560, 28)], 5))
def test_what_was_off_unseen_is_not_started_by_a_refresh_beside_the_round(phase: float) -> None:
    """Its status is no part of the round: it is read twice a second, and the word goes behind."""
    motor = Enabled(SPEED, LIMIT, response=(ACTUAL, CURRENT))
    motor.line.live(10.82 + phase)
    assert len(motor.line.when(ENABLE)) > 1, 'it is refreshed'
    asked = motor.line.when(ASK_STATUS)[-1]
    if motor.talk.now < asked + 0.02:   # what is on its way was true when it was said
        motor.line.live(asked + 0.02)
    motor.enabled = False
    motor.never_again()


def test_enable_is_refreshed_behind_a_status_beside_the_round() -> None:
    motor = Enabled(SPEED, response=(ACTUAL,))
    motor.line.live(20.0)
    times = motor.line.when(ENABLE)
    assert max(later - earlier for earlier, later in zip(times, times[1:])) < 0.6
    behind = motor.line.when(ASK_STATUS)
    assert all(any(0.0 < at - asked < 0.02 for asked in behind) for at in times[1:])


def test_a_status_that_has_waited_for_a_process_that_stood_still_is_none() -> None:
    """Stopped for 0.6 s with a read under way: its answer is older than the drive's restart."""
    motor = Enabled(period=1.0)
    motor.line.live(12.5)
    motor.line.answer = lambda text: None
    motor.line.live(13.001)
    assert motor.line.when(ASK)[-1] == 13.0
    motor.enabled, motor.line.answer = False, motor.answer
    motor.line.took(motor.talk.hears(RUNNING, 13.6))    # the reader comes first
    motor.never_again()


def test_neither_is_one_beside_the_round() -> None:
    motor = Enabled(period=0.05, response=(ACTUAL,))
    motor.line.live(12.0)
    at = motor.line.when(ASK_STATUS)[-1] + 0.4
    motor.line.live(at)
    motor.line.answer = lambda text: None if text == ASK_STATUS else motor.answer(text)
    while not motor.line.when(ASK_STATUS)[-1] > at:
        motor.line.live(motor.talk.session.next_timer())
    motor.enabled, motor.line.answer = False, motor.answer
    motor.line.took(motor.talk.hears('7F1#0300ADDEADDEADDE', motor.talk.now + 0.6))
    motor.never_again()
