# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What the channel of all families does with any transactor; a drive with one request."""

from collections.abc import Callable, Generator, Hashable
import math

import pytest

from drive_can_bridge.protocols.channel import Channel, Priority, STOP_PATIENCE
from drive_can_bridge.protocols.transactor import Transactor

TIMEOUT = 0.1
Asking = Generator[str, 'str | None', list['str | None']]


class Postman(Transactor[str, 'str | None']):
    """Steps and replies are words; None: nobody answered. Capitals are asked once."""

    busy = False
    deadline = math.inf
    silent = None

    def __init__(self) -> None:
        self.sent: list[str] = []

    @property
    def silence(self) -> float:
        return TIMEOUT

    def begin(self, step: str, now: float) -> None:
        self.sent.append(step)
        self.busy, self.deadline = True, now + TIMEOUT

    def handle_timer(self, now: float) -> str | bool | None:
        if now < self.deadline:
            return False
        self.forget()
        return None

    def receive(self, answer: str, now: float) -> str:
        self.forget()
        return answer

    def forget(self) -> None:
        self.busy, self.deadline = False, math.inf

    def abandon(self, until: float) -> None:
        self.deadline = min(self.deadline, until)

    def attempts(self, step: str) -> int:
        return 1 if step.isupper() else 2

    def unanswered(self, step: str, reply: str | None) -> bool:
        return reply is None

    def key(self, step: str) -> Hashable:
        return step


class Line:
    def __init__(self) -> None:
        self.postman = Postman()
        self.channel = Channel(self.postman)
        self.results: list[object] = []

    def asks(self, *steps: str, now: float, priority: Priority = Priority.OWN) -> list[str]:
        def asking() -> Asking:
            found = []
            for step in steps:
                found.append((yield step))
            return found
        self.channel.run(asking(), self.results.append, now, priority)
        return self.sent()

    def sent(self) -> list[str]:
        sent, self.postman.sent = self.postman.sent, []
        return sent

    def answer(self, reply: str, now: float) -> list[str]:
        self.channel.receive(reply, now)
        return self.sent()

    def at(self, now: float) -> list[str]:
        self.channel.advance(now)
        return self.sent()


def test_lanes_come_in_their_order() -> None:
    line = Line()
    assert line.asks('a', now=1.0) == ['a']
    for priority in reversed(Priority):
        line.asks(priority.name.lower(), now=1.0, priority=priority)
    assert [line.answer('', 1.01 + 0.01 * step) for step in range(6)] == [
        ['stop'], ['control'], ['setpoints'], ['users'], ['own'], []]


def test_what_is_held_back_is_begun_as_late_as_possible() -> None:
    """So that it tells what is true then; a stop is not held back."""
    line = Line()
    line.channel.hold(2.0)
    begun: list[float] = []

    def asking() -> Asking:
        begun.append(line.channel.now)
        return [(yield 'word')]
    line.channel.run(asking(), line.results.append, 1.0, Priority.CONTROL)
    assert line.channel.due == 2.0
    assert line.asks('stop', now=1.1, priority=Priority.STOP) == ['stop']
    assert line.answer('', 1.2) == []
    assert begun == []
    assert line.at(2.0) == ['word']
    assert begun == [2.0]


def test_a_stop_has_the_exchange_under_way_make_room_which_was_no_attempt() -> None:
    line = Line()
    assert line.asks('read', now=1.0) == ['read']
    line.asks('stop', now=1.01, priority=Priority.STOP)
    line.channel.make_room(1.01)
    assert line.channel.due == pytest.approx(1.01 + STOP_PATIENCE)
    assert line.at(1.0601) == ['stop']
    assert line.answer('', 1.07) == ['read'], 'its own late answer is as good'
    assert line.at(1.1701) == ['read'], 'it has its second attempt all the same'
    assert line.at(1.2702) == []
    assert line.results == [[''], [None]]


