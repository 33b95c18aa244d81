# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A drive whose answers come later than a period has stopped only if the stop was answered.

What it answers to cycles of before shows nothing. A drive that is deaf from the stop on runs on,
and is named as one that may; one that heard it is not, whatever got lost before.
"""

from collections.abc import Sequence
from functools import partial
from itertools import product
import math
from typing import Any

from builders import frame
from coming import Coming
from extent import some
import kinds
import pytest
from stops import UNANSWERED_CYCLES

from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.events import AnswerLate, Event, FrameRejected, Noted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.families import make_sessions

KINDS = ('CiA 402', 'CANnord', 'CANnord, group of two', 'CANnord, group of three',
         'CANnord, group of four',
         '29 bit, no word', '29 bit, word in its slot', '29 bit, no word, maps assumed',
         '29 bit, maps assumed, word in its slot')


class Bus:
    """Sessions that share a bus, and drives whose answers take a while."""

    def __init__(self, kind: str, period: float, delay: float, missed_limit: int = 3) -> None:
        configurations = kinds.KINDS[kind].configure(
            period=period, missed_limit=missed_limit, parameter_timeout=0.2)
        self.devices = [kinds.KINDS[kind].make(lambda begins, moves: None, index)
                        for index in range(len(configurations))]
        self.sessions: Sequence[Session] = make_sessions(configurations)
        self.events: list[list[Event]] = [[] for _ in self.sessions]
        self.delay = delay
        self.now = 10.0
        self.deaf: set[int] = set()
        self.lose = 0           # so many answers get lost
        self.copies = 1         # of each answer arrive
        self.held_until = -math.inf     # by a gateway, which then lets them go
        self.coming = Coming()
        self.sent: list[tuple[float, Frame]] = []
        for session in self.sessions:
            session.bus_up(self.now)
            session.activate(self.now)
        self.look()
        self.live(1.5)
        while not all(session.online for session in self.sessions) and self.now < 30.0:
            self.live(0.5)      # one that is set up first answers dozens of questions

    def look(self) -> None:
        for session, events in zip(self.sessions, self.events):
            while frames := session.take_frames():
                for each in frames:
                    self.sent.append((self.now, each))
                    for index, device in enumerate(self.devices):
                        if index not in self.deaf:
                            self.answer(index, device.takes(each))
                session.frames_left(self.now)
            events += session.take_events()

    def answer(self, index: int, answers: list[Frame]) -> None:
        for each in answers:
            if self.lose > 0:
                self.lose -= 1
            else:
                for _ in range(self.copies):
                    self.coming.plan(max(self.now + self.delay, self.held_until), partial(
                        self.arrives, self.sessions[index], each))

    def arrives(self, session: Session, answer: Frame) -> None:
        session.receive_frame(answer, self.now)

    def live(self, seconds: float) -> 'Bus':
        end = self.now + seconds
        self.coming.live(
            self, end, due=lambda: min(session.next_timer() for session in self.sessions),
            timers=self.timers, then=self.look)
        self.now = end
        return self

    def timers(self) -> None:
        for session in self.sessions:
            session.handle_timer(self.now)

    def run(self) -> 'Bus':
        leader = self.sessions[0]
        assert all(session.online for session in self.sessions)
        if leader.control is not None:
            leader.services.submit(ControlRequest(ControlAction.ENABLE), self.now)
            self.look()
            self.live(1.0)
        for value in (0.0, 100.0):
            leader.services.command(0, value, self.now)
            self.live(max(0.15, 1.1 * leader.configuration.period))
        assert all(device.registers.runs for device in self.devices)
        return self

    def run_on(self, seconds: float) -> 'Bus':
        """Go on with commands, which grow old."""
        end = self.now + seconds
        while self.now < end:
            self.sessions[0].services.command(0, 100.0, self.now)
            self.live(min(0.1, end - self.now))
        return self

    def stop(self) -> list[bool]:
        """End; return of which drives it was said that they may still be running."""
        for events in self.events:
            events.clear()
        end = self.now + 0.5 + max(session.longest_stop for session in self.sessions)
        for session in self.sessions:
            session.deactivate(self.now)
        self.look()
        self.live(end - self.now)
        assert all(session.stopped for session in self.sessions)
        return [any(isinstance(event, Noted) and event.danger for event in events)
                for events in self.events]


def told_to_run(device: Any) -> bool:
    return bool(device.registers.runs or device.registers[50] or device.registers.get(52))


LAGS = [(period, lag * period) for period in (0.01, 0.05) for lag in (
    0.2, 0.9, 1.3, 1.6, 2.2, 2.7)]
#: longer than what sets up a servo waits for an answer
LONG_LAGS = [(0.15, 0.4), (0.2, 0.45)]
BEHIND = some([(kind, *lag) for kind in KINDS for lag in (*LAGS, *LONG_LAGS)
               if kind != 'CiA 402' or lag in LAGS], 3)


@pytest.mark.parametrize(('kind', 'period', 'delay'), BEHIND)
def test_a_drive_that_is_deaf_from_the_stop_on_is_named(
        kind: str, period: float, delay: float) -> None:
    for place in some(range(5), 5):
        bus = Bus(kind, period, delay).run().live(0.2 * place * period)
        bus.deaf = set(range(len(bus.devices)))
        assert bus.stop() == [True] * len(bus.devices)


@pytest.mark.parametrize(('kind', 'period', 'delay'), BEHIND)
def test_a_drive_that_heard_the_stop_is_not(kind: str, period: float, delay: float) -> None:
    for place in some(range(5), 5):
        bus = Bus(kind, period, delay).run().live(0.2 * place * period)
        assert bus.stop() == [False] * len(bus.devices)
        assert not any(told_to_run(device) for device in bus.devices)


@pytest.mark.parametrize('lag', [0.2, 0.9, 1.4, 2.2])
@pytest.mark.parametrize('kind', KINDS)
def test_answers_that_come_twice_show_no_stop(kind: str, lag: float) -> None:
    """A gateway doubles frames: what seems to answer the stop answers a cycle before it."""
    bus = Bus(kind, 0.02, lag * 0.02).run()
    bus.copies = 2
    bus.run_on(0.9)
    assert all(device.registers.runs for device in bus.devices)
    bus.deaf = set(range(len(bus.devices)))
    bus.live(0.003)
    assert bus.stop() == [True] * len(bus.devices)


@pytest.mark.parametrize('kind', [kind for kind in KINDS if 'word' not in kind or 'slot' in kind])
def test_a_stop_of_a_user_is_answered_though_answers_come_twice(kind: str) -> None:
    bus = Bus(kind, 0.02, 0.002).run()
    bus.copies = 2
    bus.run_on(0.9)
    leader = bus.sessions[0]
    leader.services.submit(ControlRequest(ControlAction.DISABLE), bus.now)
    bus.look()
    bus.live(1.0)
    ended, = [event for event in bus.events[0] if isinstance(event, ControlCompleted)
              and event.request.action is ControlAction.DISABLE]
    assert ended.success
    assert not any(device.registers.runs for device in bus.devices)


@pytest.mark.parametrize(('kind', 'lost', 'silence'), some(
    product(KINDS, [1, 2, 5, 40], [0.0, 1.7]), 3))
def test_what_was_lost_before_is_no_doubt(kind: str, lost: int, silence: float) -> None:
    """A hundred answers are lost, one at a time: none of that says that they run behind."""
    bus = Bus(kind, 0.02, 0.002)
    if silence:
        everybody = set(range(len(bus.devices)))
        bus.deaf = everybody
        bus.live(silence)
        bus.deaf = set()
        bus.live(2.5)
    bus.run()
    for _ in range(lost):
        bus.lose = 1
        bus.live(0.3)
        for session in bus.sessions[:1]:
            session.services.command(0, 100.0, bus.now)
    if not all(device.registers.runs for device in bus.devices):
        bus.live(2.0)
        bus.run()
    assert bus.stop() == [False] * len(bus.devices)


@pytest.mark.parametrize('kind', KINDS)
def test_a_drive_that_misses_three_cycles_of_its_stop_gets_more(kind: str) -> None:
    bus = Bus(kind, 0.02, 0.002).run()
    everybody = set(range(len(bus.devices)))
    bus.deaf = everybody
    begun = bus.now
    for session in bus.sessions:
        session.deactivate(bus.now)
    bus.look()
    bus.live(0.09)      # three cycles
    bus.deaf = set()
    bus.sent.clear()
    bus.live(2.0)
    assert all(session.stopped for session in bus.sessions)
    assert not any(told_to_run(device) for device in bus.devices)
    assert not any(isinstance(event, Noted) and event.danger
                   for events in bus.events for event in events)
    assert bus.sent
    assert bus.sent[-1][0] - begun < 0.4


@pytest.mark.parametrize('kind', KINDS)
def test_one_that_hears_nothing_gets_up_to_three_more(kind: str) -> None:
    bus = Bus(kind, 0.02, 0.002).run()
    bus.deaf = set(range(len(bus.devices)))
    bus.sent.clear()
    bus.stop()
    cycles = '400' if 'group' in kind else '002' if 'CANnord' in kind else '003FFFF0'
    cycles = '201' if kind == 'CiA 402' else cycles
    assert len([
        each for _, each in bus.sent if str(each).startswith(f'{cycles}#')]) == UNANSWERED_CYCLES


@pytest.mark.parametrize('members', [2, 4])
def test_members_that_did_not_answer_get_frames_of_their_own(members: int) -> None:
    """Two are deaf to broadcasts and to three cycles of the stop."""
    bus = Bus(f'CANnord, group of {"two" if members == 2 else "four"}', 0.02, 0.002).run()
    deaf = {0, members - 1}
    bus.deaf = set(deaf)
    for session in bus.sessions:
        session.deactivate(bus.now)
    bus.look()
    bus.live(0.09)
    for index in deaf:
        bus.devices[index].obeys = (bus.devices[index].alone,)
    bus.deaf = set()
    bus.sent.clear()
    bus.live(2.0)
    assert not any(told_to_run(device) for device in bus.devices)
    alone = {f'{2 * index + 2:03X}' for index in deaf}
    assert {str(each)[:3] for _, each in bus.sent} == {'400', *alone}


@pytest.mark.parametrize('refused', ['002', '004', '006', '008'])
def test_members_that_a_broadcast_alone_started_are_named(refused: str) -> None:
    """The bus takes the broadcast that starts them all, and no frame of a member."""
    bus = Bus('CANnord, group of four', 0.02, 0.002)
    leader = bus.sessions[0]
    leader.services.submit(ControlRequest(ControlAction.ENABLE), bus.now)
    while not bus.devices[1].registers.runs:
        for session in bus.sessions:
            session.handle_timer(bus.now)
        frames = leader.take_frames()
        if frames:
            for each in frames[:1]:
                for device in bus.devices:
                    device.takes(each)
            leader.frames_left(bus.now, set(range(1, len(frames))))
        else:
            bus.now = leader.next_timer()
        bus.look()
        bus.live(0.0)
        if not frames or not bus.devices[1].registers.runs:
            bus.live(0.019)
    bus.deaf = set(range(4))
    assert bus.stop() == [True] * 4


@pytest.mark.parametrize('delay', [0.025, 0.03, 0.035, 0.038, 0.05, 0.07])
@pytest.mark.parametrize('members', ['two', 'four'])
def test_a_group_whose_answers_take_longer_than_a_period_comes_online(
        members: str, delay: float) -> None:
    bus = Bus(f'CANnord, group of {members}', 0.02, delay).run()
    assert not any(isinstance(event, FrameRejected)
                   for events in bus.events for event in events)


# -- answers that are held, and come all at once --------------------------------------------------


#: period, ``missed_limit``, s of answers that are held until the stop, and from then on
HELD = [(0.2, 3, 0.56, 0.5), (0.2, 3, 0.5, 0.45), (0.2, 3, 0.42, 0.3), (0.1, 30, 0.55, 0.45),
        (0.1, 30, 0.25, 0.3), (0.1, 30, 0.65, 0.3), (0.1, 30, 1.5, 0.55), (0.02, 3, 0.05, 0.3),
        (0.02, 100, 0.6, 0.06), (0.02, 100, 0.6, 0.2)]
ALONE = [kind for kind in KINDS if 'group' not in kind]


@pytest.mark.parametrize(('kind', 'period', 'limit', 'held', 'longer'), some(
    [(kind, *each) for kind in ALONE for each in HELD], 3))
def test_what_was_held_until_a_stop_does_not_show_it(
        kind: str, period: float, limit: int, held: float, longer: float) -> None:
    for place in some(range(5), 5):
        bus = Bus(kind, period, 0.002, limit).run().run_on(0.2 * place * period)
        bus.held_until = bus.now + held + longer
        bus.run_on(held)
        bus.deaf = {0}
        assert bus.stop() == [True]
        assert bus.devices[0].registers.runs


@pytest.mark.parametrize(('held', 'longer'), [(0.25, 0.15), (0.65, 0.3), (1.5, 0.8), (1.5, 1.2)])
def test_what_was_held_until_a_quick_stop_does_not_show_it(held: float, longer: float) -> None:
    for place in some(range(5), 5):
        bus = Bus('29 bit, no word, maps assumed', 0.1, 0.002, 30).run().run_on(0.02 * place)
        bus.held_until = bus.now + held + longer
        bus.run_on(held)
        bus.deaf = {0}
        bus.sessions[0].services.submit(ControlRequest(ControlAction.QUICK_STOP), bus.now)
        bus.look()
        bus.live(2.5)
        done, = (each for each in bus.events[0] if isinstance(each, ControlCompleted))
        assert (done.success, done.message.code) == (False, 'may_still_be_running')


@pytest.mark.parametrize(('kind', 'period', 'limit', 'lost'), some(
    [(kind, *each) for kind in ALONE for each in (
        (0.2, 3, 2), (0.2, 30, 12), (0.1, 30, 4), (0.1, 30, 20), (0.02, 100, 3),
        (0.02, 100, 80))], 5))
def test_what_was_lost_until_a_stop_is_no_doubt(
        kind: str, period: float, limit: int, lost: int) -> None:
    for place in some(range(5), 5):
        bus = Bus(kind, period, 0.002, limit).run().run_on(0.2 * place * period)
        bus.lose = 1000
        bus.run_on(lost * period)
        bus.lose = 0
        assert bus.stop() == [False]


@pytest.mark.parametrize(('period', 'limit', 'lost'), [
    (0.4, 3, 1), (0.4, 30, 12), (0.2, 30, 12), (0.1, 30, 20), (0.02, 100, 80)])
def test_what_was_lost_until_a_quick_stop_is_no_doubt(
        period: float, limit: int, lost: int) -> None:
    for place in some(range(5), 5):
        bus = Bus('29 bit, no word, maps assumed', period, 0.002, limit).run()
        bus.run_on(0.2 * place * period)
        bus.lose = 1000
        bus.run_on(lost * period)
        bus.lose = 0
        bus.sessions[0].services.submit(ControlRequest(ControlAction.QUICK_STOP), bus.now)
        bus.look()
        bus.live(2.5)
        done, = (each for each in bus.events[0] if isinstance(each, ControlCompleted))
        assert done.success


# -- late answers are counted, and are no sign of a second station --------------------------------


SINGLE = ['CANnord', '29 bit, no word', '29 bit, maps assumed, word in its slot']


@pytest.mark.parametrize('kind', SINGLE)
def test_late_answers_are_counted_and_told_once_in_a_while(kind: str) -> None:
    bus = Bus(kind, 0.02, 0.002)
    bus.events[0].clear()
    statistics = bus.sessions[0].statistics
    missed = statistics.missed
    for number in range(1, 6):
        # one answer takes 24 ms, and meets that to the next cycle
        bus.delay = 0.0238
        bus.live(0.02)
        bus.delay = 0.002
        bus.live(0.5)
        assert statistics.missed == missed + number
        assert statistics.late == number
    assert statistics.rejected == 0
    told = [event for event in bus.events[0] if isinstance(event, AnswerLate)]
    assert len(told) == 1
    bus.live(10.0)
    bus.delay = 0.0238
    bus.live(0.02)
    bus.delay = 0.002
    bus.live(0.5)
    told = [event for event in bus.events[0] if isinstance(event, AnswerLate)]
    assert len(told) == 2


@pytest.mark.parametrize('kind', SINGLE)
def test_at_most_one_for_each_missed_exchange(kind: str) -> None:
    """A second station answers, too: that is rejected."""
    bus = Bus(kind, 0.02, 0.002)
    statistics = bus.sessions[0].statistics
    bus.lose = 2
    bus.live(0.2)
    assert (statistics.missed, statistics.late, statistics.rejected) == (2, 0, 0)
    twice = {'CANnord': '003#310B0000'}.get(kind, '103FFFF0#0000000000010000')
    for _ in range(5):
        bus.live(0.001)
        bus.sessions[0].receive_frame(frame(twice), bus.now)
        bus.look()
        bus.live(0.0005)
    assert statistics.late <= 2
    assert statistics.rejected >= 3 - 1


@pytest.mark.parametrize(('held', 'missed'), [(0.28, 2), (0.7, 6), (1.5, 14), (4.0, 39)])
@pytest.mark.parametrize('kind', ['CANnord', '29 bit, maps assumed, word in its slot'])
def test_answers_that_were_held_are_late_however_late(
        kind: str, held: float, missed: int) -> None:
    bus = Bus(kind, 0.1, 0.002).live(0.05)
    statistics = bus.sessions[0].statistics
    bus.held_until = bus.now + held
    bus.live(held + 1.0)
    assert (statistics.missed, statistics.late, statistics.rejected) == (missed, missed, 0)


@pytest.mark.parametrize('kind', ['CANnord', '29 bit, maps assumed, word in its slot'])
def test_what_was_missed_long_ago_hides_no_second_station(kind: str) -> None:
    bus = Bus(kind, 0.1, 0.002)
    bus.deaf = {0}
    bus.live(3.0)
    bus.deaf = set()
    bus.live(1.0)
    statistics = bus.sessions[0].statistics
    rejected, late = statistics.rejected, statistics.late
    assert (rejected, late) == (0, 0)
    twice = {'CANnord': '003#310B0000'}.get(kind, '103FFFF0#0000000000010000')
    for _ in range(20):
        bus.live(0.1)
        bus.sessions[0].receive_frame(frame(twice), bus.now)
        bus.look()
    assert statistics.rejected > 10
