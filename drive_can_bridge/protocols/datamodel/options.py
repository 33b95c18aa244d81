# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The keys that only DataModel drives have."""

from dataclasses import dataclass
from typing import Literal

from drive_can_bridge.core.frame import STANDARD_IDENTIFIER_MAX
from drive_can_bridge.protocols.datamodel.extended import SLOTS
from drive_can_bridge.protocols.datamodel.mapping import REQUEST_MAP_BASE, RESPONSE_MAP_BASE
from drive_can_bridge.protocols.datamodel.standard import REQUEST_ID_BASE, RESPONSE_ID_BASE
from drive_can_bridge.protocols.options import option

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
