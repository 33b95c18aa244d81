# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A stop by words that cannot be read back: what shows that a drive has heard it."""

from dataclasses import replace

from builders import CONTROL, drive, LIMIT, SPEED, TABLE, WO, WORD
from conversation import Conversation
import extended_builders
import pytest
from saying import may_run, says
from standard_builders import ANSWER, ASK, LIMIT_ZERO, SPEED_ZERO

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted

BLIND_SPEED, BLIND_WORD = replace(SPEED, access=WO), replace(WORD, access=WO)
BLIND_TABLE = tuple(
    {SPEED: BLIND_SPEED, WORD: BLIND_WORD}.get(entry, entry) for entry in TABLE)
ASK_ACTUAL, ASK_CURRENT = '3F1#03D1000100000000', '3F1#03D2000100000000'
ASK_LIMIT = '3F1#0333000100000000'
DISABLE, ASK_STATUS_29 = '00300341#0000000000000000', '00200D31#0000000000000000'
ZERO = '7F1#0000000000000000'
UNHEARD = says('write_unanswered', what='speed_setpoint (P50)')


def well(text: str) -> str | None:
    """Answer whatever is asked."""
    return ANSWER if text == ASK else ZERO if text.startswith('3F1#03') else None


def running(**options: object) -> Conversation:
    """Return a drive that was told 100 rpm, which it cannot be asked for."""
    talk = Conversation(drive(
        'datamodel_standard', table=BLIND_TABLE, rearm_immediate=True, command_timeout=0.0,
        **{'request': (BLIND_SPEED,), **options})).begun()
    talk.served(10.03, well)
    talk.commands(0, 100.0, 10.03)
    talk.served(10.055, well)
    assert talk.session.online
    assert talk.session.duty.may_run
    talk.events()
    return talk


def warnings(talk: Conversation) -> list[object]:
    return [note.text for note in talk.events(Noted) if note.warning]


@pytest.mark.parametrize('answers, asked, heard', [
    ([ZERO], [ASK_ACTUAL], True),
    # what is lost is asked for again, and then something else
    ([None, ZERO], [ASK_ACTUAL, ASK_ACTUAL], True),
    ([None, None, ZERO], [ASK_ACTUAL, ASK_ACTUAL, ASK_CURRENT], True),
    ([None, None, None], [ASK_ACTUAL, ASK_ACTUAL, ASK_CURRENT], False)])
def test_one_that_answers_anything_has_heard_it(
        answers: list[str | None], asked: list[str], heard: bool) -> None:
    talk, coming = running(), iter(answers)
    assert talk.deactivate(10.055) == [SPEED_ZERO]
    sent = [text for _, text in talk.served(
        10.055 + talk.session.longest_stop,
        lambda text: next(coming) if text.startswith('3F1#03') else None)]
    assert sent == [SPEED_ZERO, SPEED_ZERO, *asked]
    assert talk.session.stopped
    assert warnings(talk) == ([] if heard else [may_run('stop_failed', what=[UNHEARD])])


def test_one_that_falls_silent_is_told_again_and_named() -> None:
    talk = running()
    talk.until(11.5)
    assert not talk.session.online
    assert talk.session.duty.stop_pending
    assert warnings(talk) == [may_run('stop_failed', what=[UNHEARD])]
    sent = [text for _, text in talk.served(14.0, {ASK_CURRENT: ZERO, ASK: ANSWER}.get)]
    assert SPEED_ZERO in sent
    assert talk.session.online
    assert not talk.session.duty.may_run


@pytest.mark.parametrize('last_refused, failed', [
    (False, []), (True, [may_run('stop_failed', what=[
        says('write_not_taken', what='speed_setpoint (P50)')])])])
def test_one_write_that_the_bus_takes_will_do(last_refused: bool, failed: list[object]) -> None:
    talk, refusals = running(), iter([True, True, last_refused])
    talk.refusing = lambda text: text == SPEED_ZERO and next(refusals)
    talk.deactivate(10.055)
    talk.served(11.0, well)
    assert talk.session.stopped
    assert warnings(talk) == failed


@pytest.mark.parametrize('cut, failed', [
    (False, []), (True, [may_run('stop_failed', what=[UNHEARD])])])
def test_what_can_be_read_back_shows_it_too(cut: bool, failed: list[object]) -> None:
    """But not before the last write."""
    talk = running(request=(BLIND_SPEED, LIMIT))
    asked: list[str] = []

    def answer(text: str) -> str | None:
        silent = cut and ASK_LIMIT in asked
        asked.append(text)
        return None if silent else well(text)
    assert talk.deactivate(10.055) == [SPEED_ZERO]
    sent = [text for _, text in talk.served(10.055 + talk.session.longest_stop, answer)]
    assert sent[:5] == [LIMIT_ZERO, ASK_LIMIT, SPEED_ZERO, SPEED_ZERO, ASK_LIMIT]
    assert len(sent) == (7 if cut else 5)
    assert talk.session.stopped
    assert warnings(talk) == failed


# -- with 29-bit identifiers ----------------------------------------------------------------------


@pytest.mark.parametrize('answer, failed', [
    ('10200D31#0000000000000000', []),
    (None, [may_run('stop_failed', what=[
        says('write_unanswered', what='control_word (P52)')])])])
def test_word_by_number(answer: str | None, failed: list[object]) -> None:
    talk = extended_builders.online(
        table=BLIND_TABLE, control=CONTROL, mapping='assume', period=0.1)
    talk.asks(ControlAction.ENABLE, 10.01)
    cyclic = {extended_builders.NEUTRAL: extended_builders.ANSWER}
    talk.served(10.15, cyclic.get)
    cyclic[extended_builders.NEUTRAL] = '103FFFF0#03E800FA00030000'
    talk.served(10.35, cyclic.get)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    talk.events()
    assert talk.deactivate(10.35) == [DISABLE]
    sent = [text for _, text in talk.served(
        10.35 + talk.session.longest_stop, {**cyclic, ASK_STATUS_29: answer}.get)]
    assert [text for text in sent if text not in cyclic][:3] == [DISABLE, DISABLE, ASK_STATUS_29]
    assert talk.session.stopped
    assert warnings(talk) == failed
