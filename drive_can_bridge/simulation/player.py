# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""One thread that plays the drives of one bus."""

from collections.abc import Callable, Sequence
import threading
import time
from typing import Protocol

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable, TransportError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.simulation.drive import SimulatedDrive

#: s; a stop, and a fault played by another thread, are noticed that late at most
_WAIT_MAX = 0.05
_SEND_TIMEOUT = 0.05
#: identifiers whose addressees are remembered
_ROUTES_MAX = 4096


class Port(Protocol):
    """
    What an end point offers; see :class:`drive_can_bridge.transport.port.Port`.

    :ivar age: s between the reception of the last frame and the return of ``receive``.
    """

    age: float

    def receive(self, timeout: float) -> Frame | None:
        """Wait for a frame."""

    def send(self, frame: Frame, timeout: float) -> None:
        """Hand out a frame."""

    def close(self) -> None:
        """Close. Never raises."""


OpenBus = Callable[[BusConfiguration], Port]
#: takes one readable line
Say = Callable[[str], None]
#: takes bus name, frame, and True for a frame that a simulated drive sends
ShowFrame = Callable[[str, Frame, bool], None]


class BusPlayer:
    """
    Plays the drives of one bus, and tries to get the bus back when it is lost.

    :param complain: takes lines about the bus.
    :param say: takes the drives' lines.
    :ivar lock: held whenever a drive is touched.
    :ivar failure: why the thread ended although nobody stopped it, or ''.
    """

    def __init__(self, bus: BusConfiguration, drives: Sequence[SimulatedDrive], *,
                 open_bus: OpenBus, say: Say, complain: Say,
                 show_frame: ShowFrame | None = None) -> None:
        self.bus = bus
        self.lock = threading.Lock()
        self.failure = ''
        self._drives = tuple(drives)
        self._open_bus = open_bus
        self._say = say
        self._complain = complain
        self._show_frame = show_frame
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._port: Port | None = None
        self._complained = False
        self._send_failures = 0
        self._addressees: dict[tuple[int, bool], tuple[SimulatedDrive, ...]] = {}

    def start(self) -> None:
        """
        Open the bus and begin to play. A bus that is not there yet is waited for.

        :raises BusMisconfigured: no attempt will ever succeed.
        """
        self._port = self._open()
        self._thread = threading.Thread(
            target=self._run, name=f'simulation {self.bus.name}', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread and close the bus."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
        elif self._port is not None:
            self._port.close()
        self._port = None

    # -- thread -----------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                try:
                    if self._port is None:
                        self._port = self._reopen()
                    else:
                        self._step(self._port)
                except BusUnavailable as error:
                    self._lost(error)
        except Exception as error:  # noqa: BLE001  the outermost loop: end with a line of text
            self.failure = f'bus {self.bus.name}: {type(error).__name__}: {error}'
            self._complain(self.failure)
        finally:
            if self._port is not None:
                self._port.close()

    def _step(self, port: Port) -> None:
        """Wait for a frame or a timer, and send what comes of it."""
        frame = port.receive(self._patience())
        now = time.monotonic()
        if frame is not None and self._show_frame is not None:
            self._show_frame(self.bus.name, frame, False)
        frames: list[Frame] = []
        notices: list[str] = []
        with self.lock:
            if frame is not None:
                for drive in self._addressees_of(frame):
                    drive.receive_frame(frame, now - port.age)
            for drive in self._drives:
                timer = drive.next_timer()
                if timer is not None and timer <= now:
                    drive.handle_timer(now)
                if drive.has_output:
                    frames += drive.frames_to_send()
                    notices += drive.take_notices()
        for notice in notices:
            self._say(notice)
        for answer in frames:
            self._send(port, answer)

    def _patience(self) -> float:
        with self.lock:
            timers = [timer for timer in (drive.next_timer() for drive in self._drives)
                      if timer is not None]
        if not timers:
            return _WAIT_MAX
        return min(max(min(timers) - time.monotonic(), 0.0), _WAIT_MAX)

    def _send(self, port: Port, frame: Frame) -> None:
        try:
            port.send(frame, _SEND_TIMEOUT)
        except BusUnavailable:
            raise
        except TransportError as error:
            # nobody acknowledges, or the queue is full: an answer is lost, as on a real bus
            if self._send_failures == 0:
                self._complain(f'bus {self.bus.name}: {error}')
            self._send_failures += 1
            return
        if self._show_frame is not None:
            self._show_frame(self.bus.name, frame, True)

    def _addressees_of(self, frame: Frame) -> tuple[SimulatedDrive, ...]:
        key = frame.identifier, frame.extended
        found = self._addressees.get(key)
        if found is None:
            if len(self._addressees) >= _ROUTES_MAX:
                self._addressees.clear()
            found = self._addressees[key] = tuple(
                drive for drive in self._drives
                if any(route.matches(frame) for route in drive.routes(drive.configuration)))
        return found

    # -- the bus ----------------------------------------------------------------------------------

    def _open(self) -> Port | None:
        try:
            return self._open_bus(self.bus)
        except BusUnavailable as error:
            self._complain_once(f'{error}; trying again every {self.bus.reconnect_period:g} s')
            return None

    def _reopen(self) -> Port | None:
        if self._stopping.wait(self.bus.reconnect_period):
            return None
        try:
            port = self._open()
        except BusMisconfigured as error:
            # it did work before, or might: an adapter's driver may come back
            self._complain_once(f'{error}; trying again every {self.bus.reconnect_period:g} s')
            return None
        if port is not None:
            self._complain(f'bus {self.bus.name}: open')
            self._complained = False
        return port

    def _lost(self, error: BusUnavailable) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None
        self._complain_once(f'lost: {error}; trying again every {self.bus.reconnect_period:g} s')

    def _complain_once(self, text: str) -> None:
        if not self._complained:
            self._complain(f'bus {self.bus.name}: {text}')
        self._complained = True
