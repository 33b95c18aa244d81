# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A ``/sys`` and a ``/dev`` with serial ports, as the kernel (6.1) lays them out."""

from pathlib import Path

import pytest

from drive_can_bridge.transport import usb_serial


class Host:
    """
    What a host shows of its serial ports.

    :param place: where to lay it out.
    """

    def __init__(self, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.sys, self.dev = place / 'sys', place / 'dev'
        for directory in ('class/tty', 'bus/usb-serial/devices'):
            (self.sys / directory).mkdir(parents=True)
        self.dev.mkdir()
        monkeypatch.setattr(usb_serial, 'SYS', self.sys)
        monkeypatch.setattr(usb_serial, 'DEV', self.dev)

    def plug(self, name: str, number: str, product: str, *, maker: str = '', serial: str = '',
             timer: int | None = None, link: str = '') -> str:
        """
        Plug an adapter in; return the port's path.

        :param name: ``ttyACM0`` hangs at the interface, ``ttyUSB0`` at a port below it.
        :param timer: of FTDI, in ms.
        :param link: its name that stays.
        """
        device = self.sys / f'devices/pci0000:00/0000:00:14.0/usb1/1-{name}'
        interface = device / f'{device.name}:1.0'
        place = interface / name if name.startswith('ttyUSB') else interface
        (place / 'tty' / name).mkdir(parents=True)
        vendor, _, kind = number.partition(':')
        for file, text in (('idVendor', vendor), ('idProduct', kind), ('product', product),
                           ('manufacturer', maker), ('serial', serial)):
            if text:
                (device / file).write_text(f'{text}\n')
        (place / 'tty' / name / 'device').symlink_to(place)
        (self.sys / 'class/tty' / name).symlink_to(place / 'tty' / name)
        if timer is not None:
            (place / 'latency_timer').write_text(f'{timer}\n')
            (self.sys / 'bus/usb-serial/devices' / name).symlink_to(place)
        port = self.dev / name
        port.write_text('')
        if not link:
            return str(port)
        stays = self.dev / 'serial/by-id' / link
        stays.parent.mkdir(parents=True, exist_ok=True)
        stays.symlink_to(port)
        return str(stays)
