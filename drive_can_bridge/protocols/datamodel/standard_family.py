# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The row of the family table for the DataModel protocol with 11-bit identifiers."""

from collections.abc import Iterator

from drive_can_bridge.core.complaints import says
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.datamodel import standard_round
from drive_can_bridge.protocols.datamodel.checks import (
    check_parameters, check_period_and_maps, raw_parameter,
)
from drive_can_bridge.protocols.datamodel.options import StandardOptions
from drive_can_bridge.protocols.family import Claim, Complaint, Family, Talk


class DataModelStandard(Family):
    """DataModel, 11-bit identifiers: single reads and writes, from which an exchange is made."""

    name = 'datamodel_standard'
    cyclic = False
    widths = frozenset((16,))
    options_type = StandardOptions

    def check(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        yield from self._check_station(drive)
        yield from check_period_and_maps(drive)
        yield from check_parameters(drive, self.name)

    def raw_parameter(self, drive: DriveConfiguration, name: str) -> Parameter | None:
        return raw_parameter(drive, name)

    def claims(self, drive: DriveConfiguration) -> list[Claim]:
        """Return both identifiers of the drive."""
        # one that does not fit is refused as such: it must not look like another one
        return [Claim(Route(identifier, STANDARD_IDENTIFIER_MAX, False),
                      f'11-bit identifier {identifier:03X}h')
                for identifier in (base + drive.station for base in _bases(drive).values())
                if 0 <= identifier <= STANDARD_IDENTIFIER_MAX]

    def bits_per_second(self, drive: DriveConfiguration) -> float:
        """Return the worst-case load: a round of reads and every setpoint, each period."""
        return standard_round.FRAME_BITS * standard_round.frames(drive) / drive.period

    def shortest_period(self, drive: DriveConfiguration, bitrate: int) -> float:
        """Return the time of a round of reads in which every setpoint changes."""
        return standard_round.shortest_period(drive, bitrate)

    def talk(self) -> Talk:
        from drive_can_bridge.protocols.datamodel.standard_session import StandardSession
        from drive_can_bridge.protocols.datamodel.observer import StandardObserver
        from drive_can_bridge.protocols.datamodel.scanner import standard_prober, StandardScanner
        return Talk(StandardSession, StandardObserver, StandardScanner, standard_prober)

    def _check_station(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        bases = _bases(drive)
        highest = STANDARD_IDENTIFIER_MAX - max(bases.values())
        if drive.station < 1:
            yield Complaint('station', says('station_out_of_range', station=drive.station,
                                            most=highest, family=self.name))
        for direction, base in bases.items():
            identifier = base + drive.station
            if identifier > STANDARD_IDENTIFIER_MAX:
                yield Complaint(
                    'station', says('identifier_too_long', station=drive.station,
                                    direction=direction, base=base, identifier=identifier,
                                    most=highest))
                break
        if bases['request'] == bases['response']:
            yield Complaint('response_id_base', says('same_base', base=bases['response']))


def _bases(drive: DriveConfiguration) -> dict[str, int]:
    options: StandardOptions = drive.options
    return {'request': options.request_id_base, 'response': options.response_id_base}
