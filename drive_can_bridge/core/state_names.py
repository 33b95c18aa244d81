# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The states of drives by the names that users see, and what each means: power, and what to do.

Services answer with these names. Of two, the first is that of CiA 402, the second that of NORD.
"""

from drive_can_bridge.core.messages import catalogue, Text

# -- states that services answer with -------------------------------------------------------------
state_not_ready = Text(
    'not ready to switch on', 'not ready',
    do='the motor has no power, the drive is starting up: wait; if it stays, look at its supply '
       'and its display')
state_switch_on_disabled = Text(
    'switch on disabled', 'switch-on disabled',
    do='the motor has no power: call ~/enable; if it stays, something at the drive keeps it off '
       '(STO, enable input, supply of the motor)')
state_ready_to_switch_on = Text(
    'ready to switch on',
    do='the motor has no power: call ~/enable; if it stays, the supply of the motor is missing')
state_switched_on = Text(
    'switched on',
    do='the power stage is ready, the motor does not run yet: call ~/enable')
state_operation_enabled = Text(
    'operation enabled',
    do='the motor has power and may run: give it setpoints; ~/enable with false ends that')
state_quick_stop_active = Text(
    'quick stop active', 'quick stop',
    do='the motor has power and is braked, or holds where it stands: call ~/enable to go on, with '
       'false to take the power off (an axis without a brake sinks)')
state_fault_reaction = Text(
    'fault reaction active', 'fault reaction',
    do='the motor may still have power while a fault brakes it: wait for fault, remove its cause, '
       'then call ~/reset_fault and ~/enable')
state_unknown = Text(
    'unknown state',
    do='whether the motor has power is not known: look at the status word, and whether the '
       'profile is that of the drive')

#: all of them, by their codes
CODES = catalogue(globals())
