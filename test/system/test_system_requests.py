# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Requests that the middleware cannot read: cycles, stops, signals and their times.

What goes wrong with one goes on until the story says that it is over, so nothing hangs on how fast
that is told. Times are judged where they are made: of a call by who calls, who was known to the
service before; of frames at the drive; and of cycles beside a thread that only sleeps as long.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import itertools
import os
from pathlib import Path
import signal
import sys
import threading
import time

from parameter_files import bridge_file, CONVEYOR
from processes import Client, Process, Processes, Simulator
import pytest
from test_system_reconnection import start_moving, status_of
from waiting import pause, wait_for

pytestmark = pytest.mark.real

PERIOD = CONVEYOR['period']
#: what the middleware does with a request
TROUBLES = 'sleep', 'throw', 'fill'
#: s: an ordinary process on a machine that does other things, too
LATE = 0.5
#: s of an end that waits for nobody; whoever waits for a thread at the end does it for 5 s
END = 4.5
NEUTRAL = '003FFFF0#000003E800000000 R'


@contextmanager
def _burdened(processes: Processes, file: Path, namespace: str, tmp_path: Path,
              monkeypatch: pytest.MonkeyPatch) -> Iterator[
                  tuple[Process, Path, Callable[[], None]]]:
    """Start a bridge; return it, where its trouble is told, and what says that this is over."""
    trouble = tmp_path / 'trouble'
    monkeypatch.setenv('TROUBLE', str(trouble))
    os.mkfifo(f'{trouble}.over')
    over = os.open(f'{trouble}.over', os.O_RDWR)
    script = Path(__file__).with_name('burdened_bridge.py')
    bridge = processes.start(
        [sys.executable, str(script), '--ros-args', '--params-file', str(file),
         '-r', f'__ns:=/{namespace}'], 'bridge')
    try:
        yield bridge, trouble, lambda: os.write(over, b'\n') and None
    finally:
        os.write(over, b'\n')
        os.close(over)


class _Sleeper:
    """
    What this machine does to somebody who sleeps for a period, again and again.

    :ivar count: periods so far.
    :ivar late: s that the latest one was late.
    """

    def __init__(self) -> None:
        self.count = 0
        self.late = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> '_Sleeper':
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        due = time.monotonic() + PERIOD
        while not self._ended.wait(due - time.monotonic()):
            self.count += 1
            self.late = max(self.late, time.monotonic() - due)
            due = max(due + PERIOD, time.monotonic())


def _requests(simulator: Simulator, since: int) -> list[tuple[float, str]]:
    """Return cyclic requests, as the drive has received them, and when: time of the day, in s."""
    return [(float(line.split(')')[0][1:]), line.split(' ', 2)[2])
            for line in simulator.lines[since:]
            if line.startswith('(') and ' 003FFFF0#' in line and line.endswith(' R')]


@pytest.mark.parametrize('what', TROUBLES)
def test_nobody_else_notices(processes: Processes, client: Client, namespace: str, tmp_path: Path,
                             monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    # a drive that answers late is the machine's affair, and so is one that is asked for a value
    file = bridge_file(tmp_path, memory_limit_mb=128, drives={
        'conveyor': {**CONVEYOR, 'missed_limit': 250, 'parameter_timeout': 60.0}})
    simulator = processes.simulator(file)
    with _burdened(processes, file, namespace, tmp_path, monkeypatch) as (bridge, trouble, over):
        drive = f'/{namespace}/conveyor'
        start_moving(client, drive)
        assert client.get(drive, 'ramp_time') != [None]
        client.meet(f'{drive}/quick_stop')

        def exchanges() -> int:
            return int(client.diagnostics(status_of(drive))['exchanges'])
        trouble.write_text(what, encoding='ascii')
        since = len(simulator.lines)
        with _Sleeper() as sleeper:
            asker = processes.drive_can('read', 'conveyor', 'ramp_time',
                                        '--namespace', f'/{namespace}')
            wait_for(lambda: not trouble.exists())
            success, message, took = client.control_again(f'{drive}/quick_stop')
            assert success, message
            assert took < 1.0
            before = exchanges()    # what the drive answers is read
            wait_for(lambda: exchanges() >= before + 10)
            pause(1.0)
        gaps = [later - earlier for (earlier, _), (later, _) in itertools.pairwise(
            _requests(simulator, since))]
        assert len(gaps) > 0.9 * (sleeper.count - LATE / PERIOD)
        assert max(gaps) < LATE + sleeper.late
        assert not [line for line in bridge.errors if 'offline' in line]
        if what == 'fill':
            over()
            bridge.error('filled with')
        if what == 'throw':
            bridge.error('the middleware cannot read a request of .*/conveyor/get_parameters: '
                         'std::bad_alloc')
        if what != 'sleep':
            assert client.get(drive, 'ramp_time') != [None]
        asked = time.monotonic()
        assert bridge.end(signal.SIGTERM) == 0      # of a sleep, that still lasts
        assert time.monotonic() - asked < END
    bridge.error('conveyor: stopped')
    assert simulator.frames('^003FFFF0.* R$')[-1] == NEUTRAL
    asker.kill()


def test_the_end_while_there_is_no_memory(
        processes: Processes, client: Client, namespace: str, tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    file = bridge_file(tmp_path, memory_limit_mb=128)
    simulator = processes.simulator(file)
    with _burdened(processes, file, namespace, tmp_path, monkeypatch) as (bridge, trouble, over):
        start_moving(client, f'/{namespace}/conveyor')
        trouble.write_text('fill', encoding='ascii')
        asker = processes.drive_can('read', 'conveyor', 'ramp_time',
                                    '--namespace', f'/{namespace}')
        wait_for(lambda: not trouble.exists())
        lines, frames, asked = len(simulator.lines), len(simulator.frames()), time.time()
        bridge.send(signal.SIGTERM)
        simulator.frame(f'^{NEUTRAL}$', frames, count=3)
        third = [when for when, frame in _requests(simulator, lines) if frame == NEUTRAL][2]
        assert third - asked < 1.0
        over()
        assert bridge.wait() == 0
    bridge.error('conveyor: stopped')
    assert not [line for line in bridge.errors if '[ERROR]' in line]
    asker.kill()
