# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Runs tests in several processes side by side.

usage: side_by_side.py [-n PROCESSES] [ARGUMENT...]

The arguments go to pytest, which leaves out what needs more than a checkout unless they have a
``-m`` of their own. Without any, the tests are those of ``make test``: what knows no wall clock in
a process for each core, and beside these, one after the other, the real stories of
:data:`real.CHOSEN`. Those wait most of the time; the others take what they leave of the cores, and
have a little less right to them. (Not much less: beside others who compute they would never end.)

Each process is a plain run of pytest. It has a share of the modules whose tests are small, and
knows nothing of the others, because to collect thousands of tests takes as long as many of them;
then it always takes the first module of :data:`DEAR` that nobody has taken. The tests of a module
stay together, because they may share what is expensive to start; so do all real ones. What knows
no wall clock stays on a core: threads that hand over to each other need a third of the time there.

With pytest-xdist, collecting reports in one more process cost more than what most tests do.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from itertools import chain, pairwise
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any
import zlib

import extent  # noqa: F401  all of them have one seed
import pytest
import real

#: where processes say what they have taken, which of them this is, and of how many
FOLDER, NUMBER, SHARES = (
    f'DRIVE_CAN_TEST_{what}' for what in ('FOLDER', 'NUMBER', 'SHARES'))
#: the modules whose tests take longest, and the longest of them first: who is ready takes the next
DEAR = ('test/ros/test_ros_ros2_control', 'test/ros/test_ros_contract', 'test/ros/test_ros_joints',
        'test/ros/test_ros_by_hand', 'test/panel/', 'test/system/', 'test/monitor/', 'test/ros/')
#: what is said there when enough has failed
ENOUGH = 'enough'
#: the name of what all real ones are together
REAL = 'real'
#: bytes that the files of all tests take, and ten times as many
ROOM = 500_000_000
CORES = sorted(os.sched_getaffinity(0))
#: what needs more than a checkout
WANTED = 'not browser and not linter'

Run = tuple[list[str], int]     # arguments, and by how much it gives way


# -- one of the processes -------------------------------------------------------------------------


