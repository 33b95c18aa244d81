# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What libraries log goes through a log of ours, with a limit, and never to standard error."""

from collections.abc import Iterator
import logging
import warnings

import pytest

from drive_can_bridge.transport.library_logs import Few, LibraryLogs, LINES_MAX


class Heard:
    """What was said, and the time."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.now = 100.0
        self.logs = LibraryLogs(lambda topic, line: self.lines.append(line), lambda: self.now)
        self.logs.install()


@pytest.fixture(name='heard')
def heard_fixture() -> Iterator[Heard]:
    made = Heard()
    yield made
    logging.getLogger().removeHandler(made.logs)
    logging.captureWarnings(False)


def test_every_logger_is_heard(heard: Heard, capfd: pytest.CaptureFixture[str]) -> None:
    logging.getLogger('can.interfaces.socketcand').warning('Failed to %s', 'connect')
    logging.getLogger('seeedbus').error('a\x1b[31mb\nc')
    logging.getLogger('can').info('not worth a line')
    try:
        raise ValueError('why')
    except ValueError:
        logging.getLogger('vendor').exception('failed')
    with warnings.catch_warnings():
        warnings.simplefilter('always')
        warnings.warn('old option', FutureWarning, stacklevel=1)
    assert heard.lines[:3] == ['can.interfaces.socketcand: Failed to connect',
                               'seeedbus: a\\x1b[31mb\\nc', 'vendor: failed']
    assert 'old option' in heard.lines[3]
    assert capfd.readouterr().err == ''


def test_a_flood_is_counted(heard: Heard) -> None:
    logger = logging.getLogger('can.interfaces.socketcand')
    for attempt in range(35_000):
        logger.warning('Failed to connect to server: %d', attempt)
    assert len(heard.lines) == LINES_MAX
    heard.now += 1.0
    logger.warning('again')
    assert heard.lines[LINES_MAX:] == ['34900 more lines of libraries left out',
                                       'can.interfaces.socketcand: again']


def test_what_cannot_be_said_does_no_harm(heard: Heard) -> None:
    heard.logs.handle(logging.makeLogRecord({
        'name': 'vendor', 'levelno': logging.WARNING, 'msg': '%d frames', 'args': ('no',)}))
    assert heard.lines == ['vendor: %d frames']


def test_the_last_who_asks_is_told(heard: Heard) -> None:
    other = Heard()
    logging.getLogger('can').warning('once')
    assert (heard.lines, other.lines) == ([], ['can: once'])
    logging.getLogger().removeHandler(other.logs)


def test_commands_show_a_few() -> None:
    lines: list[str] = []
    few = Few(lines.append)
    for attempt in range(10):
        few.say('can 12', f'can: attempt {attempt}')
    few.say('can 13', 'can: another')
    assert lines == ['can: attempt 0', 'can: attempt 1',
                     'can: attempt 2 (more like it are not shown)', 'can: another']
