# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a torn frame, a closed peer, a refused opening and an echo come to, interface by interface.

Of all whose Python code runs without a maker's library, over bytes as they are on the line.
``virtual`` and ``udp_multicast`` have no peer that could close, and nothing that could be torn;
SocketCAN is told of in ``system/``, because it takes a kernel.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
import os
from pathlib import Path
import socket
import threading
from typing import NamedTuple

import can
from clocks import REAL
from literal_adapters import Attached, Socketcand
import pytest
from saying import says
from test_gateway import received
from waiting import wait_for

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport.port import open_port, Port

pytestmark = pytest.mark.usefixtures('threads')

#: before 4.6 python-can takes all identifiers of its own format for 29 bits
SERIAL_ALL_EXTENDED = can.__version__.startswith(('4.3.', '4.4.', '4.5.'))
FRAME = Frame(0x201, bytes.fromhex('0F00AA5510270000'), False)


class Line(NamedTuple):
    """
    How an interface is on its line.

    :param whole: the frame.
    :param torn: of the same frame, with what ends it.
    :param rejected: frames that a torn one counts for: robotell's is dropped by its check sum.
    """

    whole: bytes
    torn: bytes
    rejected: int = 1


LINES = {
    'slcan': Line(b't20180F00AA5510270000\r', b't20180F00AA5510\r'),
    'slcan over TCP': Line(b't20180F00AA5510270000\r', b't20180F00AA5510\r'),
    'seeedstudio': Line(bytes.fromhex('AA C8 01 02 0F 00 AA 55 10 27 00 00 55'),
                        bytes.fromhex('AA C8 01 02 0F 00 AA')),
    'serial': Line(bytes.fromhex('AA 00 00 00 00 08 01 02 00 00 0F 00 AA 55 10 27 00 00 BB'),
                   bytes.fromhex('AA 00 00 00 00 08 01 02')),
    'robotell': Line(
        bytes.fromhex('AA AA 01 02 00 00 0F 00 A5 AA A5 55 10 27 00 00 08 00 00 00 50 55 55'),
        bytes.fromhex('AA AA 01 02 00 00 0F 00 08 00 00 00 50 55 55'), 0),
    'socketcand': Line(b'< frame 201 1700000000.500000 0F00AA5510270000 >',
                       b'< frame 201 1700000000.500000 0F00AA551 >'),
}


class Peer:
    """
    The other end of an interface.

    :param echo: it hands back what it is handed.
    """

    def __init__(self, name: str, *, echo: bool = False) -> None:
        self.interface = name.split()[0]
        self._take: Callable[[bytes], bytes] = (lambda data: data) if echo else self._silent
        self.options: dict[str, object] = {}
        self._closed = False
        if name == 'socketcand':
            self._gateway = Socketcand()
            self.channel = 'can0'
            self.options = {'host': '127.0.0.1', 'port': self._gateway.port}
        elif name == 'slcan over TCP':
            self._server = socket.create_server(('127.0.0.1', 0))
            self.channel = f'socket://127.0.0.1:{self._server.getsockname()[1]}'
            self._thread = threading.Thread(target=self._serve)
            self._thread.start()
        else:
            self._attached = Attached(self._take)
            self.channel = self._attached.path
        self.name = name

    def _silent(self, data: bytes) -> bytes:
        # a Robotell adapter answers its settings
        return data if self.interface == 'robotell' and b'\xFF\x01' in data else b''

    def _serve(self) -> None:
        self._connected, _ = self._server.accept()
        try:
            while data := self._connected.recv(4096):
                self._connected.sendall(self._take(data))
        except OSError:
            pass

    def opened(self) -> Port:
        """Open it, and take what it says of that."""
        port = open_port(BusConfiguration(
            'main', self.interface, self.channel, bitrate=500_000, options=self.options), REAL)
        if self.name == 'slcan over TCP':
            wait_for(lambda: hasattr(self, '_connected'), 'the connection')
        elif self.name != 'socketcand':
            self._attached.handled()
        self.say(LINES[self.name].whole)    # behind it nothing of the opening comes
        assert received(port) == heard_as(self.name)
        port.rejected_frames = 0
        return port

    def say(self, data: bytes) -> None:
        """Write."""
        if self.name == 'socketcand':
            self._gateway.say(data)
        elif self.name == 'slcan over TCP':
            self._connected.sendall(data)
        else:
            os.write(self._attached.master, data)

    def close(self) -> None:
        """Go away."""
        if self._closed:
            return
        self._closed = True
        if self.name == 'socketcand':
            self._gateway.close()
        elif self.name == 'slcan over TCP':
            with suppress(OSError):     # the other end was quicker
                self._connected.shutdown(socket.SHUT_RDWR)
            self._thread.join()
            self._connected.close()
            self._server.close()
        else:
            self._attached.close()


