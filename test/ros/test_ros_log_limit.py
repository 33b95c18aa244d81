# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Lines that repeat, sources that say too much: bounded, and nothing lost in silence."""

from functools import partial
import re

from hypothesis import given, settings, strategies as st
import pytest
from transcripts import replayed, stories

from drive_can_bridge.core import sentences
from drive_can_bridge.ros.log import (
    BURST, BURST_OF_ALL, FEW, LogLevel, LogLimit, QUIET, RATE_OF_ALL, SUM_UP, TOPICS_MAX)

FAULT, GONE = 'fault', 'gone'
DANGER = sentences.may_still_be_running(sentences.stop_not_answered())
STORIES = stories(__file__, 'log_limit.yaml')
#: of a story: who speaks, how often, what is done, with what
STEP = re.compile(r'(?:(\w*): )?(?:(\d+) )?(\w+) ?(.*)')
#: steps of which nothing is shown
HIDDEN = ('flipped', 'waited', 'numbers')


class Log:
    """A limit with a clock that is set by hand, and what it lets pass."""

    def __init__(self) -> None:
        self.now = 100.0
        self.told: list[tuple[LogLevel, str]] = []
        self.woken = 0
        self.limit = LogLimit(lambda *line: self.told.append(line), self._wake, lambda: self.now)
        self.lift = self.limit.source('lift')

    @property
    def lines(self) -> list[str]:
        return [text for _, text in self.told]

    def take(self) -> list[str]:
        """Return what was written since the last call."""
        lines = self.lines
        self.told.clear()
        return lines

    def wait(self, seconds: float) -> None:
        """Let time pass, and be served as the log's thread does it."""
        end = self.now + seconds
        while True:
            pause = self.limit.wait()
            if pause is None or self.now + pause > end:
                self.now = end
                return
            self.now += pause
            self.limit.sum_up()

    def flip(self, seconds: float, period: float = 0.01) -> None:
        """Let a fault come and go with each cycle."""
        for _ in range(round(seconds / period / 2)):
            self.lift.warning(FAULT)
            self.wait(period)
            self.lift.warning(GONE)
            self.wait(period)

    def step(self, step: str) -> list[str]:
        """Do a step of a story, and return what is written."""
        if step == 'due':
            return [str(self.limit.wait())]
        match = STEP.fullmatch(step)
        assert match, step
        name, times, what, rest = match.groups()
        source = self.lift if name is None else self.limit.source(name)
        for _ in range(int(times or 1)):
            topic, _, text = rest.partition(' ')
            {'flip': lambda: self.flip(float(rest)), 'flipped': lambda: self.flip(float(rest)),
             'wait': lambda: self.wait(float(rest)), 'waited': lambda: self.wait(float(rest)),
             'info': lambda: source.info(rest), 'warning': lambda: source.warning(rest),
             'urgent': lambda: source.warning(rest, urgent=True),
             'error': lambda: source.error(rest),
             'topic': partial(source.warn, topic, text),
             'few': partial(source.warn, topic, text, few=FEW),
             'once': partial(source.warn, topic, text, once=True),
             'numbers': lambda: [source.info(str(number)) for number in range(int(rest))],
             'reset': source.reset, 'end': lambda: self.limit.sum_up(all_of_it=True),
             }[what]()
        told = [f'{level.value[0].upper()} {text}' for level, text in self.told]
        self.told.clear()
        return [] if what in HIDDEN else told

    def _wake(self) -> None:
        self.woken += 1


@pytest.mark.parametrize('story', STORIES)
def test_lines(story: str) -> None:
    assert replayed(STORIES[story], Log().step) == STORIES[story]


# -- what repeats ---------------------------------------------------------------------------------


