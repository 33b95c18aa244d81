# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Setpoints and control words that a device does not take: they are refused, or not answered."""

from typing import Any

from builders import Conversation
from pkw_builders import CONTROL, driven, echo, online, READ_0, SPEED, SPEED_1
from saying import may_run, says

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.setpoints import CommandOutcome

UNANSWERED = says('write_unanswered', what='speed')

#: what is not answered: the setpoint, whatever it is
SPEEDS = '505#C60200'
NO_REMOTE = '22000008'


def answers(talk: Conversation, until: float, *, status: str = 'C320',
            refused: bool = False) -> list[str]:
    """Answer everything but setpoints up to a time; return what was sent."""
    sent: list[str] = []
    while (now := max(talk.now, talk.session.next_timer())) <= until:
        asked = talk.at(now)
        while asked:
            text = asked.pop(0)
            sent.append(text)
            if not text.startswith(SPEEDS):
                asked += talk.hears(echo(text, status), now + 0.0001)
            elif refused:
                function = 'CE' if text[10] == 'A' else '4E'
                asked += talk.hears(f'485#C60200{function}{NO_REMOTE}', now + 0.0001)
    return sent


def notes(talk: Conversation) -> list[str]:
    return [note.text for note in talk.events(Noted)]


def words(sent: list[str]) -> list[str]:
    """Return the control words that were written."""
    return [text[12:16] for text in sent if text[4:8] == 'C002']


def enabling(talk: Conversation, until: float, **how: Any) -> list[str]:
    """Ask a drive that is ready to be enabled; return what was sent."""
    asked = talk.asks(ControlAction.ENABLE, talk.now)
    assert len(asked) == 1 and asked[0].startswith(SPEEDS)
    if how.get('refused'):
        function = 'CE' if asked[0][10] == 'A' else '4E'
        asked += talk.hears(f'485#C60200{function}{NO_REMOTE}', talk.now)
    return asked + answers(talk, until, status='4100', **how)


def test_drive_that_refuses_neutral_is_not_enabled_and_can_be_disabled() -> None:
    """Its register may hold anything: what somebody has preset there would move it."""
    talk = online(request=(SPEED,), control=CONTROL)
    talk.until(10.0701)
    talk.hears(echo(READ_0, '4100'), 10.071)
    sent = enabling(talk, 11.0, refused=True)
    assert set(words(sent)) == {'0000'}, 'enable is withdrawn'
    (action, success, message), = talk.control_outcomes()
    assert (action, success) == ('enable', False)
    assert message == says('word_refused', word=1, reason=says('word_held_back', what=says(
        'write_refused', what='speed', reason=says('refused_by_drive', number=0x08000022))))
    talk.asks(ControlAction.DISABLE, talk.now)
    answers(talk, 12.0, status='4100')
    assert talk.control_outcomes() == [('disable', True, 'ready')]


def test_drive_that_does_not_answer_to_neutral_is_not_enabled() -> None:
    talk = online(request=(SPEED,), control=CONTROL, control_timeout=4.0)
    talk.until(10.0701)
    talk.hears(echo(READ_0, '4100'), 10.071)
    sent = enabling(talk, 13.0)
    assert '0100' not in words(sent)
    assert talk.control_outcomes() == [
        ('enable', False, says(
            'word_refused', word=1, reason=says('word_held_back', what=UNANSWERED)))]
    assert notes(talk) == [says('write_failed', what=UNANSWERED)]
    assert talk.session.warning == says('setpoint_not_taken', what=UNANSWERED)


def test_enabled_drive_that_does_not_take_neutral_is_disabled() -> None:
    """Nobody commands it any more, and it would run on with what it was told last."""
    talk = driven(control_timeout=4.0)
    sent = answers(talk, 13.0)
    assert words(sent) == ['0000'] * 2, 'it says that it runs on'
    assert len([text for text in sent if text.startswith(SPEEDS)]) >= 3
    assert says('enable_withdrawn', reason=says('neutral_not_taken', what=UNANSWERED)) in notes(
        talk)


def test_enabled_drive_that_refuses_neutral_is_disabled_at_once() -> None:
    talk = driven()
    sent = answers(talk, 10.7, refused=True)
    assert words(sent) == ['0000']


def test_drive_without_control_that_does_not_take_neutral_may_run() -> None:
    talk = online(request=(SPEED,))
    assert talk.commands(0, 0.0, 10.06) is CommandOutcome.ARMED
    assert talk.commands(0, 10.0, 10.06) is CommandOutcome.ACCEPTED
    asked = talk.until(10.0701)
    assert asked == [(10.07, SPEED_1)]
    asked_, = talk.hears(echo(SPEED_1), 10.071)
    assert talk.hears(echo(asked_, '4100'), 10.072) == []
    talk.events()
    answers(talk, 13.0)
    assert notes(talk) == [may_run('write_failed', what=UNANSWERED)]


def test_disable_that_is_not_answered_is_told() -> None:
    """The drive answers everything else, and goes on."""
    talk = driven()
    asked = talk.asks(ControlAction.DISABLE, 10.115)
    sent: list[str] = []
    while talk.now < 13.0:
        while asked:
            text = asked.pop(0)
            sent.append(text)
            if text[4:8] != 'C002':
                asked += talk.hears(echo(text), talk.now + 0.0001)
        asked = talk.at(max(talk.now, talk.session.next_timer()))
    assert len(words(sent)) > 3, 'with each round again'
    unanswered = says('write_unanswered', what='control_register_1 0000h')
    assert notes(talk) == [may_run('write_failed', what=unanswered)], 'once'
    assert talk.session.warning == says('word_not_taken', what=unanswered)
    asked = [text for text in asked if text[4:8] == 'C002'] or [sent[-1]]
    while talk.session.warning:
        if asked:
            asked += talk.hears(echo(asked.pop(0)), talk.now + 0.0001)
        else:
            asked = talk.at(max(talk.now, talk.session.next_timer()))
        assert talk.now < 16.0, 'answered, it is well again'
