# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The word that enables an 11-bit drive, while nobody knows what state the drive is in."""

from builders import CONTROL, Conversation, drive, LIMIT, SPEED, WORD
import pytest
from saying import says
from standard_builders import ANSWER, ASK
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.parameters import Parameter

ENABLE = '3F1#0634000100000000'
#: the same with status 0003h: ready, enabled
RUNNING = '7F1#E803FA000300ADDE'


def test_enable_is_not_repeated_while_a_read_goes_unanswered() -> None:
    """Whoever asks again meanwhile only joins: the drive might have been off, unseen."""
    talk = Conversation(drive(
        'datamodel_standard', control=CONTROL, request=(SPEED, LIMIT, WORD), period=0.05,
        refresh_interval=0.0, parameter_timeout=1.0))
    line = Timeline(talk, {ASK: (0.002, ANSWER)}.get)
    talk.bus_up(9.0)
    talk.activate(10.0)
    line.live(10.2)
    line.took(talk.asks(ControlAction.ENABLE, 10.2))
    line.live(10.31)
    assert line.when(ENABLE) == [10.202]
    line.answer = lambda text: None
    for at in (10.552, 10.652, 10.752):
        line.live(at)
        line.took(talk.asks(ControlAction.ENABLE, at))
    line.live(12.0)
    assert line.when(ENABLE) == [10.202], line.log
    assert [at for at in line.when(ASK) if at > 10.31] == [10.35, 11.45], 'one goes unanswered'


class Enabled:
    """A drive with an answer to each read, enabled at 10.2 s, with a refresh every 0.5 s."""

    def __init__(self, *setpoints: Parameter, period: float = 0.05) -> None:
        self.talk = Conversation(drive(
            'datamodel_standard', control=CONTROL, request=(*setpoints, WORD), period=period,
            refresh_interval=0.5, parameter_timeout=0.1))
        self.line = Timeline(self.talk, self.answer)
        self.enabled = False
        self.talk.bus_up(9.0)
        self.talk.activate(10.0)
        self.line.live(10.2)
        self.line.took(self.talk.asks(ControlAction.ENABLE, 10.2))

    def answer(self, text: str) -> tuple[float, str] | None:
        """Do what it is told, and say what it is like now."""
        if text[:10] == ENABLE[:10]:
            self.enabled = text == ENABLE
        return (0.01, RUNNING if self.enabled else ANSWER) if text == ASK else None

    def never_again(self) -> None:
        """See that nothing but ``disable`` follows, and that it is told."""
        before = len(self.line.log)
        self.line.live(self.talk.now + 3.0)
        assert ENABLE not in [text for _, text in self.line.log[before:]], self.line.log[before:]
        assert says('dropped_out_for_good') in [note.text for note in self.talk.events(Noted)]


@pytest.mark.parametrize('phase', [0.001 * step for step in range(0, 560, 7)])
def test_what_was_off_unseen_is_not_started_by_a_refresh(phase: float) -> None:
    """Off between two reads, it answers them all; only its status says that it has restarted."""
    motor = Enabled(SPEED, LIMIT)
    motor.line.live(10.72 + phase)
    assert len(motor.line.when(ENABLE)) > 1, 'it is refreshed'
    # what is on its way was true when it was said
    motor.line.live(motor.line.when(ASK)[-1] + 0.011)
    motor.enabled = False
    motor.never_again()


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
