# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The runner of scripts: what is asked for, one thing after the other, until another begins."""

from collections.abc import Generator
import math
from typing import Any

from drive_can_bridge.protocols.channel import Channel
from drive_can_bridge.protocols.lifecycle import Lifecycle, Script


class Procedures(Channel[Any, Any]):
    """Takes procedures, and ends them when it is told to."""

    def __init__(self) -> None:
        self.now = 0.0
        self.asked: list[tuple[Any, Any]] = []

    def run(self, procedure: Generator[Any, Any, Any], done: Any, now: float) -> None:
        self.asked.append((next(procedure), done))

    def answer(self, found: Any, now: float) -> None:
        self.now = now
        _, done = self.asked.pop(0)
        done(found)

    @property
    def steps(self) -> list[Any]:
        return [step for step, _ in self.asked]


def procedure(step: str) -> Generator[str, Any, Any]:
    return (yield step)


def lifecycle() -> tuple[Procedures, Lifecycle]:
    channel = Procedures()
    return channel, Lifecycle(channel)


def test_procedures_and_times_come_back() -> None:
    channel, runner = lifecycle()
    seen = []

    def script() -> Script:
        seen.append((yield procedure('first')))
        seen.append((yield 12))
        seen.append((yield procedure('second')))

    runner.start(script(), 10.0)
    assert channel.steps == ['first']
    assert runner.due == math.inf
    channel.answer('found', 11.0)
    assert runner.due == 12
    runner.handle_timer(11.9)
    assert seen == ['found']
    runner.handle_timer(12.5)
    assert channel.steps == ['second']
    channel.answer(None, 13.0)
    assert seen == ['found', 12.5, None]
    assert runner.due == math.inf


def test_another_life_ends_the_one_before() -> None:
    channel, runner = lifecycle()
    told = []

    def script(name: str) -> Script:
        told.append((name, (yield procedure(name))))

    runner.start(script('old'), 10.0)
    runner.start(script('skipped'), 10.1)
    runner.start(script('new'), 10.2)
    assert channel.steps == ['old'], 'one at a time'
    channel.answer('late', 10.3)
    assert channel.steps == ['new']
    assert told == []
    channel.answer('found', 10.4)
    assert told == [('new', 'found')]


def test_life_that_waits_is_ended_too() -> None:
    channel, runner = lifecycle()

    def waiting() -> Script:
        yield 11.0
        raise AssertionError('it was ended')

    runner.start(waiting(), 10.0)
    runner.stop()
    runner.handle_timer(12.0)
    assert runner.due == math.inf
    assert channel.asked == []


def test_script_may_begin_another_life() -> None:
    channel, runner = lifecycle()

    def second() -> Script:
        yield 20.0

    def first() -> Script:
        runner.start(second(), 10.0)
        yield procedure('nobody asks for this')

    runner.start(first(), 10.0)
    assert channel.asked == []
    assert runner.due == 20.0


def test_channel_that_was_cleared_is_not_waited_for() -> None:
    channel, runner = lifecycle()

    def script(name: str) -> Script:
        yield procedure(name)

    runner.start(script('old'), 10.0)
    channel.asked.clear()
    runner.stop()
    runner.start(script('new'), 10.1)
    assert channel.steps == ['new']
