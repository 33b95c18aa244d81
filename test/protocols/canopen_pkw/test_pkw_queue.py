# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A device that queues requests, answers in order, and stands still for seconds now and then.

What a user is told to be written it has executed by then, whatever comes late or gets lost.
"""

from collections import deque
import math
from random import Random

from builders import write
from conversation import Conversation
from extent import some
from pkw_builders import CLASS, configuration, FLC, STATUS, STATUS_2
import pytest

from drive_can_bridge.core.events import RequestCompleted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.requests import Written

LOST = 0.01


class Queue:
    """
    Node 5: it acts when the function byte changes, which it sees when a request has its turn.

    :ivar written: what register 652 was given.
    """

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self._depth = chance.choice([4, 16, 1000])
        self._free_at = 0.0
        self._stands_at = 12.0
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._function_byte = 0
        self.written: set[int] = set()

    @property
    def due(self) -> float:
        return self._waiting[0][0] if self._waiting else math.inf

    def hears(self, sent: Frame, now: float) -> None:
        chance = self._chance
        if now >= self._stands_at:
            self._free_at = max(self._free_at, now + chance.choice([0.3, 0.8, 1.6, 2.5, 4.0, 7.0]))
            self._stands_at = self._free_at + chance.uniform(0.5, 6.0)
        if (sent.identifier == 0x505 and len(self._waiting) < self._depth
                and chance.random() >= LOST):
            self._free_at = max(self._free_at, now) + chance.uniform(0.0005, 0.02) * chance.choice(
                [1, 1, 1, 10])
            self._waiting.append((self._free_at, sent.data))

    def answers(self) -> list[Frame]:
        """Do what has its turn."""
        _, data = self._waiting.popleft()
        if data[3] == self._function_byte:
            return []
        self._function_byte = data[3]
        if data[3] & 0x7F == 0x2A:
            self.written.add(int.from_bytes(data[4:6], 'little'))
        return [] if self._chance.random() < LOST else [Frame(0x485, data[:4] + bytes(4), False)]


def story(seed: int) -> tuple[int, int]:
    """Write register 652 again and again; return how often it was, and was not."""
    chance = Random(seed)
    device, written, failed, now, next_at = Queue(chance), 0, 0, 10.0, 11.0
    session = Conversation(configuration(
        parameter_timeout=chance.choice([0.1, 0.2, 0.5]), period=chance.choice([0.1, 0.5, 2.0]),
        response=chance.choice([(STATUS,), (STATUS, STATUS_2), (STATUS, CLASS)]),
        parameter_retries=chance.choice([0, 2]), missed_limit=chance.choice([3, 1000]))).session
    values = chance.sample(range(5, 100), 60)
    session.bus_up(now)
    session.activate(now)
    while values:
        due = session.next_timer()
        now = max(now, min(due, device.due, next_at))
        if device.due <= min(due, next_at):
            for answer in device.answers():
                session.receive_frame(answer, now)
        elif next_at <= due:
            next_at = now + chance.expovariate(1.5)
            session.services.submit(write((FLC, values.pop())), now)
        else:
            session.handle_timer(now)
        for sent in session.take_frames():
            device.hears(sent, now)
        session.frames_left(now)
        for event in session.take_events():
            if isinstance(event, RequestCompleted):
                (_, raw), = event.request.items     # type: ignore[union-attr]
                if event.outcomes == (Written(),):
                    written += 1
                    assert raw in device.written
                else:
                    failed += 1
    return written, failed


@pytest.mark.parametrize('first', some(range(0, 100, 10), 3))
def test_what_is_told_to_be_written_is(first: int) -> None:
    written, failed = (sum(counts) for counts in zip(*map(story, range(first, first + 10))))
    assert min(written, failed) > 50
