# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The control and status words of NORD inverters, built in: no profile has to tell them.

The steps and rules of :mod:`drive_can_bridge.core.control` hold. In the terms of the inverter:

* ``disable`` is 047Eh. It also brings an inverter out of "switch-on disabled", which nothing else
  does; so ENABLE waits for "ready to switch on" and then sends 047Fh, which switches on and
  enables operation.
* A drive counts as stopped when bit 2 (output on) is clear. In "quick stop", and on the ramp that
  047Eh begins, it is still set. So the quick stop word stays until the drive stands.
* A fault is acknowledged by the rising edge of bit 7, once. In "fault reaction" the drive still
  stops; the edge would be lost, and waits for "fault".

A broadcast group has one control word for several inverters: a condition holds when it holds for
all of them, and a fault of one is a fault of the group.
"""

from collections.abc import Callable, Sequence

from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.profile import ControlTable, StatusPattern
from drive_can_bridge.core.sentences import bus_not_in_control, quick_stop_active, voltage_disabled
from drive_can_bridge.core.status_bits import STATUS_NAME
from drive_can_bridge.core.status_reports import Wording
from drive_can_bridge.protocols.cannord.states import (
    ACKNOWLEDGE, is_faulted, parameter_set_bits, QUICK_STOP, READY, RUN, state_of)

OUTPUT_ON = 0x0004
_VOLTAGE_ENABLED = 0x0010
_NO_QUICK_STOP = 0x0020
_BUS_CONTROL = 0x0200


def control_table(parameter_set: int) -> ControlTable:
    """Return words and conditions in the form in which profiles give them."""
    chosen = parameter_set_bits(parameter_set)
    return ControlTable(
        parameter='', disable=READY | chosen, enable=RUN | chosen,
        quick_stop=QUICK_STOP | chosen, reset_fault=ACKNOWLEDGE | chosen,
        status_parameter=STATUS_NAME,
        ready=StatusPattern(0x007F, 0x0031), enabled=StatusPattern(0x007F, 0x0037),
        fault=StatusPattern(0x0008, 0x0008), running=StatusPattern(OUTPUT_ON, OUTPUT_ON),
        reaction=StatusPattern(0x004F, 0x000F), braking=StatusPattern(0x007F, 0x0017))


def make_control(*, parameter_set: int, timeout: float,
                 members: Sequence[str] = (),
                 unheard: Callable[[], Sentence] = lambda: NOTHING) -> ControlMachine:
    """
    Make the machine for one inverter, or for the inverters of a broadcast group.

    :param parameter_set: 1 to 4, bits 14 and 15 of every control word.
    :param timeout: seconds until an unconfirmed request fails.
    :param members: names of the inverters of a group, the leader's first.
    :param unheard: says which of them may run without answering any more; '' if none.
    """
    return ControlMachine(control_table(parameter_set), timeout=timeout, members=members,
                          unheard=unheard,
                          wording=Wording(lambda status: state_of(status).value, hint))


def hint(status: int) -> Sentence:
    """Return why an inverter does not go on, by its status word; '': unknown."""
    if is_faulted(status):
        return NOTHING
    if not status & _VOLTAGE_ENABLED:
        return voltage_disabled()
    if not status & _NO_QUICK_STOP:
        return quick_stop_active()
    if not status & _BUS_CONTROL:
        return bus_not_in_control()
    return NOTHING