@pytest.fixture(name='peer')
def peer_fixture() -> Iterator[Callable[..., Peer]]:
    made: list[Peer] = []

    def make(name: str, *, echo: bool = False) -> Peer:
        made.append(Peer(name, echo=echo))
        return made[-1]
    yield make
    for each in made:
        each.close()


@pytest.mark.parametrize('name', LINES)
def test_a_torn_frame_is_no_frame_and_the_next_one_is_heard(
        name: str, peer: Callable[..., Peer]) -> None:
    line, there = LINES[name], peer(name)
    port = there.opened()
    there.say(line.torn)
    end = REAL.now() + 0.4      # longer than these adapters wait for the rest of a packet
    while REAL.now() < end or port.rejected_frames < line.rejected:
        assert port.receive(0.02) is None
    assert port.rejected_frames == line.rejected
    there.say(line.whole)
    assert received(port) == heard_as(name)
    port.close()


@pytest.mark.parametrize('name', LINES)
def test_a_peer_that_closes_is_a_lost_bus(name: str, peer: Callable[..., Peer]) -> None:
    there = peer(name)
    port = there.opened()
    there.close()
    with pytest.raises(BusUnavailable, match='^receive: .'):
        while True:
            port.receive(0.02)
    port.close()


@pytest.mark.parametrize(('name', 'why'), [
    *((name, 'nothing is not there: check its plug and its name$')
      for name in ('slcan', 'seeedstudio', 'serial', 'robotell')),
    ('slcan over TCP', 'slcan socket://.*Connection refused'),
    ('socketcand', 'the gateway 127.0.0.1:[0-9]+ refuses$')])
def test_an_opening_that_is_refused(name: str, why: str, tmp_path: Path) -> None:
    with socket.create_server(('127.0.0.1', 0)) as server:
        port = server.getsockname()[1]
    channel, options = str(tmp_path / 'nothing'), dict[str, object]()
    if name == 'slcan over TCP':
        channel = f'socket://127.0.0.1:{port}'
    elif name == 'socketcand':
        channel, options = 'can0', {'host': '127.0.0.1', 'port': port}
    with pytest.raises(BusUnavailable, match=why):
        open_port(BusConfiguration('main', name.split()[0], channel, options=options), REAL)


def heard_as(name: str) -> Frame:
    """Return what the frame arrives as."""
    return FRAME._replace(extended=True) if name == 'serial' and SERIAL_ALL_EXTENDED else FRAME


def echoes(port: Port, wait: float, say: Callable[[int], object] = lambda number: None) -> None:
    """Send until it is told that what is sent comes back."""
    told: list[str] = []
    port.tell = told.append
    # on a busy machine an echo may come too late to be one, until it is known that they come
    for number in range(400):
        known = bool(told)
        port.send(Frame(0x201, bytes([number & 0xFF]), False), 0.5)
        say(number)
        end = REAL.now() + wait
        while REAL.now() < end:
            assert port.receive(0.005) is None or not known
        if known and number >= 60:
            break
    assert told == [says('adapter_echoes')]


@pytest.mark.parametrize('name', [name for name in LINES if name != 'socketcand' and not (
    name == 'serial' and SERIAL_ALL_EXTENDED)])
def test_an_echo_is_told_once_and_dropped(name: str, peer: Callable[..., Peer]) -> None:
    there = peer(name, echo=True)
    port = there.opened()
    echoes(port, 0.04)
    there.say(LINES[name].whole)
    assert received(port) == FRAME
    port.close()


def test_an_echo_of_a_gateway(peer: Callable[..., Peer]) -> None:
    there = peer('socketcand')
    port = there.opened()
    echoes(port, 0.01, lambda number: there.say(
        f'< frame 201 1700000000.500000 {number & 0xFF:02X} >'.encode()))
    port.close()
