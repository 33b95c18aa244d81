# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can monitor`` in a terminal that somebody looks at."""

import fcntl
import os
import pty
import signal
import struct
import subprocess
import sys
import termios
import threading

from child import cpu_of, PATIENCE

#: columns and lines: all drives with everything that a line holds
SIZE = (140, 50)


class Viewer:
    """The process, and the terminal's other end."""

    def __init__(self) -> None:
        self._near, far = pty.openpty()
        fcntl.ioctl(far, termios.TIOCSWINSZ, struct.pack('HHHH', SIZE[1], SIZE[0], 0, 0))
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'drive_can_bridge.cli.start', 'monitor'],
            stdin=far, stdout=far, env={**os.environ, 'TERM': 'xterm-256color'})
        os.close(far)
        self.written = 0
        threading.Thread(target=self._read, daemon=True).start()

    def cpu(self) -> float:
        """Return the CPU time of the whole process in s."""
        return cpu_of(self.process.pid)

    def close(self) -> None:
        """Let it end."""
        self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=PATIENCE)

    def _read(self) -> None:
        while True:
            try:
                self.written += len(os.read(self._near, 65536))
            except OSError:  # nobody has the terminal open any more
                os.close(self._near)
                return
