# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What make starts (``make demo``) ends with make, whoever gets the signal."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import signal
import subprocess
import sys

import pytest
from running import JOB
from waiting import wait_for

pytestmark = pytest.mark.real
#: ends well on a signal, as the demo does
PROGRAM = """
import signal, sys
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT, signal.SIGTERM])
print('begun', flush=True)
found = signal.sigwait([signal.SIGINT, signal.SIGTERM])
print('ended by', signal.Signals(found).name, flush=True)
"""
#: takes what comes more than a moment later for a second signal, as the demo does
SECOND = PROGRAM + """
import time
time.sleep(0.05)
while signal.sigtimedwait([signal.SIGINT, signal.SIGTERM], 0):
    pass
if signal.sigtimedwait([signal.SIGINT, signal.SIGTERM], 1.0):
    print('by force', flush=True)
print('over', flush=True)
"""


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM],
                         ids=['interrupt', 'terminate'])
def test_a_signal_to_make_alone_ends_what_it_has_started(
        number: signal.Signals, tmp_path: Path) -> None:
    with started_by_make(PROGRAM, tmp_path) as (make, out):
        make.send_signal(number)
        make.wait(20.0)
    assert f'ended by {number.name}' in out.read_text()


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM],
                         ids=['interrupt', 'terminate'])
def test_a_signal_to_all_of_them_is_one(number: signal.Signals, tmp_path: Path) -> None:
    """As timeout sends it, to a process group: a second one would cut off the stop of drives."""
    with started_by_make(SECOND, tmp_path) as (make, out):
        os.killpg(make.pid, number)
        wait_for(lambda: 'over' in out.read_text(), 'the end')
    assert 'by force' not in out.read_text()


@contextmanager
def started_by_make(program: str, folder: Path,
                    ) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """Run make without a terminal; yield it, and where the program writes, once that has begun."""
    (folder / 'program.py').write_text(program)
    words = ' '.join([*JOB, sys.executable, 'program.py'])
    (folder / 'Makefile').write_text(f'.PHONY: demo\ndemo:\n\t@exec {words}\n')
    out = folder / 'out'
    with out.open('wb') as file, subprocess.Popen(
            ['make', 'demo'], cwd=folder, stdin=subprocess.DEVNULL, stdout=file,
            stderr=subprocess.DEVNULL, start_new_session=True) as process:
        try:
            wait_for(lambda: 'begun' in out.read_text(), 'the program')
            yield process, out
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
