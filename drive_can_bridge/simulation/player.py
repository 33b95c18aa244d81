# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Plays the drives of one bus: on a link as the bridge's exchange, with a thread for their timers.

The link opens the bus, reads it and gets it back when it is lost. A drive is touched
within :meth:`BusPlayer.touch`.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
import math
import threading

from drive_can_bridge.clock import Clock
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.simulation.drive import SimulatedDrive
from drive_can_bridge.transport.end_point import EndPoint
from drive_can_bridge.transport.link import Link

#: s that an answer may wait for room in the adapter's queue
_SEND_TIMEOUT = 0.05
#: s that the first attempt to open a bus may take before the simulation goes on without it
_OPEN_TIMEOUT = 10.0
#: identifiers whose addressees are remembered
_ROUTES_MAX = 4096

OpenBus = Callable[[BusConfiguration], EndPoint]
#: takes one readable line
Say = Callable[[str], None]
#: takes bus name, frame, and True for a frame that a simulated drive sends
ShowFrame = Callable[[str, Frame, bool], None]


class BusPlayer:
    """
    The drives of one bus, and the link's listener.

    :param complain: takes lines about the bus.
    :param say: takes the drives' lines.
    :ivar failure: why a thread ended although nobody stopped it, or ''.
    :ivar frames_rejected: what arrived and was no frame.
    """

    def __init__(self, bus: BusConfiguration, drives: Sequence[SimulatedDrive],
                 clock: Clock, *, open_bus: OpenBus, say: Say, complain: Say,
                 show_frame: ShowFrame | None = None) -> None:
        self.bus = bus
        self.failure = ''
        self.frames_rejected = 0
        self._drives = tuple(drives)
        self._open_bus = open_bus
        self._say = say
        self._complain = complain
        self._show_frame = show_frame or (lambda *_: None)
        self._lock = threading.Lock()
        self._now = clock.now
        self._wake = clock.wake_event()
        self._wake_at = 0.0
        self._closing = False
        self._opened = False            # ever
        self._misconfigured = ''
        self._complained = False
        self._answer_lost = False       # ever
        self._addressees = lru_cache(_ROUTES_MAX)(self._find_addressees)
        # no filters: who looks on sees all frames
        self._link = Link(bus, (), self, clock, send_timeout=_SEND_TIMEOUT, opener=self._open)
        self._thread = clock.worker(self._run, f'simulation {bus.name}')

    def start(self) -> None:
        """
        Open the bus and begin to play. A bus that is not there yet is waited for.

        :raises BusMisconfigured: no attempt will ever succeed.
        :raises BusUnavailable: another process has the device.
        """
        self._link.start()
        self._link.wait_first_attempt(_OPEN_TIMEOUT)
        if self._misconfigured:
            raise BusMisconfigured(self._misconfigured)
        if self._link.taken:
            raise BusUnavailable(f'bus {self.bus.name}: {self._link.last_error}')
        self._thread.start()

    def stop(self) -> None:
        self._closing = True
        self._wake.ring()
        self._thread.join()
        self._link.stop()

    @contextmanager
    def touch(self) -> Iterator[float]:
        """Hold the drives, and give the time; what comes of it is sent at once afterwards."""
        with self._lock:
            yield self._now()
        self._wake.ring()

    def _run(self) -> None:
        try:
            while not self._closing:
                with self._lock:
                    now = self._now()
                    for drive in self._drives:
                        if drive.next_timer() <= now:
                            drive.handle_timer(now)
                    notices = self._pump(self._drives)
                    self._wake_at = min(
                        (drive.next_timer() for drive in self._drives), default=math.inf)
                for notice in notices:
                    self._say(notice)
                self._wake.wait(self._wake_at)
        except Exception as error:  # noqa: BLE001  the outermost loop: end with a line of text
            self.link_failed(f'{type(error).__name__}: {error}')

    def _pump(self, drives: Sequence[SimulatedDrive]) -> list[str]:
        """Send what drives want sent; return their notices."""
        notices: list[str] = []
        for drive in drives:
            for frame in drive.take_frames():
                if self._link.send(frame):
                    self._show_frame(self.bus.name, frame, True)
                    continue
                # nobody acknowledges, or the queue is full: it is lost, as on a real bus
                if not self._answer_lost and self._link.is_open:
                    self._complain(f'bus {self.bus.name}: {self._link.last_error}')
                self._answer_lost = True
            notices += drive.take_notices()
        return notices

    def _find_addressees(self, identifier: int, extended: bool) -> tuple[SimulatedDrive, ...]:
        frame = Frame(identifier, b'', extended)
        return tuple(drive for drive in self._drives
                     if any(route.matches(frame) for route in drive.routes))

    def _open(self) -> EndPoint:
        try:
            return self._open_bus(self.bus)
        except BusMisconfigured as error:
            if not self._opened:
                raise
            # it did work before: an adapter's driver may come back
            raise BusUnavailable(str(error)) from error

    def frame_received(self, frame: Frame, age: float) -> None:
        """Let the drives that a frame is for answer it."""
        self._show_frame(self.bus.name, frame, False)
        with self._lock:
            drives = self._addressees(frame.identifier, frame.extended)
            now = self._now()
            for drive in drives:
                drive.receive_frame(frame, now - age)
            notices = self._pump(drives)
            due = any(drive.next_timer() < self._wake_at for drive in drives)
        if due:
            self._wake.ring()
        for notice in notices:
            self._say(notice)

    def bus_opened(self) -> None:
        if self._complained:
            self._complain(f'bus {self.bus.name}: open')
        self._opened, self._complained = True, False

    def bus_lost(self, reason: str) -> None:
        """Tell once that the bus is gone, or could not be opened."""
        if not self._complained:
            lost = 'lost: ' if self._opened else ''
            self._complain(f'bus {self.bus.name}: {lost}{reason}; trying again every '
                           f'{self.bus.reconnect_period:g} s')
        self._complained = True

    def bus_misconfigured(self, reason: str) -> None:
        """Leave it to :meth:`start`, which tells."""
        self._misconfigured = reason

    def link_failed(self, reason: str) -> None:
        self.failure = f'bus {self.bus.name}: {reason}'
        self._complain(self.failure)
