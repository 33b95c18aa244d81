# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What simulated DataModel drives have in common: the parameter table."""

from collections.abc import Sequence

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.simulation.datamodel_table import DataModelTable
from drive_can_bridge.simulation.drive import EEPROM_TIME, SimulatedDrive

#: what unused bytes of a response hold, since the manual calls them undetermined
JUNK = bytes([0xA5]) * 8


class DataModelDrive(SimulatedDrive):
    """A drive with a :class:`DataModelTable`. See the base class."""

    def __init__(self, configuration: DriveConfiguration, *, neighbours: Sequence[Route] = (),
                 eeprom_time: float = EEPROM_TIME) -> None:
        super().__init__(configuration, neighbours=neighbours, eeprom_time=eeprom_time)
        self.station = configuration.station
        self.table = DataModelTable(configuration, self.plant, eeprom_time=eeprom_time,
                                    violation=self._violation)
        self._foreign_turn = 0

    @property
    def eeprom_writes(self) -> int:
        """EEPROM cells written."""
        return self.table.eeprom_writes

    # -- by hand ----------------------------------------------------------------------------------

    def value(self, name: str, now: float | None = None) -> Value:
        """Return a register; map entries by their raw names, ``p122``."""
        known = self._known(name)
        if known not in self.plant.parameters:
            return self.table.map_entry(known)
        return super().value(known, now)

    def set_value(self, name: str, value: Value, now: float | None = None) -> None:
        """Set a register; map entries by their raw names, ``p122``."""
        known = self._known(name)
        if known in self.plant.parameters:
            super().set_value(known, value, now)
        elif isinstance(value, int):
            self.table.set_map_entry(known, value)
        else:
            raise ValueRefused(f'{value!r} is not a parameter number: 0 to 65535')

    def _known(self, name: str) -> str:
        if name in self.plant.parameters:
            return name
        known = self.table.name_of(name)
        return super()._known(name) if known is None else known

    def _power_on(self, *, forget: bool) -> None:
        super()._power_on(forget=forget)
        if forget:
            self.table.clear_maps()

    def _belongs_to_neighbour(self, frame: Frame) -> bool:
        return any(route.matches(frame) for route in self.neighbours)
