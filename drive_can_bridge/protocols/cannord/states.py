# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Control word, status word, and the states that NORD inverters tell with it.

Sources: BU 0060 page 41 (status word); control word and state table as the other bus manuals of
the same inverters print them alike (BU 0050 pages 30 and 38, BU 0590 page 21, BU 0220 page 66).

================== ============ ==========================================================
control word       value        what it does
================== ============ ==========================================================
``READY``          047Eh        leaves "switch-on disabled"; ramps a running drive down
``RUN``            047Fh        switches on and enables operation
``QUICK_STOP``     047Ah        bit 2 clear: stops on the quick stop ramp, then disables
``ACKNOWLEDGE``    04FEh        rising edge of bit 7: resets faults whose cause is gone
================== ============ ==========================================================

Bit 10 ("process data valid") is set in all of them: without it an inverter ignores the frame.
Bits 14 and 15 choose the parameter set (:func:`parameter_set_bits`).
"""

from enum import Enum

from drive_can_bridge.core import state_names
from drive_can_bridge.core.errors import LocalProtocolError
from drive_can_bridge.core.parameters import AccessMode, Parameter
from drive_can_bridge.core.status_bits import CANNORD, STATUS_NAME

READY = 0x047E
RUN = 0x047F
QUICK_STOP = 0x047A
ACKNOWLEDGE = 0x04FE

#: bits of the control word
SWITCH_ON = 0x0001
NO_DISABLE_VOLTAGE = 0x0002
NO_QUICK_STOP = 0x0004
ENABLE_OPERATION = 0x0008
ENABLE_RAMP = 0x0010
RELEASE_RAMP = 0x0020
ENABLE_SETPOINT = 0x0040
FAULT_RESET = 0x0080
DATA_VALID = 0x0400
ROTATE_RIGHT = 0x0800
ROTATE_LEFT = 0x1000
PARAMETER_SET_SHIFT = 14
PARAMETER_SETS = 4

#: names of the bits of the status word, as they are published
STATUS_BITS = CANNORD
FAULT_BIT = 0x0008

STATUS_PARAMETER = Parameter(
    name=STATUS_NAME, access=AccessMode.READ_ONLY, bits=tuple(STATUS_BITS.items()),
    description='Status word of the inverter')
CONTROL_PARAMETER = Parameter(
    name='control_word', access=AccessMode.WRITE_ONLY, description='Control word of the inverter')


class InverterState(Enum):
    """The states of the inverter, by the names that users see."""

    NOT_READY = state_names.state_not_ready.texts[1]
    SWITCH_ON_DISABLED = state_names.state_switch_on_disabled.texts[1]
    READY_TO_SWITCH_ON = state_names.state_ready_to_switch_on.texts[0]
    SWITCHED_ON = state_names.state_switched_on.texts[0]
    OPERATION_ENABLED = state_names.state_operation_enabled.texts[0]
    FAULT = 'fault'
    FAULT_REACTION = state_names.state_fault_reaction.texts[1]
    QUICK_STOP = state_names.state_quick_stop_active.texts[1]
    #: a combination of bits that the table does not have
    UNKNOWN = state_names.state_unknown.texts[0]


#: (mask, value, state), as the manuals print the table
_TABLE = (
    (0x004F, 0x0000, InverterState.NOT_READY),
    (0x004F, 0x0040, InverterState.SWITCH_ON_DISABLED),
    (0x007F, 0x0031, InverterState.READY_TO_SWITCH_ON),
    (0x007F, 0x0033, InverterState.SWITCHED_ON),
    (0x007F, 0x0037, InverterState.OPERATION_ENABLED),
    (0x004F, 0x0008, InverterState.FAULT),
    (0x004F, 0x000F, InverterState.FAULT_REACTION),
    (0x007F, 0x0017, InverterState.QUICK_STOP),
)


def state_of(status: int) -> InverterState:
    """Return the state in a status word."""
    for mask, value, state in _TABLE:
        if status & mask == value:
            return state
    return InverterState.UNKNOWN


def is_faulted(status: int) -> bool:
    """Return whether the fault bit is set, whatever the other bits say."""
    return bool(status & FAULT_BIT)


def parameter_set_bits(parameter_set: int) -> int:
    """
    Return bits 14 and 15 of a control word that chooses a parameter set.

    :param parameter_set: 1 to 4.
    """
    if not 1 <= parameter_set <= PARAMETER_SETS:
        raise LocalProtocolError(f'parameter set {parameter_set} is out of range: '
                                 f'1 to {PARAMETER_SETS}')
    return parameter_set - 1 << PARAMETER_SET_SHIFT


def parameter_set_of(word: int) -> int:
    """Return the parameter set, 1 to 4, that bits 14 and 15 of a word name."""
    return (word >> PARAMETER_SET_SHIFT & PARAMETER_SETS - 1) + 1
