# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A late answer to what a user has asked does not show that a 29-bit drive has stopped."""

from builders import CONTROL, read, WORD
from conversation import Conversation
from extended_builders import ANSWER, NEUTRAL, online

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted

ENABLED = '103FFFF0#03E800FA00030000'
DISABLE, ASK_WORD = '00300341#0000000000000000', '00200341#0000000000000000'
IS_OFF, IS_ON = '10200341#0000000000000000', '10200341#0001000000000000'


def asked_in_vain() -> Conversation:
    """Return an enabled drive whose word a user asked for, which was given up at 10.45 s."""
    talk = online(control=CONTROL, mapping='assume', period=0.1, parameter_retries=0,
                  parameter_timeout=0.1)
    cycles = {NEUTRAL: ANSWER}
    talk.asks(ControlAction.ENABLE, 10.01)
    talk.served(10.15, cycles.get)
    cycles[NEUTRAL] = ENABLED
    talk.served(10.349, cycles.get)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    assert talk.submits(read(WORD), 10.35) == [ASK_WORD]
    talk.served(10.46, cycles.get)
    talk.events()
    return talk


def test_late_answer_confirms_no_stop() -> None:
    talk = asked_in_vain()
    talk.refusing = lambda text: text == DISABLE
    assert talk.deactivate(10.47) == []
    assert ASK_WORD in [text for _, text in talk.until(10.4715)]
    talk.refusing = lambda text: False
    assert talk.hears(IS_OFF, 10.472) == [ASK_WORD], 'as it was before the user asked'
    sent = talk.hears(IS_ON, 10.473)
    sent += [text for _, text in talk.served(12.0, {ASK_WORD: IS_OFF}.get)]
    assert [text for text in sent if text != NEUTRAL] == [DISABLE, ASK_WORD]
    assert talk.session.stopped
    assert [note for note in talk.events(Noted) if note.warning] == []


def test_late_answer_costs_a_question_where_it_does_not_come() -> None:
    talk = asked_in_vain()
    assert talk.deactivate(10.47) == [DISABLE]
    end = 10.47 + talk.session.longest_stop
    sent = [text for _, text in talk.served(end, {ASK_WORD: IS_OFF}.get)]
    assert sent.count(ASK_WORD) == 2
    assert sent.count(DISABLE) == 0
    assert talk.session.stopped
    assert [note for note in talk.events(Noted) if note.warning] == []