def test_cancelled_exchange_is_waited_for_and_tells_nobody() -> None:
    line = Line()
    line.asks('a', 'b', now=1.0)
    line.channel.cancel(Priority.OWN)
    assert line.asks('c', now=1.01) == [], 'one at a time'
    assert line.answer('late', 1.02) == ['c']
    assert line.answer('there', 1.03) == []
    assert line.results == [['there']]


@pytest.mark.parametrize('forget', [
    lambda line, now: line.channel.clear(), lambda line, now: line.channel.cancel(Priority.OWN)])
def test_forgotten_question_is_not_asked_again_before_its_answer_would_have_come(
        forget: Callable[[Line, float], None]) -> None:
    line = Line()
    line.asks('A', now=1.0)
    forget(line, 1.05)
    line.postman.forget()
    assert line.asks('A', now=1.06) == []
    assert line.asks('B', now=1.06, priority=Priority.USERS) == ['B'], 'others go on'
    line.answer('', 1.07)
    assert line.channel.due == pytest.approx(1.2)
    assert line.at(1.2001) == ['A']


def test_after_a_stall_the_silence_begins_anew() -> None:
    line = Line()
    line.asks('A', now=1.0)
    line.channel.handle_stall(5.0)
    line.channel.clear()
    assert line.asks('A', now=5.0) == []
    assert line.at(5.0999) == []
    assert line.at(5.1) == ['A']


def test_quarantine_that_nobody_listened_through_is_prolonged() -> None:
    line = Line()
    line.asks('A', now=1.0)
    assert line.at(1.1) == []
    line.channel.handle_stall(1.2002)      # just at its end
    assert line.asks('A', now=1.2002) == []
    assert line.at(1.2103) == ['A']


def lose(line: Line, count: int) -> None:
    """Ask something again and again in vain, each time at once."""
    for _ in range(count):
        assert line.asks('A', now=1.0) == ['A']
        line.channel.clear()
        line.channel._quarantine._until.clear()