def test_hours_of_it_are_a_line_of_each_in_ten_seconds() -> None:
    log = Log()
    log.flip(600.0)
    log.wait(SUM_UP)
    lines = log.take()
    assert len(lines) <= 2 * FEW + 2 * 61
    # none of the 30,000 is missing
    for text in (FAULT, GONE):
        counts = [int(match[1]) for line in lines
                  if (match := re.match(rf'lift: {re.escape(text)} \((\d+) more', line))]
        assert sum(counts) + FEW == 30_000


# -- topics: texts that vary ----------------------------------------------------------------------


def test_a_drive_that_comes_and_goes_all_the_time_makes_no_flood_of_its_warnings() -> None:
    log = Log()
    for _ in range(1000):
        log.lift.reset()
        log.lift.warn('disabled', 'useless', once=True)
        log.lift.warn('speed', 'fast')
        log.wait(0.01)
    assert log.take() == ['lift: useless', 'lift: fast'] * FEW
    log.wait(SUM_UP)
    assert len(log.take()) == 2


# -- too many different lines ---------------------------------------------------------------------


def test_different_lines_of_a_drive_are_many_at_once_and_then_one_a_second() -> None:
    log = Log()
    for number in range(BURST + 30):
        log.lift.info(f'p{number}')
    assert log.take() == [f'lift: p{number}' for number in range(BURST)]
    log.wait(SUM_UP + 30.0)
    assert [line.split(' (')[0] for line in log.take()] == [
        f'lift: p{number}' for number in range(BURST, BURST + 30)]


def test_dangers_are_told_whoever_talks() -> None:
    log = Log()
    for name in range(100):
        for number in range(BURST):
            log.limit.source(f'axis_{name}').info(str(number))
    assert len(log.take()) == BURST_OF_ALL
    log.lift.warning(DANGER, urgent=True)
    log.limit.source('axis_7').error('differs')
    assert log.take() == [f'lift: {DANGER}', 'axis_7: differs']


def test_a_danger_that_comes_again_is_not_only_counted() -> None:
    log = Log()
    for _ in range(FEW):
        log.lift.warning(DANGER, urgent=True)
        log.wait(QUIET / 2)
    log.take()
    log.lift.warning(DANGER, urgent=True)   # and while it is held there is a flood
    for number in range(BURST + 2 * TOPICS_MAX):
        log.lift.warning(f'read p{number}: no answer')
    log.wait(2 * SUM_UP)
    assert any(DANGER in line for line in log.lines)


def test_a_hundred_drives_at_once_stay_readable() -> None:
    log = Log()
    for _ in range(2000):
        for name in range(100):
            log.limit.source(f'axis_{name}').info('offline')
        log.wait(0.01)
    begun = len(log.take())
    assert begun <= BURST_OF_ALL + 20.0 * RATE_OF_ALL
    log.wait(100.0)
    lines = log.take()
    assert len({line.split(':')[0] for line in lines}) == 100
    assert len(lines) == 100


# -- the end, and whoever serves it ---------------------------------------------------------------


def test_the_thread_is_woken_once_for_all_that_is_held() -> None:
    log = Log()
    assert log.limit.wait() is None
    for _ in range(100):
        log.lift.info('online')
    assert log.woken == 1
    assert log.limit.wait() == SUM_UP


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(['a', 'b', 'c']), st.sampled_from([0.0, 0.1, 6.0]),
                          st.booleans()), max_size=60))
def test_whatever_comes_nothing_is_lost(said: list[tuple[str, float, bool]]) -> None:
    log = Log()
    for text, pause, urgent in said:
        log.lift.warning(text, urgent=urgent)
        log.wait(pause)
    log.limit.sum_up(all_of_it=True)
    for text in 'abc':
        found = [line for line in log.lines if line.startswith(f'lift: {text}')]
        counts = [int(match[1]) if (match := re.search(r'\((\d+) more time', line)) else 1
                  for line in found if 'this came last' not in line]
        assert sum(counts) == sum(each == text for each, _, _ in said)
    if said:    # how it is now stands last
        assert log.lines[-1].startswith(f'lift: {said[-1][0]}')
