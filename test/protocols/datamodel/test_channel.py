# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The acyclic channel alone: priorities, pace, repetitions."""

import math

import pytest

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.outbox import Outbox
from drive_can_bridge.core.requests import RetryPolicy
from drive_can_bridge.protocols.channel import Channel, Priority
from drive_can_bridge.protocols.datamodel.transactor import (
    ParameterRead, ParameterTransactor, ParameterWrite, Procedure, Words)


def nobody(sent: bool, now: float) -> None:
    """Be told of a frame that left, and do nothing."""


class Texts:
    """Frames that say whether they ask or write."""

    together = 4

    def encode_read(self, number: int, count: int) -> Frame:
        return Frame(number, b'?' * count, True)

    def encode_write(self, number: int, words: Words) -> Frame:
        return Frame(number, bytes(words), True)

    def decode(self, frame: Frame, asked: tuple[int, int] | None) -> Words:
        raise NotImplementedError


class Line:
    """A channel whose frames are texts, and the results of its procedures."""

    def __init__(self, *, timeout: float = 0.1, attempts: int = 2, gap: float = 0.02,
                 quarantine: float | None = None) -> None:
        self.outbox = Outbox()
        self.transactor = ParameterTransactor(
            Texts(), send=self.outbox.put, retry=RetryPolicy(timeout, attempts), eeprom_gap=gap,
            quarantine=quarantine)
        self.channel = Channel(self.transactor)
        self.results: list[object] = []

    def sent(self, now: float | None = None) -> list[str]:
        """Return what leaves; ``now``: when, if the bus was busy."""
        found = []
        while frames := self.outbox.take():
            found += [f'{frame.identifier}{"?" if frame.data[:1] == b"?" else "!"}'
                      for frame in frames]
            self.outbox.left(self.channel.now if now is None else now)
        return found

    def reads(self, *numbers: int, priority: Priority = Priority.OWN,
              now: float = 1.0) -> list[str]:
        self.channel.run(self.reading(numbers), self.results.append, now, priority)
        return self.sent()

    @staticmethod
    def reading(numbers: tuple[int, ...]) -> Procedure:
        found: list[Words | None] = []
        for number in numbers:
            found.append((yield ParameterRead(number)))
        return found

    def writes(self, *steps: tuple[int, bool], priority: Priority = Priority.OWN, now: float = 1.0,
               ) -> list[str]:
        self.channel.run(self.writing(steps), self.results.append, now, priority)
        return self.sent()

    @staticmethod
    def writing(steps: tuple[tuple[int, bool], ...]) -> Procedure:
        for number, eeprom in steps:
            yield ParameterWrite(number, (1,), eeprom)
        return 'done'

    def answer(self, word: int, now: float) -> list[str]:
        self.channel.receive((word,), now)
        return self.sent()

    def at(self, now: float) -> list[str]:
        self.channel.advance(now)
        return self.sent()


def test_lanes_take_turns_after_every_step() -> None:
    line = Line()
    assert line.reads(1, 2, 3, priority=Priority.USERS) == ['1?']
    assert line.reads(11, 12, priority=Priority.OWN) == []
    assert line.answer(0, 1.01) == ['11?']
    assert line.answer(0, 1.02) == ['2?']
    assert line.answer(0, 1.03) == ['12?']
    assert line.answer(0, 1.04) == ['3?']
    assert line.answer(0, 1.05) == []
    assert line.results == [[(0,), (0,)], [(0,), (0,), (0,)]]


def test_lanes_take_turns_between_attempts() -> None:
    line = Line(attempts=3)
    line.reads(1, priority=Priority.USERS)
    line.reads(11, now=1.05)
    assert line.at(1.1) == ['11?']
    assert line.answer(0, 1.11) == ['1?']
    line.reads(12, now=1.12)
    assert line.at(1.2101) == ['12?']
    assert line.answer(0, 1.22) == ['1?']
    assert line.at(1.33) == []
    assert line.results == [[(0,)], [(0,)], [None]]


def test_write_first_overtakes_and_replaces() -> None:
    line = Line()
    done: list[str] = []
    line.reads(1, 2, priority=Priority.USERS)
    line.transactor.write_first(ParameterWrite(52, (1,), False), lambda *_: done.append('one'),
                                1.01)
    line.transactor.write_first(ParameterWrite(53, (0,), False), lambda *_: done.append('two'),
                                1.02)
    assert line.sent() == []
    assert line.answer(0, 1.03) == ['53!']
    assert done == ['two']
    assert line.at(1.0311) == ['2?']


def test_write_first_waits_for_its_eeprom() -> None:
    line = Line()
    line.writes((30, True))
    line.transactor.write_first(ParameterWrite(52, (1,), True), nobody, 1.001)
    assert line.channel.due == pytest.approx(1.02)
    assert line.at(1.0199) == []
    assert line.at(1.0201) == ['52!']


def test_what_stops_a_drive_waits_for_spacing_only() -> None:
    line = Line()
    assert line.reads(1) == ['1?']          # not answered yet
    line.channel.hold(5.0)
    line.transactor.write_now(ParameterWrite(52, (0,), False), nobody, 1.01)
    line.transactor.write_now(ParameterWrite(50, (0,), False), nobody, 1.01)
    assert line.sent() == ['52!']
    assert line.channel.due == pytest.approx(1.011)
    assert line.at(1.0111) == ['50!']
    assert line.transactor.outstanding is not None


