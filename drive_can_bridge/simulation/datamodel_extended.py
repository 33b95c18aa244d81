# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated drive that speaks the DataModel protocol with 29-bit identifiers.

It does what the manual says and nothing more: it answers cyclic requests by its own maps, and
reads of parameters that exist; it never answers a write, and never anything that the manual does
not define. Unused bytes of a response hold junk, since the manual calls them undetermined.
"""

from collections.abc import Mapping, Sequence

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.datamodel import extended
from drive_can_bridge.simulation.datamodel_table import DataModelTable, JUNK, map_parameters
from drive_can_bridge.simulation.drive import ALONE, SimulatedDrive, Surroundings


class SimulatedDataModelDrive(SimulatedDrive):
    """One DataModel drive with 29-bit identifiers. See the base class."""

    table: DataModelTable

    def __init__(self, configuration: DriveConfiguration,
                 surroundings: Surroundings = ALONE) -> None:
        super().__init__(configuration, surroundings)
        self.table = DataModelTable(configuration, self.registers, violation=self._violation,
                                    eeprom_time=surroundings.eeprom_time)
        self._station = configuration.station
        self._request_bits = self._station << extended.STATION_SHIFT
        self._cyclic_identifier = extended.cyclic_request_identifier(self._station)
        self._foreign_turn = 0

    @classmethod
    def routes(cls, configuration: DriveConfiguration) -> list[Route]:
        """Return all identifiers of the station."""
        return [extended.station_route(configuration.station)]

    def own_parameters(self) -> Mapping[str, Parameter]:
        """Return the entries of the maps."""
        return map_parameters(self.configuration)

    def power_lost(self, back_at: float, *, forget: bool) -> None:
        """Keep the maps, unless they are to be forgotten."""
        if forget:
            self.table.clear_maps()

    # -- telegrams --------------------------------------------------------------------------------

    def receive(self, frame: Frame, now: float) -> None:
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

    # -- faults -----------------------------------------------------------------------------------

    def foreign_frames(self, answer: Frame) -> list[Frame]:
        """Return one of: the answer of an absent station, an 11-bit twin, a write echo."""
        junk = bytes([0x5A]) * extended.PAYLOAD
        own = answer.identifier & extended.STATION_MASK
        self._foreign_turn += 1
        turn = self._foreign_turn % 3
        if turn == 1:
            others = [(self._station + step) % (extended.STATION_MAX + 1)
                      for step in range(1, extended.STATION_MAX)]
            return self._nobodys([
                Frame(answer.identifier & ~own | station << extended.STATION_SHIFT, junk, True)
                for station in others if station])
        if turn == 2:
            return self._nobodys([Frame(answer.identifier & 0x7FF, junk, False)])
        # drives do not acknowledge writes: nobody may take this for one
        return [Frame(extended.DIR | self._request_bits | extended.W | 30 << 4 | 1, junk, True)]
