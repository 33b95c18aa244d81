# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The link to one bus: opened, read by a thread of its own, reopened when lost.

The reader thread is the only one that reads and closes the port, so that none of it ever happens
with a lock held. The thread that holds the exchange's lock sends. Each attempt to open it has a
thread of its own, because a library may not return: that is reported, no other is made before,
the end does not wait for it, and what it opens after that is closed.

A bus that sends nothing any more (no other node acknowledges, the transmit queue is full) is
*blocked*: it is reported as down, and nothing more is put into the queue. Where the
queue can be looked at, the port stays open, so that what waits in it goes on counting, and the bus
is back when there is room again; other adapters are closed and opened again, which empties them.
Both happen every ``reconnect_period``. While no other node has shown up again, the
first frame without room blocks the bus at once.

An adapter whose other end is gone may well open once more, and fail when it is read. So a bus
counts as open only after its first read.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from drive_can_bridge.clock import Clock
from drive_can_bridge.compiled import mypyc_attr
from drive_can_bridge.core import bus_sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable, TransportError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.messages import around
from drive_can_bridge.transport.bus_identity import device_of, is_absent
from drive_can_bridge.transport.end_point import Counts, EndPoint
from drive_can_bridge.transport.error_frames import ADVICE_ALONE, BUS_OFF, BusError
from drive_can_bridge.transport.failures import in_words
from drive_can_bridge.transport.port import open_port as open_by_python_can
from drive_can_bridge.transport.whereabouts import Whereabouts

#: opens a bus; asked for by this name each time, so that another one can stand here
open_port: Callable[..., EndPoint] = open_by_python_can
#: s that a receive may block: how soon a stop, or a loss seen by a sender, is noticed
RECEIVE_TIMEOUT = 0.02
#: send time-outs, and s, in which nothing leaves, until the bus counts as blocked
BLOCKED_TIMEOUTS = 4
BLOCKED_AFTER = 0.05
#: looks, and s between them, at the name of a device that has failed
_GOING, _MOMENT = 10, 0.01
#: s after which an attempt to open that has not returned is reported
OPEN_TIMEOUT = 2.0
#: s that an adapter may take to close, when all has been sent
CLOSE_TIMEOUT = 2.0


class LinkListener(Protocol):
    """
    The callbacks of a link, until it is stopped. From the link's reader thread.

    :ivar frames_rejected: counts what arrived without an owner; the link adds what was no frame.
    """

    frames_rejected: int

    def frame_received(self, frame: Frame, age: float) -> None:
        """Handle a frame that was received ``age`` seconds ago."""

    def bus_opened(self) -> None:
        """Handle a bus that is there (again)."""

    def bus_lost(self, reason: str) -> None:
        """Handle a bus that is gone, or could not be opened; ``reason`` is new."""

    def bus_told(self, text: str) -> None:
        """Log what people should know of the adapter."""

    def bus_misconfigured(self, reason: str) -> None:
        """Handle a bus that no attempt will ever open. The link has given up."""

    def link_failed(self, reason: str) -> None:
        """Handle the end of the reader thread by an internal error."""


class _Attempt:
    """
    An attempt to open a bus, in a thread of its own.

    :ivar ended: rung at its end.
    :ivar over: it has come to an end.
    """

    def __init__(self, open_: Callable[[], EndPoint], clock: Clock, name: str) -> None:
        self.ended = clock.wake_event()
        self.over = False
        self._open = open_
        self._lock = clock.lock()
        self._port: EndPoint | None = None
        self._error: Exception | None = None
        self._given_up = False
        clock.worker(self._run, name).start()

    def _run(self) -> None:
        try:
            port = self._open()
        except Exception as error:  # noqa: BLE001  outermost call of a thread: raised by take()
            self._error = error
        else:
            with self._lock:
                given_up, self._port = self._given_up, port
            if given_up:
                port.close()
        self.over = True
        self.ended.ring()

    def take(self, *, give_up: bool) -> EndPoint | None:
        """Return the opened port, or raise why there is none; None: the attempt goes on."""
        with self._lock:
            self._given_up = give_up
            port = self._port
        if port is None and self._error is not None and self.over:
            raise self._error
        return port


