# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A process that stands still for a moment: answers wait in buffers until somebody takes them.

The silence after an unanswered read is worth nothing when nobody listened to it. The timer thread
may be the first to go on; what the reader thread finds then is from before. By chance:
``test_standard_late.py``.
"""

from builders import frame, GAIN, read
from conversation import Conversation
import pytest
from standard_builders import ANSWER, ASK, online, polling


def test_an_answer_from_before_the_question_is_none() -> None:
    talk = online()
    assert talk.until(10.0205) == [(10.02, ASK)]
    # as stamped by the kernel, it was received at 10.019 s
    talk.session.receive_frame(frame(ANSWER), 10.021, age=0.002)
    assert talk.samples() == []
    assert talk.session.statistics.rejected == 1
    # the question is still open
    talk.session.receive_frame(frame(ANSWER), 10.023, age=0.001)
    assert talk.samples() == [(1000, 250, 1)]


@pytest.mark.parametrize('stall', [False, True])
def test_an_answer_that_a_gateway_has_held_is_no_strangers(stall: bool) -> None:
    """Longer than any answer is late; but one was asked for, and no second one."""
    talk = online()
    assert talk.until(10.0205) == [(10.02, ASK)]
    if stall:
        talk.handle_stall(10.5)
    else:
        talk.bus_down(10.03)
        talk.bus_up(10.5)
    talk.events()
    for rejected in (0, 1):
        talk.hears(ANSWER, 11.3)
        assert talk.session.statistics.rejected == rejected


def quarantined() -> Conversation:
    """Return a conversation at 10.15 s, with silence until 10.22 s and a user who waits."""
    talk = online()
    assert talk.until(10.0205) == [(10.02, ASK)]
    assert talk.until(10.15) == []
    talk.submits(read(GAIN), 10.15)
    return talk


def test_silence_that_nobody_listened_to() -> None:
    talk = quarantined()
    # 0.2 s too late, and the timer thread is the first to go on
    assert talk.at(10.42) == []
    assert talk.hears(ANSWER, 10.421) == []
    assert talk.samples() == []
    assert (talk.session.statistics.late, talk.session.statistics.rejected) == (1, 0)
    reads = [when for when, text in talk.until(10.55) if text.startswith('3F1#03')]
    # a silence after that answer; setpoints are refreshed just then
    assert reads == [pytest.approx(10.521, abs=0.005)]


def test_when_nothing_was_in_the_buffers_it_goes_on_soon() -> None:
    talk = quarantined()
    assert talk.at(10.42) == []
    sent = talk.until(10.44)
    assert len(sent) == 1
    assert sent[0][0] == pytest.approx(10.43)


def test_a_round_from_before_a_stall_says_nothing() -> None:
    talk = polling(request=(), parameter_retries=0)
    assert talk.hears(ANSWER, 10.002) == []
    assert talk.until(10.0205) == [(10.02, ASK)]
    assert talk.hears(ANSWER, 10.022) == []
    # a round begins at 10.04 s, and waits for a user
    assert talk.submits(read(GAIN), 10.03) == ['3F1#0328000100000000']
    assert talk.until(10.0405) == []
    talk.samples()
    assert talk.handle_stall(11.2) == []
    assert talk.until(11.35) == [(11.3, ASK)]
    assert talk.hears(ANSWER, 11.351) == []
    assert not talk.session.online
    assert talk.samples() == []
    assert talk.until(11.365) == [(11.36, ASK)]
    assert talk.hears(ANSWER, 11.366) == []
    assert talk.session.online
    assert talk.samples() == [(1000, 250, 1)]


def test_who_is_always_late_reads_all_the_same() -> None:
    talk = quarantined()
    assert talk.at(10.42) == []
    assert len(talk.at(10.5)) == 1


def test_a_timer_in_time_loses_none() -> None:
    talk = quarantined()
    assert [when for when, _ in talk.until(10.3)] == [pytest.approx(10.22)]
