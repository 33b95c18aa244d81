# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Processes as a user starts them: output in files, waiting for lines, signals, an orderly end.

Whoever waits here waits for a condition, with a deadline that only a hang exceeds.
"""

from collections.abc import Sequence
from contextlib import suppress
import json
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
from typing import Any

from middleware import as_users_have_it
from waiting import DEADLINE, wait_for

ROOT = Path(__file__).resolve().parents[2]
#: lines of an output that are shown of a process when a test fails
SHOWN = 40
#: s within which a process ends that is not needed any more
PATIENCE = 10.0
#: executable -> module, for trees that are not installed
EXECUTABLES = {'drive_can_bridge': 'drive_can_bridge.ros.start',
               'drive_can': 'drive_can_bridge.cli.start'}


def command_line(name: str) -> list[str]:
    """Return how an executable of the package is started."""
    script = Path(sys.executable).with_name(name)
    if script.exists():
        return [str(script)]
    return [sys.executable, '-m', EXECUTABLES[name]]


def environment() -> dict[str, str]:
    """Return the environment of started processes: this tree, English, unbuffered."""
    paths = [str(ROOT), str(ROOT / 'test'), *filter(None, [os.environ.get('PYTHONPATH')])]
    # SIGABRT: what a process that hangs is doing
    return {**as_users_have_it(), 'PYTHONPATH': os.pathsep.join(paths), 'PYTHONUNBUFFERED': '1',
            'PYTHONFAULTHANDLER': '1', 'LC_ALL': 'C.UTF-8', 'COLUMNS': '99'}


class Told:
    """
    What somebody says on standard output and standard error, line by line.

    :ivar name: who.
    """

    name: str

    @property
    def running(self) -> bool:
        raise NotImplementedError

    @property
    def lines(self) -> list[str]:
        """Whole lines of standard output so far."""
        raise NotImplementedError

    @property
    def errors(self) -> list[str]:
        """Whole lines of standard error so far."""
        raise NotImplementedError

    def line(self, pattern: str, *, errors: bool = False, since: int = 0,
             timeout: float = DEADLINE) -> str:
        """Wait for a line that contains the pattern, from line number ``since`` on."""
        expression = re.compile(pattern)
        looked = since

        def find() -> str | None:
            nonlocal looked
            ended = not self.running  # first: what it wrote last is there then
            lines = self.errors if errors else self.lines
            for line in lines[looked:]:
                if expression.search(line):
                    return line
            looked = max(looked, len(lines))
            if ended:
                raise AssertionError(f'{self.name} ended without a line {pattern!r}')
            return None
        return str(wait_for(find, f'a line {pattern!r} of {self.name}', timeout))

    def error(self, pattern: str, *, since: int = 0, timeout: float = DEADLINE) -> str:
        """Wait for a line of standard error."""
        return self.line(pattern, errors=True, since=since, timeout=timeout)

    def losses(self) -> list[str]:
        """Return what a bridge says of lost drives."""
        return [line for line in self.errors if 'offline' in line]


class Witness:
    """What simulated drives have seen on the bus."""

    def frames(self, pattern: str = '', since: int = 0) -> list[str]:
        """Return the logged frames, as ``003FFFF0#000003E800000000 R``; R: from the bridge."""
        raise NotImplementedError

    @staticmethod
    def matches(pattern: str, frame: str) -> bool:
        """Tell whether a frame has such a place."""
        return re.search(pattern, frame) is not None

    def frame(self, pattern: str, since: int = 0, count: int = 1) -> list[str]:
        """Wait for ``count`` frames that match."""
        def find() -> list[str] | None:
            found = self.frames(pattern, since)
            return found if len(found) >= count else None
        return list(wait_for(find, f'{count} frames {pattern!r}'))