@mypyc_attr(allow_interpreted_subclasses=True)
class Link:
    """
    Keeps one bus open.

    :param routes: acceptance filters.
    :param send_timeout: s that one send may take.
    :param stations: how many drives are on the bus, for each of which a frame may wait.
    :param prepare_thread: called first in the reader thread.
    :param opener: opens the bus; None: python-can, by the configuration.
    :param keep_time: called in the reader thread before it waits for a frame where the port is
        punctual: (longest wait in s) -> how many s it may wait; None: nothing is due there.
    :ivar error_witness: sees error frames, in the reader thread; to be set before ``start``.
    :ivar taken: another process has the bus.
    """

    def __init__(self, bus: BusConfiguration, routes: Sequence[Route], listener: LinkListener,
                 clock: Clock, *, send_timeout: float, stations: int = 0,
                 prepare_thread: Callable[[], object] = lambda: None,
                 opener: Callable[[], EndPoint] | None = None,
                 keep_time: Callable[[float], float] | None = None) -> None:
        self.bus = bus
        self._keep_time = keep_time
        self._open = opener or (lambda: open_port(bus, clock, routes, stations=stations))
        self._whereabouts = Whereabouts(bus)
        self._clock = clock
        self._now = clock.now
        self.error_witness: Callable[[int, bytes], None] | None = None
        self.taken = False
        self._listener = listener
        self._send_timeout = send_timeout
        self._prepare_thread = prepare_thread
        self._port: EndPoint | None = None
        self._attempt: _Attempt | None = None
        self._loss: str | None = None
        self._blocked: str | None = None
        self._no_room_since: float | None = None
        self._heard = False
        self._closing = self._tried = False
        self._reported = ''
        self._told: set[str] = set()
        self._end, self._first_attempt = clock.wake_event(), clock.wake_event()
        self._reader_thread = clock.worker(self._run, f'bus {bus.name}')
        self.frames_sent = 0
        self.frames_received = 0
        self.send_failures = 0
        self.reconnections = 0
        self._closed_counts = Counts()
        self._closed_controller = ''
        self._closed_bus_error: BusError | None = None
        self.last_error = ''

    # -- used by the exchange ---------------------------------------------------------------------

    def start(self) -> None:
        """Start to open the bus and to read."""
        self._reader_thread.start()

    def wait_first_attempt(self, timeout: float) -> bool:
        """Wait until the bus was tried once; return False after ``timeout`` s."""
        if not self._tried:
            self._first_attempt.wait(self._now() + timeout)
        return self._tried

    def stop(self) -> None:
        """Close the bus and end the thread."""
        self._closing = True
        self._end.ring()
        attempt = self._attempt
        if attempt is not None:
            attempt.ended.ring()
        self._reader_thread.join(CLOSE_TIMEOUT)

    def send(self, frame: Frame) -> bool:
        """
        Send a frame now or not at all: nothing is ever queued here.

        :return: False when it was not sent; counted, and the reader thread looks after the bus.
        """
        port = self._port
        if port is None or self._loss is not None or self._blocked is not None:
            self.send_failures += 1
            return False
        try:
            # one frame waits for room; the others of the bus need not wait for the same
            port.send(frame, self._send_timeout if self._no_room_since is None else 0.0)
        except BusUnavailable as error:
            self.send_failures += 1
            self.last_error = in_words(error)
            if self._port is port:  # else the reader has noticed already
                self._loss = self.last_error
            return False
        except TransportError as error:
            self.send_failures += 1
            self.last_error = in_words(error)
            self._no_room()
            return False
        self._no_room_since = None
        self.frames_sent += 1
        return True

    def look(self) -> tuple[Frame, float] | None:
        """
        Return a frame that is there already, and its age in s; None: there is none.

        In the reader thread, while it delivers the frame before.
        """
        port = self._port
        if port is None or self._loss is not None or self._blocked is not None:
            return None
        try:
            frame = port.receive(0.0)
        except BusUnavailable as error:
            self._loss = self.last_error = in_words(error)  # the reader sees to it
            return None
        if frame is None:
            return None
        self.frames_received += 1
        return frame, port.age

    def _no_room(self) -> None:
        now = self._now()
        if self._no_room_since is None:
            self._no_room_since = now
        limit = max(BLOCKED_TIMEOUTS * self._send_timeout, BLOCKED_AFTER)
        if not self._heard or now - self._no_room_since >= limit:
            self._blocked = around(self.last_error, behind=f'; {ADVICE_ALONE}')

    @property
    def is_open(self) -> bool:
        """Whether the bus is there."""
        return self._port is not None and self._loss is None and self._blocked is None

    @property
    def last_bus_error(self) -> BusError | None:
        """The last error frame that needs action."""
        port = self._port
        return (port.last_error if port is not None else None) or self._closed_bus_error

    @property
    def controller(self) -> str:
        """``error-warning``, ``error-passive`` or ``bus-off``; '' otherwise, or not known."""
        port = self._port
        return port.controller if port is not None else self._closed_controller

    @property
    def counts(self) -> Counts:
        """The counts since the start."""
        port = self._port
        return self._closed_counts if port is None else self._closed_counts.plus(port.counts)

    # -- the reader thread ------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._prepare_thread()
            self._keep_open()
        except BusMisconfigured as error:
            if not self._ended():
                self._listener.bus_misconfigured(in_words(error))
        except Exception as error:  # noqa: BLE001  outermost loop of a thread: nothing is silent
            self._tell_tried()
            self._listener.link_failed(f'{type(error).__name__}: {in_words(error)}')
            self._read_on()
        finally:
            self._close_port()
            self._tell_tried()

    def _tell_tried(self) -> None:
        self._tried = True
        self._first_attempt.ring()

    def _read_on(self) -> None:
        """Read on after an internal error, until the drives were stopped: answers show that."""
        while not self._closing:
            try:
                port = self._port
                frame = None if port is None else port.receive(RECEIVE_TIMEOUT)
                if frame is not None and port is not None:
                    self._listener.frame_received(frame, port.age)
            except Exception:   # noqa: BLE001  more of what was reported, or the bus is gone
                frame = None
            if frame is None:
                self._end.wait(self._now() + RECEIVE_TIMEOUT)

    def _keep_open(self) -> None:
        opened = False
        while not self._closing:
            try:
                self._loss = bus_sentences.not_read_yet()   # it is not known to work
                port = self._open_in_time()
                if port is None or self._ended():
                    return
                self.taken = False
                remark = self._whereabouts.opened()
                port.error_witness = self.error_witness
                port.tell = self._tell_once
                frame = port.receive(RECEIVE_TIMEOUT)
                received_at = self._now() - port.age
                self._loss = self._blocked = self._no_room_since = None
                # after a loss other nodes count as absent until one was heard
                self._heard = not opened
                if opened:
                    self.reconnections += 1
                opened = True
                self._reported = ''
                self._listener.bus_opened()
                if remark:
                    self._tell_once(remark)
                self._tell_tried()
                # it came before anything was asked: it must not pass for the answer
                port.age = self._now() - received_at
                self._read(port, frame)
            except BusUnavailable as error:
                if self._ended():
                    return
                self.taken = error.taken
                reason = self._whereabouts.reason(error, absent=opened and self._gone())
                self.last_error = reason
                self._close_port()
                self._report(reason)
            self._end.wait(self._now() + self.bus.reconnect_period)

    def _report(self, reason: str) -> None:
        """Report why the bus is not there, once for each reason."""
        if reason != self._reported:
            self._listener.bus_lost(reason)
        self._reported = reason
        self._tell_tried()

    def _tell_once(self, text: str) -> None:
        """Report what is the same after each opening, once."""
        if text not in self._told:
            self._told.add(text)
            self._listener.bus_told(text)

    def _open_in_time(self) -> EndPoint | None:
        """
        Open the port; None: it was stopped before that came to an end.

        :raises BusUnavailable: it cannot be opened now.
        :raises BusMisconfigured: it never can.
        """
        self._attempt = attempt = _Attempt(self._open, self._clock, f'open {self.bus.name}')
        if not self._closing:   # asked behind the assignment: stop() rings what is there then
            attempt.ended.wait(self._now() + OPEN_TIMEOUT)
        while not attempt.over and not self._closing:
            self._report(around(bus_sentences.not_given_back(), f'{self.bus.place}: '))
            attempt.ended.wait()
        self._port = port = attempt.take(give_up=self._closing)
        return port

    def _ended(self) -> bool:
        """Return whether another thread has stopped the link meanwhile."""
        return self._closing

    def _gone(self) -> bool:
        """Return whether the adapter was unplugged; its name disappears a moment later."""
        if device_of(self.bus) is not None:
            for _ in range(_GOING):
                if is_absent(self.bus) or self._closing:
                    break
                self._clock.wait(self._now() + _MOMENT)
        return is_absent(self.bus)

    def _read(self, port: EndPoint, frame: Frame | None) -> None:
        receive = port.receive
        listener = self._listener.frame_received
        keep_time = self._keep_time if port.punctual else None
        rejected = 0
        while not self._closing:
            if self._loss is not None:
                raise BusUnavailable(self._loss)
            if self._blocked is not None:
                self._sit_out(port, self._blocked)
            elif frame is not None:
                self._heard = True
                self.frames_received += 1
                listener(frame, port.age)
            elif port.rejected_frames != rejected:
                self._listener.frames_rejected += port.rejected_frames - rejected
                rejected = port.rejected_frames
            frame = receive(RECEIVE_TIMEOUT if keep_time is None else keep_time(RECEIVE_TIMEOUT))

    def _sit_out(self, port: EndPoint, reason: str) -> None:
        """
        Block until the bus accepts a frame; discard those received: all drives are lost.

        :raises BusUnavailable: the bus is lost, or has to be opened again to find out.
        """
        if port.has_room is None:
            raise BusUnavailable(reason)
        self._listener.bus_lost(reason)
        look_at = self._now() + self.bus.reconnect_period
        while not self._closing:
            port.receive(RECEIVE_TIMEOUT)
            now = self._now()
            if now >= look_at:
                if port.has_room:
                    break
                look_at = now + self.bus.reconnect_period
        else:
            return
        self._heard = False
        self._blocked = self._no_room_since = None
        self.reconnections += 1
        self._listener.bus_opened()

    def _close_port(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            self._closed_bus_error = port.last_error
            self._closed_counts = self._closed_counts.plus(port.counts)
            # a controller that is being tried again has no other known state
            self._closed_controller = BUS_OFF if port.controller == BUS_OFF else ''
            port.close()
