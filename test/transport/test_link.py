# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The link to a bus: kept open, given up for a while, and what it does when nothing leaves."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from jumping import JumpingClock
import pytest
from waiting import pause, wait_for
from world import World

from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.bus_sentences import adapter_gone
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable, TransportError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport import kernel_interfaces
from drive_can_bridge.transport import link as link_module
from drive_can_bridge.transport.end_point import Counts, EndPoint
from drive_can_bridge.transport.error_frames import BusError
from drive_can_bridge.transport.kernel_interfaces import KernelInterface
from drive_can_bridge.transport.link import CLOSE_TIMEOUT, Link, RECEIVE_TIMEOUT
from drive_can_bridge.transport.port import open_port

FRAME = Frame(0x003FFFF0, bytes(8), True)
ANSWER = Frame(0x103FFFF0, bytes(8), True)
FULL = 'send: transmit queue full'
ALONE = ('no other node acknowledges: check that one is switched on, cable, termination and bit '
         'rate')
#: how ``ZeroDivisionError('a defect')`` is told
DEFECT = 'failed: ZeroDivisionError: a defect'
BUS = BusConfiguration('main', 'fake', 'x', reconnect_period=0.02)


class FakePort(EndPoint):
    """An open bus on which anything may happen."""

    #: None: the adapter does not tell
    has_room: Any = None
    counts: Any = Counts()

    def __init__(self) -> None:
        super().__init__()
        self.coming: deque[Frame | BaseException] = deque()
        self.sent: list[Frame] = []
        self.timeouts: list[float] = []
        self.full = False
        self.failure: Exception | None = None
        self.looks = 0
        self.closed = False
        self.waits: set[float] = set()

    def receive(self, timeout: float) -> Frame | None:
        self.waits.add(timeout)
        if not self.coming:
            pause(min(timeout, 0.001))
            return None
        found = self.coming.popleft()
        if isinstance(found, BaseException):
            raise found
        return found

    def send(self, frame: Frame, timeout: float) -> None:
        self.timeouts.append(timeout)
        if self.failure is not None:
            raise self.failure
        if self.full:
            raise TransportError(FULL)
        self.sent.append(frame)

    def close(self) -> None:
        self.closed = True


class QueuedPort(FakePort):
    """One whose transmit queue can be looked at, as SocketCAN's."""

    @property
    def has_room(self) -> bool:
        self.looks += 1
        return not self.full


class Listener:
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.frames_rejected = 0
        self.told: list[str] = []
        self.frames: list[Frame] = []

    def frame_received(self, frame: Frame, age: float) -> None:
        self.frames.append(frame)

    def bus_opened(self) -> None:
        self.told.append('opened')

    def bus_lost(self, reason: str) -> None:
        self.told.append(f'lost: {reason}')

    def bus_told(self, text: str) -> None:
        self.told.append(text)

    def bus_misconfigured(self, reason: str) -> None:
        self.told.append(f'misconfigured: {reason}')

    def link_failed(self, reason: str) -> None:
        self.told.append(f'failed: {reason}')


