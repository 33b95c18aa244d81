# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A bus behind socketcand: a gateway that refuses, closes, stalls, and says nonsense."""

from collections.abc import Callable, Iterator
import logging
import socket
import threading

from clocks import REAL
from literal_adapters import Socketcand
import pytest
from waiting import wait_for

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusUnavailable
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport.port import open_port, Port

pytestmark = pytest.mark.usefixtures('threads')


@pytest.fixture(name='gateway')
def gateway_fixture() -> Iterator[Callable[..., Socketcand]]:
    made: list[Socketcand] = []

    def make(*words: str) -> Socketcand:
        made.append(Socketcand(words or Socketcand.WORDS))
        return made[-1]
    yield make
    for each in made:
        each.close()


def opened(port: int) -> Port:
    return open_port(BusConfiguration('main', 'socketcand', 'can0', options={
        'host': '127.0.0.1', 'port': port}), REAL)


def received(port: Port) -> Frame:
    """Return the next frame."""
    found: Frame = wait_for(lambda: port.receive(0.02), 'a frame')
    return found


def test_frames_both_ways(gateway: Callable[..., Socketcand]) -> None:
    there = gateway()
    port = opened(there.port)
    assert port.punctual
    there.say('< frame 123 1700000000.123456 0F00 >< frame 103FFFF0 1700000000.2 11 22 >')
    there.say('< frame 7')
    assert received(port) == Frame(0x123, b'\x0f\x00', False)
    assert received(port) == Frame(0x103FFFF0, b'\x11\x22', True)
    there.say('FF 1700000000.3  >')
    assert received(port) == Frame(0x7FF, b'', False)
    port.send(Frame(0x80, b'', False), 0.1)
    port.send(Frame(0x003FFFF0, bytes.fromhex('012C0037'), True), 0.1)
    there.say('< error 004 1700000000.4 >< frame 1 1700000000.5 01 >')
    assert received(port) == Frame(1, b'\x01', True)
    assert (port.error_frames, port.rejected_frames) == (1, 0)
    port.close()
    there.close()   # behind what it had to read
    assert there.sent == ['080 0', '003FFFF0 4 01 2C 00 37']


@pytest.mark.parametrize('nonsense', [
    '< frame zz 1.0 00 >', '< frame 123 now 00 >', '< frame 123 1.0 0 >', '< frame 123 >', '>',
    '< frame 123 1.0 001122334455667788 >', b'\xff\xfe< frame 1 1.0 00 >', '< ok >', 2000 * 'x'])
def test_nonsense_is_one_rejected_frame(nonsense: str | bytes,
                                        gateway: Callable[..., Socketcand]) -> None:
    there = gateway()
    port = opened(there.port)
    there.say(nonsense)
    while not port.rejected_frames:
        assert port.receive(0.02) is None
    there.say('< frame 123 1700000000.1 01 >')
    assert received(port) == Frame(0x123, b'\x01', False)
    assert port.rejected_frames == 1
    port.close()


def test_one_that_refuses_is_asked_once(caplog: pytest.LogCaptureFixture,
                                        monkeypatch: pytest.MonkeyPatch) -> None:
    """python-can asks without a pause for ten seconds, and logs each time."""
    with socket.create_server(('127.0.0.1', 0)) as listening:
        number = listening.getsockname()[1]
    asked = []

    class Socket(socket.socket):
        def connect(self, address: object) -> None:
            asked.append(address)
            super().connect(address)    # type: ignore[arg-type]
    monkeypatch.setattr(socket, 'socket', Socket)
    with caplog.at_level(logging.DEBUG), pytest.raises(BusUnavailable) as caught:
        opened(number)
    assert str(caught.value) == (f'socketcand can0: the gateway 127.0.0.1:{number} refuses')
    assert asked == [('127.0.0.1', number)]
    assert caplog.records == []


def test_one_that_closes_is_lost(gateway: Callable[..., Socketcand]) -> None:
    there = gateway()
    port = opened(there.port)
    there.drop()
    with pytest.raises(BusUnavailable) as caught:
        received(port)
    assert str(caught.value) == (
        f'receive: the gateway 127.0.0.1:{there.port} has closed the connection')
    port.close()
    # and back again
    opened(there.port).close()
    assert there.connections == 2


@pytest.mark.parametrize(('words', 'why'), [
    ((), 'does not answer'),
    (('< hi >',), 'does not answer'),
    (('< hi >', '< error could not open bus >'),
     'refuses channel can0: error could not open bus'),
    (('HTTP/1.1 400 Bad Request <html>',), 'is no socketcand'),
    ((2000 * 'x',), 'is no socketcand')])
def test_one_that_says_nothing_or_something_else(
        words: tuple[str, ...], why: str, gateway: Callable[..., Socketcand]) -> None:
    there = Socketcand(words)
    try:
        began = REAL.now()
        with pytest.raises(BusUnavailable, match=why):
            opened(there.port)
        assert REAL.now() - began < 4.0
    finally:
        there.close()


def test_one_that_stalls_holds_up_no_sender(gateway: Callable[..., Socketcand]) -> None:
    """A connection whose other end reads no more: nothing is queued without bound, none waits."""
    with socket.create_server(('127.0.0.1', 0)) as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        # it says everything at once, and is suspended then
        taken: list[socket.socket] = []

        def accept() -> None:
            connected, _ = listening.accept()
            taken.append(connected)
            for words in Socketcand.WORDS:
                connected.sendall(words.encode())
                REAL.wait(REAL.now() + 0.1)
        thread = threading.Thread(target=accept)
        thread.start()
        port = opened(listening.getsockname()[1])
        thread.join()
        longest = count = 0.0
        with pytest.raises(BusUnavailable, match='takes no more'):
            while count < 100_000:
                began = REAL.now()
                try:
                    port.send(Frame(0x123, bytes(8), False), 0.02)
                finally:
                    longest = max(longest, REAL.now() - began)
                count += 1
        assert longest < 1.0
        assert count < 2000
        port.close()
        taken[0].close()


def test_host_and_port_are_asked_for(gateway: Callable[..., Socketcand]) -> None:
    there = gateway()
    port = opened(there.port)
    assert port._bus.socket.getsockopt(     # type: ignore[attr-defined]
        socket.IPPROTO_TCP, socket.TCP_NODELAY)
    port.close()
