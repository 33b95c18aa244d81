# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""An open bus: what becomes of what an adapter delivers, refuses and throws."""

from collections import deque
from collections.abc import Iterator
import errno
import fcntl
import gc
import itertools
import os
from pathlib import Path
import socket
import struct
import sys
import termios
import time
import tty
from types import SimpleNamespace
from typing import Any

import can
from clocks import HandClock, REAL
from literal_adapters import Attached, Canable, Canable25, Esp32, Firmware, Lawicel, Usbtin
import pytest
from waiting import DEADLINE

from drive_can_bridge.core import complaints
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable, TransportError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.transport import port as port_module, serial_writer
from drive_can_bridge.transport.port import open_port, Port
from drive_can_bridge.transport.raw_socket import RawSocket
from drive_can_bridge.transport.serial_writer import AdapterAnswers, Below

FRAME = Frame(0x003FFFF0, bytes(8), True)


class FakeBus(can.BusABC):
    """Delivers what it was given; an exception is thrown."""

    def __init__(self) -> None:
        super().__init__(channel='fake')
        self.coming: deque[Any] = deque()
        self.sent: list[can.Message] = []
        self.failure: Exception | None = None
        self.waited: list[float | None] = []

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self.waited.append(timeout)
        if not self.coming:
            return None, False
        found = self.coming.popleft()
        if isinstance(found, Exception):
            raise found
        return found, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.failure is not None:
            raise self.failure
        self.sent.append(msg)


@pytest.fixture
def bus() -> FakeBus:
    return FakeBus()


def error_frame(classes: int, data: str = '') -> can.Message:
    """Make an error frame as python-can delivers SocketCAN's."""
    return can.Message(arbitration_id=classes, data=bytes.fromhex(data), is_error_frame=True,
                       is_extended_id=False)


def test_frame(bus: FakeBus) -> None:
    port = Port(bus, REAL)
    bus.coming.append(can.Message(arbitration_id=0x103FFFF0, data=b'\x12\x34', timestamp=0.0))
    assert port.receive(0.02) == Frame(0x103FFFF0, b'\x12\x34', True)
    assert port.receive(0.02) is None
    port.send(FRAME, 0.01)
    assert bus.sent[0].arbitration_id == 0x003FFFF0
    assert bus.sent[0].is_extended_id


def test_what_an_adapter_says_by_a_number_is_a_flag(bus: FakeBus) -> None:
    """Nobody checks it, and compiled code takes nothing else."""
    port = Port(bus, REAL)
    bus.coming.append(can.Message(
        arbitration_id=0x103FFFF0, is_extended_id=1))   # type: ignore[arg-type]
    received = port.receive(0.02)
    assert received is not None
    assert received.extended is True


def test_filters_of_adapters_that_have_none(bus: FakeBus) -> None:
    bus.set_filters([{'can_id': 0x123, 'can_mask': 0x7FF, 'extended': False}])
    port = Port(bus, REAL)
    bus.coming += [can.Message(arbitration_id=0x124, is_extended_id=False),
                   error_frame(0x020),
                   can.Message(arbitration_id=0x123, is_extended_id=False)]
    assert port.receive(0.0) is None
    assert port.receive(0.0) is None
    assert port.error_frames == 1
    assert port.receive(0.0) == Frame(0x123, b'', False)
    assert port.rejected_frames == 1


def test_adapter_that_replaces_recv_itself() -> None:
    """As the plugins python-can-remote 0.3.0, can-cannelloni 0.1.0, can-waveshare 0.1.0 do."""
    class Replaces(FakeBus):
        _recv_internal = can.BusABC._recv_internal      # raises NotImplementedError

        def recv(self, timeout: float | None = None) -> can.Message | None:
            return FakeBus._recv_internal(self, timeout)[0]

    bus = Replaces()
    bus.set_filters([{'can_id': 0x123, 'can_mask': 0x7FF, 'extended': False}])
    port = Port(bus, REAL)
    bus.coming += [can.Message(arbitration_id=0x124, is_extended_id=False),
                   can.Message(arbitration_id=0x123, is_extended_id=False)]
    assert port.receive(0.02) is None       # not every such plugin filters
    assert port.receive(0.02) == Frame(0x123, b'', False)
    assert port.receive(0.02) is None
    assert bus.waited == [0.02] * 3


