# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The cycles of a family that has no more to say than it must: one frame each way."""

import math
from typing import Any

from builders import CONTROL, drive, SPEED, WORD
import pytest
from saying import says

from drive_can_bridge.core.control import ControlAction, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.drive_services import DriveServices, RequestServer
from drive_can_bridge.core.events import (
    AnswerLate, FrameRejected, Noted, StationFound, StationLost)
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.protocols.answers import CycleAnswers
from drive_can_bridge.protocols.cyclic_exchange import CyclicExchange

REQUEST = 0x10


class Silent:
    """A channel with nothing to do, for a family without acyclic frames."""

    waiting = 0
    due = math.inf

    def advance(self, now: float) -> None:
        pass

    def handle_stall(self, now: float) -> None:
        pass

    def clear(self) -> None:
        pass

    cancel = clear

    def serve(self, *arguments: object) -> None:
        raise NotImplementedError


class Plain(Session):
    """As docs/architecture.md has it, and an answer that holds the status word."""

    def __init__(self, period: float, **options: Any) -> None:
        configuration = drive(control=CONTROL, request=(WORD, SPEED), period=period, **options)
        super().__init__(configuration, ControlMachine(CONTROL, timeout=2.0))
        server: RequestServer = Silent()
        self.services = DriveServices(self, server)
        self.answers = CycleAnswers(self, silence='no answer', advice='the plug')
        self.exchange = CyclicExchange(self.answers, self, slot=0)
        self.set_parts(self.exchange, channel=Silent())

    def begin(self, now: float) -> None:
        self.exchange.stop()
        self.exchange.start(now)

    def begin_stop(self, now: float) -> bool:
        self.exchange.stop_soon(now)
        return True

    @property
    def longest_stop(self) -> float:
        return self.exchange.longest_stop

    def update_control_word(self, now: float) -> None:
        self.exchange.hurry(now, setpoints=self.stop_pending)

    def encode_cycle(self, raws: list[int]) -> bytes:
        return bytes(raws)

    def send_cycle(self, telegram: bytes, now: float) -> None:
        self.exchange.put(Frame(REQUEST, telegram, False))
        self.exchange.expect_answer(now)

    def exchange_missed(self, reason: Sentence, now: float) -> None:
        self.answers.lose(reason, now)

    def last_cycle_left(self, now: float) -> None:
        self.exchange.end_stop()

    def receive_frame(self, frame: Frame, now: float, age: float = 0.0) -> None:
        if not self.answers.expects('answer', now, now - age):
            return
        self.answers.answered(now - age)
        if not self.online and self.stage is Stage.RUNNING:
            self.be_online()
        assert self.control is not None
        self.control.status_received(frame.data[0], now)
        self.control_changed(now)
        self.exchange.wait_out(now)


class Talk:
    """What is said, as times and payloads in hex."""

    def __init__(self, period: float = 0.02, **options: Any) -> None:
        self.session = Plain(period, **options)
        self.exchange = self.session.exchange
        self.session.bus_up(9.0)
        self.session.activate(10.0)

    def at(self, now: float) -> list[str]:
        self.session.handle_timer(now)
        return self.sent(now)

    def sent(self, now: float) -> list[str]:
        frames = self.session.take_frames()
        self.session.frames_left(now)
        return [frame.data.hex() for frame in frames]

    def answer(self, now: float, status: int = 1) -> None:
        self.session.receive_frame(Frame(REQUEST + 1, bytes([status]), False), now)


def test_once_a_period_as_long_as_it_answers() -> None:
    talk = Talk()
    assert talk.at(10.0) == ['0000']
    talk.answer(10.001)
    assert talk.session.take_events() == [StationFound()]
    assert talk.session.next_timer() == pytest.approx(10.02)
    for number in range(1, 5):
        assert talk.at(10.0 + 0.02 * number) == ['0000']
    reason = says('silent_for_cycles', what='no answer', cycles=3)
    assert talk.session.take_events() == [StationLost(reason)]
    assert talk.session.offline_advice == says('silent', what='no answer', look_at='the plug')
    assert talk.at(10.1) == ['0000'], 'which is how it is found again'
    talk.answer(10.101)
    assert talk.session.take_events() == [
        Noted(says('more_missed_would_hold', limit=6), warning=True), StationFound()]


def test_what_nobody_waits_for() -> None:
    talk = Talk()
    talk.at(10.0)
    talk.answer(10.001)
    talk.session.take_events()
    talk.answer(10.002)
    assert talk.session.take_events() == [FrameRejected(says('unasked', what='answer'))]
    talk.at(10.02)
    talk.at(10.04)
    talk.answer(10.041)
    talk.answer(10.042)
    assert talk.session.take_events() == [
        AnswerLate(pytest.approx(0.001), says('longer_period_would_hold')),
    ], 'one of them was late'


def test_what_stops_a_drive_is_brought_forward() -> None:
    talk = Talk(period=0.3)
    talk.at(10.0)
    talk.session.setpoints.changed = True
    talk.exchange.hurry(10.05, setpoints=False)
    assert talk.session.next_timer() == pytest.approx(10.3)
    talk.exchange.hurry(10.05, setpoints=True)
    assert talk.session.next_timer() == pytest.approx(10.05)


