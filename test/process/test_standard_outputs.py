# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Standard outputs that keep nobody waiting: any descriptors will do, and a clock by hand."""

from array import array
from collections.abc import Iterator
from contextlib import suppress
import ctypes
import fcntl
import os
from pathlib import Path
import subprocess
import sys
import termios
import threading
import time

from clocks import HandClock
import pytest

from drive_can_bridge.process.standard_outputs import Output
from drive_can_bridge.process.write_watch import MOMENT, PATIENCE, WriteWatch

pytestmark = pytest.mark.usefixtures('threads')

#: holds the interpreter while it writes, as rcutils does
LIBC = ctypes.PyDLL(None)
#: bytes of the smallest pipe, and of one write
PIECE = 4096


class Time:
    """
    A time that stands still.

    :ivar now: s.
    :ivar step: s that pass with each look at it.
    """

    def __init__(self) -> None:
        self.now = self.step = 0.0
        self.clock = HandClock(self._look)

    def _look(self) -> float:
        self.now += self.step
        return self.now


@pytest.fixture
def hand() -> Time:
    return Time()


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """Return a small pipe: where it is read, and where it is written."""
    read, write = os.pipe()
    fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, PIECE)
    yield read, write
    for descriptor in (read, write):
        with suppress(OSError):
            os.close(descriptor)


def put(descriptor: int, data: bytes) -> None:
    """Write all of it as a library does; what an output cannot take yet is tried again."""
    while LIBC.write(descriptor, data, len(data)) != len(data):
        time.sleep(0)       # its threads go on


def test_everything_arrives_whoever_writes_it(hand: Time, tmp_path: Path) -> None:
    with (tmp_path / 'written').open('w') as file:
        number = file.fileno()
        with Output(hand.clock, 'standard error', number) as output:
            assert not output.is_terminal
            print('python', file=file, flush=True)
            os.write(number, b'descriptor\n')
            put(number, b'library\n')
            for count in range(20_000):
                put(number, b'x' * 99 + b'\n')
                if count % 100 == 99:
                    assert output.flush()
        os.write(number, b'afterwards\n')
    lines = (tmp_path / 'written').read_text().splitlines()
    assert (lines[:3], lines[-1]) == (['python', 'descriptor', 'library'], 'afterwards')
    assert lines[3:-1] == ['x' * 99] * 20_000


def test_flushed_is_written(hand: Time, tmp_path: Path) -> None:
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with (tmp_path / 'written').open('wb') as file:
            real = os.dup(file.fileno())
            with Output(hand.clock, 'standard error', file.fileno()) as output:
                for number in range(1, 5001):
                    os.write(file.fileno(), b'x' * 9 + b'\n')
                    assert output.flush()
                    assert os.fstat(real).st_size == 10 * number, number
            os.close(real)
    finally:
        sys.setswitchinterval(before)


def test_nobody_reads(hand: Time, pipe: tuple[int, int]) -> None:
    read, write = pipe
    with Output(hand.clock, 'standard error', write) as output:
        for _ in range(40_000):     # 4 MB: it gets that far without a reader
            put(write, b'x' * 99 + b'\n')
        assert not output.flush(hand.now - 1.0)
        text = b''
        while b'left out here' not in text:
            text += os.read(read, 65536)
    lines = text.decode().splitlines()
    told = next(line for line in lines if 'left out here' in line)
    kept = sum(line == 'x' * 99 for line in lines)
    assert kept + int(told.split()[1]) == pytest.approx(40_000, abs=100)
    assert 5_000 < kept < 15_000


@pytest.mark.parametrize('end', ['closed', 'gone'])
def test_nobody_is_there(hand: Time, pipe: tuple[int, int], end: str) -> None:
    read, write = pipe
    os.close(read)
    if end == 'closed':
        os.close(write)
    with Output(hand.clock, 'standard error', write) as output:
        for _ in range(1000):
            if end == 'gone':
                put(write, b'x' * 1000)
        assert output.flush()


