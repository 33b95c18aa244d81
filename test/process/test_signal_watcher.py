# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What counts as a second signal."""

import os
import signal
import subprocess
import sys

import pytest

#: tells when it is ready, stops for a second after the first signal, and reports its exit code
PROGRAM = """
import sys, time
from drive_can_bridge.process.signals import SignalWatcher
with SignalWatcher() as watcher:
    print("ready", flush=True)
    watcher.wait()
    print("stopping", flush=True)
    time.sleep(1.0)
    sys.exit(watcher.exit_code(0))
"""


def run(*numbers: int, line: str = 'ready') -> int:
    """Send signals, all but the first after ``line`` was printed; return the exit code."""
    with subprocess.Popen([sys.executable, '-c', PROGRAM], stdout=subprocess.PIPE,
                          text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'ready\n'
        process.send_signal(numbers[0])
        if line == 'stopping':
            assert process.stdout.readline() == 'stopping\n'
        for number in numbers[1:]:
            process.send_signal(number)
        return process.wait(timeout=60)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_one_signal(number: int) -> None:
    assert run(number) == 0


def test_the_same_signal_in_the_same_breath_is_one_signal() -> None:
    assert run(signal.SIGINT, signal.SIGINT) == 0


def test_another_signal_is_a_second_one() -> None:
    assert run(signal.SIGTERM, signal.SIGINT, line='stopping') == 128 + signal.SIGINT


def test_a_second_signal_later_ends_at_once() -> None:
    with subprocess.Popen([sys.executable, '-c', PROGRAM], stdout=subprocess.PIPE,
                          text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'ready\n'
        process.send_signal(signal.SIGTERM)
        assert process.stdout.readline() == 'stopping\n'
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=0.2)
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=60) == 128 + signal.SIGTERM


def test_whoever_ignores_the_end_of_its_terminal_goes_on() -> None:
    with subprocess.Popen(['nohup', sys.executable, '-c', PROGRAM], stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'ready\n'
        process.send_signal(signal.SIGHUP)
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=0.3)
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=60) == 0


#: ends without what Python does on its way out
LEAVING = """
import atexit
from drive_can_bridge.process.signals import leave, SignalWatcher
atexit.register(print, "this is never said")
with SignalWatcher(keep=True) as watcher:
    print('done', flush=True)
    print('flushed', end='')
    leave(watcher.exit_code(3))
"""


def test_leaving_is_immediate_and_loses_no_output() -> None:
    done = subprocess.run([sys.executable, '-c', LEAVING], capture_output=True, text=True,
                          check=False, timeout=60, env={**os.environ, 'PYTHONUNBUFFERED': ''})
    assert (done.returncode, done.stdout, done.stderr) == (3, 'done\nflushed', '')


def test_a_script_that_starts_it_in_the_background_can_stop_it_by_sigint() -> None:
    """A shell without job control has its background processes ignore SIGINT."""
    with subprocess.Popen(['sh', '-c', f'trap "" INT; exec {sys.executable} -c \'{PROGRAM}\''],
                          stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'ready\n'
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 0
