# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which buses are the same one, as far as that shows without opening them; locks of ports.

A serial port has many names: the device, the links of udev below ``/dev/serial``, links made by
users. They are the same port when the device is the same. While there is no device (an adapter
that is not plugged in), the name has to do.
"""

from array import array
import errno
import fcntl
import os
from pathlib import Path
import socket
import stat
import termios
from typing import NamedTuple

from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusUnavailable

#: interfaces of python-can whose channel is a serial port
SERIAL_INTERFACES = frozenset(('slcan', 'robotell', 'serial', 'seeedstudio'))
#: options that are needed to know which bus is meant
_DISTINGUISHING = ('host', 'port', 'unique_hardware_id', 'serial', 'device_id')
#: major device numbers of pseudo-terminals
PSEUDO_TERMINALS = range(136, 144)
_FLEETING = '/dev/pts/'
#: Python's termios has no name for it; where the number is another one, nothing is requested
_TIOCGEXCL = 0x80045440
_LOCKS = Path('/proc/locks')


class BusIdentity(NamedTuple):
    """
    A bus on this host.

    :param names: the same for the same bus: two with a name in common are one.
    :param port: name of its serial port, which one process at a time can use; '' for adapters
        that several can.
    """

    names: tuple[str, ...]
    port: str = ''


def identity_of(bus: BusConfiguration) -> BusIdentity:
    """Return the identity of a bus."""
    channel = str(bus.channel)
    if bus.interface in SERIAL_INTERFACES:
        return BusIdentity(_port_names(channel, device_of(bus)), channel)
    words = [bus.interface, channel]
    if bus.interface == 'virtual':      # of one process only
        words.append(str(os.getpid()))
    words += [f'{key}={bus.options[key]}' for key in _DISTINGUISHING if key in bus.options]
    return BusIdentity(('/'.join(words),))


def device_of(bus: BusConfiguration) -> str | None:
    """Return the path of the serial device of a bus; None: there is none."""
    channel = str(bus.channel)
    if bus.interface not in SERIAL_INTERFACES or '://' in channel:
        return None
    return channel.split('@')[0]        # slcan: the speed of the port may follow


def adapter_of(bus: BusConfiguration) -> str:
    """Return what people call the adapter of a bus: ``/dev/ttyACM0``, ``can0``."""
    return device_of(bus) or str(bus.channel)


def is_absent(bus: BusConfiguration) -> bool:
    """Return whether the adapter of a bus is absent, as far as that can be seen."""
    device = device_of(bus)
    if device is not None:
        return not os.path.exists(device)
    if bus.interface != 'socketcan':
        return False
    try:
        socket.if_nametoindex(str(bus.channel))
    except OSError:
        return True
    return False


def _port_names(channel: str, path: str | None) -> tuple[str, ...]:
    if path is None:
        return (f'port {channel}',)
    # the number of a pseudo-terminal soon belongs to another one
    names = [] if path.startswith(_FLEETING) else [f'port {os.path.abspath(path)}']
    try:
        found = Path(path).stat()
    except (OSError, ValueError):
        return tuple(names) or (f'port {path}',)
    if not stat.S_ISCHR(found.st_mode):
        return (*names, f'port file {found.st_dev} {found.st_ino}')
    device = f'port device {os.major(found.st_rdev)} {os.minor(found.st_rdev)}'
    if os.major(found.st_rdev) in PSEUDO_TERMINALS:
        device += f' of {found.st_dev} since {found.st_ctime_ns}'
    return (*names, device)


class DeviceLock:
    """
    The lock of one serial device, held from its creation until it is released.

    Two containers may share a serial port, by one device node or by two. ``flock`` is of the
    node, so it does not meet where there are two; TIOCEXCL is of the device, but root opens it
    all the same: so its state is read. On a pseudo-terminal TIOCEXCL would outlive its
    process, and keep out the process that starts next: there ``flock`` has to do.

    Its state is read before python-can opens it, which sets its speed and discards what has
    arrived; an SLCAN adapter's first bytes would end the exchange of the process that has it.

    What is no terminal, or cannot be opened, is not locked: the adapter says what is wrong.

    :param path: of the device.
    :param exclusive: keep other processes from opening it, too; None: unless it is a
        pseudo-terminal.
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
            raise BusUnavailable(bus_sentences.port_in_use(holder=holder), taken=True) from None

    def keep_out(self) -> None:
        """Keep other processes from opening the device; one that has it open keeps it."""
        if self._exclusive:
            fcntl.ioctl(self._descriptor, termios.TIOCEXCL)

    def release(self) -> None:
        """Release the device. Idempotent, never raises."""
        if self._exclusive:
            try:
                fcntl.ioctl(self._descriptor, termios.TIOCNXCL)
            except OSError:  # the device is gone
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
    """Return which process has the lock of a file, where the kernel shows it."""
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
