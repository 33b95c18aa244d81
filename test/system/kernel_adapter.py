# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A CAN controller of the kernel, of which the test plays the hardware.

The kernel's own slcan driver makes a network interface out of a serial line. Here that line is a
pseudo-terminal with a literal peer behind it: what the bridge sends has to leave by a real
transmit queue, and error states come to it as error frames that a real driver made.
"""

from collections.abc import Callable
import fcntl
import os
from pathlib import Path
import struct
import subprocess
import termios

import pytest
from slcan_peer import Peer

#: linux/tty.h
N_SLCAN = 17
NETWORK = Path('/sys/class/net')


def ip(*arguments: str) -> None:
    """Run ``ip``."""
    subprocess.run(['ip', *arguments], check=True, capture_output=True, timeout=60)


class KernelAdapter(Peer):
    """
    The far end of an interface ``name`` with 125 kbit/s, which is up.

    Skips the test where the kernel or the rights are missing.
    """

    def __init__(self, directory: Path,
                 answers: dict[str, str | Callable[[str], list[str]]]) -> None:
        if os.geteuid() != 0:
            pytest.skip('making a CAN interface needs root')
        super().__init__(directory / 'adapter', answers)
        self.name = ''
        try:
            subprocess.run(['modprobe', 'slcan'], check=False, capture_output=True)
            before = set(os.listdir(NETWORK))
            fcntl.ioctl(self._slave, termios.TIOCSETD, struct.pack('i', N_SLCAN))
            self.name, = set(os.listdir(NETWORK)) - before
            ip('link', 'set', self.name, 'type', 'can', 'bitrate', '125000')
            self.switch('up')
        except (OSError, ValueError, subprocess.CalledProcessError) as error:
            self.close()
            pytest.skip(f'no CAN controller on a serial line can be made: {error}')

    def switch(self, state: str) -> None:
        """Take the interface ``up`` or ``down``."""
        ip('link', 'set', self.name, state)

    def report(self, state: str, received: int = 0, sent: int = 0) -> None:
        """
        Tell the driver the state of the controller, and its error counters.

        :param state: a: error-active, w: warning, p: passive, b: bus-off.
        """
        self.send(f's{state}{received:03}{sent:03}\r'.encode())
