# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Commands of the package as processes, and the terminal that they may have."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import fcntl
import os
from pathlib import Path
import pty
import re
import select
import struct
import subprocess
import sys
import termios
from typing import Any

from middleware import as_users_have_it
from waiting import wait_for

MODULES = {'drive_can': 'drive_can_bridge.cli.start',
           'drive_can_bridge': 'drive_can_bridge.ros.start'}
_COLOUR = re.compile(r'\x1b\[[0-9;]*m')
JOB = (sys.executable, str(Path(__file__).parents[1] / '.ci' / 'foreground'))


class Running:
    """
    A running command.

    :param command: ``drive_can`` or ``drive_can_bridge``, and its arguments.
    :param environment: variables to be set, or with None to be left out.
    :param job: as a shell runs it, and make: nobody else can be stopped by the keyboard.
    """

    def __init__(self, directory: Path, *command: str,
                 environment: dict[str, str | None] | None = None, job: bool = False,
                 **options: Any) -> None:
        program, *arguments = command
        directory.mkdir(exist_ok=True)
        self.out, self.err = directory / 'out', directory / 'err'
        variables: dict[str, str | None] = {
            **as_users_have_it(), 'ROS_LOG_DIR': str(directory / 'log'), **(environment or {})}
        with self.out.open('wb') as out, self.err.open('wb') as err:
            options = {'stdin': subprocess.DEVNULL, 'stdout': out, 'stderr': err, **options}
            self.process = subprocess.Popen(
                [*(JOB if job else ()), sys.executable, '-m', MODULES[program], *arguments],
                env={name: value for name, value in variables.items() if value is not None},
                **options)

    @property
    def lines(self) -> list[str]:
        """Standard output."""
        return self.out.read_text(encoding='utf-8').splitlines()

    @property
    def errors(self) -> str:
        """Standard error."""
        return self.err.read_text(encoding='utf-8')

    def line(self, pattern: str, *, since: int = 0) -> str:
        """Wait for a line of standard output, from line number ``since`` on."""
        def find() -> str | None:
            lines = self.lines[since:]
            found = next((line for line in lines if re.search(pattern, line)), None)
            if found is None and self.process.poll() is not None:
                raise AssertionError(f'it ended without {pattern}: {self.errors}')
            return found
        return str(wait_for(find, f'line {pattern}'))

    def end(self, signum: int, timeout: float = 60.0) -> int:
        """Send a signal and wait for the end."""
        self.process.send_signal(signum)
        return self.process.wait(timeout)

    def children(self) -> dict[str, int]:
        """Return the process numbers of the demo's processes, by what they run."""
        found = {}
        for number in Path(f'/proc/{self.process.pid}/task').iterdir():
            for child in (number / 'children').read_text().split():
                words = Path(f'/proc/{child}/cmdline').read_bytes().decode().split('\0')
                place = next((place for place, word in enumerate(words)
                              if 'drive_can_bridge.demo.child' in word), None)
                if place is not None:
                    program = words[place + 1]
                    found[words[place + 2] if program == 'drive_can' else program] = int(child)
        return found

    def close(self) -> None:
        """End it whatever it does."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        if self.process.stdin is not None:
            self.process.stdin.close()


@contextmanager
def starting(directory: Path, *words: str, **usual: Any) -> Iterator[Callable[..., Running]]:
    """Return what starts a command, each time in a directory of its own; they end with this."""
    running: list[Running] = []

    def start(*more: str, **options: Any) -> Running:
        running.append(Running(directory / str(len(running)), *words, *more,
                               **{**usual, **options}))
        return running[-1]
    yield start
    for each in reversed(running):
        each.close()


class Terminal:
    """The other end of a pseudo-terminal."""

    def __init__(self, columns: int = 120, lines: int = 40) -> None:
        self.near, self.far = pty.openpty()
        self.written = b''
        self.resize(columns, lines)

    @property
    def options(self) -> dict[str, Any]:
        """How a command is started that shall have it, keyboard, signals and all."""
        return {'stdin': self.far, 'stdout': self.far, 'stderr': self.far,
                'start_new_session': True, 'preexec_fn': self._take,
                'environment': {'TERM': 'xterm-256color', 'PYTHONIOENCODING': 'utf-8'}}

    def resize(self, columns: int, lines: int) -> None:
        """Change the size."""
        fcntl.ioctl(self.far, termios.TIOCSWINSZ, struct.pack('HHHH', lines, columns, 0, 0))

    def type(self, keys: str) -> None:
        """Press keys."""
        os.write(self.near, keys.encode())

    def read(self) -> str:
        """Take what has come; return all of it, without colours."""
        while select.select([self.near], [], [], 0)[0]:
            try:
                self.written += os.read(self.near, 65536)
            except OSError:  # nobody has the terminal open any more
                break
        return _COLOUR.sub('', self.written.decode(errors='replace'))

    def shows(self, pattern: str, *, since: int = 0) -> None:
        """Wait until something was written, behind so many characters."""
        expression = re.compile(pattern, re.DOTALL)
        wait_for(lambda: expression.search(self.read(), since), f'{pattern} in the terminal')

    @property
    def echoes(self) -> bool:
        """What is typed appears."""
        flags: list[Any] = termios.tcgetattr(self.far)
        return bool(flags[3] & termios.ECHO)

    def close(self) -> None:
        """Hang up."""
        os.close(self.near)
        os.close(self.far)

    def _take(self) -> None:
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)
