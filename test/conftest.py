# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What all tests share: where they run, how long they look, and which of them run beside each other.

Puts this directory, ``bench/``, ``clocked/`` and ``ros/`` on the path: every test may import
``conversation`` and ``drives``, and ``bridges`` on the clocked bench.

*Domains.* Nothing leaves this machine, and two test processes on it never meet: each takes ROS
domains of its own, before anything of ROS is imported. The tests of ``ros/`` have another one than
all others, because they look at who is in the graph, and a process that was killed stays there for
a while. The locks end with the process. The local way to bridges (``DRIVE_CAN_LOCAL``) knows no
domains: it is switched off, but in its own tests, which have a network of their own.

*Logs* of ROS go to a directory of the run, not to the user's.

*Shipped profiles* are read and checked once in a process, which takes as long as a whole story of
a drive; not so in the tests of that, ``configuration/`` and ``profiles/``.

*Profiles.* Whatever is random looks for a short time, and what tries one rule in many places tries
some of them (``extent.py``), unless DRIVE_CAN_TEST_PROFILE is ``long``, as in CI. How long one
example takes says how busy the machine is, and is no failure.

*In parallel*: ``side_by_side.py`` starts processes that share the tests.

*The wall clock.* What runs against it has the mark ``real`` (``real.py`` says what that is, and
which of them ``make test`` tells): these stories are told one after the other, by a run of their
own beside that of all others. One that fails is told again where the machine itself stood still
(``told_again.py``). Nothing else excuses a stalled machine. ``guard.py`` sees that no other test
starts a process or a thread, unless it says by a fixture, ``programs`` or ``threads``, that it
needs no time limit.

*Seed.* All that is random follows DRIVE_CAN_TEST_SEED, by default another one in each run. Behind
the failures stand the commands that run each of them alone, with the seed.

*Signals.* Who runs us under ``nohup``, or in the background of a script, has us ignore some
signals, and what is started here would inherit that.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
import fcntl
from functools import cache
import gc
import os
from pathlib import Path
import shlex
import signal
import sys
import tempfile
from typing import Any

from extent import PROFILE, SEED, times
from hypothesis import core as hypothesis_core, HealthCheck, settings
from middleware import tell_in_messages
import pytest
import real
import side_by_side
from told_again import ToldAgain

from drive_can_bridge.compiled import build
from drive_can_bridge.configuration import profiles
from drive_can_bridge.configuration.profile_check import LoadedProfile
from drive_can_bridge.resources import profiles_directory

sys.path.insert(0, str(Path(__file__).with_name('bench')))
sys.path.insert(0, str(Path(__file__).with_name('clocked')))
sys.path.append(str(Path(__file__).with_name('ros')))
from guard import Guard  # noqa: I100, I202
import world

#: what a test looks at that is run again
REPEATED = (SEED, PROFILE, 'DRIVE_CAN_SOAK_SECONDS')
# thousands of tests come, and nothing of what is loaded meanwhile goes
gc.disable()
PATIENT = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile('ours', PATIENT, max_examples=times(5, 60))
settings.load_profile('ours')

DOMAINS = range(10, 90)
#: the user's own domain, in which something may be running
_AVOIDED = os.environ.setdefault('DRIVE_CAN_TEST_AVOIDED_DOMAIN',
                                 os.environ.get('ROS_DOMAIN_ID', ''))


#: those that this process has had: what was in one may stay there for a while
_had: set[int] = set()


def _own_domain() -> tuple[str, int]:
    """Return a domain that nobody else has and this process never had, and its lock."""
    folder = Path(tempfile.gettempdir())
    for domain in DOMAINS:
        if str(domain) == _AVOIDED or domain in _had:
            continue
        try:
            lock = os.open(folder / f'drive_can_bridge_test_domain_{domain}',
                           os.O_CREAT | os.O_RDWR, 0o666)
        except OSError:  # another user's
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
        else:
            _had.add(domain)
            return str(domain), lock
    # a file system without locks, or very many runs: any domain will do
    return str(DOMAINS.start + os.getpid() % len(DOMAINS)), -1


@cache
def _domain(in_process: bool) -> str:
    """Return the domain of the tests in ``ros/``, or of all others, for this process's life."""
    domain, _ = _own_domain()
    return domain


os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['DRIVE_CAN_LOCAL'] = 'off'
tell_in_messages()

#: whose tests read shipped profiles
READING = ('test/configuration/', 'test/profiles/')


# -- signals and domains --------------------------------------------------------------------------


