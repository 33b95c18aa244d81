# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A lock on a serial device itself: names of the host end at a network namespace, devices do not.

Two containers may share a serial port, by one device node or by two. ``flock`` is of the node, so
it does not meet where there are two; TIOCEXCL is of the device, but root opens it all the same:
that is why it is asked for. On a pseudo-terminal TIOCEXCL would outlive its process, and keep out
the process that starts next: there ``flock`` has to do.

The device is asked before python-can opens it, which sets its speed and throws away what has
arrived; an SLCAN adapter's first bytes would end the exchange of the process that has it.
"""

from array import array
import errno
import fcntl
import os
from pathlib import Path
import stat
import termios

from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.transport.places import PSEUDO_TERMINALS

#: Python's termios has no name for it; where the number is another one, nobody is asked
_TIOCGEXCL = 0x80045440
_LOCKS = Path('/proc/locks')


class DeviceLock:
    """
    The lock of one serial device, from its making until it is released.

    What is no terminal, or cannot be opened, is not locked: the adapter says what is wrong.

    :param path: of the device.
    :param exclusive: keep others from opening it, too; None: unless it is a pseudo-terminal.
    :raises BusUnavailable: another process has it (``taken``).
    """

    def __init__(self, path: str, exclusive: bool | None = None) -> None:
        self._descriptor = -1
        self._exclusive = False
        try:
            self._descriptor = os.open(
                path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
            found = os.fstat(self._descriptor)
            if not (stat.S_ISCHR(found.st_mode) and os.isatty(self._descriptor)):
                self.release()
                return
            if self._is_exclusive():
                raise OSError(errno.EBUSY, path)
            self._exclusive = (os.major(found.st_rdev) not in PSEUDO_TERMINALS
                               if exclusive is None else exclusive)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except (OSError, ValueError) as error:
            holder = _holder(path)
            self._close()
            if getattr(error, 'errno', None) not in (errno.EBUSY, errno.EWOULDBLOCK):
                return
            raise BusUnavailable(f'the serial port is used by {holder}; a drive has one master: '
                                 f'end that first', taken=True) from None

    def keep_out(self) -> None:
        """Let nobody open the device any more; a process that has it open keeps it."""
        if self._exclusive:
            fcntl.ioctl(self._descriptor, termios.TIOCEXCL)

    def release(self) -> None:
        """Let others have it. Idempotent, never raises."""
        if self._exclusive:
            try:
                fcntl.ioctl(self._descriptor, termios.TIOCNXCL)
            except OSError:  # the device has gone
                pass
        self._close()

    def _is_exclusive(self) -> bool:
        answer = array('i', [0])
        try:
            fcntl.ioctl(self._descriptor, _TIOCGEXCL, answer)
        except OSError:
            return False
        return bool(answer[0])

    def _close(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor, self._exclusive = -1, False


def _holder(path: str) -> str:
    """Say who has the lock of a file, where the kernel tells."""
    try:
        node = os.stat(path)
        name = f'{os.major(node.st_dev):02x}:{os.minor(node.st_dev):02x}:{node.st_ino}'
        for line in _LOCKS.read_text(encoding='utf-8').splitlines():
            words = line.split()    # 1: FLOCK ADVISORY WRITE 1234 00:17:5 0 EOF
            if words[1] == 'FLOCK' and words[5] == name and int(words[4]) > 0:
                return f'process {words[4]}'
    except (OSError, IndexError, ValueError):
        pass
    return 'another process, perhaps in another container'
