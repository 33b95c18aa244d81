# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Only the steady clock decides when something happens: the system clock may be set any time."""

import ast
from pathlib import Path
import subprocess
import sys

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / 'drive_can_bridge'

#: Who may look at the system clock, and how often: for stamps and for what people read.
ALLOWED = {
    # the age of a frame, believed below a tenth of a second only
    'transport/port.py': 1,
    # how old a command is, where the middleware does not say when it came
    'ros/command_topic.py': 1,
    # stamps of messages
    'ros/stamps.py': 1,
    # entries of traces: when frames came, and until when all of them have
    'trace/flight.py': 3,
    'transport/tap.py': 4,
    # no look at the clock: a day and a time in a trace, as text
    'trace/candump.py': 1,
    # times shown to people
    'cli/backup.py': 1,
    'cli/read.py': 1,
    'panel/feed.py': 2,
    'panel/log_page.py': 2,
    'cli/monitor.py': 2,
    'cli/simulate.py': 2,
    'view/live.py': 1,
    'view/parts.py': 2,
}
SYSTEM_CLOCK = {'time', 'time_ns', 'localtime', 'gmtime', 'strftime', 'ctime', 'asctime',
                'CLOCK_REALTIME', 'datetime'}


def looks(path: Path) -> int:
    """Count the places where a module looks at the system clock."""
    tree = ast.parse(path.read_text(encoding='utf-8'))
    count = 0
    for node in ast.walk(tree):
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
from drive_can_bridge.transport.clock import steady_now
print(steady_now() - time.monotonic())
"""


def test_suspend_counts() -> None:
    # a machine that was suspended for 5,000 s differs from one that was not by that offset
    command = ['unshare', '--time', '--boottime', '5000', sys.executable, '-c', OFFSET]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    except FileNotFoundError:
        pytest.skip('unshare is not installed')
    if done.returncode and 'unshare' in done.stderr:
        pytest.skip(f'no time namespace: {done.stderr.strip()}')
    assert not done.returncode, done.stderr
    plain = subprocess.run([sys.executable, '-c', OFFSET], capture_output=True, text=True,
                           check=True, timeout=60)
    assert float(done.stdout) - float(plain.stdout) == pytest.approx(5000.0, abs=1.0)
