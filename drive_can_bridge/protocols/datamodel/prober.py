# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How one DataModel drive counts parameters.

The numbers on the wire are settled by reading the maps: eight parameters whose content can be
told. Reg.122 to 125 and 126 to 129 hold the numbers that the file configures, moved like
themselves. That a drive does not answer for other numbers shows nothing: an answer may be lost.
"""

from collections.abc import Callable
from typing import NamedTuple

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.protocols.datamodel import extended, standard
from drive_can_bridge.protocols.datamodel.extended import SLOTS
from drive_can_bridge.protocols.datamodel.options import effective, NUMBER_MAX, PROBED
from drive_can_bridge.protocols.datamodel.scanner import numbers_text
from drive_can_bridge.protocols.scanner import Asking, Conversation, Finding, Prober, Question

#: how far the two ways of counting are apart, of those who count from 0 and from 1
OFFSETS = (0, -1, 1)
#: even ones are parameter tasks of CANnord inverters
_CANNORD_TASKS = range(0x200, 0x400)
_Asking = Asking[tuple[int, ...] | None]


class _Maps(NamedTuple):
    request: tuple[int, ...]
    response: tuple[int, ...]

    def __str__(self) -> str:
        return f'{numbers_text(self.request)} | {numbers_text(self.response)}'


class DataModelProber(Prober):
    """
    Asks one drive, whatever its identifiers.

    :param question: the read of four parameters, from the number on.
    :param words: what the data of its answer hold.
    :param maps_count: the maps are those of cyclic telegrams.
    """

    def __init__(self, drive: DriveConfiguration, requests: list[Route],
                 question: Callable[[int], Question],
                 words: Callable[[bytes], tuple[int, ...]], *, hazard: str = '',
                 maps_count: bool = True) -> None:
        super().__init__(drive, requests, hazard)
        self._question = question
        self._words = words
        self._maps_count = maps_count

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
            reason = frame_sentences.scan_silent()
        findings = [Finding(PROBED[0], offset_found, reason)]
        if self._maps_count:
            if offset_found is None and list(seen) == [options.parameter_offset]:
                offset_found = options.parameter_offset     # nothing says anything else
            findings += self._map_findings(
                offset_found, None if offset_found is None else seen[offset_found])
        return findings

    def _conclude(self, seen: dict[int, _Maps]) -> tuple[int | None, Sentence]:
        told = '; '.join(
            f'{self._first(offset)}: {maps}' for offset, maps in sorted(seen.items()))
        agreeing = [offset for offset, maps in seen.items() if self._agrees(maps, offset)]
        if len(agreeing) == 1:
            return agreeing[0], frame_sentences.maps_are_there(told)
        if not agreeing and len(seen) == 1:
            return None, frame_sentences.maps_nowhere(told)
        if not seen:
            return None, frame_sentences.maps_unanswered()
        return None, (frame_sentences.maps_in_several(told) if agreeing else
                      frame_sentences.maps_ambiguous(told))

    def _agrees(self, maps: _Maps, offset: int) -> bool:
        """Return whether both maps are those of the file, when all numbers are moved like them."""
        wanted = [tuple((each.number or 0) + offset for each in parameters[:SLOTS])
                  for parameters in (self.drive.cyclic_request, self.drive.cyclic_response)]
        return (any(wanted) and effective(maps.request) == wanted[0]
                and effective(maps.response)[:len(wanted[1])] == wanted[1])

    def _map_findings(self, offset: int | None, maps: _Maps | None) -> list[Finding]:
        keys = PROBED[1:]
        if offset is None or maps is None:
            return [Finding(key, None, frame_sentences.offset_first()) for key in keys]
        names = {each.number: each.name for each in self.drive.profile.parameters.values()}
        found = []
        bases = self.drive.options.request_map_base, self.drive.options.response_map_base
        for key, base, entries in zip(keys, bases, maps, strict=True):
            numbers = [entry - offset for entry in effective(entries)]
            unlisted = [f'P{number}' for number in numbers if number not in names]
            place = f'{base + offset} to {base + offset + SLOTS - 1}'
            reason = frame_sentences.numbers_hold(place, numbers_text(entries))
            if unlisted:
                found.append(Finding(
                    key, None, frame_sentences.profile_lacks(reason, unlisted)))
            else:
                found.append(Finding(key, [names[number] for number in numbers], reason))
        return found

    def _first(self, offset: int) -> str:
        options = self.drive.options
        return f'{options.request_map_base + offset} and {options.response_map_base + offset} on'

    def _ask(self, number: int) -> _Asking:
        if not 1 <= number <= NUMBER_MAX - SLOTS:
            return None
        data = yield from self.ask(self._question(number))
        return None if data is None else self._words(data)


def extended_prober(drive: DriveConfiguration) -> DataModelProber:
    """Return the prober of a drive with 29-bit identifiers."""
    station = drive.station << extended.STATION_SHIFT

    def question(number: int) -> Question:
        frame = extended.encode_read_request(drive.station, number, SLOTS)
        return Question(frame, frame.identifier | extended.DIR)
    return DataModelProber(
        drive, [Route(station, extended.DIR | extended.STATION_MASK, True)], question,
        lambda data: extended.unpack_words(data, SLOTS))


def standard_prober(drive: DriveConfiguration) -> DataModelProber:
    """
    Return the prober of a drive with 11-bit identifiers.

    There is no cyclic telegram: the maps only tell the offset.
    """
    options = drive.options
    request = standard.identifier(options.request_id_base, drive.station)
    response = standard.identifier(options.response_id_base, drive.station)

    def question(number: int) -> Question:
        return Question(standard.encode_read_request(request, number, SLOTS), response,
                        quiet=options.quarantine)
    # bytes 0 and 1 are 03h 7Ah: task 7, a write to EEPROM, of P515
    hazard = '' if request & 1 or request not in _CANNORD_TASKS else (
        frame_sentences.hazard_maps(request))
    return DataModelProber(
        drive, [Route.of(request)], question,
        lambda data: standard.decode_read_response(Frame(response, data, False), SLOTS),
        hazard=hazard, maps_count=False)