def pytest_configure(config: pytest.Config) -> None:
    """Take a domain; let what is started here begin with the signals of a foreground job."""
    logs = tempfile.TemporaryDirectory(prefix='drive_can_bridge_test_log_',
                                       ignore_cleanup_errors=True)
    os.environ['ROS_LOG_DIR'] = logs.name
    config.add_cleanup(logs.cleanup)
    if config.getoption('--hypothesis-seed') is None:
        hypothesis_core.global_force_seed = int(os.environ[SEED])
    config.pluginmanager.register(ToldAgain(config))
    config.pluginmanager.register(Guard(config))
    sharer = side_by_side.sharer()
    if sharer is not None:
        config.pluginmanager.register(sharer)
    os.environ['ROS_DOMAIN_ID'] = _domain(False)
    for number in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM):
        if signal.getsignal(number) is signal.SIG_IGN:
            # ignored as before, but nobody inherits a handler
            signal.signal(number, lambda *_: None)


@pytest.fixture
def new_domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], None]]:
    """Return what moves to a domain in which nobody has been, for the rest of the test."""
    locks: list[int] = []

    def move() -> None:
        domain, lock = _own_domain()
        monkeypatch.setenv('ROS_DOMAIN_ID', domain)
        locks.append(lock)
    yield move
    for lock in locks:
        if lock >= 0:
            os.close(lock)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Choose the domain of a test, and whether it reads shipped profiles anew."""
    os.environ['ROS_DOMAIN_ID'] = _domain(item.nodeid.startswith('test/ros/'))
    profiles.read_profile = (READ_PROFILE if item.nodeid.startswith(READING)  # type: ignore
                             else _remembered)


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Say how each test that failed is run alone."""
    failed = [report.nodeid for kind in ('failed', 'error')
              for report in terminalreporter.stats.get(kind, ())]
    if failed:
        given = ' '.join(f'{name}={os.environ[name]}' for name in REPEATED if name in os.environ)
        terminalreporter.section('alone, with the same seed')
        for nodeid in dict.fromkeys(failed):
            terminalreporter.line(f'{given} {os.path.relpath(sys.executable)} -m pytest '
                                  f'{shlex.quote(nodeid)}')


# -- shipped profiles -----------------------------------------------------------------------------


READ_PROFILE = profiles.read_profile
_read_once = cache(READ_PROFILE)


def _remembered(path: Path) -> LoadedProfile:
    """Read a profile, or return what a shipped one holds, with findings of its own."""
    if path.parent != profiles_directory():
        return READ_PROFILE(path)
    loaded = _read_once(path)
    found = loaded.tree
    return replace(loaded, tree=replace(
        found, damaged=set(found.damaged), incomplete=set(found.incomplete),
        problems=list(found.problems), warnings=list(found.warnings), _wrong=set(found._wrong)))


# -- the bench ------------------------------------------------------------------------------------


@pytest.fixture
def bench() -> Iterator[world.World]:
    """Put a test on the bench: buses, drives and threads by a clock that jumps."""
    with world.world(int(os.environ[SEED])) as made:
        yield made


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: Any) -> Iterator[Any]:
    """Print the story of a test that failed."""
    report = yield
    if report.failed and world.current is not None:
        report.sections.append(('story', world.current.story()))
    return report


@pytest.fixture
def threads() -> None:
    """Let a test have threads that are handed their events, and need no time limit."""


@pytest.fixture(scope='session')
def programs() -> None:
    """Let a test run programs to their ends, however long that takes."""


@pytest.fixture
def foreground() -> Iterator[None]:
    """Let Ctrl-C raise, also where these tests began in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


# -- beside each other ----------------------------------------------------------------------------


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is real, and let it come first, and last what processes share."""
    compiled = build() == 'compiled'
    for item in items:
        real.mark(item)
        if compiled and item.get_closest_marker('interpreted'):
            item.add_marker(pytest.mark.skip('of a build that is not compiled'))
    # a bench that others share lives to the end of their module, with a clock of its own
    items.sort(key=lambda item: (item.get_closest_marker('real') is None,
                                 side_by_side.turn(item.nodeid.partition('::')[0])))


@pytest.fixture(autouse=True, scope='session')
def _no_priority() -> Iterator[None]:
    """Leave this process where it is: a bridge that is run in it asks to be before all others."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, 'setpriority', lambda *_: None)
        yield


@pytest.fixture(autouse=True, scope='module')
def _collected() -> None:
    """Let garbage collection leave out what modules before have left, too."""
    gc.freeze()


def pytest_collection_finish() -> None:
    """Let garbage collection, which tests in ros/ ask for, leave out thousands of tests."""
    gc.collect()
    gc.freeze()
    gc.enable()