class TestStopsInQuarantine:
    """A word may be answered until two time-outs after it was asked; stops are words, too."""

    @staticmethod
    def forgotten() -> Line:
        line = Line()
        line.asks('A', now=1.0)
        line.channel.clear()
        return line

    def test_a_stop_goes_at_once_and_one_answer_is_not_believed(self) -> None:
        line = self.forgotten()
        assert line.asks('A', now=1.01, priority=Priority.STOP) == ['A']
        assert line.answer('first', 1.02) == ['A']
        assert line.results == []
        assert line.answer('second', 1.03) == []
        assert line.results == [['second']]

    def test_the_answer_that_is_left_over_is_not_said_to_be_late(self) -> None:
        line = self.forgotten()
        line.asks('A', now=1.01, priority=Priority.STOP)
        line.answer('first', 1.02)
        line.answer('second', 1.03)
        assert line.channel.late(1.04) == 0.0

    def test_each_answer_is_counted_once(self) -> None:
        line, counts = self.forgotten(), []
        for stop in range(5):
            now = 1.01 + 0.1 * stop
            sent, count = line.asks('A', now=now, priority=Priority.STOP), 0
            while sent:
                count += len(sent)
                sent = line.answer('there', now + 0.001 * count)
            counts.append(count)
        assert counts == [2] * 5

    def test_it_has_all_its_attempts_besides(self) -> None:
        line = self.forgotten()
        line.asks('a', now=1.01)
        line.channel.clear()
        assert line.asks('a', now=1.02, priority=Priority.STOP) == ['a']
        assert line.answer('', 1.03) == ['a']
        assert line.at(1.1301) == ['a']
        assert line.at(1.2302) == []
        assert line.results == [[None]]

    def test_each_attempt_before_it_may_be_answered_late(self) -> None:
        line = Line()
        line.asks('a', now=1.0)
        assert line.at(1.1) == ['a']
        assert line.at(1.2) == []
        assert line.asks('a', now=1.21, priority=Priority.STOP) == ['a']
        assert line.answer('', 1.22) == ['a']
        assert line.answer('', 1.23) == ['a']
        assert line.results == [[None]]
        assert line.answer('there', 1.24) == []
        assert line.results == [[None], ['there']]

    @pytest.mark.parametrize('lost', [2, 3, 7])
    def test_however_many_were_lost_the_second_answer_is_believed(self, lost: int) -> None:
        """Behind the answer to something else, which shows that nothing older comes."""
        line = Line()
        line.postman.aside = lambda is_late: (  # type: ignore[method-assign]
            next((each for each in 'AB' if not is_late(each)), None))
        lose(line, lost)
        assert line.asks('A', now=1.01, priority=Priority.STOP) == ['A']
        assert line.answer('first', 1.02) == ['B']
        assert line.answer('', 1.03) == ['A']
        assert line.answer('second', 1.04) == []
        assert line.results == [['second']]
        # what was lost before is not counted again
        assert line.asks('A', now=1.05, priority=Priority.STOP) == ['A']
        assert line.answer('third', 1.06) == ['A']
        assert line.answer('fourth', 1.07) == []

    def test_where_nobody_answers_to_that_answers_are_counted(self) -> None:
        line = Line()
        line.postman.aside = lambda is_late: 'B'    # type: ignore[method-assign]
        lose(line, 2)
        line.asks('A', now=1.01, priority=Priority.STOP)
        assert line.answer('first', 1.02) == ['B']
        assert line.channel.due == pytest.approx(1.12)
        assert line.at(1.1201) == ['A']
        assert line.answer('second', 1.13) == ['A']
        assert line.answer('third', 1.14) == []
        assert line.results == [['third']]

    def test_what_is_cancelled_asks_nothing_else(self) -> None:
        line = Line()
        line.postman.aside = lambda is_late: 'B'    # type: ignore[method-assign]
        lose(line, 2)
        line.asks('A', now=1.01, priority=Priority.STOP)
        assert line.answer('first', 1.02) == ['B']
        line.channel.cancel(Priority.STOP)
        assert line.answer('', 1.03) == []
        assert line.asks('C', now=1.3) == ['C']

    def test_a_late_answer_to_its_own_attempt_is_as_good(self) -> None:
        line = Line()
        assert line.asks('a', now=1.0, priority=Priority.STOP) == ['a']
        assert line.at(1.1) == ['a']
        assert line.answer('there', 1.11) == []
        assert line.results == [['there']]

    def test_answers_to_others_are_no_matter(self) -> None:
        line = self.forgotten()
        assert line.asks('B', now=1.01, priority=Priority.STOP) == ['B']
        assert line.answer('there', 1.02) == []
        assert line.results == [['there']]

    def test_what_was_asked_long_ago_is_no_matter(self) -> None:
        line = self.forgotten()
        assert line.asks('A', now=2.0, priority=Priority.STOP) == ['A']
        assert line.answer('there', 2.01) == []
        assert line.results == [['there']]

    def test_what_follows_is_in_quarantine_for_the_answers_to_come(self) -> None:
        """The answer that was not believed may have been the late one: then two are to come."""
        line = self.forgotten()
        line.asks('A', now=1.01, priority=Priority.STOP)
        line.answer('', 1.02)
        line.answer('', 1.03)
        assert line.asks('A', now=1.04) == []
        assert line.channel.due == pytest.approx(1.22)

    def test_where_answers_do_not_say_what_they_answer_a_stop_waits(self) -> None:
        line = Line()
        line.postman.anonymous = True
        line.asks('A', now=1.0)
        line.channel.clear()
        assert line.asks('A', now=1.01, priority=Priority.STOP) == []
        assert line.at(1.2001) == ['A']
        assert line.answer('there', 1.21) == []
        assert line.results == [['there']]

    @pytest.mark.parametrize('idle_until, first', [(1.0, ['A']), (2.0, [])])
    def test_an_answer_may_have_waited_through_a_stall(
            self, idle_until: float, first: list[str]) -> None:
        line = self.forgotten()
        line.at(idle_until)
        line.channel.handle_stall(5.0)
        assert line.asks('A', now=5.01, priority=Priority.STOP) == ['A']
        assert line.answer('first', 5.02) == first