def test_a_closed_bus_is_not_said_to_be_open(caplog: pytest.LogCaptureFixture) -> None:
    """The shutdown() of can-cannelloni 0.1.0 does not call that of python-can."""
    class Plugin(FakeBus):
        def shutdown(self) -> None:
            pass

    port = Port(Plugin(), REAL)
    port.close()
    del port
    gc.collect()
    assert caplog.messages == []


@pytest.mark.parametrize('step', [-3600.0, 3600.0], ids=['back', 'forward'])
def test_clock_that_is_set_while_waiting(bus: FakeBus, monkeypatch: pytest.MonkeyPatch,
                                         step: float) -> None:
    # python-can's own recv works with the system clock: set back by an hour, it waits for an hour
    # as long as nothing comes; set forward, it waits no more
    clock = [1e9]

    def jumping() -> float:
        clock[0] += step
        return clock[0]
    monkeypatch.setattr(time, 'time', jumping)
    monkeypatch.setattr('can.bus.time', jumping)
    port = Port(bus, REAL)
    assert port.receive(0.02) is None
    assert bus.waited == [0.02]
    bus.coming.append(can.Message(arbitration_id=1, timestamp=1e9))
    assert port.receive(0.02) == Frame(1, b'', True)
    assert port.age == 0.0


@pytest.mark.parametrize(('stamp', 'age'), [
    (1000.0 - 0.03, 0.03), (1000.0 + 5.0, 0.0), (1000.0 - 0.2, 0.0), (0.0, 0.0)],
    ids=['late', 'from the future', 'clock was set', 'adapter without a clock'])
def test_age(bus: FakeBus, monkeypatch: pytest.MonkeyPatch, stamp: float, age: float) -> None:
    clock = HandClock(lambda: 50.0)
    monkeypatch.setattr(clock, 'stamp', lambda: 1_000_000_000_000)
    port = Port(bus, clock, host_stamps=True)
    bus.coming.append(can.Message(arbitration_id=1, timestamp=stamp))
    port.receive(0.0)
    assert port.age == pytest.approx(age)


