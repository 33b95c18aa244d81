# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated drive that speaks one of the DataModel protocols.

It does what the manual says and nothing more: it answers cyclic requests by its own maps, and
reads of parameters that exist; it never answers a write, and never anything that the manual does
not define. Unused bytes of a response hold junk, since the manual calls them undetermined.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.datamodel import extended, standard
from drive_can_bridge.simulation.datamodel_table import DataModelTable, map_parameters
from drive_can_bridge.simulation.drive import ALONE, SimulatedDrive, Surroundings

#: what unused bytes of a response hold
JUNK = bytes([0xA5]) * 8
#: what frames hold that nobody should send
FOREIGN = bytes([0x5A]) * 8

_UNDEFINED = 'frame that the manual does not define (ignored)'
_OURS = 'frame that only this drive may send'
Request = extended.CyclicRequest | extended.Write | extended.ReadRequest


class Wire(ABC):
    """The frames of one of the protocols, for one station."""

    @abstractmethod
    def routes(self) -> list[Route]:
        """Return all identifiers of the station."""

    @abstractmethod
    def decode(self, frame: Frame) -> tuple[Request | None, str]:
        """Return a request, None where there is none; and which rule the frame breaks, or ''."""

    @abstractmethod
    def answer(self, request: Frame, words: Sequence[int]) -> Frame:
        """Make the answer to a request."""

    @abstractmethod
    def foreign(self, answer: Frame, turn: int) -> list[Frame]:
        """Return frames that nobody should send; the first that is no neighbour's is sent."""


class ExtendedWire(Wire):
    """29-bit identifiers."""

    def __init__(self, configuration: DriveConfiguration) -> None:
        self._station = configuration.station
        self._bits = self._station << extended.STATION_SHIFT

    def routes(self) -> list[Route]:
        return [extended.station_route(self._station)]

    def decode(self, frame: Frame) -> tuple[Request | None, str]:
        if not frame.extended or frame.identifier & extended.STATION_MASK != self._bits:
            return None, ''
        if frame.identifier & extended.DIR:
            return None, _OURS
        try:
            request = extended.decode(frame, strict=True)
        except RemoteProtocolError:
            return None, _UNDEFINED
        if len(frame.data) != extended.PAYLOAD or not isinstance(request, Request):
            return None, 'read request without eight data bytes (ignored)'
        odd = isinstance(request, extended.ReadRequest) and any(frame.data)
        return request, 'read request with data other than 00h' if odd else ''

    def answer(self, request: Frame, words: Sequence[int]) -> Frame:
        used = 2 * len(words)
        answer = extended.encode_answer(request.identifier, words)
        return Frame(answer.identifier, answer.data[:used] + JUNK[used:], True)

    def foreign(self, answer: Frame, turn: int) -> list[Frame]:
        """Return answers of absent stations, an 11-bit twin, a write echo."""
        if turn == 1:
            rest = answer.identifier & ~extended.STATION_MASK
            stations = [(self._station + step) % (extended.STATION_MAX + 1)
                        for step in range(1, extended.STATION_MAX)]
            return [Frame(rest | station << extended.STATION_SHIFT, FOREIGN, True)
                    for station in stations if station]
        if turn == 2:
            return [Frame(answer.identifier & STANDARD_IDENTIFIER_MAX, FOREIGN, False)]
        # drives do not acknowledge writes: nobody may take this for one
        return [Frame(extended.DIR | self._bits | extended.W | 30 << 4 | 1, FOREIGN, True)]


class StandardWire(Wire):
    """11-bit identifiers: reads of one to four parameters, writes of one, nothing cyclic."""

    def __init__(self, configuration: DriveConfiguration) -> None:
        options, self._station = configuration.options, configuration.station
        self._request = standard.identifier(options.request_id_base, self._station)
        self._response = standard.identifier(options.response_id_base, self._station)

    def routes(self) -> list[Route]:
        return [Route(identifier, STANDARD_IDENTIFIER_MAX, False)
                for identifier in (self._request, self._response)]

    def decode(self, frame: Frame) -> tuple[Request | None, str]:
        if frame.extended or frame.identifier not in (self._request, self._response):
            return None, ''
        if frame.identifier == self._response:
            return None, _OURS
        try:
            request = standard.decode_request(frame)
        except RemoteProtocolError:
            return None, _UNDEFINED
        if isinstance(request, standard.Write):
            odd = 'write with unused bytes other than 00h' if any(frame.data[5:]) else ''
            return extended.Write(self._station, request.number, (request.word,)), odd
        odd = 'read request with unused bytes other than 00h' if any(frame.data[4:]) else ''
        return extended.ReadRequest(self._station, request.number, request.count), odd

    def answer(self, request: Frame, words: Sequence[int]) -> Frame:
        used = 2 * len(words)
        data = standard.encode_read_response(self._response, words).data[:used]
        return Frame(self._response, data + JUNK[used:], False)

    def foreign(self, answer: Frame, turn: int) -> list[Frame]:
        """Return a 29-bit twin, answers of absent stations, a frame of CANopen."""
        if turn == 1:
            return [Frame(answer.identifier, FOREIGN, True)]
        if turn == 2:
            others = [answer.identifier ^ bit for bit in (8, 4, 2, 1)]
            return [Frame(other, FOREIGN, False) for other in others if other != self._request]
        own = (self._request, self._response)
        return [] if 0x701 in own else [Frame(0x701, b'\x05', False)]


def wire_of(configuration: DriveConfiguration) -> Wire:
    """Return the frames of the protocol that a drive speaks."""
    is_extended = configuration.protocol == 'datamodel_extended'
    return ExtendedWire(configuration) if is_extended else StandardWire(configuration)


class SimulatedDataModelDrive(SimulatedDrive):
    """One DataModel drive. See the base class."""

    table: DataModelTable

    def __init__(self, configuration: DriveConfiguration,
                 surroundings: Surroundings = ALONE) -> None:
        super().__init__(configuration, surroundings)
        self.table = DataModelTable(configuration, self.registers, violation=self._violation,
                                    eeprom_time=surroundings.eeprom_time)
        self._wire = wire_of(configuration)
        self._foreign_turn = 0

    @classmethod
    def routes(cls, configuration: DriveConfiguration) -> list[Route]:
        """Return all identifiers of the station."""
        return wire_of(configuration).routes()

    def own_parameters(self) -> Mapping[str, Parameter]:
        """Return the entries of the maps."""
        return map_parameters(self.configuration)

    def receive(self, frame: Frame, now: float) -> None:
        """Take a frame while there is power."""
        request, rule = self._wire.decode(frame)
        if rule:
            self._violation(rule)
        if request is None:
            return
        self.requests += 1
        words: Sequence[int] | None = None
        if isinstance(request, extended.CyclicRequest):
            self.table.cyclic_write(request.words)
            words = self.table.cyclic_read()
        elif isinstance(request, extended.Write):
            self.table.write(request.number, request.words, now)
        else:
            words = self.table.read(request.number, request.count, now)
        if words is not None:
            self._answer(self._wire.answer(frame, words), now)

    def power_lost(self, back_at: float, *, forget: bool) -> None:
        """Keep the maps, unless they are to be forgotten."""
        if forget:
            self.table.clear_maps()

    def foreign_frames(self, answer: Frame) -> list[Frame]:
        """Return a frame of nobody, of another kind each time."""
        self._foreign_turn += 1
        return self._nobodys(self._wire.foreign(answer, self._foreign_turn % 3))