class Process(Told):
    """
    A process with its standard output and standard error in files.

    :param streams: descriptors that it gets instead, ``stdout``, ``stderr``.
    """

    def __init__(self, command: Sequence[str], directory: Path, name: str,
                 **streams: int) -> None:
        self.name = name
        self.command = list(command)
        self.out = directory / f'{name}.out'
        self.err = directory / f'{name}.err'
        self._out, self._err = _Lines(self.out), _Lines(self.err)
        with self.out.open('wb') as out, self.err.open('wb') as err:
            self.process = subprocess.Popen(  # type: ignore[call-overload]
                self.command, env=environment(), stdin=subprocess.PIPE,
                **{'stdout': out, 'stderr': err, **streams})

    @property
    def pid(self) -> int:
        return self.process.pid

    @property
    def running(self) -> bool:
        return self.process.poll() is None

    @property
    def lines(self) -> list[str]:
        """Whole lines of standard output so far."""
        return self._out.read()

    @property
    def errors(self) -> list[str]:
        """Whole lines of standard error so far."""
        return self._err.read()

    def write(self, text: str) -> None:
        """Write a line to standard input."""
        assert self.process.stdin is not None
        self.process.stdin.write(f'{text}\n'.encode())
        self.process.stdin.flush()

    def send(self, number: int) -> None:
        """Send a signal."""
        self.process.send_signal(number)

    def suspend(self) -> None:
        """Have it stand still; it does when this returns."""
        self.send(signal.SIGSTOP)
        tasks = Path(f'/proc/{self.pid}/task')
        wait_for(lambda: all(
            (task / 'stat').read_text().rpartition(')')[2].split()[0] == 'T'
            for task in tasks.iterdir()), f'{self.name} to stand still')

    def wait(self, timeout: float = DEADLINE) -> int:
        """Wait for the end; return the exit code."""
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            # so that its standard error tells what it is doing instead
            self.send(signal.SIGABRT)
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(10.0)
            raise AssertionError(f'{self.name} did not end in {timeout:g} s') from None

    def end(self, number: int = signal.SIGTERM, timeout: float = DEADLINE) -> int:
        """Send a signal and wait for the end; return the exit code."""
        self.send(number)
        return self.wait(timeout)

    def finish(self) -> None:
        """
        End it as a user does, and kill it only where that does not help.

        What is killed leaves a port in shared memory to its successor, which may not be heard by
        whoever still has the old one open (eProsima/Fast-DDS, pull request 4728).
        """
        if self.running:
            self.send(signal.SIGTERM)
            self.send(signal.SIGCONT)
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(PATIENCE)
        self.kill()

    def kill(self) -> None:
        """End it, whatever it is doing."""
        if self.running:
            self.process.kill()
        self.process.wait()
        if self.process.stdin is not None:
            try:
                self.process.stdin.close()
            except OSError:
                pass

    def dump(self) -> str:
        """Return the command, the exit code and the end of both outputs."""
        texts = [f'{" ".join(self.command)}\nexit code: {self.process.poll()}']
        for title, path in (('standard error', self.err), ('standard output', self.out)):
            lines = path.read_text(encoding='utf-8', errors='replace').splitlines()
            left_out = len(lines) - SHOWN
            note = f' (without the first {left_out} lines)' if left_out > 0 else ''
            texts += [f'--- {title}{note}', *lines[-SHOWN:]]
        return '\n'.join(texts)


class Processes:
    """The processes of one test; their outputs are in a directory."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.started: list[Process] = []
        #: shown and looked at like the others, but not ended with them
        self.guests: list[Process] = []

    def start(self, command: Sequence[str], name: str, **streams: int) -> Process:
        """Start anything."""
        number = sum(process.name.rstrip('0123456789') == name for process in self.started)
        process = Process(command, self.directory, name + (str(number + 1) if number else ''),
                          **streams)
        self.started.append(process)
        return process

    def drive_can(self, *arguments: str) -> Process:
        """Start the command ``drive_can``."""
        return self.start([*command_line('drive_can'), *arguments], arguments[0].strip('-'))

    def simulator(self, file: Path, *arguments: str, link: bool = True) -> 'Simulator':
        """Start simulated drives behind pseudo-terminals, which ``links/`` points to."""
        where = ['--pty-link', str(self.directory / 'links')] if link else []
        process = self.drive_can('simulate', '--params-file', str(file), *where, '--log-frames',
                                 *arguments)
        process.__class__ = Simulator
        assert isinstance(process, Simulator)
        process.links = self.directory / 'links'
        process._frames, process._looked = [], 0
        process.line('^drive ')
        return process

    def bridge(self, file: Path | None, namespace: str = '', *arguments: str,
               **streams: int) -> Process:
        """Start the bridge."""
        options = ['--params-file', str(file)] if file else []
        if namespace:
            options += ['-r', f'__ns:=/{namespace}']
        return self.start([*command_line('drive_can_bridge'), '--ros-args', *options,
                           *arguments], 'bridge', **streams)

    def end(self) -> None:
        """End what is still running, drives last."""
        for process in self.started:
            if not isinstance(process, Simulator):
                process.finish()
        for process in self.started:
            process.kill()

    def tracebacks(self) -> list[str]:
        """Return the names of the processes that showed a traceback."""
        return [process.name for process in (*self.started, *self.guests)
                if b'Traceback' in process.out.read_bytes() + process.err.read_bytes()]

    def dump(self) -> str:
        """Return all outputs; frames, which are many and say little, come last."""
        return '\n\n'.join(
            f'=== {process.name}: {process.dump()}'
            for process in sorted((*self.started, *self.guests),
                                  key=lambda process: isinstance(process, Simulator)))


class Simulator(Process, Witness):
    """``drive_can simulate --log-frames``: also a witness of what was on the bus."""

    links: Path
    _frames: list[str]
    _looked: int

    def kill(self) -> None:
        """
        End it at once, so that it cannot clean up behind itself.

        Its links go first: another test's terminal may get the name that they point to.
        """
        for link in self.links.glob('*'):
            link.unlink()
        super().kill()

    def frames(self, pattern: str = '', since: int = 0) -> list[str]:
        """Return the logged frames, as ``003FFFF0#000003E800000000 R``; R: from the bridge."""
        expression = re.compile(pattern)
        lines = self.lines
        self._frames += [line.split(' ', 2)[2] for line in lines[self._looked:]
                         if line.startswith('(')]
        self._looked = len(lines)
        return [frame for frame in self._frames[since:] if expression.search(frame)]


