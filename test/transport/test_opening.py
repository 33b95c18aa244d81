# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Opening, reopening and closing a serial adapter brings nothing to its bus.

Whatever a process that died has left in it: each firmware of ``literal_adapters`` with each half
line, and the packets of the other serial interfaces.
"""

from collections.abc import Iterator
from functools import lru_cache
import socket

from clocks import REAL
from literal_adapters import (
    Attached, Canable, Canable2, Canable25, Esp32, Firmware, Lawicel, Usbtin, WeAct,
)
import pytest

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport.port import open_port, Port

FIRMWARES = (Canable, Canable2, Canable25, Usbtin, Lawicel, WeAct, Esp32)
#: what they do with a whole line that lacks only its end (docs/safety.md)
NOT_LOOKING_AT_THE_REST = (Usbtin, Lawicel, WeAct)
#: an enabled servo at 10,000; a cycle of DataModel with 300 rpm; what opens
LINES = ('t20160F0010270000', 'T003FFFF08012C00370000FFFF', 't2018001122334455667', 'S4', 'O', 'V')


def opened(path: str, interface: str = 'slcan') -> Port:
    """Open an adapter as the bridge does."""
    return open_port(BusConfiguration('main', interface, path, bitrate=125_000), REAL)


pytestmark = pytest.mark.usefixtures('threads')


@pytest.fixture(name='written')
def written_fixture() -> tuple[bytes, bytes, bytes]:
    """Return what is written at opening, at closing, and behind a loss."""
    return _written()


@lru_cache(maxsize=1)
def _written() -> tuple[bytes, bytes, bytes]:
    attached = Attached(lambda data: b'')
    try:
        port = opened(attached.path)
        at_opening = attached.handled()
        port.close()
        at_closing = attached.handled()[len(at_opening):]
        attached.written = b''
        port = opened(attached.path)
        attached.handled()
        attached.written = b''
        port._lost = True       # as after a write that did not get through
        port.close()
        return at_opening, at_closing, attached.handled()
    finally:
        attached.close()


def lines_of(data: bytes) -> list[bytes]:
    """Return lines; the last one is what has no end."""
    return data.split(b'\r')


def test_no_empty_line(written: tuple[bytes, bytes, bytes]) -> None:
    for data in written:
        assert data
        assert b'' not in lines_of(data)[:-1]
        assert lines_of(data)[-1] == b''
    assert [line[:2] for line in lines_of(written[0])] == [
        b'VV', b'C', b'C', b'S4', b'O', b'O', b'']
    assert written[1] == b'C\r'
    assert [line[:2] for line in lines_of(written[2])] == [b'VV', b'C', b'']


def halves() -> Iterator[str]:
    """Yield all half lines, and the whole ones without their end."""
    for line in LINES:
        for end in range(len(line) + 1):
            yield line[:end]


@pytest.mark.parametrize('firmware', FIRMWARES)
@pytest.mark.parametrize('which', [0, 1, 2], ids=['opening', 'closing', 'behind a loss'])
def test_nothing_of_a_process_that_died_reaches_the_bus(
        firmware: type[Firmware], which: int, written: tuple[bytes, bytes, bytes]) -> None:
    for half in halves():
        adapter = firmware()
        # it ran: the line before is in the buffer of a CANable
        adapter.take(b'S4\rO\rt20160F0010270000\r')
        ran = list(adapter.frames)
        assert len(ran) == 1
        if which != 1:      # closing as it should be is behind a whole line
            adapter.take(half.encode())
        adapter.take(written[which])
        told = adapter.frames[len(ran):]
        whole = half in LINES and half[0] in 'tT' and which != 1
        if whole and firmware in NOT_LOOKING_AT_THE_REST:
            assert len(told) <= 1
        else:
            assert told == [], half
        assert adapter.channel_open is (which == 0)
        # and what is sent now is what is meant
        adapter.take(b'S4\rO\rt2012AABB\r')
        assert adapter.frames[len(ran) + len(told):] == ['201#AABB']


@pytest.mark.parametrize('firmware', FIRMWARES)
def test_a_read_behind_a_process_that_died(firmware: type[Firmware]) -> None:
    """As it was seen: killed at speed, stopped by somebody else, and then only looked at."""
    adapter = firmware()
    adapter.take(b'S4\rO\rt20160F0010270000\r')
    del adapter.frames[:]
    attached = Attached(adapter.take)
    try:
        port = opened(attached.path)
        port.send(Frame(0x601, bytes.fromhex('4064600000000000'), False), 0.1)
        attached.handled()
        port.close()
        attached.handled()
        assert adapter.frames == ['601#4064600000000000']
        for _ in range(2):      # lost, and opened again
            port = opened(attached.path)
            port._lost = True
            port.close()
        attached.handled()
        assert adapter.frames == ['601#4064600000000000']
        assert not adapter.channel_open
    finally:
        attached.close()


# -- packets --------------------------------------------------------------------------------------


def seeed_frames(data: bytes) -> list[str]:
    """Return the frames in what a USB-CAN-Analyzer is handed (packets as in python-can 4.6.1)."""
    found, place = [], 0
    while (place := data.find(b'\xAA', place)) >= 0:
        kind = data[place + 1] if place + 1 < len(data) else 0
        if kind & 0xC0 != 0xC0:
            place += 20 if kind == 0x55 else 1
            continue
        head = 4 if kind & 0x20 else 2
        end = place + 2 + head + (kind & 0xF)
        if end < len(data) and data[end] == 0x55:
            identifier = int.from_bytes(data[place + 2:place + 2 + head], 'little')
            found.append(f'{identifier:X}#{data[place + 2 + head:end].hex().upper()}')
        place = end + 1
    return found


def serial_frames(data: bytes) -> list[str]:
    """Return the frames of the interface ``serial`` (packets as in python-can 4.6.1)."""
    found, place = [], 0
    while (place := data.find(b'\xAA', place)) >= 0:
        length = data[place + 5] if place + 5 < len(data) else 9
        end = place + 10 + length
        if length > 8:
            place += 6
            continue
        if end < len(data) and data[end] == 0xBB:
            identifier = int.from_bytes(data[place + 6:place + 10], 'little') & 0x1FFFFFFF
            found.append(f'{identifier:X}#{data[place + 10:end].hex().upper()}')
        place = end + 1
    return found


def robotell_frames(data: bytes) -> list[str]:
    """Return the frames in what a Robotell adapter is handed (packets as in python-can 4.6.1)."""
    found, place = [], 0
    while (place := data.find(b'\xAA\xAA', place)) >= 0:
        place += 2
        packet = bytearray()
        while place < len(data) and data[place:place + 2] != b'\x55\x55':
            if data[place] == 0xA5:
                place += 1
            packet += data[place:place + 1]
            place += 1
        ended = data[place:place + 2] == b'\x55\x55'
        if (ended and len(packet) == 17 and packet[16] == sum(packet[:16]) & 0xFF
                and packet[13] != 0xFF):
            identifier = int.from_bytes(packet[:4], 'little')
            found.append(f'{identifier:X}#{packet[4:4 + packet[12]].hex().upper()}')
    return found


#: 201#0F00AA5510270000
PACKETS = [
    ('seeedstudio', seeed_frames, 'AA C8 01 02 0F 00 AA 55 10 27 00 00 55'),
    ('serial', serial_frames, 'AA 00 00 00 00 08 01 02 00 00 0F 00 AA 55 10 27 00 00 BB'),
    ('robotell', robotell_frames,
     'AA AA 01 02 00 00 0F 00 A5 AA A5 55 10 27 00 00 08 00 00 00 50 55 55')]


@pytest.mark.parametrize(('interface', 'frames', 'text'), PACKETS)
def test_half_packets_come_to_nothing(interface: str, frames: object, text: str) -> None:
    assert callable(frames)
    packet = bytes.fromhex(text)
    assert frames(packet) == ['201#0F00AA5510270000']
    # a Robotell adapter answers its settings
    attached = Attached(lambda data: data if interface == 'robotell' else b'')
    try:
        port = opened(attached.path, interface)
        at_opening = attached.handled()
        attached.written = b''
        port.send(Frame(0x123, b'\x01\x02', False), 0.1)
        sent = attached.handled()
        attached.written = b''
        port._lost = True
        port.close()
        behind_a_loss = attached.handled()
    finally:
        attached.close()
    assert frames(sent) == ['123#0102']
    for end in range(len(packet)):
        assert frames(packet[:end] + at_opening + sent) == ['123#0102'], end
        assert frames(packet[:end] + behind_a_loss + at_opening + sent) == ['123#0102'], end


def test_frames_leave_at_once_over_a_connection() -> None:
    """Pyserial leaves Nagle's algorithm on: every second frame would wait for 40 ms."""
    with socket.create_server(('127.0.0.1', 0)) as server:
        port = opened(f'socket://127.0.0.1:{server.getsockname()[1]}')
        connection = port._bus.serialPortOrig._socket   # type: ignore[attr-defined]
        assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        port.close()
