# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Every drive of a bridge configuration, played on its buses.

.. code-block:: python

    with Simulation(configuration) as simulation:
        simulation.drives['conveyor'].fault('late=0.15')
        simulation.drives['conveyor'].value('actual_speed')

The end points are python-can interfaces unless ``open_bus`` says otherwise.
"""

from collections import Counter
from collections.abc import Mapping
from copy import copy
from functools import partial
import sys
from typing import Any

from drive_can_bridge.clock import Clock, SteadyClock
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.simulation.cannord import SimulatedCannordInverter
from drive_can_bridge.simulation.canopen_pkw import SimulatedPkwDrive
from drive_can_bridge.simulation.cia402 import SimulatedServoDrive
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive
from drive_can_bridge.simulation.drive import SimulatedDrive
from drive_can_bridge.simulation.faults import Fault
from drive_can_bridge.simulation.player import BusPlayer, OpenBus, Say, ShowFrame
from drive_can_bridge.simulation.registers import Mechanics, PlantFactory
from drive_can_bridge.transport.port import open_port

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
    Make every drive of a configuration.

    :param mechanics: what motors carry, by the name of the drive.
    :param plants: what moves instead of what the family chooses, by the name of the drive.
    :raises ConfigurationError: a plant that a drive cannot do with.
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
    """Return a property: something of the drive, copied while nobody else touches it."""
    def read(self: 'PlayedDrive') -> Any:
        with self._touch():
            return copy(getattr(self.drive, name))
    return property(read)


class PlayedDrive:
    """
    A simulated drive on a running bus, for use from any thread.

    What it does and tells is what :class:`.SimulatedDrive` does and tells, now.
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

    :param clock: what everything waits by; None: that of this machine.
    :param open_bus: opens the end point of a bus; None: python-can, by the configuration.
    :param say: takes lines about the drives (faults, violations); None: they are dropped.
    :param complain: takes lines about the buses; None: standard error.
    :param show_frame: called for each frame.
    :param mechanics: what the motors of drives carry, by name.
    :param plants: what drives move instead of what they would choose, by name.
    :ivar drives: the drives by name.
    :raises ConfigurationError: a plant that a drive cannot do with.
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
        Open the buses and play.

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