class Client:
    """ROS as others see it."""

    def ask(self, action: str, timeout: float = DEADLINE, **arguments: Any) -> Any:
        """Let the client do something; return its answer."""
        raise NotImplementedError

    def publish(self, topic: str, value: float, *, rate: float = 50.0) -> None:
        """Publish a value again and again, until told something else."""
        self.ask('publish', topic=topic, value=value, rate=rate)

    def silence(self, topic: str) -> None:
        """Publish nothing any more."""
        self.ask('publish', topic=topic, value=None, rate=1.0)

    def value(self, topic: str, low: float, high: float, *, kind: str = 'Float64',
              timeout: float = DEADLINE) -> float:
        """Wait for a value within limits that arrives after this call."""
        return float(self.ask('value', timeout, topic=topic, kind=kind, low=low, high=high))

    def values(self, topic: str) -> list[float]:
        """Return the different values that have arrived since the last ``value``, sorted."""
        found: list[float] = self.ask('values', topic=topic)
        return found

    def online(self, drive: str, wanted: bool = True) -> None:
        """Wait until the drive's latched topic says online, or offline."""
        self.ask('latched', topic=f'{drive}/online', wanted=wanted)

    def bit(self, topic: str, wanted: bool) -> None:
        """Wait until a latched topic of a named bit has this value."""
        self.ask('latched', topic=topic, wanted=wanted)

    def flashed(self, topic: str) -> None:
        """Wait until a named bit was set, for however short, since the client looks at it."""
        self.ask('flashed', topic=topic)

    def control(self, service: str, wanted: bool | None = None) -> tuple[bool, str]:
        """Call ~/enable, or ~/quick_stop and ~/reset_fault (None); return what they answer."""
        success, message = self.ask('control', service=service, wanted=wanted)
        return bool(success), str(message)

    def meet(self, service: str) -> None:
        """Be known to a ~/quick_stop or ~/reset_fault, so that it can be called at any time."""
        self.ask('meet', service=service)

    def control_again(self, service: str) -> tuple[bool, str, float]:
        """Call one that was met; return what it answers, and after how many s."""
        success, message, took = self.ask('control_again', service=service)
        return bool(success), str(message), float(took)

    def get(self, drive: str, *names: str) -> list[Any]:
        """Call GetParameters; None is NOT_SET."""
        values: list[Any] = self.ask('get', drive=drive, names=names)
        return values

    def set(self, drive: str, *, atomic: bool = False, **values: Any) -> list[tuple[bool, str]]:
        """Call SetParameters; return success and reason of each."""
        answer = self.ask('set_atomically' if atomic else 'set', drive=drive, values=values)
        return [(bool(success), str(reason)) for success, reason in answer]

    def diagnostics(self, name: str, **conditions: str) -> dict[str, str]:
        """
        Return the next diagnostic status of that name whose facts match these patterns.

        It has ``level``, ``message`` and every key.
        """
        facts: dict[str, str] = self.ask('diagnostics', name=name, conditions=conditions)
        return facts


class ClientProcess(Client):
    """The client script ``ros_client.py``."""

    def __init__(self, directory: Path) -> None:
        self.process = Process([sys.executable, str(Path(__file__).with_name('ros_client.py'))],
                               directory, 'client')
        self._answers = 0

    def ask(self, action: str, timeout: float = DEADLINE, **arguments: Any) -> Any:
        """Let the client do something; return its answer."""
        self.process.write(json.dumps({'action': action, 'timeout': timeout, **arguments}))
        self._answers += 1
        wanted = self._answers
        wait_for(lambda: len(self.process.lines) >= wanted or not self.process.running,
                 f'the client to {action} {arguments}', timeout + DEADLINE)
        answer = json.loads(self.process.lines[wanted - 1])
        if 'failure' in answer:
            raise AssertionError(f'{action} {arguments}: {answer["failure"]}')
        return answer['result']


class _Lines:
    """The whole lines of a file that grows, each of them read once."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._rest = b''
        self._place = 0
        self._lines: list[str] = []

    def read(self) -> list[str]:
        """Return all of them so far."""
        with self._path.open('rb') as file:
            file.seek(self._place)
            new = file.read()
        self._place += len(new)
        whole, end, self._rest = (self._rest + new).rpartition(b'\n')
        self._lines += (whole + end).decode(errors='replace').splitlines()
        return list(self._lines)