class Sharer:
    """Takes modules that nobody has taken; a plugin of pytest."""

    def __init__(self, folder: Path, number: int, shares: int) -> None:
        self._folder, self._number, self._shares = folder, number, shares

    def pytest_ignore_collect(self, collection_path: Path, config: pytest.Config) -> bool | None:
        """Leave to the others what is theirs."""
        module = os.path.relpath(collection_path, config.rootpath)
        if not collection_path.match('test_*.py') or turn(module):
            return None
        return zlib.crc32(module.encode()) % self._shares != self._number % self._shares or None

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool | None:
        """Run what it takes."""
        if session.testsfailed or session.config.option.collectonly:
            return None
        own = {CORES[self._number % len(CORES)]}
        for item, following in pairwise(chain(self._taken(session.items), [None])):
            os.sched_setaffinity(0, CORES if _unit(item) == REAL else own)
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if (self._folder / ENOUGH).exists():
                session.shouldstop = 'another process has had enough'
            if session.shouldfail:
                (self._folder / ENOUGH).touch()
                raise session.Failed(session.shouldfail)
            if session.shouldstop:
                raise session.Interrupted(session.shouldstop)
        return True

    def _taken(self, items: list[pytest.Item]) -> Iterator[pytest.Item]:
        units: dict[str, list[pytest.Item]] = {}
        for item in items:
            units.setdefault(_unit(item), []).append(item)
        for unit, members in units.items():
            try:
                (self._folder / unit.replace('/', '+')).touch(exist_ok=False)
            except FileExistsError:
                continue
            yield from members

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Leave for the sum what came of it."""
        found = {kind: len(reports) for kind, reports in terminalreporter.stats.items()
                 if kind in ('passed', 'failed', 'error', 'skipped')}
        (self._folder / f'{self._number}.json').write_text(json.dumps(found))


def turn(module: str) -> int:
    """Return where a module stands in the order of tests; 0: among those that are shared out."""
    return next((place for place, start in enumerate(DEAR, 1) if module.startswith(start)), 0)


def _unit(item: pytest.Item) -> str:
    """Return the name of what stays together."""
    return REAL if item.get_closest_marker('real') else item.nodeid.partition('::')[0]


def sharer() -> Sharer | None:
    """Return the plugin of a process that is one of several."""
    folder = os.environ.pop(FOLDER, None)   # who is started by a test is none
    return (Sharer(Path(folder), int(os.environ[NUMBER]), int(os.environ[SHARES]))
            if folder else None)


# -- who starts them ------------------------------------------------------------------------------


def main() -> int:
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument('-n', default='auto')
    options, words = parser.parse_known_args()
    processes = len(CORES) if options.n == 'auto' else max(1, int(options.n))
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    if words:
        return _run([(['-m', WANTED, *words], 0)] * processes, processes)
    begun = time.monotonic()
    stories = real.files(everything=False)
    code = _run([(['-m', f'{WANTED} and not real'], 1)] * processes
                + [(['-m', f'{WANTED} and real and not ci', *stories], 0)], processes)
    if code == 0:
        (Path(sys.prefix) / 'tests_took').write_text(f'{time.monotonic() - begun:.0f}\n')
    return code


def _run(runs: list[Run], shares: int) -> int:
    """Run all of them; show the first as it goes, the others behind it, and then the sum."""
    begun, sums = time.monotonic(), Counter[str]()
    with tempfile.TemporaryDirectory(dir=_fast()) as place:
        folder = Path(place)
        started = [_start(run, number, shares if number < shares else 1, folder)
                   for number, run in enumerate(runs)]
        try:
            for number, process in enumerate(started):
                process.wait()
                if number:
                    print('\nbeside it:')
                    print((folder / f'{number}.log').read_text('utf-8', 'replace'), flush=True)
                result = folder / f'{number}.json'
                sums.update(json.loads(result.read_text()) if result.exists() else {'lost': 1})
        except KeyboardInterrupt:
            _end(started)
            return 128 + signal.SIGINT
    print('all together:', ', '.join(f'{count} {kind}' for kind, count in sums.items()),
          f'in {time.monotonic() - begun:.0f} s', flush=True)
    # one may have had nothing to do
    codes = {process.returncode for process in started} - {pytest.ExitCode.NO_TESTS_COLLECTED}
    return max(codes, key=abs, default=pytest.ExitCode.NO_TESTS_COLLECTED)


def _fast() -> str | None:
    """Return where thousands of small files cost nothing, if there is room; None: as usual."""
    memory = '/dev/shm'
    try:
        found = os.statvfs(memory)
    except OSError:
        return None
    if found.f_flag & os.ST_NOEXEC or not os.access(memory, os.W_OK):   # some run what they write
        return None
    return memory if found.f_bavail * found.f_frsize > ROOM else None


def _start(run: Run, number: int, shares: int, folder: Path) -> subprocess.Popen[bytes]:
    """Start one of them, in a process group of its own: a signal reaches it once, through us."""
    def begin() -> None:
        os.setpgid(0, 0)
        signal.signal(signal.SIGINT, signal.SIG_DFL)    # whatever a script has us ignore
        os.nice(run[1])

    os.environ.update({FOLDER: str(folder), NUMBER: str(number), SHARES: str(shares)})
    with (folder / f'{number}.log').open('wb') as output:
        # the files of a test go with the run
        words = [*run[0], f'--basetemp={folder / f"files_{number}"}']
        return subprocess.Popen([sys.executable, '-m', 'pytest', *words], preexec_fn=begin,
                                stdin=subprocess.DEVNULL, stdout=output if number else None)


def _end(started: list[subprocess.Popen[bytes]]) -> None:
    """End all of them, as Ctrl-C would; a second one does not wait."""
    for how in (signal.SIGINT, signal.SIGKILL):
        for process in started:
            if process.poll() is None:
                os.killpg(process.pid, how)
        try:
            for process in started:
                process.wait()
            return
        except KeyboardInterrupt:
            continue


if __name__ == '__main__':
    sys.exit(main())
