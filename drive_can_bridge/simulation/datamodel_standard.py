# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated drive that speaks the DataModel protocol with 11-bit identifiers.

It answers reads of parameters that exist, and nothing else. Unused words of a response hold junk,
since the manual does not define them.
"""

from collections.abc import Mapping

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.datamodel import standard
from drive_can_bridge.simulation.datamodel_table import DataModelTable, JUNK, map_parameters
from drive_can_bridge.simulation.drive import ALONE, SimulatedDrive, Surroundings


class SimulatedDataModelStandardDrive(SimulatedDrive):
    """One DataModel drive with 11-bit identifiers. See the base class."""

    table: DataModelTable

    def __init__(self, configuration: DriveConfiguration,
                 surroundings: Surroundings = ALONE) -> None:
        super().__init__(configuration, surroundings)
        self.table = DataModelTable(configuration, self.registers, violation=self._violation,
                                    eeprom_time=surroundings.eeprom_time)
        self._request_identifier, self._response_identifier = _identifiers(configuration)
        self._foreign_turn = 0

    @classmethod
    def routes(cls, configuration: DriveConfiguration) -> list[Route]:
        """Return both identifiers of the drive."""
        return [Route(identifier, STANDARD_IDENTIFIER_MAX, False)
                for identifier in _identifiers(configuration)]

    def own_parameters(self) -> Mapping[str, Parameter]:
        """Return the entries of the maps, which have no effect here."""
        return map_parameters(self.configuration)

    def power_lost(self, back_at: float, *, forget: bool) -> None:
        """Keep the maps, unless they are to be forgotten."""
        if forget:
            self.table.clear_maps()

    # -- telegrams --------------------------------------------------------------------------------

    def receive(self, frame: Frame, now: float) -> None:
        if frame.extended:
            return
        if frame.identifier == self._response_identifier:
            self._violation('frame that only this drive may send')
            return
        if frame.identifier != self._request_identifier:
            return
        try:
            request = standard.decode_request(frame)
        except RemoteProtocolError:
            self._violation('frame that the manual does not define (ignored)')
            return
        self.requests += 1
        if isinstance(request, standard.Write):
            if any(frame.data[5:]):
                self._violation('write with unused bytes other than 00h')
            self.table.write(request.number, (request.word,), now)
            return
        if any(frame.data[4:]):
            self._violation('read request with unused bytes other than 00h')
        words = self.table.read(request.number, request.count, now)
        if words is not None:
            used = standard.encode_read_response(
                self._response_identifier, words).data[:2 * len(words)]
            self._answer(Frame(self._response_identifier, used + JUNK[len(used):], False), now)

    # -- faults -----------------------------------------------------------------------------------

    def foreign_frames(self, answer: Frame) -> list[Frame]:
        """Return one of: a 29-bit twin, the answer of an absent station, a frame of CANopen."""
        junk = bytes([0x5A]) * standard.PAYLOAD
        self._foreign_turn += 1
        turn = self._foreign_turn % 3
        if turn == 1:
            made = [Frame(answer.identifier, junk, True)]
        elif turn == 2:
            made = [Frame(answer.identifier ^ bit, junk, False) for bit in (8, 4, 2, 1)]
        else:
            made = [Frame(0x701, b'\x05', False)]
        own = (self._request_identifier, self._response_identifier)
        return self._nobodys([frame for frame in made
                              if frame.extended or frame.identifier not in own])


def _identifiers(configuration: DriveConfiguration) -> tuple[int, int]:
    options, station = configuration.family_options, configuration.station
    return (standard.identifier(options['request_id_base'], station),
            standard.identifier(options['response_id_base'], station))
