# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The keys that only DataModel drives have, and the two maps that they configure.

Reg.122 to 125 name the parameters of the cyclic request, Reg.126 to 129 those of the cyclic
response, slot 0 first. The first entry that is 0 ends a map: that slot and all later ones are
ignored (request) or undetermined (response), whatever the later entries say (manual, "Frame
ciclico master -> slave" and "slave -> master", with the examples Reg.122 = 50, Reg.123 = 0 and
Reg.126 = 209, Reg.127 = 210, Reg.128 = 0).

The manual also calls these parameters P0040 to P0047 in its byte tables. Reg.n is what goes over
the wire; nothing here ever touches 40 to 47.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from drive_can_bridge.core.frame import STANDARD_IDENTIFIER_MAX
from drive_can_bridge.protocols.datamodel.extended import SLOTS
from drive_can_bridge.protocols.datamodel.standard import REQUEST_ID_BASE, RESPONSE_ID_BASE
from drive_can_bridge.protocols.family import option

#: those that a prober settles
PROBED = ('parameter_offset', 'cyclic_request', 'cyclic_response')
REQUEST_MAP_BASE = 122
RESPONSE_MAP_BASE = 126


def effective(entries: Sequence[int]) -> tuple[int, ...]:
    """Return the entries that count: those before the first 0."""
    length = entries.index(0) if 0 in entries else len(entries)
    return tuple(entries[:length])


def padded(numbers: Sequence[int]) -> tuple[int, ...]:
    """Fill a map with zeros up to its four slots."""
    return tuple(numbers) + (0,) * (SLOTS - len(numbers))


def differences(request: Sequence[int], response: Sequence[int] | None, *,
                wanted_request: Sequence[int], wanted_response: Sequence[int]) -> list[str]:
    """
    Compare a drive's maps with the configured ones.

    A response map may be longer than configured: the surplus is not looked at. A longer request
    map is refused, since the drive would take our zeros for values.

    :param response: None where it was not read.
    :return: one phrase per map that differs, for a message to the user.
    """
    found = []
    if effective(request) != tuple(wanted_request):
        found.append(f'request map is {_text(effective(request))}, '
                     f'configured {_text(wanted_request)}')
    if response is not None and (
            effective(response)[:len(wanted_response)] != tuple(wanted_response)):
        found.append(f'response map is {_text(effective(response))}, '
                     f'configured {_text(wanted_response)}')
    return found


def _text(numbers: Sequence[int]) -> str:
    return ', '.join(map(str, numbers)) if numbers else 'empty'


#: the manual's least time between two EEPROM writes
EEPROM_WRITE_GAP = 0.02
NUMBER_MAX = 0xFFFF


@dataclass(frozen=True, slots=True)
class DataModelOptions:
    """What both protocols have in common."""

    request_map_base: int = option(
        REQUEST_MAP_BASE, 'Number of the first of the four parameters that map the request.',
        minimum=1, maximum=NUMBER_MAX - SLOTS)
    response_map_base: int = option(
        RESPONSE_MAP_BASE, 'Number of the first of the four parameters that map the response.',
        minimum=1, maximum=NUMBER_MAX - SLOTS)
    parameter_offset: int = option(
        0, 'Added to every parameter number on the wire.', minimum=-NUMBER_MAX,
        maximum=NUMBER_MAX)
    eeprom_write_gap: float = option(
        EEPROM_WRITE_GAP, 's between EEPROM writes to the station; the manual demands 0.02.',
        minimum=EEPROM_WRITE_GAP, maximum=60.0)
    length_policy: Literal['lenient', 'strict'] = option(
        'lenient', 'lenient accepts responses with fewer than 8 bytes that hold what is needed, '
        'strict does not.')
    allow_fast_cycle: bool = option(False, 'Permit a period under 5 ms.')


@dataclass(frozen=True, slots=True)
class ExtendedOptions(DataModelOptions):
    """29-bit identifiers."""

    mapping: Literal['verify', 'configure', 'assume'] = option(
        'verify', 'What to do about the maps of the drive (Reg.122-125, 126-129): verify refuses '
        'to cycle while they differ, configure rewrites them, assume does not look.')


@dataclass(frozen=True, slots=True)
class StandardOptions(DataModelOptions):
    """11-bit identifiers."""

    request_id_base: int = option(
        REQUEST_ID_BASE, 'CanStdRxIDbase of the drive; plus station it is the identifier of '
        'requests.', minimum=0, maximum=STANDARD_IDENTIFIER_MAX - 1)
    response_id_base: int = option(
        RESPONSE_ID_BASE, 'CanStdTxIDbase of the drive; plus station it is the identifier of '
        'responses.', minimum=0, maximum=STANDARD_IDENTIFIER_MAX - 1)
    quarantine: float = option(
        0.1, 's of silence after a read that was not answered: a late answer does not say what it '
        'answers.', minimum=0.0, maximum=60.0)
    refresh_interval: float = option(
        0.5, 's after which unchanged cyclic_request values are written again; 0: only on '
        'change.', minimum=0.0, maximum=3600.0)
