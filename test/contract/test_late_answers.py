# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Answers that come after the time-out, in any order: none is taken for that to a later question.

What comes later than two time-outs after the request cannot be told from a new answer.
"""

from collections.abc import Callable
from pathlib import Path
import random
import re

from builders import EEPROM, parameter, RAM
from drives import Motor
from extent import some, times
from partners import PARTNERS
import pytest
from timeline import Timeline

from drive_can_bridge.core.events import RequestCompleted
from drive_can_bridge.core.requests import (
    Failure, ReadRequest, ReadValue, Request, WriteRequest, Written,
)

TIMEOUT = 0.1
REQUESTS = times(500, 1_500)
REGISTERS = tuple(parameter(f'register_{number}', number, storage=RAM if number >= 40 else EEPROM)
                  for number in (30, 31, 40, 42))


class History(Motor):
    """Registers, and what each has held: number -> (since when, value)."""

    def __init__(self, rest: dict[int, int], now: Callable[[], float]) -> None:
        super().__init__(rest)
        self.now = now
        self.history = {number: [(0.0, raw)] for number, raw in self.items()}

    def __setitem__(self, number: int, raw: int) -> None:
        super().__setitem__(number, raw)
        self.history[number].append((self.now(), raw))

    def held(self, number: int, since: float) -> set[int]:
        """Return what a register held from then on."""
        earlier = [value for at, value in self.history[number] if at <= since][-1:]
        return {*earlier, *(value for at, value in self.history[number] if at > since)}


class Line(Timeline):
    """
    A drive of a family, which answers users when it likes, and its cycles in time.

    :param late: returns s until an answer; None: it is lost.
    """

    def __init__(self, family: str, late: Callable[[], float | None]) -> None:
        self.partner = partner = PARTNERS[family](
            request=(), parameter_timeout=TIMEOUT, parameter_retries=1, missed_limit=1000)
        super().__init__(partner.talk, self.heard)
        self.late = late
        # no setpoint is mapped
        self.registers = partner.registers = partner.device.registers = History(
            {**partner.registers, 122: 0}, lambda: self.talk.now)
        self.own = {each: partner.own(each) for each in REGISTERS}
        self.took(self.talk.begins())
        self.live(11.0)
        assert self.talk.session.online

    def heard(self, text: str) -> tuple[float, str] | None:
        answers = self.partner.answers(text)
        delay = self.late() if re.match(self.partner.parameters, text) else 0.001
        return (delay, answers[0]) if answers and delay is not None else None

    def submits(self, request: Request) -> None:
        self.took(self.talk.submits(request, self.talk.now))


#: where the same is shown of families whose answers say less of what they answer
ELSEWHERE = {'canopen_pkw': 'protocols/canopen_pkw/test_pkw_round.py',
             'datamodel_standard': 'protocols/datamodel/test_standard_late.py'}


def test_what_is_shown_elsewhere_is_there() -> None:
    assert all((Path(__file__).parents[1] / path).is_file() for path in ELSEWHERE.values())


@pytest.mark.parametrize('seed', some([1, 2], 2))
@pytest.mark.parametrize('family', sorted({*PARTNERS} - {*ELSEWHERE}))
def test_no_read_ever_gives_what_was_overwritten(family: str, seed: int) -> None:
    chance = random.Random(seed)

    def late() -> float | None:
        """Answer late, or never, or soon."""
        dice = chance.random()
        if dice < 0.4:
            return chance.uniform(TIMEOUT, 1.95 * TIMEOUT)
        return chance.uniform(0.0002, 0.004) if dice < 0.9 else None
    line = Line(family, late)
    talk, held = line.talk, line.registers.held
    numbers = {own.name: each.number or 0 for each, own in line.own.items()}
    registers = list(line.own.values())
    submitted: dict[int, float] = {}
    read = written = failed = asked = 0
    values = iter(chance.sample(range(1, 0x10000), REQUESTS))
    while asked < REQUESTS or submitted:
        line.live(talk.now + chance.uniform(0.0, 0.01))
        if asked < REQUESTS and len(submitted) < 2 and chance.random() < 0.5:
            asked += 1
            request: Request = (
                WriteRequest(((chance.choice(registers), next(values)),), False)
                if chance.random() < 0.5 else
                ReadRequest(tuple(chance.sample(registers, chance.randint(1, 2)))))
            submitted[id(request)] = talk.now
            line.submits(request)
        for event in talk.events(RequestCompleted):
            since = submitted.pop(id(event.request))
            if isinstance(event.request, ReadRequest):
                for parameter_, outcome in zip(event.request.parameters, event.outcomes):
                    if isinstance(outcome, ReadValue):
                        read += 1
                        assert outcome.raw in held(numbers[parameter_.name], since)
                    else:
                        failed += 1
                continue
            (parameter_, raw), = event.request.items
            outcome, = event.outcomes
            if isinstance(outcome, Written):
                written += 1
                assert raw in held(numbers[parameter_.name], since)
            else:
                failed += 1
                assert isinstance(outcome, Failure)
                assert 'no answer' in outcome.reason
    assert min(read, written, failed) > times(16, 100)
    assert talk.session.statistics.late > REQUESTS / 15, 'late answers are counted'
