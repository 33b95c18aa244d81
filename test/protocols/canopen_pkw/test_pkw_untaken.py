# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Setpoints and control words that a device does not take: they are refused, or not answered."""

from conversation import Conversation
from pkw_builders import answered, CONTROL, denied, driven, echo, online, SPEED, SPEED_1
from saying import may_run, says
from timeline import Timeline

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.setpoints import CommandOutcome

UNANSWERED = says('write_unanswered', what='speed')
SPEEDS, WORDS = 'C602', 'C002'


def untaken(talk: Conversation, what: str = SPEEDS, *, status: str = 'C320',
            refused: bool = False) -> Timeline:
    """Have a drive answer everything but writes of one register, which it may refuse."""
    def answer(text: str) -> tuple[float, str] | None:
        if text[4:8] != what:
            return 0.0001, echo(text, status)
        return (0.0001, denied(text)) if refused else None
    return Timeline(talk, answer)


def enabling(until: float, **how: bool) -> Timeline:
    """Ask a drive that is ready to be enabled."""
    talk = online(request=(SPEED,), control=CONTROL, control_timeout=4.0)
    answered(talk, talk.at(10.07), 10.071)
    line = untaken(talk, status='4100', **how)
    line.took(talk.asks(ControlAction.ENABLE, 10.071))
    assert line.log[0][1][4:8] == SPEEDS
    line.live(until)
    return line


def notes(talk: Conversation) -> list[str]:
    return [note.text for note in talk.events(Noted)]


def words(line: Timeline) -> list[str]:
    """Return the control words that were written."""
    return [text[12:16] for _, text in line.log if text[4:8] == WORDS]


def test_drive_that_refuses_neutral_is_not_enabled_and_can_be_disabled() -> None:
    """Its register may hold anything: what somebody has preset there would move it."""
    line = enabling(11.0, refused=True)
    assert set(words(line)) == {'0000'}, 'enable is withdrawn'
    (action, success, message), = line.talk.control_outcomes()
    assert (action, success) == ('enable', False)
    assert message == says('word_refused', word=1, reason=says('word_held_back', what=says(
        'write_refused', what='speed', reason=says('refused_by_drive', number=0x08000022))))
    line.took(line.talk.asks(ControlAction.DISABLE, line.talk.now))
    line.live(12.0)
    assert line.talk.control_outcomes() == [('disable', True, 'ready')]


def test_drive_that_does_not_answer_to_neutral_is_not_enabled() -> None:
    line = enabling(13.0)
    assert '0100' not in words(line)
    assert line.talk.control_outcomes() == [
        ('enable', False, says(
            'word_refused', word=1, reason=says('word_held_back', what=UNANSWERED)))]
    assert notes(line.talk) == [says('write_failed', what=UNANSWERED)]
    assert line.talk.session.warning == says('setpoint_not_taken', what=UNANSWERED)


def test_enabled_drive_that_does_not_take_neutral_is_disabled() -> None:
    """Nobody commands it any more, and it would run on with what it was told last."""
    line = untaken(driven(control_timeout=4.0))
    line.live(13.0)
    assert words(line) == ['0000'] * 2, 'it says that it runs on'
    assert len([text for _, text in line.log if text[4:8] == SPEEDS]) >= 3
    assert says('enable_withdrawn', reason=says('neutral_not_taken', what=UNANSWERED)) in notes(
        line.talk)
    line = untaken(driven(), refused=True)
    line.live(10.7)
    assert words(line) == ['0000'], 'at once'


def test_drive_without_control_that_does_not_take_neutral_may_run() -> None:
    talk = online(request=(SPEED,))
    assert talk.commands(0, 0.0, 10.06) is CommandOutcome.ARMED
    assert talk.commands(0, 10.0, 10.06) is CommandOutcome.ACCEPTED
    assert answered(talk, talk.at(10.07), 10.071)[0] == SPEED_1
    talk.events()
    untaken(talk, status='4100').live(13.0)
    assert notes(talk) == [may_run('write_failed', what=UNANSWERED)]


def test_disable_that_is_not_answered_is_told() -> None:
    """The drive answers everything else, and goes on."""
    talk = driven()
    line = untaken(talk, WORDS)
    line.took(talk.asks(ControlAction.DISABLE, 10.115))
    line.live(13.0)
    assert len(words(line)) > 3, 'with each round again'
    unanswered = says('write_unanswered', what='control_register_1 0000h')
    assert notes(talk) == [may_run('write_failed', what=unanswered)], 'once'
    assert talk.session.warning == says('word_not_taken', what=unanswered)
    line.answer = lambda text: (0.0001, echo(text))
    line.live(16.0)
    assert not talk.session.warning, 'answered, it is well again'
