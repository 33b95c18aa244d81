# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Controllers of the kernel that report errors, go bus-off, and get nothing onto the bus.

Needs root and the kernel's slcan driver, as the kernels of .ci/socketcan/run have them.
"""

from collections.abc import Iterator
from pathlib import Path
import re

from kernel_adapter import KernelAdapter
from parameter_files import bridge_file, CONVEYOR
from processes import Client, Processes
import pytest
from repeating import again_and_again
from slcan_peer import NEUTRAL_WORDS, ZEROS
from test_system_reconnection import status_of
from waiting import SLOWNESS, wait_for, wait_for_end

from drive_can_bridge.cli.main import main as drive_can

CYCLIC_REQUEST = 'T003FFFF08'
MOVING = f'{CYCLIC_REQUEST}05DC{NEUTRAL_WORDS[4:]}'
NEUTRAL = CYCLIC_REQUEST + NEUTRAL_WORDS
#: what the smallest send buffer of the kernel holds, and one frame in the controller
UNDER_WAY = 3 + 1
PERIOD = 0.1
#: what is lost here is a bus, and not answers that a slow machine gives late
DRIVES = {'conveyor': {**CONVEYOR, 'period': PERIOD, 'mapping': 'assume', 'missed_limit': 100,
                       'parameter_timeout': SLOWNESS, 'command_timeout': 5.0 * SLOWNESS}}

pytestmark = pytest.mark.socketcan


@pytest.fixture
def adapter(tmp_path: Path) -> Iterator[KernelAdapter]:
    started = KernelAdapter(tmp_path, {CYCLIC_REQUEST: f'T103FFFF08{ZEROS}'})
    yield started
    started.close()


def start_feeding(client: Client, drive: str, adapter: KernelAdapter) -> None:
    """Arm the speed setpoint, and see that it arrives; the adapter's drive never moves."""
    client.online(drive)
    since = len(adapter.lines)
    client.publish(f'{drive}/command/speed_setpoint', 0.0)
    client.diagnostics(status_of(drive), state='^online$')
    client.publish(f'{drive}/command/speed_setpoint', 150.0)
    adapter.wait_for(MOVING, since)


def neutral_until_armed(client: Client, drive: str, adapter: KernelAdapter, since: int) -> None:
    """See that nothing moves although the publisher goes on, and arm again."""
    client.online(drive)
    client.diagnostics(status_of(drive), message='not armed: .*/speed_setpoint')
    adapter.wait_for(NEUTRAL, since, 3)
    assert MOVING not in adapter.lines[since:]
    start_feeding(client, drive, adapter)


def test_controller_in_trouble(processes: Processes, client: Client, namespace: str,
                               tmp_path: Path, adapter: KernelAdapter) -> None:
    file = bridge_file(tmp_path, interface='socketcan', channel=adapter.name, drives=DRIVES)
    bridge = processes.bridge(file, namespace)
    drive = f'/{namespace}/conveyor'
    bus = f'{namespace}/drive_can_bridge: bus main'
    start_feeding(client, drive, adapter)

    # error-passive while sending: nobody acknowledges; it is told, and the exchange goes on
    adapter.report('p', sent=128)
    facts = client.diagnostics(bus, state='^error-passive$', message=(
        'no other node acknowledges: check that one is switched on, cable'))
    assert facts['level'] == '1'
    assert 'controller error-passive' in facts['message']
    with again_and_again(lambda: adapter.send(b'e1a\r')):
        facts = client.diagnostics(bus, message='no acknowledgement')
    assert 'no other node acknowledges' in facts['message']
    assert int(facts['error_frames']) >= 2
    adapter.report('a', sent=1)
    facts = client.diagnostics(bus, state='^up$', level='^0$')
    assert facts['bus_off_count'] == facts['reconnections'] == '0'
    assert [line for line in bridge.errors if 'bus main: ' in line and 'open' not in line] == []

    # bus-off: the drive is lost at once, and told why; the driver takes frames and drops them
    adapter.report('b', sent=255)
    client.online(drive, wanted=False)
    bridge.error('bus main: bus-off.*check cable, shield, termination')
    client.diagnostics(bus, state='^bus-off$')
    for _ in range(3):  # at every attempt
        facts = client.diagnostics(bus)
        assert (facts['state'], facts['level'], facts['bus_off_count']) == ('bus-off', '2', '1')
    assert f'"ip link set {adapter.name} down"' in facts['message']
    assert 'restart-ms' in facts['message']
    assert client.set(drive, ramp_time=1.0) == [(False, 'bus down')]
    since = len(adapter.lines)
    adapter.switch('down')
    adapter.switch('up')
    neutral_until_armed(client, drive, adapter, since)
    facts = client.diagnostics(bus, state='^up$')
    assert facts['reconnections'] == '1'

    # nothing leaves: the transmit queue fills, and no more is put into it than it holds at once
    adapter.stop_reading()
    client.online(drive, wanted=False)
    bridge.error('bus main: send: transmit queue full.*no other node acknowledges: check that one '
                 'is switched on, cable')
    facts = client.diagnostics(bus, state='^down$', level='^2$',
                               message='no other node acknowledges')
    failures = int(facts['send_failures'])
    for _ in range(5):
        facts = client.diagnostics(bus)
    # not even tried while nothing can leave
    assert int(facts['send_failures']) == failures
    assert client.set(drive, ramp_time=1.0) == [(False, 'bus down')]
    # somebody acknowledges again: what was under way comes first, nobody can take that back
    since = adapter.read_again()
    wait_for(lambda: len(adapter.lines) > since + UNDER_WAY, 'frames')
    stale = [line for line in adapter.lines[since:since + UNDER_WAY] if line == MOVING]
    assert len(stale) <= UNDER_WAY
    neutral_until_armed(client, drive, adapter, since + len(stale))
    assert client.diagnostics(bus, state='^up$')['reconnections'] == '2'
    assert bridge.end() == 0
    wait_for_end(lambda: [line for line in adapter.lines if line.startswith('T')], [NEUTRAL] * 3)


def test_another_bit_rate_than_that_of_the_interface(
        processes: Processes, namespace: str, tmp_path: Path, adapter: KernelAdapter) -> None:
    file = bridge_file(tmp_path, interface='socketcan', channel=adapter.name,
                       bus={'bitrate': 500_000}, drives=DRIVES)
    bridge = processes.bridge(file, namespace)
    bridge.error(f'bus main: bitrate: 500000 does not change the interface: {adapter.name} is set '
                 f'to 125000 bit/s')
    assert bridge.end() == 0


def test_a_scan_says_what_is_wrong_with_the_bus(adapter: KernelAdapter,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    scan = ['scan', '--interface', 'socketcan', '--channel', adapter.name, '--bitrate', '125000']
    # somebody talks, and we understand nothing: a wrong bit rate, or no termination
    with again_and_again(lambda: adapter.send(b'e1s\r')):
        assert drive_can([*scan, '--passive', '--listen', str(SLOWNESS)]) == 1
    out, err = capsys.readouterr()
    assert out == 'no drive found, 0 frames heard\n'
    assert re.match(r'[1-9][0-9]* error frames: stuff error; check cable, shield, termination '
                    r'and bit rate\n', err)

    # nobody acknowledges: the queue fills
    adapter.stop_reading()
    assert drive_can([*scan, '--listen', '0.1']) == 1
    assert capsys.readouterr().err.startswith(
        'send: transmit queue full: no other node acknowledges: check power, cable, termination '
        'and bit rate\n')
    adapter.read_again()
