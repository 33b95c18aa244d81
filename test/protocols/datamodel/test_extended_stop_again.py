# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A drive that ran, fell silent, and answers only a part of what is asked, is told again."""

from conversation import Conversation
from extended_builders import (
    ASK_LIMIT, ASK_REQUEST_MAP, ASK_RESPONSE_MAP, ASK_SPEED, exchange, LIMIT_IS_ZERO, LIMIT_ZERO,
    NEUTRAL, online, REQUEST_MAP, RESPONSE_MAP, RUNNING, SPEED_IS_ZERO, SPEED_ZERO,
)
from saying import says
from stops import bursts, STOP_CYCLES

from drive_can_bridge.core.events import Noted

HALF = {ASK_REQUEST_MAP: REQUEST_MAP, ASK_SPEED: SPEED_IS_ZERO, ASK_LIMIT: LIMIT_IS_ZERO}


def silent() -> Conversation:
    """Return a drive that was told 100 rpm and heard nothing of what followed until 12 s."""
    talk = online(rearm_immediate=True)
    talk.commands(0, 100.0, 10.003)
    assert exchange(talk, 10.02) == RUNNING
    sent = [text for _, text in talk.until(12.0)]
    assert sent.count(NEUTRAL) == STOP_CYCLES
    assert not talk.session.online
    talk.events()
    return talk


def test_a_drive_that_answers_one_map_only_is_told_to_stop_by_number() -> None:
    talk = silent()
    sent = [text for _, text in talk.served(14.0, HALF.get)]
    assert sent.count(SPEED_ZERO) == 1
    assert sent.count(LIMIT_ZERO) == 1
    assert sent.index(SPEED_ZERO) < sent.index(LIMIT_ZERO) < sent.index(ASK_SPEED)
    assert NEUTRAL not in sent
    assert not (talk.session.duty.stop_pending or talk.session.duty.unacknowledged)
    assert [note.text for note in talk.events(Noted)] == [
        says('stopped_again')]


def test_one_that_is_back_right_after_the_stop_it_has_not_heard_is_told_at_once() -> None:
    """Only what is told again is told with pauses."""
    talk = online(rearm_immediate=True)
    talk.commands(0, 100.0, 10.003)
    assert exchange(talk, 10.02) == RUNNING
    while not [note for note in talk.events(Noted) if note.danger]:
        talk.at(talk.session.next_timer())
        assert talk.now < 12.0
    sent = [text for _, text in talk.served(talk.now + 0.9, HALF.get)]
    assert sent.count(SPEED_ZERO) == 1
    assert not (talk.session.duty.stop_pending or talk.session.duty.unacknowledged)


def test_one_that_never_confirms_is_told_about_once_a_second() -> None:
    talk = silent()
    sent = talk.served(22.0, {ASK_REQUEST_MAP: REQUEST_MAP}.get)
    begun = bursts([now for now, text in sent if text == SPEED_ZERO], slack=0.2)
    assert len(begun) > 3
    assert [text for _, text in sent].count(ASK_RESPONSE_MAP) > 2 * len(begun)
    assert talk.events(Noted) == []


def test_one_that_does_not_answer_is_only_looked_for() -> None:
    talk = silent()
    assert {text for _, text in talk.until(15.0)} == {ASK_REQUEST_MAP}


def test_one_that_answers_both_maps_gets_cycles() -> None:
    talk = silent()
    sent = [text for _, text in talk.served(13.0, {
        ASK_REQUEST_MAP: REQUEST_MAP, ASK_RESPONSE_MAP: RESPONSE_MAP}.get)]
    assert sent.index(NEUTRAL) < sent.index(SPEED_ZERO), 'by number as it does not answer those'
