# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
SocketCAN's frames on its socket, beside what python-can's own code makes of the same bytes.

python-can's class, all of it, on a socket of another family: bytes of ``struct can_frame``
(linux/can.h) come out of one end of a pair, and the kernel stamps them as it stamps CAN frames.
The same on interfaces of a kernel: ``test/system/test_system_socketcan.py``.
"""

from collections.abc import Callable, Iterator
import errno
import os
import socket
import struct
import time
from typing import Any, NoReturn

import can
from can.interfaces.socketcan.socketcan import SocketcanBus
from clocks import REAL
import pytest
from waiting import DEADLINE

from drive_can_bridge.core.errors import BusUnavailable, TransportError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport.port import Port
from drive_can_bridge.transport.raw_socket import RawSocket

# linux/can.h on a machine with little-endian numbers: identifier and flags, length, padding, data
DATA_11 = bytes.fromhex('85010000' '06000000' '370221430000 0000')
DATA_29 = bytes.fromhex('f0ff2380' '08000000' '0102030405060708')
EMPTY = bytes.fromhex('80000000' '00000000' '0000000000000000')
#: eight bytes, told as nine
RAW_DLC = bytes.fromhex('23010000' '08000009' '0102030405060708')
REMOTE = bytes.fromhex('05070040' '01000000' '0000000000000000')
#: CAN_ERR_CRTL with CAN_ERR_CRTL_TX_WARNING; CAN_ERR_BUSOFF
WARNING = bytes.fromhex('04000020' '08000000' '0008000000000000')
BUS_OFF = bytes.fromhex('40000020' '08000000' '0000000000000000')
#: struct canfd_frame: 72 bytes
FD = bytes.fromhex('23010000' '08040000') + bytes(64)

KINDS = {'11 bits': DATA_11, '29 bits': DATA_29, 'without data': EMPTY, 'a DLC of 9': RAW_DLC,
         'remote': REMOTE, 'error': WARNING, 'bus-off': BUS_OFF, 'CAN FD': FD}


class Bus(SocketcanBus):
    """python-can's, on one end of a pair."""

    def __init__(self, own: socket.socket) -> None:
        own.setsockopt(socket.SOL_SOCKET, 35, 1)    # SO_TIMESTAMPNS
        self.socket, self.channel, self.channel_info = own, 'can0', 'a pair of sockets'
        self._bcm_sockets: dict[str, socket.socket] = {}
        can.BusABC.__init__(self, channel='can0')

    def _apply_filters(self, filters: Any) -> None:
        self._is_filtered = True


class Pair:
    """A port, and the other end of its socket."""

    def __init__(self, *, direct: bool) -> None:
        own, self.far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        bus = Bus(own)
        self.port = Port(bus, REAL, kernel_errors=True, host_stamps=True)
        self.errors: list[tuple[int, bytes]] = []
        self.port.error_witness = lambda classes, data: self.errors.append((classes, data))
        if not direct:
            self.port.witness = lambda _: None

    def close(self) -> None:
        self.port.close()
        self.far.close()


@pytest.fixture
def pair(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Pair]]:
    monkeypatch.setattr(socket, 'AF_CAN', socket.AF_UNIX, raising=False)
    made: list[Pair] = []

    def make(*, direct: bool = True) -> Pair:
        made.append(Pair(direct=direct))
        return made[-1]
    yield make
    for each in made:
        each.close()


def outcome(pair: Pair, frame: bytes) -> tuple[object, ...]:
    """Return all that becomes of a frame."""
    pair.far.send(frame)
    try:
        found: object = pair.port.receive(1.0)
    except BusUnavailable as error:
        found = str(error)
    port = pair.port
    return (found, port.error_frames, port.rejected_frames, port.last_error, port.controller,
            port.counts, pair.errors)


def test_what_is_received(pair: Callable[..., Pair]) -> None:
    port = pair().port
    assert port.receive(0.0) is None
    it = pair()
    for sent, frame in ((DATA_11, Frame(0x185, bytes.fromhex('370221430000'), False)),
                        (DATA_29, Frame(0x0023FFF0, bytes(range(1, 9)), True)),
                        (EMPTY, Frame(0x080, b'', False)),
                        (RAW_DLC, Frame(0x123, bytes(range(1, 9)), False))):
        began = REAL.now()
        it.far.send(sent)
        assert it.port.receive(DEADLINE) == frame
        assert 0.0 < it.port.age < REAL.now() - began + 0.001
    assert it.port.rejected_frames == 0
    for other in (REMOTE, FD):
        it.far.send(other)
        assert it.port.receive(1.0) is None
    assert it.port.rejected_frames == 2
    it.far.send(WARNING)
    assert it.port.receive(1.0) is None
    assert it.errors == [(0x004, bytes.fromhex('0008000000000000'))]
    assert it.port.controller == 'error-warning'


@pytest.mark.parametrize('frame', KINDS.values(), ids=KINDS.keys())
def test_as_by_python_can(pair: Callable[..., Pair], frame: bytes) -> None:
    assert outcome(pair(direct=True), frame) == outcome(pair(direct=False), frame)


