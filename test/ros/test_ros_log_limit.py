# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Lines that repeat, speakers that say too much: bounded, and nothing lost in silence."""

import re

from hypothesis import given, settings, strategies as st

from drive_can_bridge.ros.log import (
    BURST, BURST_OF_ALL, FEW, Level, LogLimit, QUIET, RATE_OF_ALL, SUM_UP, TOPICS_MAX,
)

FAULT, GONE = 'fault (status word 0008h)', 'fault gone (status word 0001h)'


class Log:
    """A limit with a clock that is set by hand, and what it lets pass."""

    def __init__(self) -> None:
        self.now = 100.0
        self.told: list[tuple[Level, str]] = []
        self.woken = 0
        self.limit = LogLimit(lambda *line: self.told.append(line), self._wake, lambda: self.now)
        self.lift = self.limit.speaker('lift')

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

    def _wake(self) -> None:
        self.woken += 1


# -- what repeats ---------------------------------------------------------------------------------


def test_the_first_few_at_once_then_a_summary_and_the_last_state_in_the_end() -> None:
    log = Log()
    log.flip(0.4)   # 20 times
    assert log.take() == [f'lift: {FAULT}', f'lift: {GONE}'] * FEW
    log.flip(3.0)
    log.wait(SUM_UP)
    assert log.take() == [f'lift: {FAULT} (165 more times in 10 s, the last 7 s ago)',
                          f'lift: {GONE} (165 more times in 10 s, the last 7 s ago)']
    log.wait(1000.0)
    assert log.take() == []
    assert log.limit.wait() is None


def test_whatever_was_last_stands_last() -> None:
    log = Log()
    log.flip(1.0)
    log.lift.warning(FAULT)
    log.take()
    log.wait(SUM_UP)
    *_, last = log.take()
    assert last == f'lift: {FAULT} (46 more times in 10 s, the last 9 s ago)'


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


def test_what_differs_and_came_last_stands_last_again() -> None:
    log = Log()
    log.flip(1.0)
    log.wait(1.0)
    log.lift.warning('offline: no answer', urgent=True)
    log.take()
    log.wait(SUM_UP)
    assert log.take() == [f'lift: {FAULT} (45 more times in 10 s, the last 9 s ago)',
                          f'lift: {GONE} (45 more times in 10 s, the last 9 s ago)',
                          'lift: offline: no answer (this came last, 8 s ago)']


def test_what_is_over_for_a_while_is_news_again() -> None:
    log = Log()
    log.flip(1.0)
    log.wait(SUM_UP + QUIET)
    log.take()
    log.flip(0.1)
    assert log.take() == [f'lift: {FAULT}', f'lift: {GONE}'] * FEW
    # also before the summary of what was held: in the order in which it came
    log.flip(0.1)
    log.wait(QUIET)
    log.lift.warning(FAULT)
    assert log.take() == [f'lift: {FAULT} (5 more times in 5 s, the last 5 s ago)',
                          f'lift: {FAULT}']


def test_what_differs_is_told_at_once_meanwhile() -> None:
    log = Log()
    log.flip(1.0)
    log.take()
    log.lift.warning('offline: no answer', urgent=True)
    log.lift.info('online')
    log.limit.speaker('conveyor').warning(FAULT)
    assert log.take() == ['lift: offline: no answer', 'lift: online', f'conveyor: {FAULT}']


def test_levels_stay() -> None:
    log = Log()
    for _ in range(FEW + 1):
        log.lift.info('online')
        log.lift.error('mapping differs')
    log.wait(SUM_UP)
    assert {(level, text.split(' (')[0]) for level, text in log.told} == {
        (Level.INFO, 'lift: online'), (Level.ERROR, 'lift: mapping differs')}


def test_a_speaker_without_a_name() -> None:
    log = Log()
    log.limit.speaker('').warn('joints', 'refused')
    assert log.take() == ['refused']


# -- topics: texts that vary ----------------------------------------------------------------------


