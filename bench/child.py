# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Processes of a bench that are told what to do by lines, and answer each with a line of JSON.

Everything that is measured, and everything that makes load, is a process of its own, so that no
Python lock is shared by what is not shared in real life.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import json
import os
from pathlib import Path
import subprocess
import sys
import time
from typing import Any, NoReturn

# before rclpy is imported: nothing leaves this machine
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('ROS_DOMAIN_ID', '97')
# and no command reaches another bridge of it
os.environ.setdefault('DRIVE_CAN_LOCAL', 'off')

HERE = Path(__file__).resolve().parent
#: s after which what has not happened never will, whoever else has the processors
PATIENCE = 300.0


class Child:
    """
    The near end.

    :param python: that runs it; another one has another build of the bridge.
    """

    def __init__(self, script: str, *arguments: object, python: str = sys.executable) -> None:
        self.script = script
        self.process = subprocess.Popen(
            [python, str(HERE / script), *map(str, arguments)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.ready = self._read()

    def ask(self, line: str) -> Any:
        """Tell something; return the answer."""
        assert self.process.stdin is not None
        self.process.stdin.write(line + '\n')
        self.process.stdin.flush()
        return self._read()

    def cpu(self) -> float:
        """Return the CPU time of the whole process in s."""
        return cpu_of(self.process.pid)

    def resident_mb(self) -> float:
        """Return the resident memory in MB."""
        status = Path(f'/proc/{self.process.pid}/status').read_text()
        return int(status.split('VmRSS:')[1].split()[0]) / 1024

    def close(self) -> None:
        """Let it end."""
        if self.process.stdin is not None:
            self.process.stdin.close()
        try:
            self.process.wait(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def _read(self) -> Any:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            try:
                return json.loads(line)
            except ValueError:      # the middleware has something to say before serve() begins
                print(f'{self.script}: {line}', end='', file=sys.stderr)
        raise SystemExit(f'{self.script} ended before its time')


def cpu_of(process: int) -> float:
    """Return the CPU time of all threads of a process in s."""
    spent = 0
    for task in Path(f'/proc/{process}/task').iterdir():
        with suppress(OSError):     # it has ended meanwhile
            spent += int((task / 'schedstat').read_text().split()[0])
    return 1e-9 * spent


@contextmanager
def child(script: str, *arguments: object, python: str = sys.executable) -> Iterator[Child]:
    """Run a process for as long as needed."""
    process = Child(script, *arguments, python=python)
    try:
        yield process
    finally:
        process.close()


def serve(commands: dict[str, Callable[..., Any]], ready: Any = True, *,
          close: Callable[[], Any] = lambda: None) -> NoReturn:
    """
    Be the far end: obey until the standard input ends, and then end the process.

    The answers have standard output for themselves: what the middleware writes there goes where
    errors go. It does not take Python's way out, on which the middleware finds its threads still
    running.
    """
    answers = os.fdopen(os.dup(1), 'w')
    os.dup2(2, 1)

    def answer(content: Any) -> None:
        print(json.dumps(content), file=answers, flush=True)
    answer(ready)
    for line in sys.stdin:
        name, *arguments = line.split()
        answer(commands[name](*map(float, arguments)))
    close()
    sys.stderr.flush()
    os._exit(0)


def sleep_until(deadline: float) -> None:
    """Sleep to an absolute time of the steady clock."""
    left = deadline - time.monotonic()
    if left > 0.0:
        time.sleep(left)
