# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What is said of adapters that cannot do what the drives of a file need."""

from pathlib import Path
import re

from configuration_builders import at, changed, FILE, problems, warnings
import pytest
from saying import says
from usb_host import Host

from drive_can_bridge.transport import adapters

#: for an adapter that is not plugged in here
REMEDY = ('latency timer to 1 ms: echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB7/'
          'latency_timer, for good by a udev rule')
LAWICEL = 'interface: slcan\n        channel: /dev/ttyUSB7\n        adapter: lawicel'


def with_bus(lines: str) -> str:
    """Return the file with another bus."""
    return changed(changed(FILE, 'interface: virtual', lines), '        channel: demo\n', '')


@pytest.mark.parametrize(('lines', 'expected'), [
    ('interface: slcan\n        channel: /dev/ttyUSB7\n        adapter: esp32_slcan', [
        at('f.yaml:8: buses.main.adapter', 'adapter_drops', adapter='ESP32-SLCAN', drive=drive,
           what=['29-bit identifiers'], protocol='datamodel_extended')
        for drive in ('conveyor', 'lift')]),
    ('interface: slcan\n        channel: /dev/ttyUSB7\n        adapter: lawicl',
     [at('f.yaml:8: buses.main.adapter', 'unknown_adapter', name='lawicl',
         hint=says('did_you_mean', word='lawicel'))]),
    ('interface: robotell\n        channel: /dev/ttyUSB7\n        adapter: lawicel',
     [at('f.yaml:8: buses.main.adapter', 'adapter_of_other_interface', name='lawicel',
         other='slcan')]),
    (LAWICEL, []), ('interface: socketcan\n        channel: can7', [])])
def test_errors(tmp_path: Path, lines: str, expected: list[str]) -> None:
    assert problems(tmp_path, with_bus(lines), adapters=adapters) == expected


@pytest.mark.parametrize('bitrate', [750000, 800000])
def test_one_command_has_two_bit_rates(tmp_path: Path, bitrate: int) -> None:
    text = re.sub('bitrate: [0-9]+', f'bitrate: {bitrate}', with_bus(LAWICEL))
    assert warnings(tmp_path, text, adapters=adapters) == [
        at('f.yaml:9: buses.main.bitrate', 'rate_of_two')]


def test_a_period_that_is_shorter_than_what_is_received_is_kept(tmp_path: Path) -> None:
    """The latency timer of FTDI: 16 ms are fine at 20 ms, and too long at 10 ms."""
    text = with_bus(LAWICEL)
    assert warnings(tmp_path, text, adapters=adapters) == []
    late = text.replace('period: 0.02', 'period: 0.01')
    told = [at(f'f.yaml:{line}: drives.{drive}.period', 'adapter_late', period=0.01, latency='16',
               adapter='LAWICEL CANUSB', least=0.019, remedy=REMEDY)
            for line, drive in enumerate_periods(late)]
    assert told and warnings(tmp_path, late, adapters=adapters) == told


def test_the_timer_of_this_host_is_what_counts(tmp_path: Path,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    host = Host(tmp_path / 'host', monkeypatch)
    port = host.plug('ttyUSB0', '0403:6001', 'FT232R USB UART', timer=16)
    file = tmp_path / 'host/sys/bus/usb-serial/devices/ttyUSB0/latency_timer'
    text = with_bus(f'interface: slcan\n        channel: {port}').replace(
        'period: 0.02', 'period: 0.01')
    first, *_ = warnings(tmp_path, text, adapters=adapters)
    assert first.endswith('recommended is at least 0.019 s, or: echo 1 | sudo tee '
                          'host/sys/bus/usb-serial/devices/ttyUSB0/latency_timer')
    file.write_text('1\n')
    assert not [each for each in warnings(tmp_path, text, adapters=adapters) if 'keeps' in each]


def enumerate_periods(text: str) -> list[tuple[int, str]]:
    """Return line and drive of each period that stands in a file."""
    found, drive = [], ''
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith('      ') and not line.startswith('       ') and line.endswith(':'):
            drive = line.strip(' :')
        if line.strip() == 'period: 0.01':
            found.append((number, drive))
    return found


def test_a_line_that_is_too_slow(tmp_path: Path) -> None:
    """Half of 2 x 16640 bit/s goes each way, a bit of the bus is 1.7 of the line."""
    text = with_bus('interface: slcan\n        channel: /dev/ttyUSB7@38400')
    assert warnings(tmp_path, text, adapters=adapters) == [
        at('f.yaml:5: buses.main', 'line_too_slow', adapter='slcan /dev/ttyUSB7@38400',
           rate=38400, most=70.0)]
    assert warnings(tmp_path, text.replace('38400', '57600'), adapters=adapters) == []


@pytest.mark.parametrize(('lines', 'told'), [
    ('interface: slcan\n        channel: /dev/ttyACM7',
     at('f.yaml:8: buses.main.listen_only', 'only_listens')),
    ('interface: slcan\n        channel: /dev/ttyACM7\n        adapter: canable',
     at('f.yaml:9: buses.main.listen_only', 'no_listen_only', instead='')),
    ('interface: seeedstudio\n        channel: /dev/ttyACM7',
     at('f.yaml:8: buses.main.listen_only', 'no_listen_only', instead='operation_mode: silent'))])
def test_listen_only(tmp_path: Path, lines: str, told: object) -> None:
    text = with_bus(f'{lines}\n        listen_only: true')
    assert warnings(tmp_path, text, adapters=adapters)[-1] == told
