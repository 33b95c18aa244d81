# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A drive that ran, fell silent, and shows up without being online, is told to stop again."""

from conversation import Conversation
from pkw_builders import (
    CONTROL, CURRENT, DISABLE_0, DISABLE_1, DISABLED_0, echo, ENABLE_0, ENABLE_1, IDLE,
    OPERATIONAL, PRE_OPERATIONAL, READ_1, running, START, started, STATUS, STATUS_2,
)
import pytest
from stops import bursts

from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import Noted

STOPS = (DISABLE_0, DISABLE_1)
CONFIRMED = 'told to stop once more, which it has confirmed'
FAILED = ('told to stop, but control_register_1 0000h not acknowledged in 3 attempts: '
          'it may still be running')


def half(text: str) -> str | None:
    """Return the answer of a drive that runs, and does not answer register 500."""
    if not text.startswith('505#') or text[4:8] == 'F401':
        return None
    return echo(text)


def stops(sent: list[tuple[float, str]]) -> list[float]:
    return [now for now, text in sent if text in STOPS]


def well(text: str) -> str | None:
    return echo(text) if text.startswith('505#') else None


def still(text: str) -> str | None:
    return echo(text, '4100') if text.startswith('505#') else None


def runs_in_two_reads() -> Conversation:
    """Return a drive that was enabled, whose rounds read 455 and 456, then 500 and 501."""
    talk = started(response=(STATUS, STATUS_2, CURRENT), control=CONTROL, period=0.1)
    talk.served(10.2, still)
    enable, = talk.asks(ControlAction.ENABLE, 10.201)
    assert enable in (ENABLE_0, ENABLE_1)
    assert talk.hears(echo(enable), 10.203) == []
    talk.served(10.6, well)
    assert talk.control_outcomes() == [('enable', True, 'enabled')]
    talk.events()
    return talk


def silent(talk: Conversation, end: float) -> Conversation:
    """Let nothing be answered until a drive was told to stop in vain."""
    talk.until(end)
    assert not talk.session.online
    assert [note.text for note in talk.events(Noted) if note.danger] == [FAILED]
    assert talk.session.duty.stop_pending
    return talk


def test_one_register_unanswered_when_it_is_back() -> None:
    talk = silent(runs_in_two_reads(), 14.0)
    sent = talk.served(16.0, half)
    assert not talk.session.online
    place, = (place for place, (_, text) in enumerate(sent) if text in STOPS)
    assert sent[place - 1][1][4:8] == 'C701', 'right behind the first answer'
    assert sent[place][0] == pytest.approx(sent[place - 1][0] + 0.002)
    assert not talk.session.duty.stop_pending
    assert [note.text for note in talk.events(Noted)] == [CONFIRMED]
    assert [text[4:8] for _, text in sent].count('C701') > 2, 'rounds go on'
    assert 'average_current' in talk.session.offline_advice


def test_one_that_is_back_right_after_the_stop_it_has_not_heard_is_told_at_once() -> None:
    """Only what is told again is told with pauses."""
    talk = runs_in_two_reads()
    while FAILED not in [note.text for note in talk.events(Noted)]:
        talk.at(talk.session.next_timer())
        assert talk.now < 14.0
    sent = talk.served(talk.now + 0.9, half)
    assert not talk.session.online
    assert len(stops(sent)) == 1
    assert not talk.session.duty.stop_pending


def test_drive_that_is_deaf_first_and_answers_later() -> None:
    """Its reads are answered, its writes not: attempts a second apart, and one warning in all."""
    talk = silent(runs_in_two_reads(), 14.0)

    def deaf(text: str) -> str | None:
        return None if text[10:12] in ('2A', 'AA') else half(text)
    sent = talk.served(22.0, deaf)
    times = stops(sent)
    begun = bursts(times, slack=0.6)
    assert len(begun) > 3
    assert len(times) <= 3 * len(begun)
    assert [text[4:8] for _, text in sent].count('F401') > len(begun), 'rounds go on'
    assert talk.events(Noted) == []
    heard = stops(talk.served(24.0, half))
    assert len(heard) == 1
    assert [note.text for note in talk.events(Noted)] == [CONFIRMED]
    assert stops(talk.served(30.0, half)) == []


def test_complete_round_of_a_slow_drive_is_not_held_up() -> None:
    """It takes 0.3 s for each read: what is told again between them makes no room for itself."""
    talk = silent(runs_in_two_reads(), 14.0)

    def deaf(text: str) -> str | None:
        return None if text[10:12] in ('2A', 'AA') else echo(text)
    talk.served(20.0, deaf, 0.3)
    assert talk.session.online


def test_heartbeat() -> None:
    """What is under way was asked when nobody was there: 50 ms more will do for its answer."""
    talk = silent(running(), 13.2)
    assert talk.hears(OPERATIONAL, 13.21) == []
    assert talk.until(13.8) == [
        (13.26, DISABLE_1), (13.31, DISABLE_0), (13.36, DISABLE_1)]
    assert talk.until(13.9)[:2] == [(13.81, START), (13.86, IDLE)], 'the drive is looked for'
    talk.until(14.69)
    assert talk.hears(OPERATIONAL, 14.7) == []
    assert not stops(talk.until(14.85)), 'less than a second after the last'
    assert talk.hears(OPERATIONAL, 14.9) == []
    assert talk.until(14.9) == []
    assert talk.until(15.07) == [(15.06, DISABLE_0)], 'no room is made any more'
    assert talk.hears(DISABLED_0, 15.07) == [READ_1], 'which has synchronised the mailbox'
    assert not talk.session.duty.stop_pending
    assert [note.text for note in talk.events(Noted)] == [CONFIRMED]
    assert talk.hears(OPERATIONAL, 17.0) == []
    assert not stops(talk.until(20.0))


@pytest.mark.parametrize('sign', [OPERATIONAL, '085#1023020A00000000', '485#5E02002507000000'])
def test_any_sign_of_life(sign: str) -> None:
    talk = silent(running(), 14.0)
    talk.hears(sign, 14.001)
    times = stops(talk.until(30.0))
    assert times[0] <= 14.5, 'when the read under way has had its time'
    assert len(times) == 3, 'and only for a sign'


def test_complete_rounds_of_a_node_whose_heartbeats_have_ceased() -> None:
    """It is there, but does not count as online."""
    talk = running(heartbeat_timeout=0.5)
    talk.hears(OPERATIONAL, 10.095)
    silent(talk, 14.0)
    sent = talk.served(14.6, well)
    assert not talk.session.online
    assert len(stops(sent)) == 1
    assert not talk.session.duty.stop_pending


def test_node_that_is_held_back_and_says_so() -> None:
    talk = running()
    talk.hears(PRE_OPERATIONAL, 10.3)
    sent = []
    for place in range(30):
        now = 10.4 + 0.1 * place
        sent += talk.until(now)
        sent += [(now, text) for text in talk.hears(PRE_OPERATIONAL, now)]
    times = stops(sent)
    assert [round(now, 2) for now in times[:2]] == [10.43, 10.57]
    assert times[2] == pytest.approx(11.1), 'three attempts, and the next heartbeat'
    assert [note.text for note in talk.events(Noted) if note.danger] == [FAILED]
