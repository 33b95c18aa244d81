# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The link to one bus: opened, read by a thread of its own, reopened when lost.

The reader thread is the only one that opens, reads and closes the port, so that none of it ever
happens with a lock held. Sending is done by whoever holds the exchange's lock.
"""

from collections.abc import Sequence
import threading
import time
from typing import Protocol

from drive_can_bridge.configuration.model import BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable, TransportError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.transport.port import in_words, open_port, Port

#: s that a receive may block: how soon a stop, or a loss seen by a sender, is noticed
RECEIVE_TIMEOUT = 0.02


class LinkListener(Protocol):
    """
    What a link tells its exchange. Every call comes from the link's reader thread.

    :ivar frames_rejected: counts what arrived and was nobody's; the link adds what was no frame.
    """

    frames_rejected: int

    def frame_received(self, frame: Frame, age: float) -> None:
        """Take a frame that was received ``age`` seconds ago."""

    def bus_opened(self) -> None:
        """Note that the bus is there (again)."""

    def bus_lost(self, reason: str) -> None:
        """Note that the bus is gone, or could not be opened; ``reason`` is new."""

    def bus_misconfigured(self, reason: str) -> None:
        """No attempt will ever succeed. The link has given up."""

    def link_failed(self, reason: str) -> None:
        """Note that the reader thread ended by a defect of the program."""


class Link:
    """
    Keeps one bus open.

    :param routes: acceptance filters.
    :param send_timeout: s that one send may take.
    """

    def __init__(self, bus: BusConfiguration, routes: Sequence[Route], listener: LinkListener, *,
                 send_timeout: float) -> None:
        self.bus = bus
        self._routes = routes
        self._listener = listener
        self._send_timeout = send_timeout
        self._port: Port | None = None
        self._loss: str | None = None
        self._closing = threading.Event()
        self._first_attempt = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f'bus {bus.name}', daemon=True)
        self.frames_sent = 0
        self.frames_received = 0
        self.send_failures = 0
        self.reconnections = 0
        self._closed_error_frames = 0
        self._closed_bus_off_count = 0
        self.last_error = ''
        self._closed_bus_error = ''

    # -- used by the exchange ---------------------------------------------------------------------

    def start(self) -> None:
        """Start to open the bus and to read."""
        self._thread.start()

    def wait_first_attempt(self, timeout: float) -> bool:
        """Wait until the bus was tried once; False if that takes longer than ``timeout`` s."""
        return self._first_attempt.wait(timeout)

    def stop(self) -> None:
        """Close the bus and end the thread."""
        self._closing.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=5.0)

    def send(self, frame: Frame) -> bool:
        """
        Send a frame now or not at all: nothing is ever queued here.

        :return: False when it was not sent; counted, and the reader thread looks after the bus.
        """
        port = self._port
        if port is None or self._loss is not None:
            self.send_failures += 1
            return False
        try:
            port.send(frame, self._send_timeout)
        except BusUnavailable as error:
            self.send_failures += 1
            self.last_error = in_words(error)
            if self._port is port:  # else the reader has noticed already
                self._loss = self.last_error
            return False
        except TransportError as error:
            self.send_failures += 1
            self.last_error = in_words(error)
            return False
        self.frames_sent += 1
        return True

    @property
    def is_open(self) -> bool:
        """The bus is there."""
        return self._port is not None and self._loss is None

    @property
    def last_bus_error(self) -> str:
        """The last error frame in words."""
        return (self._port.last_error if self._port else '') or self._closed_bus_error

    @property
    def error_frames(self) -> int:
        """Error frames seen since the start."""
        return self._closed_error_frames + (self._port.error_frames if self._port else 0)

    @property
    def bus_off_count(self) -> int:
        """How often the controller went bus-off, as far as the adapter reports it."""
        return self._closed_bus_off_count + (self._port.bus_off_count if self._port else 0)

    # -- the reader thread ------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._keep_open()
        except BusMisconfigured as error:
            self._listener.bus_misconfigured(in_words(error))
        except Exception as error:  # noqa: BLE001  outermost loop of a thread: nothing is silent
            self._listener.link_failed(f'{type(error).__name__}: {in_words(error)}')
        finally:
            self._close_port()
            self._first_attempt.set()

    def _keep_open(self) -> None:
        reported = ''
        opened = False
        while not self._closing.is_set():
            try:
                self._port = open_port(self.bus, self._routes)
                self._loss = None
                if opened:
                    self.reconnections += 1
                opened = True
                reported = ''
                self._listener.bus_opened()
                self._first_attempt.set()
                self._read(self._port)
            except BusUnavailable as error:
                reason = in_words(error)
                self.last_error = reason
                self._close_port()
                if reason != reported:
                    self._listener.bus_lost(reason)
                reported = reason
            finally:
                self._close_port()
                self._first_attempt.set()
            self._closing.wait(self.bus.reconnect_period)

    def _read(self, port: Port) -> None:
        receive = port.receive
        listener = self._listener.frame_received
        closing = self._closing
        malformed = 0
        while not closing.is_set():
            frame = receive(RECEIVE_TIMEOUT)
            if self._loss is not None:
                raise BusUnavailable(self._loss)
            if frame is not None:
                self.frames_received += 1
                listener(frame, port.age)
            elif port.malformed_frames != malformed:
                self._listener.frames_rejected += port.malformed_frames - malformed
                malformed = port.malformed_frames

    def _close_port(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            self._closed_bus_error = port.last_error
            self._closed_error_frames += port.error_frames
            self._closed_bus_off_count += port.bus_off_count
            port.close()


def steady_now() -> float:
    """Return the steady clock in s: the ``now`` of all sessions."""
    return time.monotonic()
