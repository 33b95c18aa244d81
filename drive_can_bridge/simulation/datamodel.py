# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated drive that speaks one of the DataModel protocols.

It does what the manual defines and nothing more: it answers cyclic requests by its own maps, and
reads of parameters that exist; it never answers a write, and never anything that the manual does
not define. Unused bytes of a response hold junk, since the manual calls them undetermined.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.core.parameters import Parameter, Storage
from drive_can_bridge.protocols.datamodel import extended, standard
from drive_can_bridge.protocols.datamodel.extended import SLOTS
from drive_can_bridge.protocols.datamodel.options import effective, padded
from drive_can_bridge.simulation.drive import IgnoredFrame, SimulatedDrive
from drive_can_bridge.simulation.registers import Registers

#: s that an EEPROM write takes: the manual's 20 ms, less the time by which the arrival of a frame
#: may be noticed late
EEPROM_TIME = 0.018
#: what unused bytes of a response hold
JUNK = bytes([0xA5]) * 8
#: content of frames that no drive should send
FOREIGN = bytes([0x5A]) * 8

Request = extended.CyclicRequest | extended.WriteTelegram | extended.ReadTelegram


class DataModelTable:
    """
    Everything that can be addressed by a parameter number.

    Both protocols of the family (29-bit and 11-bit identifiers) read and write the same table.
    All numbers here are those of the wire; the offset of the configuration is in them already.

    :param violation: called with the rule that was broken.
    """

    def __init__(self, configuration: DriveConfiguration, registers: Registers, *,
                 violation: Callable[[str], None]) -> None:
        options = configuration.options
        self._offset: int = options.parameter_offset
        self._registers = registers
        self._violation = violation
        self._eeprom_busy_until = -math.inf
        self._parameters: dict[int, Parameter] = {
            p.number + self._offset: p for p in registers.parameters.values()
            if p.number is not None}
        # what is sent again and again is volatile, unless the profile has it otherwise
        self._volatile = {p.name for p in configuration.cyclic_request if p.storage is None}
        self._request_map, self._response_map = (
            [self._parameters[base + self._offset + slot].name for slot in range(SLOTS)]
            for base in (options.request_map_base, options.response_map_base))
        self._maps = {*self._request_map, *self._response_map}
        self.clear_maps()
        # with 11-bit identifiers there is no mapping, and as little to configure
        if getattr(options, 'mapping', '') != 'configure':
            for names, mapped in ((self._request_map, configuration.cyclic_request),
                                  (self._response_map, configuration.cyclic_response)):
                # nor is there a limit to how many are exchanged
                numbers = padded([(p.number or 0) + self._offset for p in mapped[:SLOTS]])
                for name, number in zip(names, numbers, strict=True):
                    registers.set_value(name, number)

    def read(self, number: int, count: int, now: float) -> list[int] | None:
        """Read parameters; None where the drive does not answer."""
        if self._busy(now):
            self._violation('read while an EEPROM write is under way (not answered)')
            return None
        words = [self._word(wanted) for wanted in range(number, number + count)]
        known = [word for word in words if word is not None]
        return known if len(known) == count else None

    def write(self, number: int, words: Sequence[int], now: float) -> None:
        """Write parameters. A frame with a number that does not exist is ignored as a whole."""
        known = [self._parameters[wanted] for wanted in range(number, number + len(words))
                 if wanted in self._parameters]
        if len(known) < len(words):
            return
        # one frame is one EEPROM write, however many words it has
        eeprom = any(map(self._takes_eeprom, known))
        lost = eeprom and self._busy(now)
        if lost:
            self._violation('EEPROM write less than 20 ms after the one before (lost)')
        for parameter, word in zip(known, words, strict=True):
            wears = self._takes_eeprom(parameter)
            if not (wears and lost):
                self._store(parameter, word, wears)
        if eeprom and not lost:
            self._eeprom_busy_until = now + EEPROM_TIME

    def exchange(self, words: Sequence[int]) -> list[int]:
        """
        Apply a cyclic request to the parameters of the request map.

        :return: the words of the response; a parameter that does not exist reads 0.
        """
        for number, word in zip(self._mapped(self._request_map), words, strict=False):
            parameter = self._parameters.get(number)
            if parameter is None:
                continue
            if parameter.name in self._maps:
                self._violation('map parameter in the request map (ignored)')
                continue
            wears = parameter.writable and parameter.storage is Storage.EEPROM
            if wears:
                self._violation(f'EEPROM parameter {parameter.name} written cyclically')
            self._store(parameter, word, wears)
        return [self._word(number) or 0 for number in self._mapped(self._response_map)]

    def clear_maps(self) -> None:
        for name in self._maps:
            self._registers.set_value(name, 0)

    def name_of(self, raw: Parameter) -> str | None:
        """Return the name of the register with a number; None: there is none."""
        parameter = self._parameters.get((raw.number or 0) + self._offset)
        return None if parameter is None else parameter.name

    def _mapped(self, names: Sequence[str]) -> tuple[int, ...]:
        """Return the wire numbers that the slots of a telegram stand for."""
        return effective([self._registers.raw(name) for name in names])

    def _word(self, number: int) -> int | None:
        """Return a parameter as unsigned word; None where there is nothing to read."""
        parameter = self._parameters.get(number)
        if parameter is None or not parameter.readable:
            return None
        return self._registers.raw(parameter.name) & 0xFFFF

    def _busy(self, now: float) -> bool:
        return now < self._eeprom_busy_until

    def _takes_eeprom(self, parameter: Parameter) -> bool:
        """Return whether a write goes to EEPROM: unless it is known not to, or has no effect."""
        return (parameter.writable and parameter.storage is not Storage.RAM
                and parameter.name not in self._volatile)

    def _store(self, parameter: Parameter, word: int, wears: bool) -> None:
        """Write within the limits; what is refused keeps its value, without an answer."""
        raw = self._registers.clamped(parameter.name, parameter.raw_from_word(word))
        if self._registers.refusal({parameter.name: raw}) is None:
            self._registers.write(parameter.name, raw, wear=int(wears))


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
            raise IgnoredFrame('read request without eight data bytes')
        odd = isinstance(request, extended.ReadTelegram) and any(frame.data)
        return request, 'read request with data other than 00h' if odd else ''

    def answer(self, request: Frame, words: Sequence[int]) -> Frame:
        """Return the answer to a request."""
        return _with_junk(extended.encode_answer(request.identifier, words), words)

    def foreign(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        """Return answers of absent stations, an 11-bit counterpart, a write echo."""
        rest, last = answer.identifier & ~extended.STATION_MASK, extended.STATION_MAX + 1
        others = ((self._station + step) % last for step in range(1, last - 1))
        return (
            (Frame(rest | other << extended.STATION_SHIFT, FOREIGN, True)
             for other in others if other),
            (Frame(answer.identifier & STANDARD_IDENTIFIER_MAX, FOREIGN, False),),
            # drives do not acknowledge writes: this must not count as one
            (Frame(extended.DIR | self._bits | extended.W | 30 << 4 | 1, FOREIGN, True),))


class StandardWire:
    """The frames with 11 bits: reads of one to four parameters, writes of one, nothing cyclic."""

    def __init__(self, configuration: DriveConfiguration) -> None:
        options = configuration.options
        self._own = [standard.identifier(base, configuration.station)
                     for base in (options.request_id_base, options.response_id_base)]

    def decode(self, frame: Frame) -> tuple[Request, str] | None:
        if frame.extended or frame.identifier != self._own[0]:
            return None
        request = standard.decode_request(frame)
        what, unused = ('write', frame.data[5:]) if isinstance(request,
                                                               extended.WriteTelegram) else (
            'read request', frame.data[4:])
        return request, f'{what} with unused bytes other than 00h' if any(unused) else ''

    def answer(self, request: Frame, words: Sequence[int]) -> Frame:
        return _with_junk(standard.encode_read_response(self._own[1], words), words)

    def foreign(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        """Return a 29-bit counterpart, answers of absent stations, a frame of CANopen."""
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
        self.table = DataModelTable(configuration, self.registers, violation=self._violation)

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
            raise IgnoredFrame('frame that the manual does not define') from None
        if found is None:
            return False
        request, rule = found
        if rule:
            self._violation(rule)
        self.requests += 1
        words: Sequence[int] | None = None
        if isinstance(request, extended.CyclicRequest):
            words = self.table.exchange(request.words)
        elif isinstance(request, extended.WriteTelegram):
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
