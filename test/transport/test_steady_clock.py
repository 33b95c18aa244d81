# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Only the steady clock decides when something happens, and a suspended machine stops no clock."""

import subprocess
import sys

import pytest

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