def test_what_starts_a_drive_waits_for_its_turn() -> None:
    talk = Talk(period=0.3)
    talk.at(10.0)
    talk.answer(10.001)
    talk.session.services.submit(ControlRequest(ControlAction.ENABLE), 10.01)
    assert talk.session.next_timer() == pytest.approx(10.3)
    assert talk.at(10.301) == ['0100']


def test_last_cycles_are_not_hurried() -> None:
    talk = Talk(period=0.3)
    talk.at(10.0)
    talk.session.deactivate(10.2)
    assert talk.session.next_timer() == pytest.approx(10.2)
    assert talk.at(10.2) == ['0000']
    talk.session.setpoints.changed = True
    talk.exchange.hurry(10.21, setpoints=True)
    assert talk.session.next_timer() == pytest.approx(10.3)
    assert talk.at(10.301) == talk.at(10.402) == ['0000']
    assert talk.session.stopped
    assert talk.session.next_timer() == math.inf


def test_nothing_is_left_of_an_exchange_that_was_stopped() -> None:
    talk = Talk()
    talk.at(10.0)
    talk.session.answers.settle(10.02)
    talk.session.answers.settle(10.02)
    talk.exchange.expect_answer(10.03)
    talk.exchange.stop_soon(10.03)
    assert talk.session.answers.book.missed_in_row == 1
    talk.exchange.stop()
    assert talk.exchange.due == math.inf
    assert talk.exchange.cycles_left == -1
    assert talk.session.answers.book.missed_in_row == 0
    talk.answer(10.04)
    assert talk.session.take_events() == [AnswerLate(pytest.approx(0.02))], 'it was on its way'


@pytest.mark.parametrize('answered', [True, False])
def test_the_answer_to_the_last_cycle_is_waited_for_where_the_drive_ran(answered: bool) -> None:
    talk = Talk()
    talk.at(10.0)
    talk.answer(10.001)
    talk.session.services.submit(ControlRequest(ControlAction.ENABLE), 10.01)
    talk.at(10.02)
    talk.answer(10.021)
    assert talk.at(10.04) == ['0100']
    talk.answer(10.041, 3)
    talk.session.take_events()
    talk.session.deactivate(10.05)
    for now in (10.06, 10.08, 10.1):
        assert talk.at(now) == ['0000']
    assert not talk.session.stopped
    assert talk.session.next_timer() == pytest.approx(10.2)
    if answered:
        talk.answer(10.15)
        assert talk.session.stopped
    else:   # three more, and then no more
        for now in (10.2, 10.22, 10.24):
            assert talk.at(now) == ['0000']
        assert talk.session.next_timer() == pytest.approx(10.34)
        assert talk.at(10.34) == []
        assert talk.session.stopped
    told = [event for event in talk.session.take_events() if 'does not answer' in str(event)]
    assert bool(told) is not answered


def slow(gap: float) -> Talk:
    """Have a drive lost, and answer so many s after its last answer."""
    talk = Talk()
    talk.at(10.0)
    talk.answer(10.001)
    for number in range(1, round(gap / 0.02) + 1):
        talk.at(10.0 + 0.02 * number)
    talk.session.take_events()
    talk.answer(10.001 + gap)
    return talk


def test_what_would_have_held_is_said_when_the_answer_comes() -> None:
    talk = slow(0.1)
    told = says('more_missed_would_hold', gap=pytest.approx(0.1), limit=6,
                seconds=pytest.approx(0.12))
    assert Noted(told, warning=True) in talk.session.take_events()
    # with that, it is not lost
    patient = Talk(missed_limit=6)
    patient.at(10.0)
    patient.answer(10.001)
    for number in range(1, 6):
        patient.at(10.0 + 0.02 * number)
    patient.answer(10.101)
    assert not [event for event in patient.session.take_events()
                if isinstance(event, StationLost)]


def test_what_would_have_held_is_said_once() -> None:
    talk = slow(0.1)
    talk.session.take_events()
    for number in range(6, 11):
        talk.at(10.0 + 0.02 * number)
    talk.answer(10.201)
    assert [event for event in talk.session.take_events() if isinstance(event, Noted)] == []


def test_nothing_would_have_held_for_a_drive_that_was_away() -> None:
    assert [event for event in slow(2.1).session.take_events() if isinstance(event, Noted)] == []


def test_a_longer_period_would_have_held_for_what_is_late() -> None:
    talk = Talk()
    talk.at(10.0)
    talk.answer(10.001)
    talk.at(10.02)
    talk.at(10.04)
    talk.session.take_events()
    for at in (10.049, 10.0491):
        talk.answer(at)
    late = says('longer_period_would_hold', late=pytest.approx(0.009), period=0.032)
    assert talk.session.take_events() == [AnswerLate(pytest.approx(0.009), late)]
    assert talk.session.answers.timing.late(0.009) == '', 'that is known by now'


def test_an_answer_that_is_late_and_taken_all_the_same_loses_nothing() -> None:
    """Of a group each drive has its turn: what comes before the next one is its answer."""
    talk = Talk()
    talk.session.answers.in_turn = True
    talk.at(10.0)
    talk.answer(10.001)
    talk.at(10.02)
    talk.session.answers.settle(10.04)
    talk.session.take_events()
    talk.answer(10.049)
    assert talk.session.take_events() == [AnswerLate(
        pytest.approx(0.009), says('longer_period_would_hold'), taken=True)]