def test_the_first_of_a_topic_at_once_the_others_counted() -> None:
    log = Log()
    for _ in range(3):
        log.lift.warn('speed', 'too fast')
    log.lift.warn('limit', 'too high')
    assert log.take() == ['lift: too fast', 'lift: too high']
    log.wait(QUIET - 1.0)
    log.lift.warn('speed', 'much too fast')
    assert log.take() == []
    log.wait(SUM_UP)
    assert log.take() == ['lift: much too fast (and 2 more like it in 10 s, the last 6 s ago)']
    log.lift.warn('speed', 'too fast')
    log.lift.warn('speed', 'far too fast')
    log.wait(SUM_UP)
    assert log.take() == ['lift: too fast', 'lift: far too fast (10 s ago)']


def test_once_is_once_until_reset() -> None:
    log = Log()
    for _ in range(3):
        log.lift.warn('joint', 'no such joint', once=True)
        log.wait(1000.0)
    assert log.take() == ['lift: no such joint']
    log.lift.reset()
    log.lift.warn('joint', 'no such joint', once=True)
    assert log.take() == ['lift: no such joint']


def test_a_drive_that_comes_and_goes_all_the_time_makes_no_flood_of_its_warnings() -> None:
    log = Log()
    for _ in range(1000):
        log.lift.reset()
        log.lift.warn('disabled', 'no effect', once=True)
        log.lift.warn('speed', 'too fast')
        log.wait(0.01)
    assert log.take() == ['lift: no effect', 'lift: too fast'] * FEW
    log.wait(SUM_UP)
    assert len(log.take()) == 2


# -- too many different lines ---------------------------------------------------------------------


def test_different_lines_of_a_drive_are_many_at_once_and_then_one_a_second() -> None:
    log = Log()
    for number in range(BURST + 30):
        log.lift.info(f'fault ({number:04X}h)')
    assert log.take() == [f'lift: fault ({number:04X}h)' for number in range(BURST)]
    log.wait(SUM_UP + 30.0)
    assert [line.split(') (')[0] for line in log.take()] == [
        f'lift: fault ({number:04X}h' for number in range(BURST, BURST + 30)]


def test_what_could_not_even_be_held_is_counted() -> None:
    log = Log()
    for number in range(BURST + TOPICS_MAX + 50):
        log.lift.info(str(number))
    log.wait(SUM_UP + TOPICS_MAX)
    assert log.take()[-1] == 'lift: 50 more lines left out: too many different ones at once'


def test_dangers_are_told_whoever_talks() -> None:
    log = Log()
    for name in range(100):
        for number in range(BURST):
            log.limit.speaker(f'axis_{name}').info(str(number))
    assert len(log.take()) == BURST_OF_ALL
    log.lift.warning('told to stop, but no answer: it may still be running', urgent=True)
    log.limit.speaker('axis_7').error('mapping differs')
    assert log.take() == ['lift: told to stop, but no answer: it may still be running',
                          'axis_7: mapping differs']


def test_a_danger_that_comes_again_is_not_only_counted() -> None:
    log = Log()
    danger = 'told to stop, but no answer: it may still be running'
    for _ in range(FEW):
        log.lift.warning(danger, urgent=True)
        log.wait(QUIET / 2)
    log.take()
    log.lift.warning(danger, urgent=True)   # and while it is held there is a flood
    for number in range(BURST + 2 * TOPICS_MAX):
        log.lift.warning(f'read p{number}: no answer')
    log.wait(2 * SUM_UP)
    assert any(danger in line for line in log.lines)


def test_a_hundred_drives_at_once_stay_readable() -> None:
    log = Log()
    for _ in range(2000):
        for name in range(100):
            log.limit.speaker(f'axis_{name}').info('offline')
        log.wait(0.01)
    begun = len(log.take())
    assert begun <= BURST_OF_ALL + 20.0 * RATE_OF_ALL
    log.wait(100.0)
    lines = log.take()
    assert len({line.split(':')[0] for line in lines}) == 100
    assert len(lines) == 100


# -- the end, and whoever serves it ---------------------------------------------------------------


def test_in_the_end_everything_is_written() -> None:
    log = Log()
    log.flip(1.0)
    log.take()
    log.limit.sum_up(all_of_it=True)
    assert [line.split(' (status')[0] for line in log.take()] == [
        'lift: fault', 'lift: fault gone']
    for _ in range(FEW + 1):
        log.lift.info('too late to be summed up')
    assert len(log.take()) == FEW + 1


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
