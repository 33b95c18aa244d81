# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Control word, status word, states and modes of CiA 402, as manuals of all makers print them alike.

=================== ===== ======================================================================
control word        value what it does
=================== ===== ======================================================================
``DISABLE_VOLTAGE`` 0000h power off at once: the axis coasts; the way out of *quick stop active*
``QUICK_STOP``      0002h brakes as 605Ah says
``SHUTDOWN``        0006h to *ready to switch on*; from *operation enabled* as 605Bh says
``SWITCH_ON``       0007h to *switched on*; from *operation enabled* as 605Ch says
``ENABLE``          000Fh to *operation enabled*
``FAULT_RESET``     0080h the rising edge of bit 7
=================== ===== ======================================================================

Beside them bit 8 halts, and bits 4 to 6 mean something else in each mode (:data:`MODES`).
"""

from dataclasses import dataclass
from enum import Enum

from drive_can_bridge.core import state_names
from drive_can_bridge.core.parameters import AccessMode, Parameter, ParameterType
from drive_can_bridge.core.status_bits import CIA402, STATUS_NAME

CONTROL_WORD, STATUS_WORD = 0x6040, 0x6041
MODE, MODE_SHOWN, MODES_OFFERED = 0x6060, 0x6061, 0x6502
ERROR_CODE, POSITION = 0x603F, 0x6064
#: of mode vl; and what counts as no velocity
VELOCITY, VELOCITY_VL, VELOCITY_THRESHOLD = 0x606C, 0x6044, 0x606F
#: what the drive does at a stop
STOP_OPTIONS = QUICK_STOP_OPTION, SHUTDOWN_OPTION, DISABLE_OPTION = 0x605A, 0x605B, 0x605C
ABORT_CONNECTION_OPTION, INTERPOLATION_TIME = 0x6007, 0x60C2
HOMING_MODE, HOMING_METHOD = 6, 0x6098
#: s: longest period in which a drive that interpolates gets its setpoints
INTERPOLATION_MAX = 0.02

DISABLE_VOLTAGE = 0x0000
QUICK_STOP = 0x0002
SHUTDOWN = 0x0006
SWITCH_ON = 0x0007
ENABLE = 0x000F
FAULT_RESET = 0x0080
#: bits of the control word
NEW_SETPOINT = START = INTERPOLATE = 0x0010
AT_ONCE = 0x0020
HALT = 0x0100
RAMP_BITS = 0x0070

#: bits of the status word
FAULT_BIT = 0x0008
VOLTAGE_ENABLED = 0x0010
NO_QUICK_STOP = 0x0020
REMOTE = 0x0200
TARGET_REACHED = 0x0400
#: by mode: set-point acknowledged (pp), interpolation active (ip), attained (hm)
BIT_12 = 0x1000
BIT_13 = 0x2000

#: answered cycles by which a status may be behind its control word
STATUS_LAG = 3

STATUS_BITS = CIA402
STATUS_PARAMETER = Parameter(
    name=STATUS_NAME, index=STATUS_WORD, subindex=0, access=AccessMode.READ_ONLY,
    bits=tuple(STATUS_BITS.items()), description='Status word of the drive')
CONTROL_PARAMETER = Parameter(
    name='control_word', index=CONTROL_WORD, subindex=0, access=AccessMode.WRITE_ONLY,
    description='Control word of the drive')


class ServoState(Enum):
    """The states of a drive, by the names that users see."""

    NOT_READY = state_names.state_not_ready.texts[0]
    SWITCH_ON_DISABLED = state_names.state_switch_on_disabled.texts[0]
    READY_TO_SWITCH_ON = state_names.state_ready_to_switch_on.texts[0]
    SWITCHED_ON = state_names.state_switched_on.texts[0]
    OPERATION_ENABLED = state_names.state_operation_enabled.texts[0]
    QUICK_STOP_ACTIVE = state_names.state_quick_stop_active.texts[0]
    FAULT_REACTION = state_names.state_fault_reaction.texts[0]
    FAULT = 'fault'
    #: a combination of bits that the table does not have
    UNKNOWN = state_names.state_unknown.texts[0]


#: state: (mask, value) of the status word
PATTERNS = {
    ServoState.NOT_READY: (0x004F, 0x0000),
    ServoState.SWITCH_ON_DISABLED: (0x004F, 0x0040),
    ServoState.READY_TO_SWITCH_ON: (0x006F, 0x0021),
    ServoState.SWITCHED_ON: (0x006F, 0x0023),
    ServoState.OPERATION_ENABLED: (0x006F, 0x0027),
    ServoState.QUICK_STOP_ACTIVE: (0x006F, 0x0007),
    ServoState.FAULT_REACTION: (0x004F, 0x000F),
    ServoState.FAULT: (0x004F, 0x0008),
}
#: in which a motor has current, and may move
MOVING = (ServoState.OPERATION_ENABLED, ServoState.QUICK_STOP_ACTIVE, ServoState.FAULT_REACTION)
#: in which 000Fh alone starts the motor: many drives go on from *ready to switch on* by themselves
ONE_WORD_FROM_ENABLED = (ServoState.READY_TO_SWITCH_ON, ServoState.SWITCHED_ON)
_MASK = 0x006F
#: of all combinations of the bits that states are told by
_STATES = {raw: next((state for state, (mask, value) in PATTERNS.items()
                      if raw & mask == value), ServoState.UNKNOWN)
           for raw in range(_MASK + 1) if raw & _MASK == raw}


def state_of(status: int) -> ServoState:
    """Return the state in a status word."""
    return _STATES[status & _MASK]


@dataclass(frozen=True)
class Mode:
    """
    A mode of operation.

    :param number: in 6060h and 6061h; 6502h has bit ``number - 1`` for it.
    :param index: object of its setpoint.
    :param subindex: likewise.
    :param type: of the setpoint.
    :param position: the setpoint is a position: the axis stays where it is.
    :param interpolated: the drive expects a setpoint each SYNC.
    """

    number: int
    index: int
    subindex: int
    type: ParameterType
    position: bool = False
    interpolated: bool = False


_INT16, _INT32 = ParameterType.INT16, ParameterType.INT32
#: by the names that the drive key ``mode`` has
MODES = {
    'pp': Mode(1, 0x607A, 0, _INT32, position=True),
    'vl': Mode(2, 0x6042, 0, _INT16),
    'pv': Mode(3, 0x60FF, 0, _INT32),
    'tq': Mode(4, 0x6071, 0, _INT16),
    'ip': Mode(7, 0x60C1, 1, _INT32, position=True, interpolated=True),
    'csp': Mode(8, 0x607A, 0, _INT32, position=True, interpolated=True),
    'csv': Mode(9, 0x60FF, 0, _INT32, interpolated=True),
    'cst': Mode(10, 0x6071, 0, _INT16, interpolated=True),
}
