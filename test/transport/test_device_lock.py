# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A serial device that another process has is not written to, whatever its container."""

from collections.abc import Iterator
import fcntl
import os
import select
import subprocess
import sys
import tty

from clocks import REAL
from extent import LONG, some
import pytest

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable
from drive_can_bridge.transport.bus_identity import DeviceLock
from drive_can_bridge.transport.port import open_port

#: opens a port like anybody, tells, and keeps it until it is killed
HOLDER = """
from drive_can_bridge.clock import SteadyClock
import sys
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.transport.port import open_port
port = open_port(BusConfiguration('main', sys.argv[1], sys.argv[2], 125000), SteadyClock())
print('open', flush=True)
sys.stdin.read()
"""
#: says what becomes of the device lock for somebody without privileges
STRANGER = """
import os, sys
from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.transport.bus_identity import DeviceLock
if os.getuid() == 0:
    os.setgroups([])
    os.setuid(65534)
try:
    lock = DeviceLock(sys.argv[1], exclusive=True)
    lock.keep_out()
    lock.release()
    print('free')
except BusUnavailable as error:
    print(error)
"""


class Device:
    """A pseudo-terminal, and whatever was written into it."""

    def __init__(self) -> None:
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.path = os.ttyname(self.slave)
        os.chmod(self.path, 0o666)

    def written(self) -> bytes:
        """Return what has come since the last time."""
        text = b''
        while select.select([self.master], [], [], 0)[0]:
            text += os.read(self.master, 4096)
        return text

    def close(self) -> None:
        os.close(self.master)
        os.close(self.slave)


@pytest.fixture
def device() -> Iterator[Device]:
    """Return a terminal of its own: TIOCEXCL stays as long as it does."""
    made = Device()
    yield made
    made.close()


def bus(path: str, interface: str = 'slcan') -> BusConfiguration:
    return BusConfiguration('main', interface, path, 125_000)


# python-can waits for seconds for what a robotell tells of itself
@pytest.mark.usefixtures('programs')
@pytest.mark.parametrize('interface', some(['slcan', 'seeedstudio', 'serial'], 3)
                         + LONG * ['robotell'])
def test_the_device_of_another_process_is_not_written_to(device: Device, interface: str) -> None:
    process = subprocess.Popen([sys.executable, '-c', HOLDER, interface, device.path],
                               stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdin is not None and process.stdout is not None
    assert process.stdout.readline() == b'open\n'
    device.written()
    with pytest.raises(BusUnavailable, match=f'{device.path}: the serial port is used by process '
                                       f'{process.pid}; a drive has one master'):
        open_port(bus(device.path, interface), REAL)
    assert device.written() == b''
    process.kill()
    process.wait()
    process.stdin.close()
    process.stdout.close()
    # what a process held that was killed is free
    open_port(bus(device.path, interface), REAL).close()


def test_whoever_closes_it_lets_others_have_it(device: Device) -> None:
    for _ in range(2):
        port = open_port(bus(device.path), REAL)
        with pytest.raises(BusUnavailable):
            open_port(bus(device.path), REAL)
        port.close()


def stranger(path: str) -> str:
    return subprocess.run([sys.executable, '-c', STRANGER, path], capture_output=True, text=True,
                          check=True).stdout.strip()


@pytest.mark.usefixtures('programs')
def test_two_nodes_of_one_device_meet_by_what_the_device_itself_says(device: Device) -> None:
    """They do not under flock, and root opens what is exclusive."""
    lock = DeviceLock(device.path, exclusive=True)
    lock.keep_out()
    fcntl.flock(lock._descriptor, fcntl.LOCK_UN)    # which is of the other node
    assert 'used by' in stranger(device.path)
    if os.getuid() == 0:
        with pytest.raises(BusUnavailable):
            DeviceLock(device.path, exclusive=True)
    lock.release()
    assert stranger(device.path) == 'free'


@pytest.mark.usefixtures('programs')
def test_on_a_pseudo_terminal_nothing_outlives_the_process(device: Device) -> None:
    lock = DeviceLock(device.path)
    lock.keep_out()
    assert 'used by' in stranger(device.path)
    os.close(lock._descriptor)      # as the kernel does when it is killed
    assert stranger(device.path) == 'free'


@pytest.mark.parametrize('channel', ['/dev/no_such_port', '/dev/null', '/'])
def test_what_is_no_terminal_is_left_to_the_adapter(channel: str) -> None:
    lock = DeviceLock(channel)
    lock.keep_out()
    lock.release()
    lock.release()


def test_a_channel_that_would_write_a_file_is_refused(tmp_path: object) -> None:
    path = f'{tmp_path}/precious'
    with pytest.raises(BusMisconfigured, match='is no serial port'):
        open_port(bus(f'spy:///dev/null?file={path}'), REAL)
    assert not os.path.exists(path)
