# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Warnings that repeat."""

from drive_can_bridge.ros.throttle import QUIET_PERIOD, Throttle, TOPICS_MAX


class Log:
    """A throttle with a clock that is set by hand, and what it lets pass."""

    def __init__(self) -> None:
        self.now = 100.0
        self.lines: list[str] = []
        self.throttle = Throttle(self.lines.append, lambda: self.now)


def test_the_first_at_once_the_others_counted() -> None:
    log = Log()
    for _ in range(3):
        log.throttle('speed', 'too fast')
    log.throttle('limit', 'too high')
    assert log.lines == ['too fast', 'too high']
    log.now += QUIET_PERIOD
    log.throttle('speed', 'much too fast')
    log.throttle('limit', 'too high')
    assert log.lines[2:] == ['much too fast (and 2 more like it)', 'too high']


def test_once_is_once_until_reset() -> None:
    log = Log()
    for _ in range(3):
        log.throttle('joint', 'no such joint', once=True)
        log.now += 1000 * QUIET_PERIOD
    assert log.lines == ['no such joint']
    log.throttle.reset()
    log.throttle('joint', 'no such joint', once=True)
    assert log.lines == ['no such joint'] * 2


def test_not_every_topic_is_kept_for_ever() -> None:
    log = Log()
    for number in range(TOPICS_MAX + 1):
        log.throttle(f'topic {number}', 'text')
    log.throttle(f'topic {TOPICS_MAX}', 'text')
    assert len(log.lines) == TOPICS_MAX + 1
    log.throttle('topic 0', 'text')
    assert len(log.lines) == TOPICS_MAX + 2
