# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A process of the demo, from both sides: started and ended in one, run in the other.

It ends with the demo, however that ends: the kernel sends it SIGTERM then.
"""

from contextlib import nullcontext
import ctypes
import importlib
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import IO

from drive_can_bridge.process.critical_sections import signals_held

#: what can be run: module with ``main()``
PROGRAMS = {
    'drive_can_bridge': 'drive_can_bridge.ros.start',
    'drive_can': 'drive_can_bridge.cli.start',
    'commander': 'drive_can_bridge.ros.demo.commander',
}
#: how a child begins: not as with -m, which imports from the working directory first; there a
#: directory with the name of this package is no rarity
_BEGIN = ('import sys; sys.path[:] = filter(None, sys.path); '
          f'from {__name__} import main; sys.exit(main())')
_PR_SET_PDEATHSIG = 1


class Child:
    """
    A process of the demo.

    :param what: its name for users, ``the bridge``.
    :param shared: stays in the terminal's foreground, and gets its signals; others have a session
        of their own, so that nothing but the demo ends them.
    :param log: file for its standard error; None: it is the demo's.
    """

    def __init__(self, what: str, program: str, *arguments: str,
                 shared: bool = False, log: Path | None = None,
                 output: IO[bytes] | int | None = None) -> None:
        self.what = what
        self.log = log
        self.told = False
        command = [sys.executable, '-c', _BEGIN, program, *arguments]
        keyboard = None if shared else subprocess.DEVNULL
        with nullcontext() if log is None else log.open('wb') as errors, signals_held():
            self.process = subprocess.Popen(command, stdin=keyboard, stdout=output,
                                            stderr=errors, start_new_session=not shared)

    @property
    def code(self) -> int | None:
        """The exit code; negative: killed by that signal; None: it runs."""
        return self.process.poll()

    @property
    def end(self) -> str:
        """How it ended, in words."""
        code = self.process.returncode
        return f'killed by signal {-code}' if code < 0 else f'exit code {code}'

    def ask_to_end(self, signum: int = signal.SIGTERM) -> None:
        """Send a signal, if the process still runs."""
        if self.code is None:
            # stopped processes have to go on in order to end
            for number in (signum, signal.SIGCONT):
                self.process.send_signal(number)

    def ends(self, timeout: float) -> bool:
        """Wait for its end; return whether it has come."""
        try:
            self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            return False
        return True

    def wait(self, timeout: float) -> bool:
        """Wait for its end, and then end it; return whether it ended by itself."""
        if self.ends(timeout):
            return True
        self.process.kill()
        self.process.wait()
        return False

    def errors(self) -> str:
        """Return what it wrote to standard error and was not shown."""
        return self.log.read_text(encoding='utf-8', errors='replace') if self.log else ''


def main() -> int:
    """Run a program in this process."""
    parent = os.getppid()
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGTERM))
    if os.getppid() != parent:  # it is gone already
        return 1
    program, *arguments = sys.argv[1:]
    sys.argv = [program, *arguments]
    code: int = importlib.import_module(PROGRAMS[program]).main()
    return code
