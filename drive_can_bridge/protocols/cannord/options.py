# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The keys that only CANnord inverters have."""

from dataclasses import dataclass
from typing import Literal

from drive_can_bridge.protocols.cannord.states import PARAMETER_SETS
from drive_can_bridge.protocols.family import option

#: those that a prober settles
PROBED = ('value_order', 'index_byte')


@dataclass(frozen=True, slots=True)
class CannordOptions:
    """How an inverter is addressed, and how its frames are laid out."""

    extended_identifiers: bool = option(
        False, 'Use 29-bit identifiers: the 11-bit ones followed by 18 zero bits.')
    broadcast: Literal['none', 'group', 'all'] = option(
        'none', 'Send control word and setpoints in one frame for several drives: to the group of '
        '32 addresses, or to all. The drive with the lowest station takes the commands.')
    value_order: Literal['high_first', 'low_first'] = option(
        'high_first', 'Which half of a parameter value comes first in the parameter frame.')
    index_byte: Literal['low', 'high'] = option(
        'low', 'Which byte of IND carries the sub-index: low is byte 2, high byte 3.')
    swap_setpoints_2_3: bool = option(
        False, 'Words 3 and 4 of the 8-byte process frames change places (SK 300E, SK 700E, '
        'SK 750E).')
    extra_setpoints: bool = option(
        False, 'SK 540E, SK 545E: setpoints and actual values 4 and 5 travel in a frame of 5 '
        'bytes after the main one.')
    parameter_set: int = option(
        1, 'Parameter set that the control word chooses.', minimum=1, maximum=PARAMETER_SETS)
    persist_writes: bool = option(
        False, 'Write parameters without storage in the profile to EEPROM (true) or to RAM only '
        '(false).')
