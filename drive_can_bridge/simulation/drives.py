# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The table of simulated drives. A new protocol family adds one row."""

from collections.abc import Mapping

from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.simulation.cannord import SimulatedCannordInverter
from drive_can_bridge.simulation.canopen_pkw import SimulatedPkwDrive
from drive_can_bridge.simulation.cia402 import SimulatedServoDrive
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive
from drive_can_bridge.simulation.drive import EEPROM_TIME, SimulatedDrive
from drive_can_bridge.simulation.plant import Mechanics
from drive_can_bridge.simulation.registers import PlantFactory

SIMULATED_DRIVES: Mapping[str, type[SimulatedDrive]] = {
    'cannord': SimulatedCannordInverter,
    'canopen_pkw': SimulatedPkwDrive,
    'cia402': SimulatedServoDrive,
    'datamodel_extended': SimulatedDataModelDrive,
    'datamodel_standard': SimulatedDataModelDrive,
}


def make_drives(configuration: BridgeConfiguration, *, eeprom_time: float = EEPROM_TIME,
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
            drive, eeprom_time=eeprom_time, mechanics=(mechanics or {}).get(name),
            plant=(plants or {}).get(name))
        for name, drive in configuration.drives.items()}
    for drive in drives.values():
        drive.neighbours = [
            route for other in drives.values()
            if other is not drive and other.configuration.bus == drive.configuration.bus
            for route in other.routes]
    return drives