def test_age_of_frames_that_waited(bus: FakeBus, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [50.0]
    clock = HandClock(lambda: now[0])
    monkeypatch.setattr(clock, 'stamp', lambda: round(1e9 * (950.0 + now[0])))
    port = Port(bus, clock, host_stamps=True)

    def comes(stamped: float) -> float:
        bus.coming.append(can.Message(arbitration_id=1, timestamp=stamped))
        assert port.receive(0.02) is not None
        return port.age
    assert port.receive(0.02) is None       # nothing is there at 50.0
    now[0] = 50.5                           # and nobody looks for half a second
    assert comes(1000.1) == pytest.approx(0.4)
    assert comes(1000.3) == pytest.approx(0.2)
    now[0] = 51.2
    assert comes(1000.9) == pytest.approx(0.3)
    assert port.receive(0.02) is None
    # the queue was empty just now: a stamp that is older is one of a clock that was set
    assert comes(1001.0) == 0.0
    now[0] = 55.0
    assert comes(1000.0) == 0.0, 'before the one before it'
    assert comes(0.0) == 0.0


def test_error_frames_change_the_state(bus: FakeBus) -> None:
    port = Port(bus, REAL, kernel_errors=True)
    bus.coming += [error_frame(0x004, '0008'), error_frame(0x004, '0020'), error_frame(0x020),
                   error_frame(0x002), error_frame(0x004, '0040')]
    states = []
    for _ in range(5):
        assert port.receive(0.0) is None
        states.append(port.controller)
    assert states == ['error-warning', 'error-passive', 'error-passive', 'error-passive', '']
    assert port.error_frames == 5
    # what asks for nothing to be done does not hide what does
    assert port.last_error is not None
    assert port.last_error.text == 'no acknowledgement'


def test_bus_off_is_a_lost_bus(bus: FakeBus) -> None:
    port = Port(bus, REAL, kernel_errors=True)
    bus.coming.append(error_frame(0x040))
    with pytest.raises(BusUnavailable, match='^bus-off; check cable, shield, termination and'):
        port.receive(0.0)
    assert (port.controller, port.bus_off_count) == ('bus-off', 1)


def test_error_frames_of_other_adapters_are_counted_only(bus: FakeBus) -> None:
    # 040h would be bus-off with SocketCAN; elsewhere it is anything
    port = Port(bus, REAL)
    bus.coming.append(error_frame(0x040))
    assert port.receive(0.0) is None
    assert (port.error_frames, port.controller, port.bus_off_count) == (1, '', 0)
    assert port.last_error is not None
    assert port.last_error.text == 'error frame'


@pytest.mark.parametrize('failure', [
    can.CanOperationError('Failed to transmit: No buffer space available', errno.ENOBUFS),
    OSError(errno.ENOBUFS, 'No buffer space available'),
    can.CanTimeoutError('no room'),
], ids=['python-can', 'socket', 'time-out'])
def test_full_queue_is_no_lost_bus(bus: FakeBus, failure: Exception) -> None:
    port = Port(bus, REAL)
    bus.failure = failure
    with pytest.raises(TransportError) as caught:
        port.send(FRAME, 0.01)
    assert not isinstance(caught.value, BusUnavailable)


def caused(error: Exception, cause: Exception) -> Exception:
    """Return an error with its cause."""
    error.__cause__ = cause
    return error


#: what python-can 4.3.1 to 4.6.1 raises about packets, and where
MALFORMED = {
    'slcan': ValueError("invalid literal for int() with base 16: 'G12'"),
    'slcan, cut off': IndexError('string index out of range'),
    'slcan, no UTF-8': caused(can.CanOperationError('Could not read from serial device'),
                              UnicodeDecodeError('utf-8', b'\xff', 0, 1, 'invalid start byte')),
    'seeedstudio, the tail comes later': TypeError('ord() expected a character'),
    'seeedstudio, serial': struct.error('unpack requires a buffer of 4 bytes'),
    'serial': can.CanOperationError('invalid delimiter byte while reading message: 0'),
    'udp_multicast': caused(can.CanOperationError('could not unpack received message'),
                            TypeError("Message.__init__() got an unexpected keyword 'x'")),
}


@pytest.mark.parametrize('where', MALFORMED)
def test_what_is_malformed_is_one_rejected_frame(bus: FakeBus, where: str) -> None:
    port = Port(bus, REAL)
    bus.coming += [MALFORMED[where], can.Message(arbitration_id=1, data=b'\x01')]
    assert port.receive(0.0) is None
    assert port.rejected_frames == 1
    assert port.receive(0.0) == Frame(1, b'\x01', True)
    assert port.rejected_frames == 1


class Early(FakeBus):
    """Says at once that nothing is there; each look takes so many s."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self.seconds, self.now = seconds, 50.0
        self.port = Port(self, HandClock(lambda: self.now))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self.now += self.seconds
        return super()._recv_internal(timeout)

    def looks(self, count: int) -> None:
        for _ in range(count):
            assert self.port.receive(0.02) is None


def test_adapter_that_does_not_wait_has_lost_its_other_end() -> None:
    """As python-can's socketcand, when its gateway has closed the connection."""
    early = Early(0.00005)
    early.looks(999)
    with pytest.raises(BusUnavailable, match='its other end has closed'):
        early.looks(1)


def test_one_that_has_hung_up_is_lost_on_a_busy_machine_too() -> None:
    """As python-can's seeedstudio, when it is unplugged: the kernel knows, however slow we are."""
    master, slave = os.openpty()
    early = Early(0.0005)
    early.port._below = Below(SimpleNamespace(fd=slave), None, b'', None)
    early.looks(999)        # it is there, and has nothing
    os.close(master)
    with pytest.raises(BusUnavailable, match='its other end has closed'):
        early.looks(100)
    os.close(slave)


@pytest.mark.parametrize('below', [
    Below(None, None, b'', None), Below(SimpleNamespace(fd=None), None, b'', None)])
def test_one_that_looks_a_thousand_times_a_second_is_there(below: Below) -> None:
    """``timeout: 0.0005`` of seeedstudio, on a bus on which nothing is said."""
    early = Early(0.0005)
    early.port._below = below
    early.looks(5000)
    early.seconds = 0.00005
    with pytest.raises(BusUnavailable, match='its other end has closed'):
        early.looks(2000)


def test_status_events_are_no_lost_bus() -> None:
    """pcan, kvaser, ixxat return early for what is no frame: some dozens in a row."""
    early = Early(0.0002)
    early.looks(5000)


def test_acknowledgements_are_no_lost_bus() -> None:
    """An adapter that says that it took what was sent, all at once, behind a stall."""
    early = Early(0.00001)
    for _ in range(1000):
        early.port.send(FRAME, 0.01)
    early.looks(1000)


def test_bytes_that_come_are_no_lost_bus() -> None:
    early = Early(0.00001)
    early.port._below = below = Below(None, None, b'', None)
    for _ in range(5000):
        below.heard += 1    # garbage, of which nothing becomes
        early.looks(1)


def test_who_is_not_to_wait_does_not_return_early() -> None:
    early = Early(0.0)
    for _ in range(5000):
        assert early.port.receive(0.0) is None


@pytest.mark.parametrize('failure', [
    can.CanOperationError('Failed to transmit: Network is down', errno.ENETDOWN),
    OSError(errno.ENXIO, 'No such device or address'), RuntimeError('anything'),
], ids=['python-can', 'socket', 'anything'])
def test_anything_else_is(bus: FakeBus, failure: Exception) -> None:
    port = Port(bus, REAL)
    bus.failure = failure
    with pytest.raises(BusUnavailable, match='^send: '):
        port.send(FRAME, 0.01)
    bus.coming.append(failure)
    with pytest.raises(BusUnavailable, match='^receive: '):
        port.receive(0.0)


class FakeSocket(RawSocket):
    """A socket below the bus that is full, or not."""

    def __init__(self) -> None:     # there is none
        self.room = True
        self.overflowed = 0
        self.waited: list[float] = []

    @property
    def overflowed_frames(self) -> int:
        return self.overflowed

    def has_room(self, timeout: float) -> bool:
        self.waited.append(timeout)
        return self.room


def test_socket_without_room_gets_nothing(bus: FakeBus) -> None:
    port = Port(bus, REAL)
    assert port.has_room is None
    port._socket = socket = FakeSocket()
    assert port.has_room
    socket.room = False
    with pytest.raises(TransportError, match='^send: transmit queue full$'):
        port.send(FRAME, 0.0125)
    assert bus.sent == []
    assert socket.waited[-1] == 0.0125
    socket.overflowed = 7
    assert port.counts.overflowed == 7


def test_only_what_waits_for_a_socket_is_punctual(bus: FakeBus) -> None:
    assert not Port(bus, REAL).punctual
    with socket.socket() as bus.socket:     # type: ignore[attr-defined]
        assert Port(bus, REAL).punctual


def test_controller_that_is_bus_off_is_not_opened(tmp_path: Path,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    carrier = tmp_path / 'carrier'
    asked: list[tuple[str, ...]] = []

    def path(*parts: str) -> Path:
        asked.append(parts)
        return carrier
    monkeypatch.setattr(port_module, 'Path', path)
    port_module._check_carrier('can7')  # no such file: nothing can be said
    carrier.write_text('1\n', encoding='ascii')
    port_module._check_carrier('can7')
    carrier.write_text('0\n', encoding='ascii')
    with pytest.raises(BusUnavailable, match='^bus-off; .*"ip link set can7 down"'):
        port_module._check_carrier('can7')
    assert set(asked) == {('/sys/class/net', 'can7', 'carrier')}


class NoLibrary(FakeBus):
    """As Kvaser's adapter where canlib is not installed: nothing of it is defined."""

    def __init__(self, channel: object, **_: object) -> None:
        canGetNumberOfChannels()    # type: ignore[name-defined]  # noqa: F821


def test_an_adapter_without_its_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('can.interface._get_class_for_interface', lambda _: NoLibrary)
    with pytest.raises(BusMisconfigured) as caught:
        open_port(BusConfiguration('main', 'kvaser', 0), REAL)
    assert str(caught.value) == 'kvaser 0: ' + complaints.driver_missing(
        interface='kvaser', why="name 'canGetNumberOfChannels' is not defined",
        helps="the kernel's driver kvaser_usb: socketcan")


# -- serial adapters ------------------------------------------------------------------------------


#: bytes that a terminal keeps ready for its reader
READ_BUFFER = 4095


class FullTerminal:
    """A pseudo-terminal whose buffers are full: nobody reads."""

    def __init__(self) -> None:
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.slave, False)
        self.path = os.ttyname(self.slave)

    def fill(self, data: bytes = b'T003FFFF0805DC000000000000\r') -> None:
        """Write until nothing more is taken."""
        while True:
            # the kernel moves what it took from one buffer to the next, in its own time
            no_further = self._waiting() >= READ_BUFFER
            try:
                os.write(self.slave, data)
            except BlockingIOError:
                if no_further:
                    return
                time.sleep(0.001)

    def _waiting(self) -> int:
        """Return how many bytes the far end could read."""
        return int.from_bytes(fcntl.ioctl(self.master, termios.FIONREAD, bytes(4)), sys.byteorder)

    def close(self) -> None:
        os.close(self.master)
        os.close(self.slave)


def slcan(path: str) -> BusConfiguration:
    """Return the configuration of an SLCAN adapter."""
    return BusConfiguration('main', 'slcan', path, bitrate=125_000)


def test_opening_an_adapter_that_takes_nothing_does_not_hang(
        monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = FullTerminal()
    seconds = itertools.count()
    # an adapter whose buffer the kernel cannot empty
    monkeypatch.setattr('serial.Serial.reset_output_buffer', lambda port: None)
    try:
        terminal.fill()
        with pytest.raises(BusUnavailable, match='the adapter takes no more data'):
            open_port(slcan(terminal.path), HandClock(lambda: float(next(seconds))))
    finally:
        terminal.close()


def test_what_an_earlier_client_left_is_thrown_away() -> None:
    terminal = FullTerminal()
    try:
        terminal.fill()
        port = open_port(slcan(terminal.path), REAL, [Route(0x103FFFF0, 0x1FFFFFFF, True)])
        os.set_blocking(terminal.master, False)
        text = b''
        deadline = time.monotonic() + 10.0
        while not text.endswith(b'O\rO\r') and time.monotonic() < deadline:
            try:
                text += os.read(terminal.master, 65536)
            except BlockingIOError:
                time.sleep(0.005)
        port.close()
        # at most what had reached the far end already; the commands are lines of their own
        assert len(text) < 8192
        lines = [line for line in text.split(b'\r') if line]
        assert lines[-4:] == [b'C', b'S4', b'O', b'O']
    finally:
        terminal.close()


class Adapter:
    """The far end of an SLCAN adapter: answers what it is told to each frame."""

    def __init__(self) -> None:
        self.terminal = FullTerminal()
        os.set_blocking(self.terminal.master, False)
        self.port = open_port(slcan(self.terminal.path), REAL)
        while b'O' not in self.lines():
            pass

    def lines(self) -> list[bytes]:
        """Return the commands that have arrived; wait for one."""
        text, deadline = b'', time.monotonic() + 10.0
        while not text.endswith(b'\r'):
            assert time.monotonic() < deadline, text
            try:
                text += os.read(self.terminal.master, 65536)
            except BlockingIOError:
                time.sleep(0.001)
        return [line for line in text.split(b'\r') if line]

    def answer(self, text: bytes) -> None:
        """Answer every command so far."""
        for _ in self.lines():
            os.write(self.terminal.master, text)

    def receive(self, refused: int = 0) -> None:
        """Have the port take what was answered: so many refusals, for instance."""
        deadline = time.monotonic() + 10.0
        for _ in range(5):
            self.port.receive(0.01)
        while self.port.counts.refused < refused and time.monotonic() < deadline:
            self.port.receive(0.01)

    def close(self) -> None:
        self.port.close()
        self.terminal.close()


@pytest.fixture(name='adapter')
def adapter_fixture() -> Iterator[Adapter]:
    adapter = Adapter()
    yield adapter
    adapter.close()


STOP = Frame(0x003FFFF0, bytes(8), True)


@pytest.mark.real
def test_frame_that_an_adapter_refuses_is_counted(adapter: Adapter) -> None:
    # of a command, before there was a frame; behind it somebody's frame, which tells that it came
    os.write(adapter.terminal.master, b'\at1230\r')
    deadline = time.monotonic() + 10.0
    while not adapter.port.receive(0.01):
        assert time.monotonic() < deadline
    assert adapter.port.counts.refused == 0
    for taken, refused in ((b'\a', 1), (b'z\r', 1), (b'\a', 2), (b'\r', 2), (b'\a', 3)):
        adapter.port.send(STOP, 0.1)
        adapter.answer(taken)
        adapter.receive(refused)
    assert adapter.port.counts.refused == 3
    with pytest.raises(BusUnavailable, match='the adapter refuses frames; no other node'):
        for _ in range(20):
            adapter.port.send(STOP, 0.1)
            adapter.answer(b'\a')
            adapter.receive()


def answered(*lines: str, seconds: float) -> tuple[int, bool]:
    """Return how many frames were refused, and whether all are, with so many s between them."""
    answers = AdapterAnswers()
    assert answers.refusal(125_000) == ''     # the opening is over
    for place, line in enumerate(lines):
        answers.sent()
        answers.take(line, seconds * place)
    return answers.refused, answers.takes_nothing(seconds * (len(lines) - 1))


def test_adapter_that_refuses_everything_is_lost() -> None:
    assert answered(*3 * ['\a'], seconds=1.0) == (3, False)
    assert answered(*4 * ['\a'], seconds=1.0) == (4, True)
    # as many, within the time of which a full queue is nothing to speak of
    assert answered(*4 * ['\a'], seconds=0.016) == (4, False)
    assert answered(*5 * ['\a'], seconds=0.016) == (5, True)


def test_adapter_that_refuses_some_is_not_lost() -> None:
    assert answered(*10 * ['\a', '\a', '\a', 'z\r'], seconds=1.0) == (30, False)


WHOLE = [(b'T103FFFF084A38012C00370000', '103FFFF0#4A38012C00370000'),
         (b't0C984037000C00000000', '0C9#4037000C00000000'),
         (b't7F1400110022', '7F1#00110022'),
         (b't7F14001100221234', '7F1#00110022'),            # with the time in ms
         (b't7F1400110022000123AB', '7F1#00110022'),        # in µs
         (b't0C90', '0C9#')]
#: without one of their bytes, and with a part of the next line
TORN = [b'T103FFFF04A38012C00370000', b't0C94037000C00000000', b't7F14A01000000000000',
        b't0C94370B0020t0C94370F1120', b't', b'T103FFFF0']


@pytest.mark.real
def test_line_that_has_lost_bytes_is_no_frame(adapter: Adapter) -> None:
    # what follows in place of the length made a shorter frame of it, with other data
    os.write(adapter.terminal.master, b'\r'.join(
        [*TORN, *(line for line, _ in WHOLE), b'']))
    found, deadline = [], time.monotonic() + 10.0
    while len(found) < len(WHOLE):
        assert time.monotonic() < deadline
        frame = adapter.port.receive(0.01)
        found += [] if frame is None else [str(frame)]
    assert found == [frame for _, frame in WHOLE]
    assert adapter.port.rejected_frames == len(TORN)


@pytest.mark.parametrize('kept', ['_buffer', '_rxbuffer'], ids=['slcan', 'robotell'])
def test_garbage_without_an_end_does_not_fill_the_memory(bus: FakeBus, kept: str) -> None:
    port, garbage = Port(bus, REAL), bytearray(4097)
    setattr(bus, kept, garbage)
    assert port.receive(0.0) is None
    assert (len(garbage), port.rejected_frames) == (0, 1)


def test_a_port_that_was_closed_writes_to_no_other(adapter: Adapter) -> None:
    # the reader closes it while a sender is about to write; the next thing opened has its number
    number = adapter.port._below.port.fd
    other, far_end = os.pipe()
    adapter.port._below.port.close()
    try:
        os.dup2(far_end, number)
        with pytest.raises(BusUnavailable):
            adapter.port.send(STOP, 0.1)
        os.set_blocking(other, False)
        with pytest.raises(BlockingIOError):
            os.read(other, 100)
    finally:
        for each in (number, other, far_end):
            os.close(each)


def test_absent_adapter(tmp_path: Path) -> None:
    with pytest.raises(BusUnavailable, match='nothing is not there: check its plug'):
        open_port(slcan(str(tmp_path / 'nothing')), REAL)


def test_what_is_no_data_frame_is_counted(bus: FakeBus) -> None:
    port = Port(bus, REAL)
    bus.coming += [can.Message(arbitration_id=0x003FFFF0, is_remote_frame=True, dlc=8),
                   can.Message(arbitration_id=0x003FFFF0, is_fd=True, data=bytes(8))]
    assert [port.receive(0.0), port.receive(0.0)] == [None, None]
    assert port.rejected_frames == 2
    assert port.error_frames == 0


def test_only_malformed_frames_in_a_row_lose_the_bus(bus: FakeBus) -> None:
    port = Port(bus, REAL)
    bad = can.Message(arbitration_id=0x800, is_extended_id=False)
    good = can.Message(arbitration_id=0x003FFFF0, data=bytes(8))
    few = [bad] * (port_module._MALFORMED_MAX - 1)
    bus.coming += [*few, good, *few, bad]
    received = [port.receive(0.0) for _ in range(2 * len(few) + 1)]
    assert [frame for frame in received if frame is not None] == [FRAME]
    assert port.rejected_frames == 2 * len(few)
    with pytest.raises(BusUnavailable, match='malformed frames in a row'):
        port.receive(0.0)


# -- what an adapter says of the commands that opened it ------------------------------------------


def told(commands: str, answers: str) -> str:
    """Return what is refused: ``+`` is CR, ``-`` BEL."""
    opening = AdapterAnswers()
    for command in commands.split():
        opening.commanded(command)
    for letter in answers:
        opening.take('\r' if letter == '+' else '\a', 50.0)
    return opening.refusal(125_000)


@pytest.mark.parametrize(('answers', 'what'), [
    ('', ''),           # CANable
    ('++++', ''),       # ESP32-SLCAN, simulated ones
    ('+++-', ''),       # USBtin, which was open
    ('-++-', ''),       # and closed
    ('---++-+++-', ''),     # behind what it had to say of something before
    ('+-+-', 'the adapter refuses bit rate 125000'),
    ('--+-', 'the adapter refuses bit rate 125000'),
    ('++--', 'the adapter does not open'),
    ('--', ''),         # of what, nobody knows
])
def test_what_an_adapter_refuses_when_it_is_opened(answers: str, what: str) -> None:
    assert told('C S4 O O', answers) == what


def test_listen_only_is_an_opening() -> None:
    assert told('C S4 L L', '++--') == 'the adapter does not open'
    assert told('C S4 L L', '+++-') == ''


class Answers(FakeBus):
    """
    An adapter that answers its opening, ``C S4 O O``, by a script.

    ``+`` and ``-`` are CR and BEL, ``f`` is a frame; in a look of ``_`` nothing comes, and in one
    of ``!`` this process does not run for a second. Behind the script nothing comes.
    """

    def __init__(self, script: str) -> None:
        super().__init__()
        self.now, self.script = 0.0, deque(script)
        answers = AdapterAnswers()
        for command in ('C', 'S4', 'O', 'O'):
            answers.commanded(command)
        self.drive_can_below = Below(None, None, b'', answers)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        step = self.script.popleft() if self.script else '_'
        if step == 'f':
            self.now += 0.001
            return can.Message(), False
        if step in '+-':
            self.drive_can_below.answers.take(      # type: ignore[union-attr]
                '\r' if step == '+' else '\a', self.now)
        else:
            self.now += 1.0 if step == '!' else timeout or 0.0
        return None, False


@pytest.mark.parametrize(('script', 'seconds', 'why'), [
    ('', 0.16, ''), ('++++', 0.02, ''), ('-++-', 0.02, ''),
    ('+++', 0.16, ''),          # CANable 2.5
    ('+' + 24 * '_' + '-+-', 0.5, 'the adapter refuses bit rate 125000'),
    ('++', 0.5, ''), ('+-++++++', 0.02, ''),
    ('+__-+-', 0.06, 'the adapter refuses bit rate 125000'),
    ('_______+-+-', 0.16, 'the adapter refuses bit rate 125000'),
    ('+!-+-', 1.02, 'the adapter refuses bit rate 125000'),
    ('+-+fffffffff-', 0.03, 'the adapter refuses bit rate 125000'),
    ('--++--', 0.02, 'the adapter does not open'),
    ('f' * 999, 0.16, ''),
], ids=lambda value: value[:15] if isinstance(value, str) else None)
def test_late_answers_are_awaited(script: str, seconds: float, why: str) -> None:
    bus = Answers(script)
    port = Port(bus, HandClock(lambda: bus.now))
    if why:
        with pytest.raises(BusUnavailable, match=f'^{why}$'):
            port.await_answers(125_000)
    else:
        port.await_answers(125_000)
    assert bus.now == pytest.approx(seconds, abs=0.025)


@pytest.mark.parametrize(('answers', 'seconds', 'left'), [
    ({}, 0.16, 0), ({0.15: 7}, 0.2, 0), ({0.01: 1, 0.05: 6}, 0.1, 0),
    ({0.01: 1, 0.07: 4}, 0.06, 4)], ids=['none', 'late', 'in parts', 'too late'])
def test_answers_to_what_was_before_are_not_those_of_the_opening(
        answers: dict[float, int], seconds: float, left: int) -> None:
    class Answering:
        """A port that is answered so many bytes at those times."""

        now, timeout = 0.0, 0.001

        def write(self, data: bytes) -> None:
            assert data == b'C\r'

        def read(self, size: int) -> bytes:
            came = min(answers, default=9.0)
            self.now = max(self.now, min(came, self.now + self.timeout))
            return b'\a' if came <= self.now else b''

        def reset_input_buffer(self) -> None:
            del answers[min(answers)]

    port = Answering()
    serial_writer._await_quiet(port, lambda: port.now)
    assert port.now == pytest.approx(seconds)
    assert sum(answers.values()) == left
    assert port.timeout == 0.001


def test_what_stands_behind_refusals_is_read_before_they_count() -> None:
    """Read late, four refusals of one moment are far apart."""
    bus = Answers('')
    port = Port(bus, HandClock(lambda: bus.now))
    port.await_answers(125_000)
    below = bus.drive_can_below
    assert below.answers is not None
    below.port = SimpleNamespace(in_waiting=3)
    for _ in range(8):
        below.answers.sent()
    bus.script.extend('-!---+-!---')
    for _ in range(11):
        port.receive(0.02)
    assert port.counts.refused == 8
    below.port.in_waiting = 0
    with pytest.raises(BusUnavailable, match='the adapter refuses frames'):
        port.receive(0.02)


class DoesNotOpen(Usbtin):
    """One whose controller does not come up."""

    def take(self, data: bytes) -> bytes:
        return super().take(data.replace(b'O', b'X'))


class Canable25Refuses(Canable25):
    """Does not answer ``C`` either: as ``L``, which is another command there."""

    def _obey(self, line: str) -> bytes:
        return self.refused if line == 'O' else super()._obey(line)


@pytest.mark.usefixtures('threads')
@pytest.mark.parametrize(('firmware', 'bitrate', 'why'), [
    (Usbtin, 125_000, ''), (Lawicel, 125_000, ''), (Canable, 125_000, ''), (Esp32, 125_000, ''),
    (Canable25, 125_000, ''), (Usbtin, 800_000, ''),
    (Usbtin, 83_300, 'the adapter refuses bit rate 83300'),
    (Esp32, 50_000, 'the adapter refuses bit rate 50000'),
    (Canable25Refuses, 125_000, 'the adapter does not open'),
    (DoesNotOpen, 125_000, 'the adapter does not open')])
def test_adapters_are_believed(monkeypatch: pytest.MonkeyPatch, firmware: type[Firmware],
                               bitrate: int, why: str) -> None:
    adapter = firmware()
    attached = Attached(adapter.take)
    if why:     # the terminal of a busy machine takes longer than any adapter
        monkeypatch.setattr(port_module, '_SILENCE', 1.0)
        monkeypatch.setattr(port_module, '_LONG_SILENCE', DEADLINE)
        monkeypatch.setattr(serial_writer, '_FIRST', DEADLINE)
    try:
        for _ in range(2):      # closed, and as it was left by a process that died
            bus = BusConfiguration('main', 'slcan', attached.path, bitrate=bitrate)
            if not why:
                port = open_port(bus, REAL)
                attached.handled()
                assert adapter.channel_open
                port._bus._is_shutdown = True   # by SIGKILL
                port._below.port.close()        # type: ignore[union-attr]
                port._lock.release()            # type: ignore[union-attr]
                continue
            with pytest.raises(BusUnavailable) as caught:
                open_port(bus, REAL)
            assert str(caught.value) == f'slcan {attached.path}: {why}'
    finally:
        attached.close()
