# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Finding DataModel drives, with 29-bit and with 11-bit identifiers."""

from collections.abc import Sequence
from typing import Any

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.protocols.datamodel import extended, standard
from drive_can_bridge.protocols.datamodel.options import (
    effective, REQUEST_MAP_BASE, RESPONSE_MAP_BASE)
from drive_can_bridge.protocols.scanner import Certainty, Scanner

#: the highest station whose both identifiers fit 11 bits with the default bases
STANDARD_STATION_MAX = 15
#: a parameter that the manual names, and whose read is no write in any other protocol
HARMLESS_NUMBER = 30


class ExtendedScanner(Scanner):
    """
    Recognises 29-bit identifiers, and reads both maps of each station.

    Its reads have 1 to 4 in the last four bits of the identifier, in which CANnord's 29-bit form
    has zeros: nobody else takes them for anything.
    """

    protocol = 'datamodel_extended'
    unmistakable = True

    def __init__(self) -> None:
        super().__init__()
        self.maps: dict[int, dict[int, tuple[int, ...]]] = {}

    def begin(self) -> None:
        self._questions += [
            extended.encode_read_request(station, REQUEST_MAP_BASE, extended.SLOTS)
            for station in range(1, extended.STATION_MAX + 1)]

    def receive_request(self, frame: Frame, now: float) -> None:
        # its answer repeats the identifier, but for the direction
        self._request(extended.station_of(frame.identifier), frame.data, now,
                      service=frame.identifier)

    def receive(self, frame: Frame, now: float) -> None:
        try:
            telegram = extended.decode(frame)
        except RemoteProtocolError:
            return
        station = extended.station_of(frame.identifier)
        service = frame.identifier & ~extended.DIR
        if isinstance(telegram, extended.CyclicResponse):
            self._answer(station, 'cyclic responses', now, service=service,
                         certainty=Certainty.CERTAIN)
        elif isinstance(telegram, extended.ReadResponse):
            text = f'answers to reads of P{telegram.number}'
            if self._answer(station, text, now, service=service) and (
                    telegram.number in (REQUEST_MAP_BASE, RESPONSE_MAP_BASE)):
                self._take_map(station, telegram.number, telegram.words)
        else:
            if not isinstance(telegram, extended.WriteTelegram):    # which nobody answers
                self.receive_request(frame, now)
            self.master = frame_sentences.requests_to_station(station, self.protocol)

    def _take_map(self, station: int, base: int, words: tuple[int, ...]) -> None:
        maps = self.maps.setdefault(station, {})
        if len(words) == extended.SLOTS:
            maps[base] = effective(words)
        if RESPONSE_MAP_BASE not in maps:
            self._questions.insert(0, extended.encode_read_request(
                station, RESPONSE_MAP_BASE, extended.SLOTS))
        told = ', '.join(f'{name} map {numbers_text(maps[key])}' for key, name in (
            (REQUEST_MAP_BASE, 'request'), (RESPONSE_MAP_BASE, 'response')) if key in maps)
        if station in self.sightings:
            self._see(station, told or 'answers to reads of its maps', Certainty.CERTAIN)

    def settings(self, station: int) -> dict[str, Any]:
        maps = self.maps.get(station, {})
        request, response = maps.get(REQUEST_MAP_BASE, ()), maps.get(RESPONSE_MAP_BASE, ())
        return {'request_numbers': _exchangeable(request),
                'response_numbers': _exchangeable(response),
                'remarks': [frame_sentences.map_not_exchangeable(name, numbers_text(numbers))
                            for name, numbers in (('request', request), ('response', response))
                            if numbers and not _exchangeable(numbers)]}


def _exchangeable(numbers: Sequence[int]) -> list[int]:
    """Return the parameters of a map; none where no bridge can be configured to exchange them."""
    unfit = extended.CYCLIC_PARAMETER in numbers or len(set(numbers)) < len(numbers) or any(
        base <= number < base + extended.SLOTS for number in numbers
        for base in (REQUEST_MAP_BASE, RESPONSE_MAP_BASE))
    return [] if unfit else list(numbers)


class StandardScanner(Scanner):
    """
    Recognises the default identifiers of 11 bits, and reads P30 of each station.

    Not a map: a read of P122 at station 2 is task 7, a write of an EEPROM parameter, to CANnord
    inverter 249. A read of P30 has 1Eh in that place, which is a read there, too.
    """

    protocol = 'datamodel_standard'
    hazard = frame_sentences.hazard_standard()

    def begin(self) -> None:
        self._questions += [
            standard.encode_read_request(standard.REQUEST_ID_BASE + station, HARMLESS_NUMBER, 1)
            for station in range(1, STANDARD_STATION_MAX + 1)]

    def receive_request(self, frame: Frame, now: float) -> None:
        station = frame.identifier - standard.REQUEST_ID_BASE
        if frame.extended or not 1 <= station <= STANDARD_STATION_MAX:
            return
        try:
            request = standard.decode_request(frame)
        except RemoteProtocolError:
            return
        if isinstance(request, extended.ReadTelegram):
            self._request(station, frame.data, now)

    def receive(self, frame: Frame, now: float) -> None:
        self.receive_request(frame, now)
        station = frame.identifier - standard.RESPONSE_ID_BASE
        if frame.extended or not 1 <= station <= STANDARD_STATION_MAX:
            return
        if len(frame.data) == standard.PAYLOAD:
            self._answer(station, 'answers to reads', now)

    def settings(self, station: int) -> dict[str, Any]:
        return {'request_numbers': [], 'response_numbers': [HARMLESS_NUMBER]}


def numbers_text(numbers: tuple[int, ...]) -> str:
    """Write the entries of a map."""
    return ' '.join(map(str, numbers)) or 'empty'
