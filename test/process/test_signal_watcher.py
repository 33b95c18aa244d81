# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What counts as a second signal, by a clock that jumps; and that signals arrive."""

import os
import signal
import subprocess
import sys

from clocks import REAL
import pytest
from world import World

from drive_can_bridge.process.signals import GRACE, SAME_BREATH, SignalWatcher

ALL = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT]


@pytest.fixture
def codes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the codes with which the process would have ended."""
    found: list[int] = []
    monkeypatch.setattr(os, '_exit', found.append)
    return found


@pytest.mark.parametrize(('number', 'code'), [
    (signal.SIGINT, 0), (signal.SIGTERM, 0), (signal.SIGHUP, 0), (signal.SIGQUIT, 131)])
def test_one_signal(bench: World, codes: list[int], number: int, code: int) -> None:
    watcher = SignalWatcher(bench.clock)
    assert watcher.wait(1.0) is None and not watcher.signalled
    watcher.take(number)
    assert watcher.signalled
    assert watcher.wait() == ''
    assert watcher.interrupted == (number in (signal.SIGINT, signal.SIGQUIT))
    assert (watcher.exit_code(0), codes) == (code, [])
    assert watcher.exit_code(1) == 1


@pytest.mark.parametrize('second', ALL)
@pytest.mark.parametrize('first', ALL)
def test_any_signal_in_the_same_breath_is_the_same_stop(
        bench: World, codes: list[int], first: int, second: int) -> None:
    """A terminal and a launcher both signal; which of them comes first is up to the kernel."""
    watcher = SignalWatcher(bench.clock)
    watcher.take(first)
    bench.clock.live(0.9 * SAME_BREATH)
    watcher.take(second)
    assert codes == []
    assert watcher.exit_code(0) == (131 if first == signal.SIGQUIT else 0)
    assert watcher.wait() == ''
    assert watcher.wait(1.0) is None    # one reason to end, not two


@pytest.mark.parametrize('later', [1.1 * SAME_BREATH, GRACE, 10.0])
@pytest.mark.parametrize('number', ALL)
def test_another_signal_later_ends_the_process_when_drives_had_their_grace(
        bench: World, codes: list[int], number: int, later: float) -> None:
    clock = bench.clock
    watcher = SignalWatcher(clock)
    steps: list[tuple[float, float]] = []

    def fail(_: float) -> None:
        raise RuntimeError
    watcher.last_steps += [fail, lambda until: steps.append((clock.now(), until))]
    watcher.take(signal.SIGTERM)
    first = clock.now()
    clock.live(later)
    second = clock.now()
    watcher.take(number)
    assert codes == [128 + number]
    assert clock.now() == pytest.approx(max(first + GRACE, second))
    assert steps == [(clock.now(), second + GRACE)]
    assert watcher.exit_code(0) == 128 + number


def test_a_request_to_suspend_is_refused_and_is_no_signal_that_ends_anything(
        bench: World, codes: list[int]) -> None:
    refused: list[float] = []
    watcher = SignalWatcher(bench.clock, refuse=lambda: refused.append(bench.clock.now()))
    for count in (1, 2):
        bench.clock.live(1.0)
        watcher.take(signal.SIGTSTP)
        assert len(refused) == count
    assert not watcher.signalled and watcher.wait(0.0) is None
    watcher.take(signal.SIGTERM)
    watcher.take(signal.SIGTSTP)
    bench.clock.live(1.0)
    watcher.take(signal.SIGTSTP)
    assert (watcher.exit_code(0), codes, len(refused)) == (0, [], 4)


def test_why_it_ends_by_itself(bench: World) -> None:
    watcher = SignalWatcher(bench.clock)
    bench.clock.worker(lambda: watcher.fatal('defect'), 'the one that dies').start()
    assert watcher.wait() == 'defect'
    assert not watcher.signalled


# -- signals of this process ----------------------------------------------------------------------


@pytest.mark.usefixtures('threads')
@pytest.mark.parametrize('number', ALL)
def test_they_arrive_and_what_was_before_is_put_back(number: int) -> None:
    before = [signal.getsignal(each) for each in ALL]
    with SignalWatcher(REAL) as watcher:
        os.kill(os.getpid(), number)
        assert watcher.wait() == ''
        assert watcher.signalled
    assert [signal.getsignal(each) for each in ALL] == before


@pytest.fixture(params=[signal.SIGHUP, signal.SIGINT])
def ignored(request: pytest.FixtureRequest) -> int:
    """Have this process ignore a signal, as nohup does, or a shell without job control."""
    before = signal.signal(request.param, signal.SIG_IGN)
    request.addfinalizer(lambda: signal.signal(request.param, before))
    return int(request.param)


@pytest.mark.usefixtures('threads')
def test_what_was_started_to_outlive_its_terminal_does_and_all_else_stops_it(ignored: int) -> None:
    """A script starts it in the background: nothing but a signal can stop it then."""
    with SignalWatcher(REAL) as watcher:
        os.kill(os.getpid(), ignored)
        if ignored == signal.SIGHUP:
            assert signal.getsignal(ignored) is signal.SIG_IGN
            assert not watcher.signalled
            os.kill(os.getpid(), signal.SIGTERM)
        assert watcher.wait() == ''


#: hangs after its first signal, and says so when a second one is no breath any more
HANGING = """
import time
from drive_can_bridge.clock import SteadyClock
from drive_can_bridge.process.signals import SAME_BREATH, SignalWatcher
with SignalWatcher(SteadyClock()) as watcher:
    print("ready", flush=True)
    watcher.wait()
    time.sleep(2 * SAME_BREATH)
    print("stopping", flush=True)
    time.sleep(600.0)
"""


@pytest.mark.real
def test_a_second_signal_ends_a_process_that_hangs() -> None:
    with subprocess.Popen([sys.executable, '-c', HANGING], stdout=subprocess.PIPE,
                          text=True) as process:
        assert process.stdout is not None
        for line in ('ready\n', 'stopping\n'):
            assert process.stdout.readline() == line
            process.send_signal(signal.SIGTERM)
        assert process.wait() == 128 + signal.SIGTERM


#: gets two signals before it looks after any, and ends without what Python does on its way out
LEAVING = """
import atexit, os, signal
from drive_can_bridge.process.beginning import hold_signals
hold_signals()
for number in (signal.SIGINT, signal.SIGTERM):
    os.kill(os.getpid(), number)
from drive_can_bridge.clock import SteadyClock
from drive_can_bridge.process.beginning import leave
from drive_can_bridge.process.signals import SignalWatcher
atexit.register(print, "this is never said")
with SignalWatcher(SteadyClock(), keep=True) as watcher:
    watcher.wait()
    print('done', flush=True)
    print('flushed', end='')
    leave(watcher.exit_code(3))
"""


@pytest.mark.usefixtures('programs')
def test_signals_wait_for_the_watcher_and_leaving_loses_no_output() -> None:
    done = subprocess.run([sys.executable, '-c', LEAVING], capture_output=True, text=True,
                          check=False, env={**os.environ, 'PYTHONUNBUFFERED': ''})
    assert (done.returncode, done.stdout, done.stderr) == (3, 'done\nflushed', '')
