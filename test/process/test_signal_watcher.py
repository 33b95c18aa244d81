# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What counts as a second signal."""

import os
import signal
import subprocess
import sys

import pytest

#: against the wall clock (test/real.py)
pytestmark = pytest.mark.real

#: tells when it is ready, stops for a second after the first signal, says so when that is no
#: breath any more, and reports its exit code
PROGRAM = """
import sys, time
from drive_can_bridge.process.signals import SAME_BREATH, SignalWatcher
with SignalWatcher() as watcher:
    print("ready", flush=True)
    watcher.wait()
    time.sleep(2 * SAME_BREATH)
    print("stopping", flush=True)
    time.sleep(1.0)
    sys.exit(watcher.exit_code(0))
"""
#: gets two signals at the same moment, however busy the machine is
BOTH_AT_ONCE = """
import os, sys, time
from drive_can_bridge.process.beginning import hold_signals
from drive_can_bridge.process.signals import SignalWatcher
hold_signals()
for number in sys.argv[1:]:
    os.kill(os.getpid(), int(number))
with SignalWatcher() as watcher:
    watcher.wait()
    time.sleep(1.0)
    sys.exit(watcher.exit_code(0))
"""
ALL = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT]


def run(*numbers: int) -> int:
    """Send signals, all but the first a while after that; return the exit code."""
    with subprocess.Popen([sys.executable, '-c', PROGRAM], stdout=subprocess.PIPE,
                          text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'ready\n'
        process.send_signal(numbers[0])
        if numbers[1:]:
            assert process.stdout.readline() == 'stopping\n'
        for number in numbers[1:]:
            process.send_signal(number)
        return process.wait(timeout=60)


@pytest.mark.parametrize(('number', 'code'), [
    (signal.SIGINT, 0), (signal.SIGTERM, 0), (signal.SIGHUP, 0), (signal.SIGQUIT, 131)])
def test_one_signal(number: int, code: int) -> None:
    assert run(number) == code


@pytest.mark.parametrize('second', ALL)
@pytest.mark.parametrize('first', [signal.SIGINT, signal.SIGTERM])
def test_any_signal_in_the_same_breath_is_the_same_stop(first: int, second: int) -> None:
    """A terminal and a launcher both signal; which of them comes first is up to the kernel."""
    done = subprocess.run([sys.executable, '-c', BOTH_AT_ONCE, str(int(first)), str(int(second))],
                          check=False, timeout=60)
    quits = signal.SIGQUIT in (first, second)
    assert done.returncode in ((0, 131) if quits else (0,))


@pytest.mark.parametrize('number', ALL)
def test_another_signal_later_is_a_second_one(number: int) -> None:
    assert run(signal.SIGTERM, number) == 128 + number


def test_a_request_to_suspend_is_refused_in_words() -> None:
    program = PROGRAM.replace(
        'SignalWatcher()', 'SignalWatcher(refuse=lambda: print("not suspended", flush=True))')
    with subprocess.Popen([sys.executable, '-c', program], stdout=subprocess.PIPE,
                          text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'ready\n'
        process.send_signal(signal.SIGTSTP)
        assert process.stdout.readline() == 'not suspended\n'
        # which is no signal that ends anything
        process.send_signal(signal.SIGTERM)
        assert process.stdout.readline() == 'stopping\n'
        assert process.wait(timeout=60) == 0


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
