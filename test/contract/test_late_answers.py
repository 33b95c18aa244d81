# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Answers that come after the time-out, in any order: none is taken for that to a later question.

What comes later than two time-outs after the request cannot be told from a new answer.
"""

from abc import abstractmethod
from dataclasses import replace
import heapq
from pathlib import Path
import random

import builders
from builders import EEPROM, INT16, parameter, RAM, RO
from conversation import Conversation
from extent import some, times
import pytest

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.events import RequestCompleted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.requests import (
    Failure, ReadRequest, ReadValue, Request, WriteRequest, Written,
)
from drive_can_bridge.protocols.families import FAMILIES

TIMEOUT = 0.1
REQUESTS = times(500, 1_500)
SPEED = parameter('speed', 200, access=RO)
ACTUAL = parameter('actual', None, type=INT16, access=RO)
REGISTERS = tuple(parameter(f'register_{number}', number, storage=RAM if number < 42 else EEPROM)
                  for number in (30, 31, 40, 42))
#: the same as objects
OBJECTS = tuple(replace(each, index=0x2000 + (each.number or 0), subindex=0)
                for each in (SPEED, *REGISTERS))


class Partner:
    """A drive whose parameters change when they are written, and which answers when it likes."""

    drive: DriveConfiguration

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.answers: list[tuple[float, int, Frame]] = []
        self.answered = 0
        #: number -> (since when, value)
        self.history: dict[int, list[tuple[float, int]]] = {
            parameter_.number or 0: [(0.0, 0)] for parameter_ in REGISTERS}

    @abstractmethod
    def hear(self, frame: Frame, now: float) -> None:
        """Take a frame of the bridge."""

    def answer(self, frame: Frame, at: float) -> None:
        self.answered += 1
        heapq.heappush(self.answers, (at, self.answered, frame))

    def late(self, now: float, frame: Frame) -> None:
        """Answer late, or never, or soon."""
        dice = self.chance.random()
        if dice < 0.4:
            self.answer(frame, now + self.chance.uniform(TIMEOUT, 1.95 * TIMEOUT))
        elif dice < 0.9:
            self.answer(frame, now + self.chance.uniform(0.0002, 0.004))

    def value(self, number: int) -> int:
        return self.history[number][-1][1]

    def write(self, number: int, value: int, now: float) -> None:
        self.history[number].append((now, value))

    def held(self, number: int, since: float) -> set[int]:
        """Return what a register held from then on."""
        earlier = [value for at, value in self.history[number] if at <= since][-1:]
        return {*earlier, *(value for at, value in self.history[number] if at > since)}


class DataModelPartner(Partner):
    """Station 1 with 29-bit identifiers."""

    drive = builders.drive(
        'datamodel_extended', mapping='assume', request=(), response=(SPEED,),
        table=(SPEED, *REGISTERS), parameter_timeout=TIMEOUT, parameter_retries=1,
        missed_limit=1000)

    def hear(self, frame: Frame, now: float) -> None:
        number, count = frame.identifier >> 4 & 0xFFFF, frame.identifier & 0xF
        answer = frame.identifier | 0x10000000
        if number == 0xFFFF:
            self.answer(Frame(answer, bytes(8), True), now + 0.001)
        elif frame.identifier & 0x00100000:
            for place in range(count):
                self.write(number + place,
                           int.from_bytes(frame.data[2 * place:2 * place + 2], 'big'), now)
        else:
            words = b''.join(self.value(number + place).to_bytes(2, 'big')
                             for place in range(count))
            self.late(now, Frame(answer, words.ljust(8, b'\0'), True))


class NordPartner(Partner):
    """Inverter 1; responses to writes come as late as those to reads."""

    drive = builders.drive(
        'cannord', request=(), response=(ACTUAL,), table=(ACTUAL, *REGISTERS),
        parameter_timeout=TIMEOUT, parameter_retries=1, missed_limit=1000)

    def hear(self, frame: Frame, now: float) -> None:
        if frame.identifier == 0x002:
            self.answer(Frame(0x003, bytes.fromhex('310B0000'), False), now + 0.001)
            return
        assert frame.identifier == 0x202
        pke, word = (int.from_bytes(frame.data[at:at + 2], 'little') for at in (0, 6))
        task, number = pke >> 12, pke & 0x7FF
        if task != 1:
            self.write(number, word, now)
        self.late(now, Frame(0x203, ((1 << 12) | number).to_bytes(2, 'little') + bytes(4)
                             + self.value(number).to_bytes(2, 'little'), False))


class ServoPartner(Partner):
    """Node 1 of CiA 402: registers are objects from 2000h on."""

    drive = builders.drive(
        'cia402', mode='pv', mapping='assume', request=(), table=OBJECTS, response=(OBJECTS[0],),
        parameter_timeout=TIMEOUT, parameter_retries=1, missed_limit=1000,
        heartbeat_producer=0.0, heartbeat_timeout=0.0)

    def hear(self, frame: Frame, now: float) -> None:
        if frame.identifier == 0x080:
            self.answer(Frame(0x181, bytes.fromhex('50020000'), False), now + 0.001)
        if frame.identifier != 0x601:
            return
        command, index = frame.data[0], int.from_bytes(frame.data[1:3], 'little')
        if not 0x2000 <= index < 0x3000:
            answer = {0x6041: '4B41600050020000', 0x6060: '6060600000000000'}.get(index)
            data = bytes.fromhex(answer) if answer else (
                b'\x80' + frame.data[1:4] + bytes.fromhex('00000206'))
            self.answer(Frame(0x581, data, False), now + 0.001)
            return
        if command == 0x2B:
            self.write(index - 0x2000, int.from_bytes(frame.data[4:6], 'little'), now)
            self.late(now, Frame(0x581, b'\x60' + frame.data[1:4] + bytes(4), False))
        else:
            assert command == 0x40
            value = self.value(index - 0x2000).to_bytes(2, 'little')
            self.late(now, Frame(0x581, b'\x4B' + frame.data[1:4] + value + bytes(2), False))


KINDS = {'cannord': NordPartner, 'cia402': ServoPartner, 'datamodel_extended': DataModelPartner}
#: where the same is shown of families whose answers say less of what they answer
ELSEWHERE = {'canopen_pkw': 'protocols/canopen_pkw/test_pkw_round.py',
             'datamodel_standard': 'protocols/datamodel/test_standard_late.py'}


def test_every_family_is_here_or_elsewhere() -> None:
    assert {*KINDS, *ELSEWHERE} == set(FAMILIES)
    assert all((Path(__file__).parents[1] / path).is_file() for path in ELSEWHERE.values())


@pytest.mark.parametrize('seed', some([1, 2], 2))
@pytest.mark.parametrize('kind', KINDS.values(), ids=KINDS)
def test_no_read_ever_gives_what_was_overwritten(kind: type[Partner], seed: int) -> None:
    chance = random.Random(seed)
    partner = kind(chance)
    session = Conversation(kind.drive).session
    registers = list(kind.drive.profile.parameters.values())[1:]
    now = 10.0
    session.bus_up(now)
    session.activate(now)
    submitted: dict[int, float] = {}
    read = written = failed = asked = 0
    values = iter(chance.sample(range(1, 0x10000), REQUESTS))
    while asked < REQUESTS or submitted:
        due = session.next_timer()
        if partner.answers and partner.answers[0][0] <= due:
            now, _, frame = heapq.heappop(partner.answers)
            session.receive_frame(frame, now)
        else:
            now = max(now, due)
            session.handle_timer(now)
        if asked < REQUESTS and len(submitted) < 2 and chance.random() < 0.5:
            asked += 1
            request: Request = (
                WriteRequest(((chance.choice(registers), next(values)),), False)
                if chance.random() < 0.5 else
                ReadRequest(tuple(chance.sample(registers, chance.randint(1, 2)))))
            submitted[id(request)] = now
            session.services.submit(request, now)
        for frame in session.take_frames():
            partner.hear(frame, now)
        session.frames_left(now)
        for event in session.take_events():
            if not isinstance(event, RequestCompleted):
                continue
            since = submitted.pop(id(event.request))
            if isinstance(event.request, ReadRequest):
                for parameter_, outcome in zip(event.request.parameters, event.outcomes):
                    if isinstance(outcome, ReadValue):
                        read += 1
                        assert outcome.raw in partner.held(parameter_.number or 0, since)
                    else:
                        failed += 1
                continue
            (parameter_, raw), = event.request.items
            outcome, = event.outcomes
            if isinstance(outcome, Written):
                written += 1
                assert raw in partner.held(parameter_.number or 0, since)
            else:
                failed += 1
                assert isinstance(outcome, Failure)
                assert 'no answer' in outcome.reason
    assert min(read, written, failed) > times(16, 100)
    assert session.statistics.late > REQUESTS / 15, 'late answers are counted'
