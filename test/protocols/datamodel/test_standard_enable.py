# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The word that enables an 11-bit drive, while nobody knows what state the drive is in."""

from builders import CONTROL, Conversation, drive, LIMIT, SPEED, WORD
from standard_builders import ANSWER, ASK
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction

ENABLE = '3F1#0634000100000000'


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
