# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What make starts (``make demo``) ends with make, whoever gets the signal."""

from contextlib import suppress
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


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM],
                         ids=['interrupt', 'terminate'])
def test_a_signal_to_make_alone_ends_what_it_has_started(
        number: signal.Signals, tmp_path: Path) -> None:
    (tmp_path / 'program.py').write_text(PROGRAM)
    words = ' '.join([*JOB, sys.executable, 'program.py'])
    (tmp_path / 'Makefile').write_text(f'.PHONY: demo\ndemo:\n\t@exec {words}\n')
    out = tmp_path / 'out'
    with out.open('wb') as file, subprocess.Popen(
            ['make', 'demo'], cwd=tmp_path, stdin=subprocess.DEVNULL, stdout=file,
            stderr=subprocess.DEVNULL, start_new_session=True) as process:
        try:
            wait_for(lambda: 'begun' in out.read_text(), 'the program')
            process.send_signal(number)
            process.wait(20.0)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert f'ended by {number.name}' in out.read_text()
