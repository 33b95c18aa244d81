# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The table of adapters: complete, found by what USB shows, and what it says of a bus."""

from pathlib import Path
import runpy
from typing import Any

import can.interfaces
import pytest
from usb_host import Host

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.transport.known_adapters import (
    BY_NAME, NOT_ON_LINUX, row_of, row_of_port, ROWS, traits_of,
)
from drive_can_bridge.transport.usb_serial import latency_timer, serial_ports, usb_device


def bus(interface: str, channel: str | int, **keys: Any) -> BusConfiguration:
    return BusConfiguration('main', interface, channel, adapter=keys.pop('adapter', ''),
                            bitrate=500000, options=keys)


@pytest.fixture(name='host')
def host_fixture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Host:
    return Host(tmp_path, monkeypatch)


def test_the_page_is_current() -> None:
    """Written again by ``docs/adapters.py``."""
    script = runpy.run_path(str(Path(__file__).parents[2] / 'docs' / 'adapters.py'))
    assert script['PAGE'].read_text(encoding='utf-8') == script['page']()


def test_every_interface_has_a_row_or_a_reason() -> None:
    known = {row.interface for row in ROWS} | set(NOT_ON_LINUX)
    assert set(can.interfaces.BACKENDS) <= known
    assert not {row.interface for row in ROWS} & set(NOT_ON_LINUX)
    # plug-ins, which are no part of python-can
    assert known - set(can.interfaces.BACKENDS) <= {
        'sontheim', 'wuensche', 'remote', 'cannelloni', 'waveshare', 'damiao'}


def test_one_that_garbles_short_frames_drives_nothing() -> None:
    """The plug-in python-can-damiao 0.1.0; findings/ has the bytes."""
    traits = traits_of(bus('damiao', '/dev/ttyACM0'))
    assert traits is not None
    assert {each.route.extended for each in traits.drops} == {False, True}


def test_names_are_names() -> None:
    assert len(BY_NAME) == len(ROWS)
    assert all(name.replace('_', '').isalnum() and name == name.lower() for name in BY_NAME)


def test_each_interface_has_a_row_of_its_own_first() -> None:
    """Which is the one for a bus of which nothing else is known."""
    first: dict[str, str] = {}
    for row in ROWS:
        first.setdefault(row.interface, row.name)
    assert all(interface == name for interface, name in first.items())


@pytest.mark.parametrize(('name', 'number', 'product', 'row'), [
    ('ttyACM0', 'ad50:60c4', 'CANable b6b9f8d github.com/normaldotcom/canable-fw.git', 'canable'),
    ('ttyACM0', '16d0:117e', 'CANable2 b158aa7 github.com/normaldotcom/canable2.git', 'canable2'),
    ('ttyACM0', '04d8:000a', 'USBtin', 'usbtin'),
    ('ttyUSB0', '0403:ffa8', 'CANUSB', 'lawicel'),
    ('ttyUSB0', '0403:6015', 'USB-CAN Plus', 'vscom'),
    ('ttyUSB0', '0403:6015', 'FT231X USB UART', None),
    ('ttyUSB0', '1a86:7523', 'USB Serial', None)])
def test_what_usb_shows(host: Host, name: str, number: str, product: str, row: str | None) -> None:
    port = host.plug(name, number, product, link='usb-it-if00')
    found = row_of_port(port)
    assert (None if found is None else found.name) == row
    meant = row_of(bus('slcan', f'{port}@115200'))
    assert meant is not None and meant.name == (row or 'slcan')


def test_what_the_file_says_counts(host: Host) -> None:
    port = host.plug('ttyACM0', 'ad50:60c4', 'CANable')
    meant = row_of(bus('slcan', port, adapter='esp32_slcan'))
    assert meant is BY_NAME['esp32_slcan']
    assert row_of(bus('slcan', 'socket://10.0.0.5:7000')) is BY_NAME['slcan_tcp']
    assert row_of(bus('robotell', port)) is BY_NAME['robotell']     # whatever USB says
    assert row_of(bus('etas', 'x')) is None and traits_of(bus('etas', 'x')) is None


def test_a_device_names_itself(host: Host) -> None:
    port = host.plug('ttyUSB0', '0403:FFA8', 'CANUSB', maker='LAWICEL', serial='LW1')
    assert usb_device(port) == ('0403:ffa8', 'LAWICEL', 'CANUSB', 'LW1')
    host.plug('ttyACM1', '16d0:117e', 'CAN\x1b[31m')
    assert usb_device(str(host.dev / 'ttyACM1')) == ('16d0:117e', '', r'CAN\x1b[31m', '')
    assert usb_device('/dev/ttyUSB7') is None and latency_timer('/dev/ttyUSB7') is None


def test_ports_by_the_name_that_stays(host: Host) -> None:
    first = host.plug('ttyACM0', 'ad50:60c4', 'CANable', link='usb-CANable-if00')
    second = host.plug('ttyUSB0', '1a86:7523', 'USB Serial')
    (host.sys / 'class/tty/ttyS0').mkdir()
    (host.sys / 'class/tty/ttyUSB9').mkdir()    # which has gone
    assert list(serial_ports()) == [first, second]


def test_latency_timer(host: Host) -> None:
    """FTDI's, as the kernel has it: 16 ms unless told otherwise."""
    port = host.plug('ttyUSB0', '0403:ffa8', 'CANUSB', timer=16, link='usb-LAWICEL-if00-port0')
    timer = latency_timer(port)
    assert timer is not None and timer.seconds == 0.016
    assert timer.remedy == (
        f'echo 1 | sudo tee {host.sys}/bus/usb-serial/devices/ttyUSB0/latency_timer')
    traits = traits_of(bus('slcan', port))
    assert traits is not None
    assert (traits.latency, traits.remedy) == (0.016, timer.remedy)
    Path(timer.file).write_text('1\n')
    traits = traits_of(bus('slcan', port))
    assert traits is not None and (traits.latency, traits.remedy) == (0.001, '')
    # not plugged in: what is known of its kind
    elsewhere = traits_of(bus('slcan', '/dev/ttyUSB7', adapter='lawicel'))
    assert elsewhere is not None and elsewhere.latency == 0.016


@pytest.mark.parametrize(('interface', 'channel', 'keys', 'rate'), [
    ('slcan', '/dev/ttyACM0', {}, 0), ('slcan', '/dev/ttyUSB0', {}, 115200),
    ('slcan', '/dev/ttyUSB0@1000000', {}, 1000000),
    ('slcan', '/dev/ttyUSB0', {'tty_baudrate': 57600}, 57600),
    ('slcan', '/dev/ttyUSB0@500000', {'adapter': 'esp32_slcan'}, 500000),
    ('slcan', '/dev/ttyUSB0', {'adapter': 'lawicel'}, 0),   # its chip has no line behind
    ('seeedstudio', '/dev/ttyUSB0', {}, 2000000), ('slcan', 'socket://10.0.0.5:1', {}, 0),
    ('socketcan', 'can0', {}, 0)])
def test_speed_of_the_line(host: Host, interface: str, channel: str, keys: dict[str, Any],
                           rate: int) -> None:
    traits = traits_of(bus(interface, channel, **keys))
    assert traits is not None and traits.line_rate == rate
