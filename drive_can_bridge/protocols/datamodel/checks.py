# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What both DataModel protocols refuse, and their raw parameter names."""

from collections.abc import Iterator
import re

from drive_can_bridge.core.complaints import says
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.datamodel.extended import CYCLIC_PARAMETER, SLOTS
from drive_can_bridge.protocols.datamodel.mapping import REQUEST_MAP_BASE, RESPONSE_MAP_BASE
from drive_can_bridge.protocols.datamodel.options import NUMBER_MAX
from drive_can_bridge.protocols.family import Complaint

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
    """Look at how fast the drive is cycled, and at the place of its maps."""
    if drive.period < FASTEST_PERIOD and not drive.options.allow_fast_cycle:
        yield Complaint('period', says('period_too_fast', period=drive.period,
                                       least=FASTEST_PERIOD))
    offset = drive.options.parameter_offset
    for key in ('request_map_base', 'response_map_base'):
        base = getattr(drive.options, key)
        if not 0 <= base + offset <= NUMBER_MAX - SLOTS:
            yield Complaint(key, says('map_out_of_range', base=base, offset=offset,
                                      most=NUMBER_MAX - SLOTS))
    request = drive.options.request_map_base
    response = drive.options.response_map_base
    if abs(request - response) < SLOTS:
        # at the key that was given; the other one has its default
        moved = request != REQUEST_MAP_BASE and response == RESPONSE_MAP_BASE
        yield Complaint('request_map_base' if moved else 'response_map_base',
                        says('maps_overlap', request=request, response=response, distance=SLOTS))


def check_parameters(drive: DriveConfiguration, family: str) -> Iterator[Complaint]:
    """Look at the setpoints, and at every parameter of the profile."""
    yield from _check_request(drive)
    yield from _check_profile(drive, family)


def _check_request(drive: DriveConfiguration) -> Iterator[Complaint]:
    """Look for setpoints that would overwrite each other, or the maps themselves."""
    numbers: dict[int, str] = {}
    for parameter in drive.cyclic_request:
        if parameter.number is None:
            continue
        if parameter.number in numbers:
            yield Complaint('cyclic_request',
                            says('same_number', name=parameter.name,
                                 other=numbers[parameter.number], address=parameter.address))
        numbers.setdefault(parameter.number, parameter.name)
        for key in ('request_map_base', 'response_map_base'):
            base = getattr(drive.options, key)
            if base <= parameter.number < base + SLOTS:
                yield Complaint('cyclic_request',
                                says('mapping_parameter', name=parameter.name,
                                     address=parameter.address, base=base, last=base + SLOTS - 1))


def _check_profile(drive: DriveConfiguration, family: str) -> Iterator[Complaint]:
    offset = drive.options.parameter_offset
    shared = not _PROTOCOLS.issuperset(drive.profile.protocols)
    for name, parameter in drive.profile.parameters.items():
        place = f'profile.parameters.{name}'
        if parameter.number is None:
            yield Complaint(f'{place}.number', says('number_missing', family=family,
                                                    most=NUMBER_MAX))
            continue
        if not 0 <= parameter.number + offset <= NUMBER_MAX:
            yield Complaint('parameter_offset', says('moved_out', offset=offset, name=name,
                                                     address=parameter.address, most=NUMBER_MAX))
        elif parameter.writable and parameter.number + offset == CYCLIC_PARAMETER:
            yield Complaint(f'{place}.access', says('access_impossible',
                                                    access=parameter.access.value,
                                                    name=CYCLIC_PARAMETER))
        if parameter.subindex is not None and not shared:
            yield Complaint(f'{place}.subindex', says('no_subindex', family=family))
