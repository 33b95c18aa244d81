# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated drive that speaks the DataModel protocol with 29-bit identifiers.

It does what the manual says and nothing more: it answers cyclic requests by its own maps, and
reads of parameters that exist; it never answers a write, and never anything that the manual does
not define. Unused bytes of a response hold junk, since the manual calls them undetermined.
"""

from collections.abc import Sequence

from drive_can_bridge.configuration.model import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError, ValueRefused
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.protocols.datamodel import extended
from drive_can_bridge.simulation.datamodel_table import DataModelTable
from drive_can_bridge.simulation.drive import EEPROM_TIME, SimulatedDrive

JUNK = bytes([0xA5]) * extended.PAYLOAD


class SimulatedDataModelDrive(SimulatedDrive):
    """One DataModel drive with 29-bit identifiers. See the base class."""

    def __init__(self, configuration: DriveConfiguration, *, neighbours: Sequence[Route] = (),
                 eeprom_time: float = EEPROM_TIME) -> None:
        super().__init__(configuration, neighbours=neighbours, eeprom_time=eeprom_time)
        self.station = configuration.station
        self.table = DataModelTable(configuration, self.plant, eeprom_time=eeprom_time,
                                    violation=self._violation)
        self._request_bits = self.station << extended.STATION_SHIFT
        self._cyclic_identifier = extended.cyclic_request_identifier(self.station)
        self._foreign_turn = 0

    @classmethod
    def routes(cls, configuration: DriveConfiguration) -> list[Route]:
        """Return all identifiers of the station."""
        return [extended.station_route(configuration.station)]

    @property
    def eeprom_writes(self) -> int:
        """EEPROM cells written."""
        return self.table.eeprom_writes

    # -- telegrams --------------------------------------------------------------------------------

    def _receive(self, frame: Frame, now: float) -> None:
        if (not frame.extended
                or frame.identifier & extended.STATION_MASK != self._request_bits):
            return
        if frame.identifier & extended.DIR:
            self._violation('frame that only this drive may send')
            return
        try:
            telegram = extended.decode(frame, strict=True)
        except RemoteProtocolError:
            self._violation('frame that the manual does not define (ignored)')
            return
        if len(frame.data) != extended.PAYLOAD:
            self._violation('read request without eight data bytes (ignored)')
            return
        self.requests += 1
        self.plant.advance(now)
        if isinstance(telegram, extended.CyclicRequest):
            self.table.cyclic_write(telegram.words)
            self._answer(self._response(
                self._cyclic_identifier, self.table.cyclic_read()), now)
        elif isinstance(telegram, extended.Write):
            self.table.write(telegram.number, telegram.words, now)
        elif isinstance(telegram, extended.ReadRequest):
            if any(frame.data):
                self._violation('read request with data other than 00h')
            words = self.table.read(telegram.number, telegram.count, now)
            if words is not None:
                self._answer(self._response(frame.identifier, words), now)

    def _response(self, request_identifier: int, words: Sequence[int]) -> Frame:
        used = 2 * len(words)
        data = extended.pack_words(words)[:used] + JUNK[used:]
        return Frame(request_identifier | extended.DIR, data, True)

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

    def _foreign_frames(self, answer: Frame) -> list[Frame]:
        """Return one of: the answer of an absent station, an 11-bit twin, a write echo."""
        junk = bytes([0x5A]) * extended.PAYLOAD
        own = answer.identifier & extended.STATION_MASK
        self._foreign_turn += 1
        turn = self._foreign_turn % 3
        if turn == 1:
            for step in range(1, extended.STATION_MAX):
                station = (self.station + step) % (extended.STATION_MAX + 1)
                frame = Frame(answer.identifier & ~own | station << extended.STATION_SHIFT,
                              junk, True)
                if station and not self._belongs_to_neighbour(frame):
                    return [frame]
            return []
        if turn == 2:
            frame = Frame(answer.identifier & 0x7FF, junk, False)
            return [] if self._belongs_to_neighbour(frame) else [frame]
        # drives do not acknowledge writes: nobody may take this for one
        return [Frame(extended.DIR | self._request_bits | extended.W | 30 << 4 | 1, junk, True)]

    def _belongs_to_neighbour(self, frame: Frame) -> bool:
        return any(route.matches(frame) for route in self.neighbours)
