# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The log's own thread: nobody waits for it, and nothing is left out in silence."""

from pathlib import Path
import tempfile
import threading
import time
from typing import Any

from clocks import REAL
import pytest
from rclpy.logging import get_logging_directory
from waiting import wait_for

from drive_can_bridge.ros import log as log_module
from drive_can_bridge.ros.log import LINES_MAX, Log


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
    assert told == (f'{dropped} lines of the log left out: they came faster than they could be '
                    f'written')
    assert dropped + len(logger.lines) - 1 == LINES_MAX + 500
    assert logger.lines[:3] == [('info', '0'), ('info', '1'), ('info', '2')]
    log.close()


def test_the_last_words_are_written_however_long_that_takes() -> None:
    class SlowLogger(Logger):
        def __getattr__(self, level: str) -> Any:
            time.sleep(0.05)
            return super().__getattr__(level)
    logger = SlowLogger()
    log = Log(logger, REAL)
    for number in range(20):
        log.info(str(number))
    log.fatal('why it ends')
    log.close()
    assert logger.lines[-1] == ('fatal', 'why it ends')


def test_the_end_does_not_wait_for_ever() -> None:
    logger = Logger()
    logger.open.clear()
    log = Log(logger, REAL)
    for number in range(LINES_MAX + 2):
        log.info(str(number))
    log.close()
    logger.open.set()


def test_its_thread_sums_up_what_repeats_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_module, 'SUM_UP', 0.05)
    logger = Logger()
    log = Log(logger, REAL)
    for _ in range(500):
        log.speaker('lift').warning('fault')
        log.speaker('lift').info('fault gone')
    wait_for(lambda: sum('more time' in text for _, text in logger.lines) >= 2)
    assert logger.lines[:10] == [('warning', 'lift: fault'), ('info', 'lift: fault gone')] * 5
    log.close()
    assert len(logger.lines) < 50
    assert logger.lines[-1][1].startswith('lift: fault gone (')


def test_the_end_writes_what_is_held_behind_what_waits() -> None:
    logger = Logger()
    log = Log(logger, REAL)
    for _ in range(7):
        log.speaker('lift').info('online')
    log.close()
    assert logger.lines == [('info', 'lift: online')] * 5 + [
        ('info', 'lift: online (2 more times in 1 s)')]


def test_tests_leave_the_logs_of_the_user_alone() -> None:
    assert Path(tempfile.gettempdir()) in Path(str(get_logging_directory())).parents
