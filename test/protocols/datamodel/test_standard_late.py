# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Answers of 11-bit drives do not say what they answer. None may be taken for another.

The drive here answers late, twice, or not at all; every register holds a value that no other
register has ever had, so that an answer in the wrong place is seen.
"""

import heapq
import random

from builders import drive, parameter, RO, RW
from conversation import Conversation
from extent import some
import pytest
from timeline import Timeline

from drive_can_bridge.core.events import ProcessDataReceived, RequestCompleted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.requests import Failure, ReadRequest, ReadValue

#: where the round reads, and where users read
POLLED = tuple(parameter(f'polled_{number}', number, access=RO) for number in (200, 201, 210, 300))
ASKED = tuple(parameter(f'asked_{number}', number, access=RW) for number in range(20, 60, 3))


class LateDrive:
    """
    A drive that answers reads after a while of its own choosing.

    :param lateness: (random numbers) -> s until the answer comes; more than one, or none.
    """

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.reads = 0
        self.history: dict[int, set[int]] = {}
        self.words: dict[int, int] = {}
        self.fresh = iter(chance.sample(range(0x10000), 0x10000))
        self.answers: list[tuple[float, int, Frame]] = []

    def word(self, number: int) -> int:
        """Return what a register holds; now and then it changes."""
        if number not in self.words or self.chance.random() < 0.002:
            word = next(self.fresh, None)
            if word is not None:
                self.words[number] = word
                self.history.setdefault(number, set()).add(word)
        return self.words[number]

    def hear(self, frame: Frame, now: float) -> None:
        if frame.data[0] != 3:
            return
        self.reads += 1
        number = int.from_bytes(frame.data[1:3], 'little')
        words = [self.word(number + place) for place in range(frame.data[3])]
        data = b''.join(word.to_bytes(2, 'little') for word in words).ljust(8, b'\xEE')
        for lateness in self.latenesses():
            heapq.heappush(self.answers, (now + lateness, self.reads, Frame(0x7F1, data, False)))

    def latenesses(self) -> list[float]:
        dice = self.chance.random()
        if dice < 0.05:
            return []
        if dice < 0.25:
            return [0.15 + self.chance.uniform(-0.045, 0.045)]
        if dice < 0.27:
            return [0.002, 0.0025]
        return [self.chance.uniform(0.0002, 0.004)]


class SlowDrive(LateDrive):
    """Answers late or not at all, but never twice."""

    def latenesses(self) -> list[float]:
        return super().latenesses()[:1]


@pytest.mark.parametrize(('make', 'stumbles', 'reads', 'enough'), [
    (LateDrive, 0.0, 5_000, (200, 500, 50)), (SlowDrive, 0.1, 3_000, (50, 100, 0))])
@pytest.mark.parametrize('seed', some([1, 2], 2))
def test_no_answer_is_ever_taken_for_another(
        seed: int, make: type[LateDrive], stumbles: float, reads: int,
        enough: tuple[int, int, int]) -> None:
    """A process may stumble: then a tenth of all timers come up to 0.4 s too late."""
    chance = random.Random(seed)
    partner = make(chance)
    session = Conversation(drive(
        'datamodel_standard', table=(*POLLED, *ASKED), request=(), response=POLLED,
        parameter_retries=1)).session
    now = 10.0
    session.bus_up(now)
    session.activate(now)
    samples = good = failed = open_requests = 0
    while partner.reads < reads:
        due = session.next_timer()
        stalled = bool(stumbles) and chance.random() < stumbles
        if stalled:  # first the timer, then what lay in the buffer
            now = max(now, due) + chance.uniform(0.0, 0.4)
            session.handle_timer(now)
        elif partner.answers and partner.answers[0][0] <= due:
            now, _, heard = heapq.heappop(partner.answers)
            session.receive_frame(heard, now)
        else:
            now = max(now, due)
            session.handle_timer(now)
        buffered: list[Frame] = []
        while stalled and partner.answers and partner.answers[0][0] <= now:
            buffered.append(heapq.heappop(partner.answers)[2])
        for place in range(len(buffered) + 1):
            if open_requests < 3 and chance.random() < 0.3:
                open_requests += 1
                session.services.submit(ReadRequest(tuple(
                    chance.sample(ASKED, chance.randint(1, 4)))), now)
            for sent in session.take_frames():
                partner.hear(sent, now)
            for event in session.take_events():
                if isinstance(event, ProcessDataReceived):
                    samples += 1
                    for parameter_, raw in zip(POLLED, event.raws):
                        assert raw in partner.history[parameter_.number]
                elif isinstance(event, RequestCompleted):
                    open_requests -= 1
                    assert isinstance(event.request, ReadRequest)
                    for parameter_, outcome in zip(event.request.parameters, event.outcomes):
                        if isinstance(outcome, ReadValue):
                            good += 1
                            assert outcome.raw in partner.history[parameter_.number]
                        else:
                            failed += 1
                            assert isinstance(outcome, Failure)
                            assert 'no answer' in outcome.reason
            if place < len(buffered):
                now += 0.0005
                session.receive_frame(buffered[place], now)
    assert all(count > least for count, least in zip((samples, good, failed), enough, strict=True))
    assert stumbles or session.statistics.late > 500, 'late answers are counted'


def test_a_drive_that_is_always_150_ms_late_is_offline_and_nothing_is_published() -> None:
    talk = Conversation(drive('datamodel_standard', request=()))
    line = Timeline(talk, lambda text: (0.15, '7F1#0000000000000000'))
    talk.begins()
    line.live(60.0)
    assert talk.samples() == []
    assert not talk.session.online
    assert talk.session.statistics.missed > 100
