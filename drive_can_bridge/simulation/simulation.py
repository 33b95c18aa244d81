# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Every drive of a bridge configuration, simulated on its buses.

.. code-block:: python

    with Simulation(configuration) as simulation:
        simulation.drives['conveyor'].fault('late=0.15')
        simulation.drives['conveyor'].value('actual_speed')

The end points are python-can interfaces unless ``open_bus`` says otherwise. A link opens each bus,
reads it and gets it back when it is lost, as for the bridge's exchange; a thread has its drives'
timers. A drive is touched within :meth:`BusPlayer.touch`.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from functools import lru_cache, partial
import math
import sys
import threading
from typing import Any

from drive_can_bridge.clock import Clock, SteadyClock
from drive_can_bridge.core.configuration import BridgeConfiguration, BusConfiguration
from drive_can_bridge.core.errors import BusMisconfigured, BusUnavailable
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.simulation.cannord import SimulatedCannordInverter
from drive_can_bridge.simulation.canopen_pkw import SimulatedPkwDrive
from drive_can_bridge.simulation.cia402 import SimulatedServoDrive
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive
from drive_can_bridge.simulation.drive import SimulatedDrive
from drive_can_bridge.simulation.faults import Fault
from drive_can_bridge.simulation.registers import Mechanics, PlantFactory
from drive_can_bridge.transport.end_point import EndPoint
from drive_can_bridge.transport.link import Link
from drive_can_bridge.transport.port import open_port

#: s that an answer may wait for room in the adapter's queue
_SEND_TIMEOUT = 0.05
#: s that the first attempt to open a bus may take before the simulation goes on without it
_OPEN_TIMEOUT = 10.0
#: identifiers whose addressees are remembered
_ROUTES_MAX = 4096

OpenBus = Callable[[BusConfiguration], EndPoint]
#: prints one readable line
Say = Callable[[str], None]
#: called with bus name, frame, and True for a frame that a simulated drive sends
ShowFrame = Callable[[str, Frame, bool], None]


class BusPlayer:
    """
    The drives of one bus, and the link's listener.

    :param complain: prints lines about the bus.
    :param say: prints the drives' lines.
    :ivar failure: why a thread ended by itself, or ''.
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
        # no filters: the log shows all frames
        self._link = Link(bus, (), self, clock, send_timeout=_SEND_TIMEOUT, opener=self._open)
        self._thread = clock.worker(self._run, f'simulation {bus.name}')

    def start(self) -> None:
        """
        Open the bus and start the drives. A bus that is not there yet is waited for.

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
        """Hold the drives, and yield the time; resulting frames are sent at once afterwards."""
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
        """Send the drives' frames; return their notices."""
        notices: list[str] = []
        for drive in drives:
            for frame in drive.take_frames():
                if self._link.send(frame):
                    self._show_frame(self.bus.name, frame, True)
                    continue
                # not acknowledged, or the queue is full: it is lost, as on a real bus
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
        """Pass a frame to its drives, and send their answers."""
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

    def bus_told(self, text: str) -> None:
        self._complain(f'bus {self.bus.name}: {text}')

    def bus_lost(self, reason: str) -> None:
        """Report once that the bus is gone, or could not be opened."""
        if not self._complained:
            lost = 'lost: ' if self._opened else ''
            self._complain(f'bus {self.bus.name}: {lost}{reason}; trying again every '
                           f'{self.bus.reconnect_period:g} s')
        self._complained = True

    def bus_misconfigured(self, reason: str) -> None:
        """Keep the reason for :meth:`start`, which raises it."""
        self._misconfigured = reason

    def link_failed(self, reason: str) -> None:
        self.failure = f'bus {self.bus.name}: {reason}'
        self._complain(self.failure)


#: a new protocol family adds one row
SIMULATED_DRIVES: Mapping[str, type[SimulatedDrive]] = {
    'cannord': SimulatedCannordInverter,
    'canopen_pkw': SimulatedPkwDrive,
    'cia402': SimulatedServoDrive,
    'datamodel_extended': SimulatedDataModelDrive,
    'datamodel_standard': SimulatedDataModelDrive,
}