class Bench:
    """A link on ports of ours; ``ports`` are those that it got."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, clock: JumpingClock,
                 kind: type[FakePort] = FakePort, *, send_timeout: float = 0.01,
                 bus: BusConfiguration = BUS,
                 keep_time: Callable[[float], float] | None = None) -> None:
        self.clock = clock
        self.kind = kind
        self.ports: list[FakePort] = []
        self.refusals: deque[Exception] = deque()
        self.stations: set[int] = set()
        self.listener = Listener()
        monkeypatch.setattr(link_module, 'open_port', self._open)
        self.link = Link(bus, [], self.listener, clock, send_timeout=send_timeout, stations=3,
                         keep_time=keep_time)
        self.link.start()

    def _open(self, bus: BusConfiguration, clock: object, routes: object, *,
              stations: int) -> FakePort:
        self.stations.add(stations)
        if self.refusals:
            raise self.refusals.popleft()
        self.ports.append(self.kind())
        return self.ports[-1]

    @property
    def port(self) -> FakePort:
        return self.ports[-1]

    def opened(self, times: int = 1) -> None:
        """Wait until the bus was opened so often."""
        wait_for(lambda: self.listener.told.count('opened') == times)

    def block(self) -> None:
        """Let nothing leave any more, and send as a timer would until that is told."""
        self.port.full = True

        def send() -> bool:
            self.link.send(FRAME)
            return not self.link.is_open
        wait_for(send)
        wait_for(lambda: len(self.listener.told) > 1)


@pytest.fixture
def make(bench: World, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Bench]]:
    made: list[Bench] = []

    def start(*arguments: Any, **options: Any) -> Bench:
        made.append(Bench(monkeypatch, bench.clock, *arguments, **options))
        assert made[-1].link.wait_first_attempt(20.0)
        made[-1].opened()
        return made[-1]
    yield start
    for each in made:
        each.link.stop()
    # that of an attempt to open is not waited for
    wait_for(lambda: not bench.clock.tasks, 'the end of all threads')


def test_what_is_there_already_can_be_looked_at(make: Callable[..., Bench],
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    found, heard = list[object](), list[Frame]()

    def look(_: Listener, frame: Frame, age: float) -> None:
        bench.port.age = 0.25
        found.extend((bench.link.look(), bench.link.look(), bench.link.look()))
        heard.append(frame)
    monkeypatch.setattr(Listener, 'frame_received', look)
    bench = make()
    bench.port.coming.extend((ANSWER, FRAME, BusUnavailable('unplugged')))
    wait_for(lambda: bench.listener.told[-1] == 'lost: unplugged')
    assert heard == [ANSWER]
    assert found == [(FRAME, 0.25), None, None]
    assert bench.link.frames_received == 2


@pytest.mark.parametrize(('interface', 'set_to', 'told'), [
    ('socketcan', 250_000, [bus_sentences.interface_at_other_bitrate(125_000, 'can9', 250_000)]),
    ('socketcan', 125_000, []),
    ('socketcan', 125_313, []),     # as near as the oscillator of its controller allows
    ('socketcan', 0, []),           # vcan
    ('fake', 250_000, [])])
def test_a_bit_rate_that_the_interface_does_not_have_is_said_once(
        interface: str, set_to: int, told: list[str], make: Callable[..., Bench],
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_interfaces, 'kernel_interfaces', lambda: [
        KernelInterface('can8', 8, True, 'can', 10_000),
        KernelInterface('can9', 9, True, 'can', set_to)])
    bench = make(bus=replace(BUS, interface=interface, channel='can9', bitrate=125_000))
    bench.port.coming.append(BusUnavailable('down'))
    bench.opened(2)
    bench.link.stop()
    assert bench.listener.told == ['opened', *told, 'lost: down', 'opened']


def test_open_read_send_close(make: Callable[..., Bench]) -> None:
    bench = make()
    assert bench.stations == {3}
    bench.port.coming.append(ANSWER)
    wait_for(lambda: bench.listener.frames == [ANSWER])
    assert bench.link.send(FRAME)
    assert bench.port.timeouts == [0.01]
    assert (bench.link.frames_sent, bench.link.frames_received) == (1, 1)
    bench.link.stop()
    assert bench.port.closed
    assert not bench.link.send(FRAME)
    assert bench.listener.told == ['opened']


def test_loss_seen_by_the_reader(make: Callable[..., Bench]) -> None:
    bench = make()
    bench.refusals += [BusUnavailable('gone'), BusUnavailable('gone'), BusUnavailable('busy')]
    bench.port.coming.append(BusUnavailable('down'))
    bench.opened(2)
    # told once each, not at every attempt
    assert bench.listener.told == ['opened', 'lost: down', 'lost: gone',
                                   'lost: busy', 'opened']
    assert bench.ports[0].closed
    assert bench.link.reconnections == 1


def test_the_same_loss_is_told_again_when_the_bus_was_there_in_between(
        make: Callable[..., Bench]) -> None:
    bench = make()
    for times in (1, 2, 3):
        bench.opened(times)
        bench.port.coming.append(BusUnavailable('unplugged'))
    bench.opened(4)
    assert bench.listener.told == ['opened', 'lost: unplugged'] * 3 + ['opened']


class PunctualPort(FakePort):
    """One that returns when it is told to."""

    def __init__(self) -> None:
        super().__init__()
        self.punctual = True


@pytest.mark.parametrize(('kind', 'waits'), [
    (FakePort, {RECEIVE_TIMEOUT}), (PunctualPort, {RECEIVE_TIMEOUT, 0.004})])
def test_the_reader_keeps_time_where_the_adapter_lets_it(
        kind: type[FakePort], waits: set[float], make: Callable[..., Bench]) -> None:
    asked: list[float] = []

    def keep_time(longest: float) -> float:
        asked.append(longest)
        return 0.004
    bench = make(kind, keep_time=keep_time)
    bench.port.coming.append(ANSWER)
    wait_for(lambda: bench.listener.frames == [ANSWER])
    pause(0.05)
    assert bench.port.waits == waits    # the first look, and those after it
    assert set(asked) == ({RECEIVE_TIMEOUT} if kind is PunctualPort else set())


class DeadPort(FakePort):
    """Opens, and fails at its first read: a terminal whose other end has gone."""

    def __init__(self) -> None:
        super().__init__()
        self.coming.append(BusUnavailable('gone'))
        self.counts = Counts(bus_off=1)


def test_adapter_that_opens_and_fails_when_it_is_read(make: Callable[..., Bench]) -> None:
    bench = make()
    bench.kind = DeadPort
    bench.port.coming.append(BusUnavailable('gone'))

    def send() -> bool:
        bench.link.send(FRAME)
        return len(bench.ports) > 5
    wait_for(send)
    bench.kind = FakePort
    bench.opened(2)
    # it was never open, and the same loss is told once
    assert bench.listener.told == ['opened', 'lost: gone', 'opened']
    assert bench.link.reconnections == 1
    dead = [port for port in bench.ports if isinstance(port, DeadPort)]
    assert all(port.closed and port.timeouts == [] for port in dead)
    assert bench.link.counts.bus_off == len(dead)


def test_frame_that_is_there_before_the_bus_counts_as_open_is_older_than_what_is_asked_then(
        make: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch) -> None:
    class ReadyPort(FakePort):
        def __init__(self) -> None:
            super().__init__()
            self.age = 0.01
            self.coming.append(ANSWER)
    heard: list[tuple[Frame, float]] = []
    monkeypatch.setattr(Listener, 'bus_opened', lambda listener: (
        listener.told.append('opened'), pause(0.02))[-1])
    monkeypatch.setattr(Listener, 'frame_received', lambda listener, *frame: heard.append(frame))
    make(ReadyPort)
    wait_for(lambda: heard)
    assert heard == [(ANSWER, pytest.approx(0.03))]


def test_an_adapter_that_hangs_at_the_end_is_not_waited_for_long(
        make: Callable[..., Bench]) -> None:
    class HangingPort(FakePort):
        def close(self) -> None:
            pause(10.0)
            super().close()
    bench = make(HangingPort)
    began = bench.clock.now()
    bench.link.stop()
    assert bench.clock.now() <= began + CLOSE_TIMEOUT + 0.1 and not bench.port.closed
    wait_for(lambda: not bench.clock.tasks)


def test_loss_seen_by_a_sender(make: Callable[..., Bench]) -> None:
    bench = make()
    bench.port.failure = BusUnavailable('absent')
    assert not bench.link.send(FRAME)
    assert not bench.link.send(FRAME)  # nothing is tried any more until it is open again
    assert len(bench.ports[0].timeouts) == 1
    bench.opened(2)
    assert bench.listener.told == ['opened', 'lost: absent', 'opened']
    assert bench.link.send(FRAME)


def test_configuration_that_can_never_work(make: Callable[..., Bench]) -> None:
    bench = make()
    bench.refusals.append(BusMisconfigured('unknown'))
    bench.port.coming.append(BusUnavailable('gone'))
    wait_for(lambda: len(bench.listener.told) == 3)
    assert bench.listener.told[2] == 'misconfigured: unknown'


@pytest.mark.parametrize('end', [BusUnavailable('no route to host'), BusMisconfigured('no driver'),
                                 None], ids=['in vain', 'never', 'open'])
def test_who_has_stopped_is_not_told_what_becomes_of_an_attempt(
        make: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch,
        end: Exception | None) -> None:
    """An adapter may take longer to open than anybody waits: socketcand tries for ten seconds."""
    bench = make()
    tried = []

    def slowly(*_: object, **__: object) -> FakePort:
        tried.append(bench.clock.now())
        pause(10.0)
        if end is not None:
            raise end
        bench.ports.append(FakePort())
        return bench.port
    monkeypatch.setattr(bench.link, '_open', slowly)
    bench.port.coming.append(BusUnavailable('gone'))
    wait_for(lambda: tried)
    told = list(bench.listener.told)
    bench.link.stop()
    assert bench.clock.now() < tried[0] + 10.0
    wait_for(lambda: not bench.clock.tasks)
    assert bench.listener.told == told
    assert bench.port.closed


def test_attempt_that_a_library_does_not_give_back(
        make: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make()
    tried: list[float] = []

    def slowly() -> FakePort:
        tried.append(bench.clock.now())
        pause(60.0)
        bench.ports.append(FakePort())
        return bench.port
    monkeypatch.setattr(bench.link, '_open', slowly)
    bench.port.coming.append(BusUnavailable('gone'))
    wait_for(lambda: len(bench.listener.told) == 3)
    assert bench.listener.told[2] == f'lost: {BUS.place}: {bus_sentences.not_given_back()}'
    assert bench.clock.now() - tried[0] == pytest.approx(2.0, abs=0.05)
    assert bench.link.wait_first_attempt(0.0)
    pause(50.0)
    assert len(tried) == 1, 'no other before it has come back'
    bench.opened(2)
    assert bench.clock.now() - tried[0] == pytest.approx(60.0, abs=0.2)
    assert bench.link.send(FRAME)
    assert len(bench.listener.told) == 4


def test_what_a_library_opens_after_the_end_is_closed_without_a_frame(
        make: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make()
    tried = []
    late = FakePort()

    def slowly() -> FakePort:
        tried.append(bench.clock.now())
        pause(60.0)
        return late
    monkeypatch.setattr(bench.link, '_open', slowly)
    bench.port.coming.append(BusUnavailable('gone'))
    wait_for(lambda: tried)
    began = bench.clock.now()
    bench.link.stop()
    assert bench.clock.now() - began < 0.1, 'the end waits for none'
    told = list(bench.listener.told)
    wait_for(lambda: not bench.clock.tasks)
    assert late.closed
    assert not late.waits, 'it was not read'
    assert not late.sent
    assert bench.listener.told == told


def test_defect_is_told(make: Callable[..., Bench]) -> None:
    bench = make()
    bench.port.coming.append(ZeroDivisionError('a defect'))
    wait_for(lambda: len(bench.listener.told) == 2)
    assert bench.listener.told[1] == DEFECT


def test_the_bus_stays_open_after_a_defect_until_the_drives_were_stopped(
        make: Callable[..., Bench]) -> None:
    bench = make()
    bench.port.coming.extend([ZeroDivisionError('a defect'), KeyError('another'), ANSWER])
    wait_for(lambda: bench.listener.frames == [ANSWER])
    assert bench.listener.told[1:] == [DEFECT]
    assert not bench.port.closed
    assert bench.link.send(FRAME)
    bench.link.stop()
    assert bench.port.closed


# -- nothing leaves any more ----------------------------------------------------------------------


def test_queue_that_is_full_for_a_moment(make: Callable[..., Bench]) -> None:
    bench = make(QueuedPort, send_timeout=5.0)
    bench.port.full = True
    assert not bench.link.send(FRAME)
    assert not bench.link.send(FRAME)
    # the first waited for room; the others need not wait for the same
    assert bench.port.timeouts == [5.0, 0.0]
    bench.port.full = False
    assert bench.link.send(FRAME)
    assert bench.link.send(FRAME)
    assert bench.port.timeouts == [5.0, 0.0, 0.0, 5.0]
    # nothing of what was refused was kept for later
    assert len(bench.port.sent) == 2
    assert bench.link.send_failures == 2
    assert bench.listener.told == ['opened']


def test_blocked_bus_is_down_but_its_queue_is_watched(make: Callable[..., Bench]) -> None:
    bench = make(QueuedPort)
    begun = bench.clock.now()
    bench.block()
    assert bench.listener.told[1] == f'lost: {FULL}; {ALONE}'
    tried = len(bench.port.timeouts)
    assert not bench.link.send(FRAME)
    wait_for(lambda: bench.port.looks >= 6)
    assert bench.clock.now() - begun >= 6 * BUS.reconnect_period
    assert len(bench.port.timeouts) == tried
    # a frame of that time is nobody's: the drives count as lost
    bench.port.coming.append(ANSWER)
    wait_for(lambda: not bench.port.coming)
    bench.port.full = False
    bench.opened(2)
    assert bench.listener.frames == []
    assert len(bench.ports) == 1
    assert not bench.port.closed
    assert bench.link.reconnections == 1
    assert bench.link.send(FRAME)


def test_one_frame_per_attempt_until_somebody_is_heard(make: Callable[..., Bench]) -> None:
    bench = make(QueuedPort)
    bench.block()
    bench.port.full = False
    bench.opened(2)
    # it filled up again, and nobody was heard in between
    bench.port.full = True
    assert not bench.link.send(FRAME)
    assert not bench.link.is_open
    bench.port.full = False
    bench.opened(3)
    # now somebody is there: a full queue is given time again
    bench.port.coming.append(ANSWER)
    wait_for(lambda: bench.listener.frames == [ANSWER])
    bench.port.full = True
    assert not bench.link.send(FRAME)
    assert bench.link.is_open


def test_one_frame_after_a_loss_until_somebody_is_heard(make: Callable[..., Bench]) -> None:
    bench = make(QueuedPort)
    bench.port.coming.append(BusUnavailable('down'))
    bench.opened(2)
    bench.port.full = True
    assert not bench.link.send(FRAME)
    assert not bench.link.is_open


def test_adapter_that_does_not_tell_is_opened_anew(make: Callable[..., Bench]) -> None:
    bench = make()
    bench.block()
    bench.opened(2)
    assert bench.listener.told == ['opened', f'lost: {FULL}; {ALONE}', 'opened']
    assert bench.ports[0].closed
    assert bench.link.send(FRAME)


def test_blocked_bus_that_goes_down(make: Callable[..., Bench]) -> None:
    bench = make(QueuedPort)
    bench.block()
    bench.port.coming.append(BusUnavailable('down'))
    bench.opened(2)
    assert bench.listener.told[2] == 'lost: down'
    assert bench.ports[0].closed


def test_stop_while_blocked(make: Callable[..., Bench]) -> None:
    bench = make(QueuedPort)
    bench.block()
    bench.link.stop()
    assert bench.port.closed
    assert bench.listener.told[-1].startswith('lost')


# -- what diagnostics show ------------------------------------------------------------------------


def test_figures_outlive_a_port(make: Callable[..., Bench]) -> None:
    bench = make()
    first = bench.port
    first.counts = Counts(error_frames=5, overflowed=7, bus_off=1)
    error = first.last_error = BusError('bus-off', 'bus-off', 'check the cable')
    first.controller = 'bus-off'
    assert bench.link.controller == 'bus-off'
    bench.refusals += [BusUnavailable('bus-off')] * 3
    first.coming.append(BusUnavailable('bus-off'))
    seen: list[str] = []
    wait_for(lambda: seen.append(bench.link.controller) or len(bench.ports) == 2)
    bench.opened(2)
    assert set(seen) <= {'bus-off', ''}
    assert seen[0] == 'bus-off'
    assert bench.link.controller == ''
    assert bench.link.last_bus_error == error
    for times in (2, 3):        # of the port that is open, and of all before it
        bench.opened(times)
        second = bench.port
        second.counts = Counts(error_frames=1, overflowed=2, bus_off=3, refused=4)
        assert bench.link.counts == Counts(
            error_frames=4 + times, overflowed=5 + 2 * times, bus_off=3 * times - 2,
            refused=4 * (times - 1))
        second.coming.append(BusUnavailable('unplugged'))


def test_rejected_frames_count_as_rejected(make: Callable[..., Bench]) -> None:
    bench = make()
    bench.port.rejected_frames = 3
    wait_for(lambda: bench.listener.frames_rejected == 3)


def test_reconnections_leave_no_descriptors(bench: World, monkeypatch: pytest.MonkeyPatch,
                                            tmp_path: Path) -> None:
    # a device that cannot be opened, a hundred times over
    listener = Listener()
    bus = BusConfiguration('main', 'slcan', str(tmp_path / 'nothing'), reconnect_period=0.001)
    link = Link(bus, [], listener, bench.clock, send_timeout=0.01)
    attempts = []
    monkeypatch.setattr(link_module, 'open_port',
                        lambda *a, **o: attempts.append(1) or open_port(*a, **o))
    link.start()
    wait_for(lambda: len(attempts) > 5)
    before = len(list(Path('/proc/self/fd').iterdir()))
    wait_for(lambda: len(attempts) > 100)
    after = len(list(Path('/proc/self/fd').iterdir()))
    link.stop()
    assert after <= before + 1
    assert listener.told == [f'lost: {link.last_error}']
    assert adapter_gone(bus.channel) not in link.last_error     # it never was there


def test_an_adapter_that_is_unplugged_is_told_once(make: Callable[..., Bench],
                                                   tmp_path: Path) -> None:
    device = tmp_path / 'ttyACM0'
    device.touch()
    bench = make(bus=BusConfiguration('main', 'slcan', f'{device}@115200', reconnect_period=0.02))
    bench.refusals += [BusUnavailable(f'could not open port {device}: [Errno 2]')] * 5
    device.unlink()
    bench.ports[0].coming.append(BusUnavailable(
        'receive: device reports readiness to read but returned no data'))
    wait_for(lambda: len(bench.ports) == 2)
    wait_for(lambda: len(bench.listener.told) == 3)
    assert bench.listener.told == ['opened', f'lost: {adapter_gone(str(device))}', 'opened']
    # one that fails while it is there is another matter
    device.touch()
    bench.ports[1].coming.append(BusUnavailable('overheated'))
    wait_for(lambda: len(bench.listener.told) == 5)
    assert bench.listener.told[3] == 'lost: overheated'
