# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Finding out which parameter numbers a DataModel drive has on the wire, by reading its maps.

The maps are eight parameters whose content can be told: Reg.122 to 125 and 126 to 129 hold the
numbers that the file configures, moved like themselves. Where they hold others, it still tells
that a drive does not answer for parameters that it has not.
"""

from abc import abstractmethod
from collections.abc import Generator
from typing import NamedTuple

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Frame, Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.protocols.datamodel import extended, standard
from drive_can_bridge.protocols.datamodel.extended import SLOTS
from drive_can_bridge.protocols.datamodel.mapping import effective
from drive_can_bridge.protocols.datamodel.options import NUMBER_MAX
from drive_can_bridge.protocols.prober import Conversation, Finding, Prober, Question

#: how far the two ways of counting are apart, of those who count from 0 and from 1
OFFSETS = (0, -1, 1)
#: even ones are parameter tasks of CANnord inverters
_CANNORD_TASKS = range(0x200, 0x400)


class _Maps(NamedTuple):
    request: tuple[int, ...]
    response: tuple[int, ...]

    def __str__(self) -> str:
        return f'{_numbers(self.request)} | {_numbers(self.response)}'


_Asking = Generator[Question, Frame | None, tuple[int, ...] | None]


class DataModelProber(Prober):
    """Asks one drive, whatever its identifiers."""

    #: the maps are those of cyclic telegrams
    maps_count = True

    @abstractmethod
    def question(self, number: int) -> Question:
        """Return the read of four parameters."""

    @abstractmethod
    def words(self, frame: Frame) -> tuple[int, ...]:
        """Return the words of its answer."""

    def converse(self) -> Conversation:
        options = self.drive.options
        seen: dict[int, _Maps] = {}
        for offset in dict.fromkeys((options.parameter_offset, *OFFSETS)):
            request = yield from self._ask(options.request_map_base + offset)
            response = yield from self._ask(options.response_map_base + offset)
            if request is not None and response is not None:
                seen[offset] = _Maps(request, response)
        offset_found, reason = self._conclude(seen)
        if not self.answered:
            reason = 'no answer: check station and bit rate'
        findings = [Finding('parameter_offset', offset_found, reason)]
        if self.maps_count:
            findings += self._map_findings(
                offset_found, None if offset_found is None else seen[offset_found])
        return findings

    def _conclude(self, seen: dict[int, _Maps]) -> tuple[int | None, str]:
        told = '; '.join(
            f'{self._first(offset)}: {maps}' for offset, maps in sorted(seen.items()))
        agreeing = [offset for offset, maps in seen.items() if self._agrees(maps, offset)]
        if len(agreeing) == 1:
            return agreeing[0], f'the maps of the file are there, {told}'
        if not agreeing and len(seen) == 1:
            return next(iter(seen)), (
                'other numbers than these are not answered, and two maps are eight parameters, '
                + told)
        if not seen:
            return None, 'the maps are not answered; check request_map_base and response_map_base'
        return None, ('the maps of the file are in more than one place, ' if agreeing else
                      'the maps of the file are nowhere, and more than eight numbers answer, '
                      ) + told

    def _agrees(self, maps: _Maps, offset: int) -> bool:
        """Tell whether both maps are those of the file, when all numbers are moved like them."""
        wanted = [tuple((each.number or 0) + offset for each in parameters[:SLOTS])
                  for parameters in (self.drive.cyclic_request, self.drive.cyclic_response)]
        return (any(wanted) and effective(maps.request) == wanted[0]
                and effective(maps.response)[:len(wanted[1])] == wanted[1])

    def _map_findings(self, offset: int | None, maps: _Maps | None) -> list[Finding]:
        keys = ('cyclic_request', 'cyclic_response')
        if offset is None or maps is None:
            return [Finding(key, None, 'parameter_offset comes first') for key in keys]
        names = {each.number: each.name for each in self.drive.profile.parameters.values()}
        found = []
        bases = self.drive.options.request_map_base, self.drive.options.response_map_base
        for key, base, entries in zip(keys, bases, maps, strict=True):
            numbers = [entry - offset for entry in effective(entries)]
            unlisted = [f'P{number}' for number in numbers if number not in names]
            place = f'{base + offset} to {base + offset + SLOTS - 1}'
            reason = f'{place} hold {_numbers(entries)}'
            if unlisted:
                found.append(Finding(key, None, f'{reason}; the profile lacks '
                                                f'{", ".join(unlisted)}'))
            else:
                found.append(Finding(key, [names[number] for number in numbers], reason))
        return found

    def _first(self, offset: int) -> str:
        options = self.drive.options
        return f'{options.request_map_base + offset} and {options.response_map_base + offset} on'

    def _ask(self, number: int) -> _Asking:
        if not 1 <= number <= NUMBER_MAX - SLOTS:
            return None
        frame = yield self.question(number)
        if frame is None:
            return None
        self.answered = True
        return self.words(frame)


class ExtendedProber(DataModelProber):
    """29-bit identifiers."""

    @property
    def requests(self) -> list[Route]:
        return [Route(self.drive.station << extended.STATION_SHIFT,
                      extended.DIR | extended.STATION_MASK, True)]

    def question(self, number: int) -> Question:
        frame = extended.encode_read_request(self.drive.station, number, SLOTS)
        return Question(frame, lambda answer: answer.extended and len(
            answer.data) == extended.PAYLOAD and (
            answer.identifier == frame.identifier | extended.DIR))

    def words(self, frame: Frame) -> tuple[int, ...]:
        return extended.unpack_words(frame.data, SLOTS)


class StandardProber(DataModelProber):
    """11-bit identifiers, where there is no cyclic telegram: the maps only tell the offset."""

    maps_count = False

    def __init__(self, drive: DriveConfiguration) -> None:
        super().__init__(drive)
        self._request = standard.identifier(drive.options.request_id_base, drive.station)
        self._response = standard.identifier(drive.options.response_id_base, drive.station)
        if not self._request & 1 and self._request in _CANNORD_TASKS:
            # bytes 0 and 1 are 03h 7Ah: task 7, a write to EEPROM, of P515
            self.hazard = (f'a read of the maps on {self._request:03X}h is a write of a parameter '
                           'in EEPROM to a CANnord inverter that has it as its identifier for '
                           'parameter tasks')

    @property
    def requests(self) -> list[Route]:
        return [Route(self._request, STANDARD_IDENTIFIER_MAX, False)]

    def question(self, number: int) -> Question:
        frame = standard.encode_read_request(self._request, number, SLOTS)
        return Question(
            frame, lambda answer: not answer.extended and answer.identifier == self._response
            and len(answer.data) == standard.PAYLOAD, self.drive.options.quarantine)

    def words(self, frame: Frame) -> tuple[int, ...]:
        return standard.decode_read_response(frame, SLOTS)


def _numbers(numbers: tuple[int, ...]) -> str:
    return ' '.join(map(str, numbers))