def test_no_message_is_made(pair: Callable[..., Pair], monkeypatch: pytest.MonkeyPatch) -> None:
    it = pair()

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError('python-can was asked')
    monkeypatch.setattr(can, 'Message', refuse)
    monkeypatch.setattr(Bus, 'send', refuse)
    monkeypatch.setattr(it.port, '_receive', refuse)
    it.far.send(DATA_11)
    assert it.port.receive(1.0) is not None
    it.port.send(Frame(0x205, b'\x0f\x00', False), 0.1)


def test_a_witness_sees_all(pair: Callable[..., Pair]) -> None:
    it = pair()
    seen: list[can.Message] = []
    it.port.witness = seen.append
    for frame in (DATA_29, REMOTE, WARNING):
        it.far.send(frame)
        it.port.receive(1.0)
    assert [(each.arbitration_id, each.is_remote_frame, each.is_error_frame) for each in seen] == [
        (0x0023FFF0, False, False), (0x705, True, False), (0x004, False, True)]
    it.port.witness = None
    it.far.send(DATA_11)
    assert it.port.receive(1.0) is not None
    assert len(seen) == 3


@pytest.mark.parametrize('direct', [True, False], ids=['on the socket', 'by python-can'])
def test_a_frame_that_waited_is_old(pair: Callable[..., Pair], direct: bool) -> None:
    it = pair(direct=direct)
    it.far.send(DATA_11)
    time.sleep(0.03)
    assert it.port.receive(1.0) is not None
    assert it.port.age >= 0.03


@pytest.mark.parametrize(('frame', 'data'), [
    (Frame(0x185, bytes.fromhex('3702'), False), '85010000' '02000000' '3702000000000000'),
    (Frame(0x0023FFF0, bytes(range(1, 9)), True), 'f0ff2380' '08000000' '0102030405060708'),
    (Frame(0x080, b'', False), '80000000' '00000000' '0000000000000000'),
], ids=['11 bits', '29 bits', 'without data'])
def test_what_is_sent(pair: Callable[..., Pair], frame: Frame, data: str) -> None:
    it = pair()
    it.port.send(frame, 0.1)
    assert it.far.recv(100).hex() == bytes.fromhex(data).hex()


def test_full_queue(pair: Callable[..., Pair]) -> None:
    it = pair()
    with pytest.raises(TransportError, match='^send: transmit queue full$'):
        for _ in range(100_000):
            it.port.send(Frame(0x185, bytes(8), False), 0.0)
    assert it.port.has_room is False
    waiting = 0
    it.far.setblocking(False)
    with pytest.raises(BlockingIOError):
        while it.far.recv(100):
            waiting += 1
    assert waiting > 0
    assert it.port.has_room
    it.port.send(Frame(0x185, bytes(8), False), 0.0)


class Refusing(RawSocket):
    """A socket below that has an error to tell."""

    def __init__(self, number: int) -> None:    # there is none
        self.error = OSError(number, os.strerror(number))

    def receive(self, timeout: float) -> NoReturn:
        raise self.error

    def send(self, frame: Frame, timeout: float) -> bool:
        raise self.error


def test_no_buffer_is_a_full_queue(pair: Callable[..., Pair]) -> None:
    port = pair().port
    port._direct = Refusing(errno.ENOBUFS)
    with pytest.raises(TransportError, match='^send: transmit queue full$'):
        port.send(Frame(0x185, b'', False), 0.0)


@pytest.mark.parametrize('number', [errno.ENETDOWN, errno.ENODEV, errno.ENXIO])
def test_lost(pair: Callable[..., Pair], number: int) -> None:
    port = pair().port
    port._direct = Refusing(number)
    with pytest.raises(BusUnavailable, match=f'^send: .*{os.strerror(number)}'):
        port.send(Frame(0x185, b'', False), 0.0)
    with pytest.raises(BusUnavailable, match=f'^receive: .*{os.strerror(number)}'):
        port.receive(0.0)


def test_closed(pair: Callable[..., Pair]) -> None:
    it = pair()
    it.far.close()
    with pytest.raises(BusUnavailable, match='^receive: '):
        it.port.receive(1.0)
    it.port.close()
    with pytest.raises(BusUnavailable, match='^receive: '):
        it.port.receive(1.0)


def test_filters_that_the_kernel_refused_are_applied_here(
        pair: Callable[..., Pair], monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(bus: Bus, filters: Any) -> None:
        bus._is_filtered = False
    monkeypatch.setattr(Bus, '_apply_filters', refused)
    it = pair()
    it.port._bus.set_filters([{'can_id': 0x185, 'can_mask': 0x7FF, 'extended': False}])
    it.far.send(EMPTY)
    assert it.port.receive(1.0) is None
    assert it.port.rejected_frames == 1
    it.far.send(DATA_11)
    assert it.port.receive(1.0) is not None


def test_layout() -> None:
    """As the kernel has it: native byte order, 16 bytes."""
    assert struct.unpack('=IB3x8s', DATA_29)[0] == 0x8023FFF0
    assert len(DATA_29) == 16 and len(FD) == 72
