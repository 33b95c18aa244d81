# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The bits of status words that are built in: of families, not of profiles.

They stand here, by the name of the family, for views: those import no family.
"""

from collections.abc import Mapping

#: name of the status word among the parameters of a drive
STATUS_NAME = 'status_word'

CANNORD = {
    'ready_to_switch_on': 0,
    'ready': 1,
    'enabled': 2,
    'fault': 3,
    'voltage_enabled': 4,
    'no_quick_stop': 5,
    'switch_on_disabled': 6,
    'warning': 7,
    'setpoint_reached': 8,
    'bus_control': 9,
    'bit_10': 10,
    'rotating_right': 11,
    'rotating_left': 12,
    'bit_13': 13,
}
CIA402 = {
    'ready_to_switch_on': 0, 'switched_on': 1, 'enabled': 2, 'fault': 3, 'voltage_enabled': 4,
    'no_quick_stop': 5, 'switch_on_disabled': 6, 'warning': 7, 'bit_8': 8, 'remote': 9,
    'target_reached': 10, 'internal_limit': 11, 'bit_12': 12, 'bit_13': 13, 'bit_14': 14,
    'bit_15': 15,
}
#: family -> name of a bit -> number
BUILT_IN: Mapping[str, Mapping[str, int]] = {'cannord': CANNORD, 'cia402': CIA402}
