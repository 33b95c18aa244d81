# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Standard outputs that keep nobody waiting, in a process of their own."""

import os
from pathlib import Path
import subprocess
import sys
import textwrap
import time

import pytest

#: against the wall clock (test/real.py)
pytestmark = pytest.mark.real

HEAD = """
import ctypes, os, sys, threading, time
from drive_can_bridge.process.standard_outputs import Output, StandardOutputs
libc = ctypes.PyDLL(None)      # holds the interpreter while it writes, as rcutils does
"""


def run(program: str, **options: object) -> 'subprocess.CompletedProcess[bytes]':
    return subprocess.run([sys.executable, '-c', HEAD + textwrap.dedent(program)], timeout=60,
                          stdout=subprocess.PIPE, check=False, **options)  # type: ignore[call-overload,no-any-return]


def start(program: str, standard_error: int) -> 'subprocess.Popen[bytes]':
    return subprocess.Popen([sys.executable, '-c', HEAD + textwrap.dedent(program)],
                            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                            stderr=standard_error)


def test_everything_arrives_whoever_writes_it() -> None:
    done = run("""
        with Output('standard error', 2) as output:
            assert not output.is_terminal
            print('python', file=sys.stderr)
            os.write(2, b'descriptor\\n')
            libc.write(2, b'library\\n', 8)
            for number in range(20_000):
                libc.write(2, b'x' * 99 + b'\\n', 100)
                if number % 100 == 99:
                    assert output.flush(time.monotonic() + 30.0)
        os.write(2, b'afterwards\\n')
        """, stderr=subprocess.PIPE)
    lines = done.stderr.decode().splitlines()
    assert (done.returncode, lines[:3], lines[-1]) == (
        0, ['python', 'descriptor', 'library'], 'afterwards')
    assert lines[3:-1] == ['x' * 99] * 20_000


def test_flushed_is_written(tmp_path: Path) -> None:
    with (tmp_path / 'written').open('wb') as file:
        done = run("""
            sys.setswitchinterval(1e-6)
            real = os.dup(2)
            with Output('standard error', 2) as output:
                for number in range(1, 5001):
                    os.write(2, b'x' * 9 + b'\\n')
                    assert output.flush(time.monotonic() + 30.0)
                    assert os.fstat(real).st_size == 10 * number, number
            """, stderr=file)
    assert done.returncode == 0, (tmp_path / 'written').read_text()[-1000:]


def test_nobody_reads() -> None:
    read, write = os.pipe()
    process = start("""
        output = Output('standard error', 2).__enter__()
        ticks = []
        threading.Thread(target=lambda: [ticks.append(time.monotonic()) or time.sleep(0.001)
                                         for _ in range(500)], daemon=True).start()
        for number in range(40_000):    # 4 MB
            while libc.write(2, b'x' * 99 + b'\\n', 100) != 100:   # nobody's, if lost here
                time.sleep(0.001)
        while len(ticks) < 500:
            time.sleep(0.01)
        assert not output.flush(time.monotonic() + 0.05)
        print('on its way', flush=True)
        sys.stdin.read()
        """, write)
    os.close(write)
    assert process.stdin is not None and process.stdout is not None
    # it got that far without a reader
    assert process.stdout.readline() == b'on its way\n'
    text = b''
    while b'left out here' not in text:
        text += os.read(read, 65536)
    lines = text.decode().splitlines()
    told = next(line for line in lines if 'left out here' in line)
    kept = sum(line == 'x' * 99 for line in lines)
    assert kept + int(told.split()[1]) == pytest.approx(40_000, abs=100)
    assert 5_000 < kept < 15_000
    process.kill()
    process.wait()
    process.stdin.close()
    process.stdout.close()
    os.close(read)