@pytest.mark.parametrize('gap, left_at', [(0.02, 1.02), (60.0, 1.03)])
def test_what_stops_a_drive_waits_for_its_eeprom_but_not_for_long(
        gap: float, left_at: float) -> None:
    line = Line(gap=gap)
    line.writes((30, True))
    line.transactor.write_now(ParameterWrite(52, (0,), True), nobody, 1.005)
    assert line.at(left_at - 0.0001) == []
    assert line.at(left_at + 0.0001) == ['52!']


def test_what_stops_a_drive_makes_a_word_that_waits_outdated() -> None:
    line = Line()
    assert line.reads(1) == ['1?']
    line.transactor.write_first(ParameterWrite(52, (1,), False), nobody, 1.001)
    line.transactor.write_now(ParameterWrite(52, (0,), False), nobody, 1.002)
    assert line.sent() == ['52!']
    assert line.answer(0, 1.01) == []


def test_what_stops_a_drive_makes_a_stop_of_the_same_parameter_outdated() -> None:
    line = Line()
    for word in (9, 2, 0):
        line.transactor.write_now(ParameterWrite(52, (word,), False), nobody, 1.0)
    line.transactor.write_now(ParameterWrite(50, (0,), False), nobody, 1.0)
    left = []
    for now in (1.0, 1.001, 1.002, 1.003):
        line.channel.advance(now)
        left += [(frame.identifier, frame.data[0]) for frame in line.outbox.take()]
        line.outbox.left(now)
    assert left == [(52, 9), (52, 0), (50, 0)]


def test_clear_forgets_everything_but_the_eeprom() -> None:
    line = Line()
    line.writes((30, True))
    line.reads(1, priority=Priority.USERS)
    line.reads(2, priority=Priority.USERS)
    line.reads(3)
    line.transactor.write_first(ParameterWrite(52, (1,), False), lambda: None, 1.0)
    assert line.channel.waiting_users == 1
    line.channel.clear()
    assert line.channel.due == math.inf
    assert line.channel.waiting_users == 0
    assert line.at(2.0) == []
    assert line.results == ['done']
    line.channel.clear()
    assert line.reads(4, now=1.019) == []
    assert line.at(1.02) == ['4?']


def test_the_pause_of_the_eeprom_begins_when_the_write_has_left() -> None:
    line = Line()
    line.channel.run(line.writing(((30, True),)), line.results.append, 1.0)
    assert line.sent(1.009) == ['30!']  # the bus was busy
    assert line.reads(30, now=1.02) == []
    assert line.channel.due == pytest.approx(1.029)


# -- where the exchange itself goes through the channel -------------------------------------------


def test_a_stall_ends_a_read_whose_answer_would_not_say_what_it_answers() -> None:
    """However short the silence after it."""
    line = Line(quarantine=0.0, attempts=1)
    line.reads(7)
    line.channel.handle_stall(1.01)
    assert line.results == [[None]]
    line = Line(attempts=1)
    line.reads(7)
    line.channel.handle_stall(1.01)
    assert line.results == []


def test_a_round_is_interrupted_once_at_most() -> None:
    line = Line(quarantine=0.1)
    line.reads(1, 2, 3)
    line.reads(11, 12, priority=Priority.USERS)
    sent = ['1?']
    for step in range(1, 5):
        line.answer(0, 1.0 + 0.01 * step)
        sent += line.at(1.001 + 0.01 * step)
    assert sent == ['1?', '2?', '3?', '11?', '12?']


def test_users_are_owed_a_step_after_each_round() -> None:
    line = Line(quarantine=0.1)
    line.reads(1)
    line.answer(0, 1.01)
    line.reads(11, 12, 13, priority=Priority.USERS, now=1.011)
    line.reads(2, 3, now=1.012)
    line.reads(4, now=1.012)
    sent = []
    for step in range(2, 7):
        line.answer(0, 1.0 + 0.01 * step)
        sent += line.at(1.001 + 0.01 * step)
    assert sent == ['2?', '3?', '12?', '4?', '13?']


def test_writes_that_go_first_do_not_wait_for_answers() -> None:
    line = Line(quarantine=0.1)
    line.reads(1)
    line.transactor.write_first(ParameterWrite(52, (1,), False), nobody, 1.01)
    assert line.sent() == ['52!']
    line.transactor.write_first(ParameterWrite(52, (0,), False), nobody, 1.0105)
    assert line.channel.due == pytest.approx(1.011)
    assert line.at(1.011) == ['52!']
    assert line.transactor.outstanding is not None
    assert line.channel.due == pytest.approx(1.1)


def test_a_round_waits_for_one_attempt_and_its_silence_at_most() -> None:
    line = Line(quarantine=0.1, attempts=3)
    line.reads(11, priority=Priority.USERS)
    line.reads(1, now=1.01)
    assert line.at(1.1) == []
    assert line.at(1.2001) == ['1?']


def test_silence_after_a_read_that_nobody_answered() -> None:
    line = Line(quarantine=0.3, attempts=1)
    line.reads(1, 2)
    assert line.at(1.1) == []
    assert line.channel.due == pytest.approx(1.4)
    line.channel.disturbed(1.35)
    assert line.at(1.6) == []
    assert line.at(1.6501) == ['2?']