def make_drives(configuration: BridgeConfiguration, *,
                mechanics: Mapping[str, Mechanics] | None = None,
                plants: Mapping[str, PlantFactory] | None = None) -> dict[str, SimulatedDrive]:
    """
    Return every drive of a configuration.

    :param mechanics: the loads of motors, by the name of the drive.
    :param plants: plants in place of the family's choice, by the name of the drive.
    :raises ConfigurationError: a plant that does not fit a drive.
    """
    drives = {
        name: SIMULATED_DRIVES[drive.protocol](
            drive, mechanics=(mechanics or {}).get(name), plant=(plants or {}).get(name))
        for name, drive in configuration.drives.items()}
    for drive in drives.values():
        drive.neighbours = [
            route for other in drives.values()
            if other is not drive and other.configuration.bus == drive.configuration.bus
            for route in other.routes]
    return drives


def _read(name: str) -> Any:
    """Return a property: an attribute of the drive, copied under its lock."""
    def read(self: 'PlayedDrive') -> Any:
        with self._touch():
            return copy(getattr(self.drive, name))
    return property(read)


class PlayedDrive:
    """
    A simulated drive on a running bus, for use from any thread.

    Its methods are those of :class:`.SimulatedDrive`, at the present time.
    """

    requests: int = _read('requests')
    answers: int = _read('answers')
    violations: Counter[str] = _read('violations')
    wear: Counter[str] = _read('wear')
    eeprom_writes: int = _read('eeprom_writes')
    faults_text: str = _read('faults_text')

    def __init__(self, drive: SimulatedDrive, player: BusPlayer) -> None:
        self.drive = drive
        self.name = drive.name
        self._touch = player.touch

    def fault(self, fault: str | Fault) -> None:
        with self._touch() as now:
            self.drive.fault(fault, now)

    def value(self, name: str) -> Value:
        with self._touch() as now:
            return self.drive.value(name, now)

    def set_value(self, name: str, value: Value) -> None:
        with self._touch() as now:
            self.drive.set_value(name, value, now)

    def release(self, name: str) -> None:
        with self._touch():
            self.drive.release(name)


class Simulation:
    """
    All drives of a configuration, and a thread per bus.

    :param clock: the clock of all waiting; None: that of this machine.
    :param open_bus: opens the end point of a bus; None: python-can, by the configuration.
    :param say: prints lines about the drives (faults, violations); None: they are dropped.
    :param complain: prints lines about the buses; None: standard error.
    :param show_frame: called for each frame.
    :param mechanics: the loads of motors, by name.
    :param plants: plants in place of the drives' choice, by name.
    :ivar drives: the drives by name.
    :raises ConfigurationError: a plant that does not fit a drive.
    """

    def __init__(self, configuration: BridgeConfiguration, clock: Clock | None = None, *,
                 open_bus: OpenBus | None = None,
                 say: Say | None = None, complain: Say | None = None,
                 show_frame: ShowFrame | None = None,
                 mechanics: Mapping[str, Mechanics] | None = None,
                 plants: Mapping[str, PlantFactory] | None = None) -> None:
        self.configuration = configuration
        clock = clock or SteadyClock()
        drives = make_drives(configuration, mechanics=mechanics, plants=plants)
        self._players = {
            bus.name: BusPlayer(
                bus, [drive for drive in drives.values() if drive.configuration.bus == bus.name],
                clock, open_bus=open_bus or partial(open_port, clock=clock),
                say=say or (lambda line: None),
                complain=complain or partial(print, file=sys.stderr, flush=True),
                show_frame=show_frame)
            for bus in configuration.buses.values()}
        self.drives = {
            name: PlayedDrive(drive, self._players[drive.configuration.bus])
            for name, drive in drives.items()}

    def start(self) -> None:
        """
        Open the buses, and start the drives.

        :raises BusMisconfigured: no attempt to open a bus will ever succeed.
        """
        try:
            for player in self._players.values():
                player.start()
        except BaseException:
            self.stop()
            raise

    def stop(self) -> None:
        for player in self._players.values():
            player.stop()

    @property
    def failure(self) -> str:
        """Why a thread ended by itself, or ''."""
        return '; '.join(player.failure for player in self._players.values() if player.failure)

    def __enter__(self) -> 'Simulation':
        self.start()
        return self

    def __exit__(self, *_: Any) -> None:
        self.stop()
