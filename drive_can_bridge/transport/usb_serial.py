# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Serial ports of this host as the kernel shows them: their makers, and how long they keep bytes.

Nothing is opened: all of it stands in ``/sys``.
"""

from collections.abc import Iterator
import os
from pathlib import Path
from typing import NamedTuple

from drive_can_bridge.core.text import printable

#: where the kernel shows its devices; tests have one of their own
SYS = Path('/sys')
DEV = Path('/dev')
#: directories from a terminal up to the USB device that it belongs to, at most
_UP = 4
#: names of terminals that are adapters, or may be
_PORTS = ('ttyUSB', 'ttyACM', 'ttyAMA', 'ttyXRUSB', 'rfcomm')


class UsbDevice(NamedTuple):
    """
    A USB device, by its own descriptors; '' where they are empty.

    :param number: vendor and product, ``0403:6001``.
    """

    number: str
    maker: str
    product: str
    serial: str


class LatencyTimer(NamedTuple):
    """
    The timer of a USB converter (FTDI) that keeps received bytes until it has a packet full.

    :param seconds: how long at most.
    :param file: where it is set, in ms.
    """

    seconds: float
    file: str

    @property
    def remedy(self) -> str:
        """The command that makes it as short as it can be."""
        return f'echo 1 | sudo tee {self.file}'


def port_name(path: str) -> str:
    """Return the kernel's name of a serial port, whatever link leads to it: ``ttyUSB0``."""
    return os.path.basename(os.path.realpath(path))


def usb_device(path: str) -> UsbDevice | None:
    """Return the USB device of a serial port; None: it is not there, or none."""
    place = SYS / 'class' / 'tty' / port_name(path) / 'device'
    if not place.exists():
        return None
    place = place.resolve()
    for directory in (place, *place.parents[:_UP]):
        vendor, product = _line(directory / 'idVendor'), _line(directory / 'idProduct')
        if vendor and product:
            return UsbDevice(f'{vendor}:{product}'.lower(), *(
                _line(directory / name) for name in ('manufacturer', 'product', 'serial')))
    return None


def latency_timer(path: str) -> LatencyTimer | None:
    """Return the latency timer of a serial port; None: it has none."""
    file = SYS / 'bus' / 'usb-serial' / 'devices' / port_name(path) / 'latency_timer'
    text = _line(file)
    return LatencyTimer(1e-3 * int(text), str(file)) if text.isdecimal() else None


def serial_ports() -> Iterator[str]:
    """Yield the serial ports of this host, by the name that stays where there is one."""
    stable: dict[str, str] = {}
    try:
        links = sorted((DEV / 'serial' / 'by-id').iterdir())
    except OSError:
        links = []
    for link in links:
        stable.setdefault(port_name(str(link)), str(link))
    try:
        names = sorted(os.listdir(SYS / 'class' / 'tty'))
    except OSError:
        names = []
    for name in names:
        if name.startswith(_PORTS) and (DEV / name).exists():
            yield stable.get(name, str(DEV / name))


def _line(file: Path) -> str:
    try:
        with file.open(encoding='utf-8', errors='replace') as opened:
            return printable(opened.readline().strip())
    except OSError:
        return ''
