# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which buses are the same one, as far as that can be told without opening them.

A serial port has many names: the device, the links of udev below ``/dev/serial``, links of one's
own. They are the same port when the device is the same. While there is no device (an adapter that
is not plugged in), the name has to do.
"""

import os
from pathlib import Path
import socket
import stat
from typing import NamedTuple

from drive_can_bridge.core.configuration import BusConfiguration

#: interfaces of python-can whose channel is a serial port
SERIAL_INTERFACES = frozenset(('slcan', 'robotell', 'serial', 'seeedstudio'))
#: options without which a channel does not say which bus is meant
_DISTINGUISHING = ('host', 'port', 'unique_hardware_id', 'serial', 'device_id')
#: major device numbers of pseudo-terminals
PSEUDO_TERMINALS = range(136, 144)
_FLEETING = '/dev/pts/'


class Place(NamedTuple):
    """
    A bus on this host.

    :param names: the same for the same bus: two places with a name in common are one.
    :param port: name of its serial port, which one process at a time can use; '' for adapters
        that several can.
    """

    names: tuple[str, ...]
    port: str = ''


def place_of(bus: BusConfiguration) -> Place:
    """Say where a bus is."""
    channel = str(bus.channel)
    if bus.interface in SERIAL_INTERFACES:
        return Place(_port_names(channel, device_of(bus)), channel)
    words = [bus.interface, channel]
    if bus.interface == 'virtual':      # of one process only
        words.append(str(os.getpid()))
    words += [f'{key}={bus.options[key]}' for key in _DISTINGUISHING if key in bus.options]
    return Place(('/'.join(words),))


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
    """Tell whether the adapter of a bus is not there, as far as that can be seen."""
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
