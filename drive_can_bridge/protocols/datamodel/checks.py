# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What both DataModel protocols refuse, and their raw parameter names."""

from collections.abc import Iterator
import re

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
        yield Complaint('period', f'{drive.period:g} s is too fast, allowed is at least '
                                  f'{FASTEST_PERIOD:g} s unless allow_fast_cycle is true')
    offset = drive.options.parameter_offset
    for key in ('request_map_base', 'response_map_base'):
        base = getattr(drive.options, key)
        if not 0 <= base + offset <= NUMBER_MAX - SLOTS:
            yield Complaint(key, f'{base} with parameter_offset {offset} is out of range, '
                                 f'allowed on the wire is 0 to {NUMBER_MAX - SLOTS}')
    request = drive.options.request_map_base
    response = drive.options.response_map_base
    if abs(request - response) < SLOTS:
        # at the key that was given; the other one has its default
        moved = request != REQUEST_MAP_BASE and response == RESPONSE_MAP_BASE
        yield Complaint('request_map_base' if moved else 'response_map_base',
                        f'{request} and {response} overlap, allowed is a distance of {SLOTS} '
                        'or more')


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
                            f"'{parameter.name}' and '{numbers[parameter.number]}' are both "
                            f'{parameter.address}, allowed is one of them')
        numbers.setdefault(parameter.number, parameter.name)
        for key in ('request_map_base', 'response_map_base'):
            base = getattr(drive.options, key)
            if base <= parameter.number < base + SLOTS:
                yield Complaint('cyclic_request',
                                f"'{parameter.name}' ({parameter.address}) is a mapping "
                                f'parameter, allowed are others than {base} to '
                                f'{base + SLOTS - 1}')


def _check_profile(drive: DriveConfiguration, family: str) -> Iterator[Complaint]:
    offset = drive.options.parameter_offset
    shared = not _PROTOCOLS.issuperset(drive.profile.protocols)
    for name, parameter in drive.profile.parameters.items():
        place = f'profile.parameters.{name}'
        if parameter.number is None:
            yield Complaint(f'{place}.number', f'missing, allowed in {family} is '
                                               f'0 to {NUMBER_MAX}')
            continue
        if not 0 <= parameter.number <= NUMBER_MAX:
            yield Complaint(f'{place}.number', f'{parameter.number} is out of range, '
                                               f'allowed is 0 to {NUMBER_MAX}')
        elif not 0 <= parameter.number + offset <= NUMBER_MAX:
            yield Complaint('parameter_offset', f"{offset} moves '{name}' "
                                                f'({parameter.address}) out of the allowed '
                                                f'0 to {NUMBER_MAX}')
        elif parameter.writable and parameter.number + offset == CYCLIC_PARAMETER:
            yield Complaint(f'{place}.access', f'{parameter.access.value} is impossible, '
                                               f'{CYCLIC_PARAMETER} is never written; '
                                               f'allowed is ro')
        if parameter.subindex is not None and not shared:
            yield Complaint(f'{place}.subindex', f'{family} knows no sub-index, '
                                                 f'allowed is number alone')