@pytest.mark.parametrize('end', ['closed', 'gone'])
def test_nobody_is_there(end: str) -> None:
    program = """
        with Output('standard error', 2) as output:
            for _ in range(1000):
                libc.write(2, b'x' * 1000, 1000) if end == 'gone' else None
                time.sleep(0)
            assert output.flush()
        print('through')
        """
    if end == 'closed':
        command = [sys.executable, '-c', f'{HEAD}\nend = "closed"\n{textwrap.dedent(program)}']
        done = subprocess.run(['sh', '-c', 'exec "$@" 2>&-', 'sh', *command], timeout=60,
                              stdout=subprocess.PIPE, check=False)
    else:
        read, write = os.pipe()
        os.close(read)
        done = run('\nend = "gone"\n' + textwrap.dedent(program), stderr=write)
        os.close(write)
    assert (done.returncode, done.stdout) == (0, b'through\n')


def test_last_words_wait_until_they_are_taken_unless_nobody_takes_them() -> None:
    """However long that takes: a reader that reads slowly reads."""
    program = """
        output = Output('standard error', 2).__enter__()
        libc.write(2, b'x' * 200_000, 200_000)
        print('flushing', flush=True)
        print(output.flush(), flush=True)
        libc.write(2, b'x' * 200_000, 200_000)
        print(output.flush(), flush=True)
        sys.stdin.read()
        """
    read, write = os.pipe()
    process = start(program, write)
    os.close(write)
    assert process.stdin is not None and process.stdout is not None
    assert process.stdout.readline() == b'flushing\n'
    taken = 0
    while taken < 200_000:
        taken += len(os.read(read, 4096))
        time.sleep(0.03)    # 1.5 s for all of it
    assert process.stdout.readline() == b'True\n'
    assert process.stdout.readline() == b'False\n'
    process.kill()
    process.wait()
    process.stdin.close()
    process.stdout.close()
    os.close(read)


@pytest.mark.parametrize('number', [1, 2])
def test_neither_output_keeps_anybody_waiting(number: int) -> None:
    read, write = os.pipe()
    streams = {1: {'stdout': write, 'stderr': subprocess.PIPE},
               2: {'stdout': subprocess.PIPE, 'stderr': write}}[number]
    process = subprocess.Popen([sys.executable, '-c', HEAD + textwrap.dedent(f"""
        with StandardOutputs() as outputs:
            for _ in range(10):
                libc.write({number}, b'x' * 100_000, 100_000)
                time.sleep(0)
            print('through', file=sys.stdout if {number} == 2 else sys.stderr, flush=True)
            assert not outputs.flush()
            os._exit(0)
        """)], **streams)  # type: ignore[call-overload]
    os.close(write)
    other = process.stderr if number == 1 else process.stdout
    assert other is not None and other.readline() == b'through\n'
    assert process.wait(timeout=60) == 0
    other.close()
    os.close(read)


def test_lines_of_both_keep_their_order_where_they_go_the_same_way() -> None:
    done = run("""
        with StandardOutputs():
            for number in range(1000):
                os.write(1 + number % 2, b'%d\\n' % number)
        """, stderr=subprocess.STDOUT)
    assert done.stdout == b''.join(b'%d\n' % number for number in range(1000))


CLOSED = """
import os, sys
from drive_can_bridge.process.beginning import begin
begin()
print('output')
print('error', file=sys.stderr)
sys.stdout.flush()
assert os.open(os.devnull, os.O_RDONLY) > 2
"""


@pytest.mark.parametrize('closed', ['<&-', '>&-', '2>&-', '<&- >&- 2>&-'])
def test_streams_that_somebody_closed_go_to_nobody(closed: str) -> None:
    done = subprocess.run(['sh', '-c', f'exec "$@" {closed}', 'sh', sys.executable, '-c', CLOSED],
                          timeout=60, capture_output=True, check=False)
    assert done.returncode == 0
    assert done.stdout == (b'' if ' >' in f' {closed}' else b'output\n')
    assert done.stderr == (b'' if '2>' in closed else b'error\n')
