# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can demo`` in a terminal: a pseudo-terminal, and what arrives at its other end."""

from collections.abc import Iterator
import fcntl
import os
from pathlib import Path
import pty
import select
import signal
import struct
import termios
from typing import Any

from demo_builders import Demo
import pytest
from waiting import wait_for

pytest.importorskip('rclpy')
pytest.importorskip('rich')

ENTERED, LEFT = b'\x1b[?1049h', b'\x1b[?1049l'


class Terminal:
    """The other end of a pseudo-terminal."""

    def __init__(self) -> None:
        self.near, self.far = pty.openpty()
        self.written = b''

    def resize(self, columns: int, lines: int) -> None:
        fcntl.ioctl(self.far, termios.TIOCSWINSZ, struct.pack('HHHH', lines, columns, 0, 0))

    def read(self) -> bytes:
        """Take what has come; return all of it."""
        while select.select([self.near], [], [], 0)[0]:
            try:
                self.written += os.read(self.near, 65536)
            except OSError:  # nobody has the terminal open any more
                break
        return self.written

    @property
    def echoes(self) -> bool:
        """What is typed appears."""
        flags: list[Any] = termios.tcgetattr(self.far)
        return bool(flags[3] & termios.ECHO)

    def close(self) -> None:
        os.close(self.near)
        os.close(self.far)


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    opened = Terminal()
    opened.resize(120, 40)
    yield opened
    opened.close()


def start(terminal: Terminal, directory: Path, *arguments: str, **variables: str) -> Demo:
    return Demo(directory, *arguments, stdin=terminal.far, stdout=terminal.far,
                stderr=terminal.far, environment={
                    'TERM': 'xterm-256color', 'PYTHONIOENCODING': 'utf-8', **variables})


@pytest.fixture
def demos() -> Iterator[list[Demo]]:
    started: list[Demo] = []
    yield started
    for demo in started:
        demo.close()


def test_the_view_comes_and_goes(terminal: Terminal, tmp_path: Path, demos: list[Demo]) -> None:
    demo = start(terminal, tmp_path)
    demos.append(demo)
    wait_for(lambda: b'not armed' in terminal.read() and b'online' in terminal.read(), 'view')
    assert ENTERED in terminal.written
    assert LEFT not in terminal.written
    assert not terminal.echoes
    # the log is inside the view, and never written across it
    assert b'[INFO]' not in terminal.written

    before = len(terminal.written)
    terminal.resize(80, 24)
    wait_for(lambda: b'\x1b[2J' in terminal.read()[before:]
             and b'conveyor' in terminal.written[before:], 'page of another size')

    assert demo.end(signal.SIGINT) == 0
    view, _, rest = terminal.read().rpartition(LEFT)
    assert view.endswith(b'\x1b[?25h')
    assert b' missed, period error ' in rest
    assert b'Traceback' not in terminal.written
    assert terminal.echoes


def test_a_dumb_terminal_gets_lines(terminal: Terminal, tmp_path: Path,
                                    demos: list[Demo]) -> None:
    demo = start(terminal, tmp_path, TERM='dumb')
    demos.append(demo)
    wait_for(lambda: b'conveyor online actual_speed=' in terminal.read(), 'lines')
    assert demo.end(signal.SIGTERM) == 0
    assert b'\x1b[?' not in terminal.read()


def test_a_mistake_is_seen(terminal: Terminal, tmp_path: Path, demos: list[Demo]) -> None:
    demo = start(terminal, tmp_path, '--fault', 'lift:stuck=nothing')
    demos.append(demo)
    assert demo.process.wait(30.0) == 2
    assert b'drive_can demo: --fault' in terminal.read()
    assert ENTERED not in terminal.written
