# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The rows of the family table for the DataModel protocols: with 11-bit and 29-bit identifiers."""

from collections.abc import Iterator
import re

from drive_can_bridge.core import complaints
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Route, STANDARD_IDENTIFIER_MAX, worst_bits
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.process_image import control_word
from drive_can_bridge.protocols.datamodel import standard_round
from drive_can_bridge.protocols.datamodel.extended import (
    CYCLIC_PARAMETER, PAYLOAD, SLOTS, STATION_MASK, STATION_MAX, STATION_SHIFT)
from drive_can_bridge.protocols.datamodel.options import (
    ExtendedOptions, NUMBER_MAX, PROBED, REQUEST_MAP_BASE, RESPONSE_MAP_BASE, StandardOptions)
from drive_can_bridge.protocols.family import (
    Claim, Complaint, Family, FamilyParts, out_of_range, ScanEntry)

#: the manual recommends not to cycle faster
FASTEST_PERIOD = 0.005
_RAW_NAME = re.compile(r'p([0-9]{1,5})', re.ASCII)
_PROTOCOLS = frozenset(('datamodel_extended', 'datamodel_standard'))


def raw_parameter(drive: DriveConfiguration, name: str) -> Parameter | None:
    """
    Resolve ``p<number>``: an unsigned 16-bit parameter of unknown storage.

    Nobody has a parameter 65535: that number marks cyclic telegrams.
    """
    match = _RAW_NAME.fullmatch(name)
    if match is None:
        return None
    number = int(match.group(1))
    wire = number + drive.options.parameter_offset
    if number > NUMBER_MAX or not 0 <= wire < CYCLIC_PARAMETER:
        return None
    return Parameter(name=name, number=number, listed=False)


def check_period_and_maps(drive: DriveConfiguration) -> Iterator[Complaint]:
    """Check how fast the drive is cycled, and the place of its maps."""
    if drive.period < FASTEST_PERIOD and not drive.options.allow_fast_cycle:
        yield Complaint('period', complaints.period_too_fast(
            period=drive.period, least=FASTEST_PERIOD))
    offset = drive.options.parameter_offset
    for key in ('request_map_base', 'response_map_base'):
        base = getattr(drive.options, key)
        if not 0 <= base + offset <= NUMBER_MAX - SLOTS:
            yield Complaint(key, complaints.map_out_of_range(
                base=base, offset=offset, most=NUMBER_MAX - SLOTS))
    request = drive.options.request_map_base
    response = drive.options.response_map_base
    if abs(request - response) < SLOTS:
        # at the key that was given; the other one has its default
        moved = request != REQUEST_MAP_BASE and response == RESPONSE_MAP_BASE
        yield Complaint('request_map_base' if moved else 'response_map_base',
                        complaints.maps_overlap(
                            request=request, response=response, distance=SLOTS))


def check_parameters(drive: DriveConfiguration, family: str) -> Iterator[Complaint]:
    """Check the setpoints, and every parameter of the profile."""
    yield from _check_request(drive)
    yield from _check_profile(drive, family)


def _check_request(drive: DriveConfiguration) -> Iterator[Complaint]:
    """Look for setpoints that would overwrite each other, the control word, or the maps."""
    numbers: dict[int, str] = {}
    word = control_word(drive, controlled=True)
    listed = drive.cyclic_request
    for parameter in listed if word is None or word in listed else (word, *listed):
        if parameter.number is None:
            continue
        if parameter.number in numbers:
            yield Complaint('cyclic_request',
                            complaints.same_number(
                                name=parameter.name, other=numbers[parameter.number],
                                address=parameter.address))
        numbers.setdefault(parameter.number, parameter.name)
        for key in ('request_map_base', 'response_map_base'):
            base = getattr(drive.options, key)
            if base <= parameter.number < base + SLOTS:
                yield Complaint('cyclic_request',
                                complaints.mapping_parameter(
                                    name=parameter.name, address=parameter.address, base=base,
                                    last=base + SLOTS - 1))


def _check_profile(drive: DriveConfiguration, family: str) -> Iterator[Complaint]:
    offset = drive.options.parameter_offset
    shared = not _PROTOCOLS.issuperset(drive.profile.protocols)
    for name, parameter in drive.profile.parameters.items():
        place = f'profile.parameters.{name}'
        if parameter.number is None:
            yield Complaint(f'{place}.number', complaints.number_missing(
                family=family, most=NUMBER_MAX))
            continue
        if not 0 <= parameter.number + offset <= NUMBER_MAX:
            yield Complaint('parameter_offset', complaints.moved_out(
                offset=offset, name=name, address=parameter.address, most=NUMBER_MAX))
        elif parameter.writable and parameter.number + offset == CYCLIC_PARAMETER:
            yield Complaint(f'{place}.access', complaints.access_impossible(
                access=parameter.access.value, name=CYCLIC_PARAMETER))
        if parameter.subindex is not None and not shared:
            yield Complaint(f'{place}.subindex', complaints.no_subindex(family=family))