def test_last_words_wait_until_they_are_taken_unless_nobody_takes_them(
        hand: Time, pipe: tuple[int, int]) -> None:
    """However long that takes: a reader that reads slowly reads."""
    read, write = pipe
    with Output(hand.clock, 'standard error', write) as output:
        put(write, b'x' * 50 * PIECE)

        def read_slowly() -> None:
            for _ in range(50):
                assert len(os.read(read, PIECE)) == PIECE
                hand.now += 0.75 * PATIENCE
        reader = threading.Thread(target=read_slowly)
        reader.start()
        assert output.flush()
        reader.join()
        assert hand.now == 50 * 0.75 * PATIENCE
        put(write, b'x' * 50 * PIECE)
        hand.step = 0.1 * PATIENCE
        begun = hand.now
        assert not output.flush()
        assert hand.now - begun > PATIENCE
        os.close(read)      # who would read it all has gone: the writing thread ends, too


def test_a_process_that_stood_still_says_nothing_about_its_reader(hand: Time) -> None:
    taking = WriteWatch(hand.clock.now)
    with taking:
        nobody = taking.watch()
        for _ in range(3):      # SIGSTOP, a virtual machine that was moved, ...
            hand.now += 100.0 * PATIENCE
            assert not nobody()
    with taking:                # the next write
        for _ in range(int(PATIENCE / MOMENT)):
            assert not nobody()
            hand.now += MOMENT
        hand.now += MOMENT
        assert nobody()
    assert not nobody()         # taken after all


#: writes to both outputs, which nobody reads until it has said on another descriptor that it could
BOTH = """
import os, sys
from drive_can_bridge.clock import SteadyClock
from drive_can_bridge.process.standard_outputs import StandardOutputs
with StandardOutputs(SteadyClock()):
    for number in range(1000):
        os.write(1 + number % 2, b'%-99d\\n' % number)
    os.write(int(sys.argv[1]), b'through')
    sys.stdin.read()
"""


@pytest.mark.real
def test_lines_of_both_keep_nobody_waiting_and_their_order_where_they_go_the_same_way() -> None:
    told, tell = os.pipe()
    with subprocess.Popen([sys.executable, '-c', BOTH, str(tell)], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          pass_fds=[tell]) as process:
        os.close(tell)
        assert os.read(told, 7) == b'through'
        out, _ = process.communicate()
    os.close(told)
    assert [int(line) for line in out.splitlines()] == list(range(1000))


CLOSED = """
import os, sys
from drive_can_bridge.process.beginning import begin
begin()
print('output')
print('error', file=sys.stderr)
sys.stdout.flush()
assert os.open(os.devnull, os.O_RDONLY) > 2
assert sys.stdin.read() == '' and not sys.stdin.isatty()
"""


@pytest.mark.usefixtures('programs')
def test_streams_that_somebody_closed_go_to_nobody() -> None:
    """Each at once; what a bridge does then: system/test_system_stuck_output.py."""
    done = subprocess.run(['sh', '-c', 'exec "$@" <&- >&-', 'sh', sys.executable, '-c', CLOSED],
                          capture_output=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, b'', b'error\n')


KEPT = """
import os, shutil, sys
from drive_can_bridge.cli.command import output
from drive_can_bridge.process.beginning import begin, keep_output
begin()
keep_output()
os.write(1, b'library\\n')
print('ours', sys.stdout.isatty(), shutil.get_terminal_size().columns, flush=True)
with open(output('/dev/stdout'), 'w') as file:
    file.write('a file')
"""


@pytest.mark.usefixtures('programs')
def test_standard_output_is_kept_from_libraries() -> None:
    command = [sys.executable, '-c', KEPT]
    environment = {name: value for name, value in os.environ.items() if name != 'COLUMNS'}
    done = subprocess.run(command, capture_output=True, env=environment, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (
        0, b'ours False 80\na file', b'library\n')
    done = subprocess.run(['sh', '-c', 'exec "$@" >&-', 'sh', *command], capture_output=True,
                          env=environment, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, b'', b'library\n')
    keyboard, screen = os.openpty()
    fcntl.ioctl(screen, termios.TIOCSWINSZ, array('H', [24, 132, 0, 0]))
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=screen,
                          stderr=subprocess.PIPE, env=environment, check=False)
    assert (done.returncode, done.stderr) == (0, b'library\n')
    assert os.read(keyboard, PIECE) == b'ours True 132\r\na file'
    for descriptor in (keyboard, screen):
        os.close(descriptor)
