# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``drive_can adapters`` on hosts that are laid out for it."""

from collections.abc import Iterator
import json
import os
from pathlib import Path
import sys
from types import ModuleType
from typing import Any

import can.interfaces
import pytest
from usb_host import Host

from drive_can_bridge.cli.main import main
from drive_can_bridge.clock import SteadyClock
from drive_can_bridge.transport import found_adapters
from drive_can_bridge.transport.kernel_interfaces import KernelInterface


@pytest.fixture(name='host')
def host_fixture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Host:
    monkeypatch.setattr(found_adapters, 'kernel_interfaces', list)
    monkeypatch.setattr(can.interfaces, 'BACKENDS', {})
    return Host(tmp_path, monkeypatch)


@pytest.fixture(name='library')
def library_fixture(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """Return a module that python-can takes for the interfaces ``pcan`` and ``stuck``."""
    module = ModuleType('makers_library')
    monkeypatch.setitem(sys.modules, module.__name__, module)
    yield module


def shown(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[list[str], str]:
    assert main(['adapters', *arguments]) == 0
    out = capsys.readouterr()
    return out.out.splitlines(), out.err


def test_nothing_is_no_failure(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    lines, told = shown(capsys)
    assert lines == [] and told.startswith('drive_can adapters: none found: no CAN interface')
    assert told.count('\n') == 1


def test_serial_ports(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    known = host.plug('ttyACM0', 'ad50:60c4', 'CANable b6b9f8d', maker='Protofusion Labs',
                      serial='0012', link='usb-Protofusion_CANable-if00')
    slow = host.plug('ttyUSB0', '0403:6001', 'FT232R USB UART', maker='FTDI', timer=16)
    lines, told = shown(capsys)
    assert told == ''
    assert lines == [
        f'slcan {known}: Protofusion Labs CANable b6b9f8d, USB ad50:60c4, serial number 0012',
        '    interface: slcan', f'    channel: {known}',
        f'slcan {slow}: FTDI FT232R USB UART, USB 0403:6001',
        '    interface: slcan', f'    channel: {slow}',
        '    # what is behind this port does not show: an SLCAN adapter is written so',
        '    # keeps what it receives for 16 ms: echo 1 | sudo tee '
        f'{host.sys}/bus/usb-serial/devices/ttyUSB0/latency_timer']


@pytest.mark.skipif(os.geteuid() == 0, reason='root may open everything')
def test_a_port_that_this_user_may_not_open(host: Host,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    port = host.plug('ttyACM0', 'ad50:60c4', 'CANable')
    os.chmod(port, 0)
    assert 'dialout' in '\n'.join(shown(capsys)[0])


def test_interfaces_of_the_kernel(host: Host, monkeypatch: pytest.MonkeyPatch,
                                  capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(found_adapters, 'kernel_interfaces', lambda: [
        KernelInterface('can0', 3, True, 'can', 500000, 'error-active'),
        KernelInterface('can1', 4, False, 'can', 0, 'stopped'),
        KernelInterface('vcan0', 2, True, 'vcan')])
    assert shown(capsys)[0] == [
        'socketcan can0: up error-active, 500000 bit/s, a CAN controller',
        '    interface: socketcan', '    channel: can0', '    bitrate: 500000',
        'socketcan can1: down, no bit rate, a CAN controller',
        '    interface: socketcan', '    channel: can1',
        '    # switch it on: ip link set can1 up type can bitrate 500000',
        'socketcan vcan0: up, virtual, no hardware',
        '    interface: socketcan', '    channel: vcan0']
    first, *_ = map(json.loads, shown(capsys, '--json')[0])
    assert first == {
        'interface': 'socketcan', 'channel': 'can0', 'options': {'bitrate': 500000},
        'adapter': 'socketcan', 'what': 'up error-active, 500000 bit/s, a CAN controller',
        'state': 'up error-active', 'bitrate': 500000, 'latency_ms': None, 'remarks': []}


@pytest.mark.usefixtures('threads')
def test_what_libraries_find(host: Host, library: ModuleType, monkeypatch: pytest.MonkeyPatch,
                             capsys: pytest.CaptureFixture[str]) -> None:
    class Bus(can.BusABC):
        """Of a maker: as python-can's pcan answers."""

        @staticmethod
        def _detect_available_configs() -> list[Any]:
            return [{'interface': 'pcan', 'channel': 'PCAN_USBBUS1', 'supports_fd': True,
                     'controller_number': 0, 'device_name': 'PCAN-USB', 'device_id': 1}]

    class Fails(can.BusABC):
        """Another one, whose library is not there."""

        @staticmethod
        def _detect_available_configs() -> list[Any]:
            raise NameError("name 'canlib' is not defined")

    library.Bus, library.Fails = Bus, Fails   # type: ignore[attr-defined]
    monkeypatch.setattr(can.interfaces, 'BACKENDS', {
        'pcan': ('makers_library', 'Bus'), 'kvaser': ('makers_library', 'Fails'),
        'neovi': ('no_such_library', 'Bus'), 'virtual': ('can.interfaces.virtual', 'VirtualBus')})
    lines, told = shown(capsys)
    assert told == ''
    assert lines == ['pcan PCAN_USBBUS1: PCAN-USB', '    interface: pcan',
                     '    channel: PCAN_USBBUS1']


@pytest.mark.usefixtures('threads')
def test_a_library_that_does_not_come_back(monkeypatch: pytest.MonkeyPatch,
                                           library: ModuleType) -> None:
    clock = SteadyClock()
    held = clock.wake_event()

    class Stuck(can.BusABC):
        """Waits for a driver."""

        @staticmethod
        def _detect_available_configs() -> list[Any]:
            held.wait(clock.now() + 60.0)
            return []

    library.Stuck = Stuck   # type: ignore[attr-defined]
    monkeypatch.setattr(found_adapters, 'PATIENCE', 0.01)
    monkeypatch.setattr(can.interfaces, 'BACKENDS', {'stuck': ('makers_library', 'Stuck')})
    assert found_adapters.ask_libraries(clock) == ([], ['stuck'])
    held.ring()
