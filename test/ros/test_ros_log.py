# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The log's own thread: nobody waits for it, and nothing is left out in silence."""

from pathlib import Path
import tempfile
import threading
from typing import Any

from clocks import REAL
import pytest
from rclpy.logging import get_logging_directory
from waiting import wait_for
from world import World

from drive_can_bridge.core.sentences import log_too_fast
from drive_can_bridge.ros.log import LINES_MAX, Log, PATIENCE


class Logger:
    """Keeps lines, or holds up whoever writes one."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, str]] = []
        self.open = threading.Event()
        self.open.set()

    def __getattr__(self, level: str) -> Any:
        def write(text: str) -> None:
            self.open.wait()
            self.lines.append((level, text))
        return write


@pytest.mark.usefixtures('threads')
def test_lines_in_order_and_printable() -> None:
    logger = Logger()
    log = Log(logger, REAL)
    log.info('first')
    log.warning('line\nfeed \x1b[2J')
    log.error('third')
    log.fatal('fourth')
    log.close()
    assert logger.lines == [('info', 'first'), ('warning', r'line\nfeed \x1b[2J'),
                            ('error', 'third'), ('fatal', 'fourth')]
    log.error('too late')
    assert logger.lines[-1] == ('error', 'too late')


@pytest.mark.usefixtures('threads')
def test_nobody_waits_for_a_logger_that_does_not_come_back() -> None:
    logger = Logger()
    logger.open.clear()
    log = Log(logger, REAL)
    for number in range(LINES_MAX + 500):
        log.info(str(number))
    logger.open.set()
    wait_for(lambda: logger.lines[-1:] and logger.lines[-1][0] == 'warning')
    told = logger.lines[-1][1]
    dropped = int(told.split()[0])
    assert told == log_too_fast(dropped)
    assert dropped + len(logger.lines) - 1 == LINES_MAX + 500
    assert logger.lines[:3] == [('info', '0'), ('info', '1'), ('info', '2')]
    log.close()


def test_the_last_words_are_written_however_long_that_takes(bench: World) -> None:
    class SlowLogger(Logger):
        def __getattr__(self, level: str) -> Any:
            bench.clock.live(0.9 * PATIENCE)
            return super().__getattr__(level)
    logger = SlowLogger()
    log = Log(logger, bench.clock)
    for number in range(20):
        log.info(str(number))
    log.fatal('defect')
    log.close()
    assert logger.lines[-1] == ('fatal', 'defect')


def test_the_end_does_not_wait_for_ever(bench: World) -> None:
    class DeafLogger(Logger):
        def __getattr__(self, level: str) -> Any:
            bench.clock.wait(bench.clock.now() + 10.0 * PATIENCE)
            return super().__getattr__(level)
    logger = DeafLogger()
    log = Log(logger, bench.clock)
    for number in range(LINES_MAX + 2):
        log.info(str(number))
    begun = bench.clock.now()
    log.close()
    assert PATIENCE < bench.clock.now() - begun < 1.1 * PATIENCE
    assert not logger.lines


def test_its_thread_sums_up_what_repeats_by_itself(bench: World) -> None:
    logger = Logger()
    log = Log(logger, bench.clock)
    for _ in range(500):
        log.source('lift').warning('fault')
        log.source('lift').info('gone')
    wait_for(lambda: sum('more time' in text for _, text in logger.lines) >= 2)
    assert logger.lines[:10] == [('warning', 'lift: fault'), ('info', 'lift: gone')] * 5
    log.close()
    assert len(logger.lines) < 50
    assert logger.lines[-1][1].startswith('lift: gone ')


@pytest.mark.usefixtures('threads')
def test_the_end_writes_what_is_held_behind_what_waits() -> None:
    logger = Logger()
    log = Log(logger, REAL)
    for _ in range(7):
        log.source('lift').info('online')
    log.close()
    *written, (_, summary) = logger.lines
    assert written == [('info', 'lift: online')] * 5
    assert summary.split()[:3] == ['lift:', 'online', '(2']


def test_tests_leave_the_logs_of_the_user_alone() -> None:
    assert Path(tempfile.gettempdir()) in Path(str(get_logging_directory())).parents
