# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The table of simulated drives. A new protocol family adds one row."""

from collections.abc import Mapping

from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.errors import ConfigurationError
from drive_can_bridge.simulation.cannord import SimulatedCannordInverter
from drive_can_bridge.simulation.canopen_pkw import SimulatedPkwDrive
from drive_can_bridge.simulation.datamodel import SimulatedDataModelDrive
from drive_can_bridge.simulation.drive import EEPROM_TIME, SimulatedDrive, Surroundings
from drive_can_bridge.simulation.plant import Mechanics, PlantFactory

SIMULATED_DRIVES: Mapping[str, type[SimulatedDrive]] = {
    'cannord': SimulatedCannordInverter,
    'canopen_pkw': SimulatedPkwDrive,
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
    :raises ConfigurationError: a protocol that is not simulated.
    """
    problems = [
        f"drives.{drive.name}.protocol: '{drive.protocol}' is not simulated, "
        f"simulated are: {', '.join(SIMULATED_DRIVES)}"
        for drive in configuration.drives.values() if drive.protocol not in SIMULATED_DRIVES]
    if problems:
        raise ConfigurationError(problems)
    drives = {}
    for drive in configuration.drives.values():
        neighbours = tuple(
            route for other in configuration.drives.values()
            if other is not drive and other.bus == drive.bus
            for route in SIMULATED_DRIVES[other.protocol].routes(other))
        drives[drive.name] = SIMULATED_DRIVES[drive.protocol](drive, Surroundings(
            neighbours, eeprom_time, (mechanics or {}).get(drive.name, Mechanics()),
            (plants or {}).get(drive.name)))
    return drives
