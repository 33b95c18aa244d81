# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A drive that ran, fell silent, and answers a part of its round only, is told to stop again."""

from dataclasses import replace

from builders import ACTUAL, CONTROL, CURRENT, drive, GAIN, LIMIT, SPEED, STATUS, TABLE, WORD
from conversation import Conversation
from saying import says
from standard_builders import LIMIT_ZERO, SPEED_ZERO
from stops import bursts

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.parameters import Parameter

ASK_GAIN, ASK = '3F1#0328000100000000', '3F1#03D1000300000000'
GAIN_IS, ZERO = '7F1#0500000000000000', '7F1#0000000000000000'
ASK_SPEED = '3F1#0332000100000000'
DISABLE, ENABLE = '3F1#0634000000000000', '3F1#0634000100000000'
CONFIRMED = 'told to stop once more, which it has confirmed'


def well(status: int) -> dict[str, str]:
    """Return what a drive answers whose status word is this."""
    return {ASK_GAIN: GAIN_IS, ASK: f'7F1#E803FA000{status}00ADDE'}


def half(text: str) -> str | None:
    """Return the answer of a drive that does not answer P209 to P211."""
    if not text.startswith('3F1#03') or text == ASK:
        return None
    return GAIN_IS if text == ASK_GAIN else ZERO


def told(sent: list[tuple[float, str]]) -> list[float]:
    return [now for now, text in sent if text in (SPEED_ZERO, DISABLE)]


def lost(word: Parameter = WORD, *, end: float = 12.0, **options: object) -> Conversation:
    """
    Return a drive that ran, and was told to stop in vain; two reads a round.

    :param end: until when nothing happens then, in s.
    """
    table = tuple(word if entry is WORD else entry for entry in TABLE)
    talk = Conversation(drive(
        'datamodel_standard', response=(GAIN, ACTUAL, CURRENT, STATUS), rearm_immediate=True,
        command_timeout=0.0, period=0.1, table=table, **options)).begun()
    talk.served(10.09, well(1).get)
    assert talk.session.online
    if talk.session.control is not None:
        sent = talk.asks(ControlAction.ENABLE, 10.095)
        sent += [text for _, text in talk.served(10.19, well(1).get)]
        assert ENABLE in sent
        talk.served(10.49, well(3).get)
        assert talk.control_outcomes() == [('enable', True, 'enabled')]
    talk.commands(0, 150.0, 10.5)
    talk.events()
    while not [note for note in talk.events(Noted) if note.danger]:
        talk.at(talk.session.next_timer())
        assert talk.now < 12.0
    talk.until(end)
    assert not talk.session.online
    assert talk.session.duty.stop_pending
    assert talk.events(Noted) == []
    return talk


def test_a_drive_that_answers_a_part_of_its_round_is_told_again() -> None:
    talk = lost(request=(SPEED, LIMIT))
    sent = talk.served(14.0, half)
    assert not talk.session.online
    assert len(told(sent)) == 1
    place = sent.index((told(sent)[0], SPEED_ZERO))
    assert sent[place - 1][1] == ASK_GAIN, 'right behind the first answer'
    assert [text for _, text in sent[place:place + 3]] == [SPEED_ZERO, LIMIT_ZERO, ASK_SPEED]
    assert not talk.session.duty.stop_pending
    assert [note.text for note in talk.events(Noted)] == [CONFIRMED]
    names = 'actual_speed (P209), motor_current (P210), status_word (P211)'
    assert talk.session.offline_advice == says('one_read_unanswered', names=names)


def test_one_that_is_back_right_after_the_stop_it_has_not_heard_is_told_at_once() -> None:
    """Only what is told again is told with pauses."""
    talk = lost(end=0.0, request=(SPEED, LIMIT))
    since = talk.now
    sent = talk.served(since + 0.9, half)
    assert len(told(sent)) == 1
    place = sent.index((told(sent)[0], SPEED_ZERO))
    assert [text for _, text in sent[:place]].count(ASK_GAIN) == 1, 'right behind the first answer'
    assert not talk.session.duty.stop_pending
    assert [note.text for note in talk.events(Noted)] == [CONFIRMED]


def test_one_that_never_confirms_is_told_about_once_a_second() -> None:
    talk = lost(request=(SPEED, LIMIT))
    sent = talk.served(22.5, {ASK_GAIN: GAIN_IS}.get)
    times = told(sent)
    begun = bursts(times, slack=0.4)
    assert len(begun) > 3
    assert len(times) == 3 * len(begun)
    assert [text for _, text in sent].count(ASK) > 2 * len(begun), 'rounds go on'
    assert talk.events(Noted) == [], 'told once'


def test_a_control_word_that_wears_an_eeprom_is_told_less_and_less_often() -> None:
    talk = lost(replace(WORD, storage=None), control=CONTROL, request=(SPEED,))
    begun = bursts([now for now, text in talk.served(75.0, {ASK_GAIN: GAIN_IS}.get)
                    if text == DISABLE])
    gaps = [round(later - sooner) for sooner, later in zip(begun, begun[1:])]
    assert gaps == [3, 5, 9, 17], gaps
