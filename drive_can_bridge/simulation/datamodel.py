# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated drive that speaks one of the DataModel protocols.

It does what the manual says and nothing more: it answers cyclic requests by its own maps, and
reads of parameters that exist; it never answers a write, and never anything that the manual does
not define. Unused bytes of a response hold junk, since the manual calls them undetermined.
"""

from collections.abc import Iterable, Mapping, Sequence

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.core.parameters import Parameter, Storage
from drive_can_bridge.protocols.datamodel import extended, standard
from drive_can_bridge.simulation.datamodel_table import DataModelTable
from drive_can_bridge.simulation.drive import Ignored, SimulatedDrive

#: what unused bytes of a response hold
JUNK = bytes([0xA5]) * 8
#: what frames hold that nobody should send
FOREIGN = bytes([0x5A]) * 8

Request = extended.CyclicRequest | extended.Write | extended.ReadRequest


class ExtendedWire:
    """The frames with 29-bit identifiers, for one station."""

    def __init__(self, configuration: DriveConfiguration) -> None:
        self._station = configuration.station
        self._bits = self._station << extended.STATION_SHIFT

    def decode(self, frame: Frame) -> tuple[Request, str] | None:
        """
        Read a request; None: the frame is none to this station.

        :return: the request, and which rule it breaks although it is carried out, or ''.
        :raises RemoteProtocolError: it is one that the manual does not define.
        """
        if not frame.extended or self._bits != frame.identifier & (
                extended.STATION_MASK | extended.DIR):
            return None
        request = extended.decode(frame, strict=True)
        if len(frame.data) != extended.PAYLOAD or not isinstance(request, Request):
            raise Ignored('read request without eight data bytes')
        odd = isinstance(request, extended.ReadRequest) and any(frame.data)
        return request, 'read request with data other than 00h' if odd else ''

    def answer(self, request: Frame, words: Sequence[int]) -> Frame:
        """Make the answer to a request."""
        return _with_junk(extended.encode_answer(request.identifier, words), words)

    def foreign(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        """Return answers of absent stations, an 11-bit twin, a write echo."""
        rest, last = answer.identifier & ~extended.STATION_MASK, extended.STATION_MAX + 1
        others = ((self._station + step) % last for step in range(1, last - 1))
        return (
            (Frame(rest | other << extended.STATION_SHIFT, FOREIGN, True)
             for other in others if other),
            (Frame(answer.identifier & STANDARD_IDENTIFIER_MAX, FOREIGN, False),),
            # drives do not acknowledge writes: nobody may take this for one
            (Frame(extended.DIR | self._bits | extended.W | 30 << 4 | 1, FOREIGN, True),))


class StandardWire:
    """Those with 11 bits: reads of one to four parameters, writes of one, nothing cyclic."""

    def __init__(self, configuration: DriveConfiguration) -> None:
        options = configuration.options
        self._own = [standard.identifier(base, configuration.station)
                     for base in (options.request_id_base, options.response_id_base)]

    def decode(self, frame: Frame) -> tuple[Request, str] | None:
        if frame.extended or frame.identifier != self._own[0]:
            return None
        request = standard.decode_request(frame)
        what, unused = ('write', frame.data[5:]) if isinstance(request, extended.Write) else (
            'read request', frame.data[4:])
        return request, f'{what} with unused bytes other than 00h' if any(unused) else ''

    def answer(self, request: Frame, words: Sequence[int]) -> Frame:
        return _with_junk(standard.encode_read_response(self._own[1], words), words)

    def foreign(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        """Return a 29-bit twin, answers of absent stations, a frame of CANopen."""
        others = (answer.identifier ^ bit for bit in (8, 4, 2, 1))
        return (
            (Frame(answer.identifier, FOREIGN, True),),
            (Frame(other, FOREIGN, False) for other in others if other != self._own[0]),
            () if 0x701 in self._own else (Frame(0x701, b'\x05', False),))


def _with_junk(answer: Frame, words: Sequence[int]) -> Frame:
    used = 2 * len(words)
    return Frame(answer.identifier, answer.data[:used] + JUNK[used:], answer.extended)


class SimulatedDataModelDrive(SimulatedDrive):
    """One DataModel drive. See the base class."""

    table: DataModelTable

    def set_up(self) -> None:
        configuration = self.configuration
        self._wire: ExtendedWire | StandardWire = (
            ExtendedWire(configuration) if configuration.protocol == 'datamodel_extended'
            else StandardWire(configuration))
        self.table = DataModelTable(configuration, self.registers, violation=self._violation,
                                    eeprom_time=self.eeprom_time)

    def own_parameters(self) -> Mapping[str, Parameter]:
        """Return the entries of both maps that the profile does not list, ``p122`` and so on."""
        options, profile = self.configuration.options, self.configuration.profile
        listed = {parameter.number for parameter in profile.parameters.values()}
        numbers = [base + slot for base in (options.request_map_base, options.response_map_base)
                   for slot in range(extended.SLOTS)]
        return {f'p{number}': Parameter(f'p{number}', number=number, storage=Storage.EEPROM)
                for number in numbers if number not in listed}

    def receive(self, frame: Frame, now: float) -> bool:
        try:
            found = self._wire.decode(frame)
        except RemoteProtocolError:
            raise Ignored('frame that the manual does not define') from None
        if found is None:
            return False
        request, rule = found
        if rule:
            self._violation(rule)
        self.requests += 1
        words: Sequence[int] | None = None
        if isinstance(request, extended.CyclicRequest):
            words = self.table.exchange(request.words)
        elif isinstance(request, extended.Write):
            self.table.write(request.number, request.words, now)
        else:
            words = self.table.read(request.number, request.count, now)
        if words is not None:
            self.answer(self._wire.answer(frame, words), now)
        return True

    def power_lost(self, *, forget: bool) -> None:
        """Keep the maps, unless they are to be forgotten."""
        if forget:
            self.table.clear_maps()

    def foreign_frames(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        return self._wire.foreign(answer)
