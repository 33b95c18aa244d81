# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Only the steady clock decides when something happens: the system clock may be set any time."""

import ast
from functools import cache
from pathlib import Path
import subprocess
import sys

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / 'drive_can_bridge'

#: Who may look at the system clock, or write down a day, and how often.
ALLOWED = {
    # everybody else asks this one
    'clock.py': 1,
    # no look at the clock: a day and a time as text
    'trace/files.py': 1,
    'trace/flight.py': 2,
    'cli/backup.py': 1,
    'panel/pages.py': 2,
    'view/parts.py': 2,
    'panel/parts.py': 2,
    'ros/diagnostics.py': 2,
}
SYSTEM_CLOCK = {'time', 'time_ns', 'localtime', 'gmtime', 'strftime', 'ctime', 'asctime',
                'CLOCK_REALTIME', 'datetime'}


@cache
def nodes(path: Path) -> list[ast.AST]:
    """Return everything that a module consists of."""
    return list(ast.walk(ast.parse(path.read_text(encoding='utf-8'))))


def looks(path: Path) -> int:
    """Count the places where a module looks at the system clock."""
    count = 0
    for node in nodes(path):
        if isinstance(node, ast.Attribute) and node.attr in SYSTEM_CLOCK and isinstance(
                node.value, ast.Name) and node.value.id in ('time', 'datetime'):
            count += 1
        elif isinstance(node, ast.ImportFrom) and node.module in ('time', 'datetime'):
            count += sum(alias.name in SYSTEM_CLOCK for alias in node.names)
        elif isinstance(node, ast.Import):
            count += sum(alias.name == 'datetime' for alias in node.names)
    return count


def test_who_looks_at_the_system_clock() -> None:
    found = {path.relative_to(PACKAGE).as_posix(): looks(path) for path in PACKAGE.rglob('*.py')}
    assert {path: count for path, count in found.items() if count} == ALLOWED


OFFSET = """
import time
from drive_can_bridge.clock import SteadyClock
print(SteadyClock().now() - time.monotonic())
"""


@pytest.mark.usefixtures('programs')
def test_suspend_counts() -> None:
    # a machine that was suspended for 5,000 s differs from one that was not by that offset
    command = ['unshare', '--time', '--boottime', '5000', sys.executable, '-c', OFFSET]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip('unshare is not installed')
    if done.returncode and 'unshare' in done.stderr:
        pytest.skip(f'no time namespace: {done.stderr.strip()}')
    assert not done.returncode, done.stderr
    plain = subprocess.run([sys.executable, '-c', OFFSET], capture_output=True, text=True,
                           check=True)
    assert float(done.stdout) - float(plain.stdout) == pytest.approx(5000.0, abs=1.0)


#: who may wait by himself, or ask for a time that nobody injects: processes, descriptors, signals
OWN_WAYS = {'clock.py', 'process/locks.py', 'process/scheduling.py', 'process/signals.py',
            'process/standard_outputs.py', 'ros/demo/commander.py',
            'view/live.py'}
WAYS = {'monotonic', 'monotonic_ns', 'perf_counter', 'sleep', 'thread_time', 'process_time',
        'clock_gettime', 'Thread', 'Event', 'Condition', 'Timer', 'Semaphore', 'SimpleQueue',
        'Queue'}


def test_everybody_else_is_handed_a_clock() -> None:
    found = set()
    for path in PACKAGE.rglob('*.py'):
        for node in nodes(path):
            if isinstance(node, ast.Attribute) and node.attr in WAYS and isinstance(
                    node.value, ast.Name) and node.value.id in ('time', 'threading', 'queue'):
                found.add(path.relative_to(PACKAGE).as_posix())
    assert found == OWN_WAYS
