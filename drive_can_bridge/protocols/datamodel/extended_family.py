# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The row of the family table for the DataModel protocol with 29-bit identifiers."""

from collections.abc import Iterator

from drive_can_bridge.core.complaints import says
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Route, worst_bits
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.datamodel.checks import (
    check_parameters, check_period_and_maps, raw_parameter,
)
from drive_can_bridge.protocols.datamodel.extended import (
    PAYLOAD, SLOTS, STATION_MASK, STATION_MAX, STATION_SHIFT,
)
from drive_can_bridge.protocols.datamodel.options import ExtendedOptions, NUMBER_MAX
from drive_can_bridge.protocols.family import Claim, Complaint, Family, out_of_range, Talk

#: of every frame
FRAME_BITS = worst_bits(PAYLOAD, extended=True)
#: both maps are read once a second, request and response each
MAPPING_CHECK_BITS = 4 * FRAME_BITS


class DataModelExtended(Family):
    """DataModel, 29-bit identifiers: a cyclic service of four words each way, acyclic access."""

    name = 'datamodel_extended'
    cyclic = True
    widths = frozenset((16,))
    options_type = ExtendedOptions

    def check(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        yield from out_of_range('station', drive.station, 1, STATION_MAX, f' ({self.name})')
        yield from check_period_and_maps(drive)
        yield from self._check_slots(drive)
        yield from check_parameters(drive, self.name)

    def raw_parameter(self, drive: DriveConfiguration, name: str) -> Parameter | None:
        return raw_parameter(drive, name)

    def claims(self, drive: DriveConfiguration) -> list[Claim]:
        """Return all identifiers of the drive on its bus: every frame of its station."""
        route = Route(drive.station << STATION_SHIFT, STATION_MASK, True)
        return [Claim(route, f'29-bit frames of station {drive.station}')]

    def bits_per_second(self, drive: DriveConfiguration) -> float:
        """Return the worst-case load: one exchange a period, and the look at the maps."""
        exchange = 2 * FRAME_BITS / drive.period
        if drive.options.mapping == 'assume':
            return exchange
        return exchange + MAPPING_CHECK_BITS

    def talk(self) -> Talk:
        from drive_can_bridge.protocols.datamodel.extended_session import ExtendedSession
        from drive_can_bridge.protocols.datamodel.observer import ExtendedObserver
        from drive_can_bridge.protocols.datamodel.scanner import extended_prober, ExtendedScanner
        return Talk(ExtendedSession, ExtendedObserver, ExtendedScanner, extended_prober)

    def _check_slots(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        offset = drive.options.parameter_offset
        for key in ('cyclic_request', 'cyclic_response'):
            listed: tuple[Parameter, ...] = getattr(drive, key)
            if len(listed) > SLOTS:
                yield Complaint(key, says('too_many_slots', count=len(listed), most=SLOTS))
            for parameter in listed:
                if parameter.number is not None and parameter.number + offset == 0:
                    yield Complaint(key, says('number_zero', name=parameter.name, most=NUMBER_MAX))