class DataModelStandard(Family):
    """DataModel, 11-bit identifiers: single reads and writes, from which an exchange is made."""

    name = 'datamodel_standard'
    cyclic = False
    widths = frozenset((16,))
    options_type = StandardOptions
    probed = PROBED[:1]     # no cyclic telegrams, whose maps would count
    scan_entry = ScanEntry('drive_std')

    def check(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        yield from self._check_station(drive)
        yield from check_period_and_maps(drive)
        yield from check_parameters(drive, self.name)

    def raw_parameter(self, drive: DriveConfiguration, name: str) -> Parameter | None:
        return raw_parameter(drive, name)

    def claims(self, drive: DriveConfiguration) -> list[Claim]:
        """Return both identifiers of the drive."""
        # one that does not fit is refused as such: it must not look like another one
        return [Claim(Route.of(identifier), f'11-bit identifier {identifier:03X}h')
                for identifier in (base + drive.station for base in _bases(drive).values())
                if 0 <= identifier <= STANDARD_IDENTIFIER_MAX]

    def bits_per_second(self, drive: DriveConfiguration) -> float:
        """Return the worst-case load: a round of reads and every setpoint, each period."""
        return standard_round.FRAME_BITS * standard_round.frames(drive) / drive.period

    def shortest_period(self, drive: DriveConfiguration, bitrate: int) -> float:
        """Return the time of a round of reads in which every setpoint changes."""
        return standard_round.shortest_period(drive, bitrate)

    def parts(self) -> FamilyParts:
        from drive_can_bridge.protocols.datamodel.standard_session import StandardSession
        from drive_can_bridge.protocols.datamodel.observer import StandardObserver
        from drive_can_bridge.protocols.datamodel.prober import standard_prober
        from drive_can_bridge.protocols.datamodel.scanner import StandardScanner
        return FamilyParts(StandardSession, StandardObserver, StandardScanner, standard_prober)

    def _check_station(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        bases = _bases(drive)
        highest = STANDARD_IDENTIFIER_MAX - max(bases.values())
        if drive.station < 1:
            yield Complaint('station', complaints.station_out_of_range(
                station=drive.station, most=highest, family=self.name))
        for direction, base in bases.items():
            identifier = base + drive.station
            if identifier > STANDARD_IDENTIFIER_MAX:
                yield Complaint(
                    'station', complaints.identifier_too_long(
                        station=drive.station, direction=direction, base=base,
                        identifier=identifier, most=highest))
                break
        if bases['request'] == bases['response']:
            yield Complaint('response_id_base', complaints.same_base(base=bases['response']))


def _bases(drive: DriveConfiguration) -> dict[str, int]:
    options: StandardOptions = drive.options
    return {'request': options.request_id_base, 'response': options.response_id_base}


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
    probed = PROBED

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
        """Return the worst-case load: one exchange a period, and the polls of the maps."""
        exchange = 2 * FRAME_BITS / drive.period
        if drive.options.mapping == 'assume':
            return exchange
        return exchange + MAPPING_CHECK_BITS

    def parts(self) -> FamilyParts:
        from drive_can_bridge.protocols.datamodel.extended_session import ExtendedSession
        from drive_can_bridge.protocols.datamodel.observer import ExtendedObserver
        from drive_can_bridge.protocols.datamodel.prober import extended_prober
        from drive_can_bridge.protocols.datamodel.scanner import ExtendedScanner
        return FamilyParts(ExtendedSession, ExtendedObserver, ExtendedScanner, extended_prober)

    def _check_slots(self, drive: DriveConfiguration) -> Iterator[Complaint]:
        offset = drive.options.parameter_offset
        for key in ('cyclic_request', 'cyclic_response'):
            listed: tuple[Parameter, ...] = getattr(drive, key)
            if len(listed) > SLOTS:
                yield Complaint(key, complaints.too_many_slots(count=len(listed), most=SLOTS))
            for parameter in listed:
                if parameter.number is not None and parameter.number + offset == 0:
                    yield Complaint(key, complaints.number_zero(
                        name=parameter.name, most=NUMBER_MAX))
