# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The effect of control words on a simulated drive, and its status word.

One state machine, with the rules of a family or a profile as data. Of a status word, bits are
found by their names; then the profile's patterns are met.

.. code-block:: text

    power on, reset ──► switch-on disabled   ready to switch on   switched on   operation enabled
                                ▲                                                       │
       any ── trip ──► fault    └──────────────── standstill ◄── quick stop ◄───────────┘

The ways between the upper four are those of the rules. In "switch-on disabled" a word that enables
does not count before another one came. A "shutdown" is a way down that some machines have: at
standstill it leads to "ready to switch on".
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from enum import auto, Enum
import math
from typing import NamedTuple

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import ControlTable


class MachineState(Enum):
    """
    The states of all machines; none uses all of them.

    A fault is released by a word that would end "switch-on disabled": a reset then leads past it.
    """

    SWITCH_ON_DISABLED = auto()
    READY_TO_SWITCH_ON = auto()
    SWITCHED_ON = auto()
    OPERATION_ENABLED = auto()
    SHUTDOWN = auto()
    QUICK_STOP = auto()
    FAULT = auto()
    FAULT_RELEASED = auto()


FAULTS = (MachineState.FAULT, MachineState.FAULT_RELEASED)
RUNNING = (MachineState.OPERATION_ENABLED, MachineState.SHUTDOWN)
#: where standstill leads
ENDS = {MachineState.QUICK_STOP: MachineState.SWITCH_ON_DISABLED,
        MachineState.SHUTDOWN: MachineState.READY_TO_SWITCH_ON}


class Transition(NamedTuple):
    """
    Where control words with ``word & mask == value`` lead.

    :param states: from which states; None: all.
    :param to: None: nowhere.
    """

    states: Collection[MachineState] | None
    mask: int
    value: int
    to: MachineState | None


@dataclass(frozen=True, slots=True)
class Machine:
    """
    The state machine of a family or a profile, as data.

    :param rules: the first that applies counts.
    :param reset: mask and value of a word that ends a fault, where the word before was none.
    :param power_on: where it begins, and with which word as the one before.
    :param after_fault: where a reset leads.
    :param ramp: bits of a word without which the ramp of the quick stop holds.
    """

    rules: tuple[Transition, ...] = ()
    reset: tuple[int, int] | None = None
    power_on: tuple[MachineState, int] = (MachineState.SWITCH_ON_DISABLED, 0)
    after_fault: MachineState = MachineState.SWITCH_ON_DISABLED
    ramp: int = 0


class OperatingState:
    """
    The operating state of one simulated drive.

    :ivar now: the time of the last advance; before the first frame minus infinity.
    :ivar powered: there is power.
    :ivar state: what the machine is in.
    :ivar word: the last control word.
    :ivar enabled: torque is on.
    :ivar stopping: on the quick stop ramp; still enabled.
    :ivar faulted: torque is off until the fault is reset.
    """

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self.now = -math.inf
        self.power_off()
        self.powered = True

    def power_off(self) -> None:
        """Switch off; it starts without a fault once it is powered again."""
        self.powered = False
        state, self.word = self._machine.power_on
        self._cause_ends = -math.inf
        self._enter(state)

    def advance(self, now: float) -> float:
        """
        Advance the time up to now. It never runs backwards.

        :return: how much passed, in s.
        """
        last, self.now = self.now, max(now, self.now)
        return self.now - last if last > -math.inf else 0.0

    def word_written(self, word: int) -> None:
        before, self.word = self.word, word
        for states, mask, value, to in self._machine.rules:
            if word & mask == value and (states is None or self.state in states):
                self._enter(to or self.state)
                break
        if self.faulted and self._machine.reset is not None:
            mask, value = self._machine.reset
            if word & mask == value != before & mask and self.reset_allowed:
                self.repair()

    def trip(self, duration: float = 0.0, code: float | None = None) -> None:
        """
        Trip.

        :param duration: s that the cause lasts, during which no reset helps.
        :param code: of the fault; None: it has none of its own.
        """
        self._cause_ends = self.now + duration
        self._code = code
        self._enter(MachineState.FAULT)

    def fault_code(self, default: float) -> float:
        """Return the code of the fault, the default where it has none; 0 without a fault."""
        if not self.faulted:
            return 0.0
        return default if self._code is None else self._code

    @property
    def reset_allowed(self) -> bool:
        """Whether the cause of a trip is gone."""
        return self.now >= self._cause_ends

    def end_cause(self) -> None:
        """End the cause of a trip: a reset helps from now on."""
        self._cause_ends = min(self._cause_ends, self.now)

    def repair(self) -> None:
        """Clear a fault, as a reset or a person at the drive does."""
        if self.faulted:
            self._enter(
                MachineState.READY_TO_SWITCH_ON if self.state is MachineState.FAULT_RELEASED
                else self._machine.after_fault)

    def standstill(self) -> None:
        """Record that the motor stands: the end of a quick stop, or of a shutdown."""
        self._enter(ENDS.get(self.state, self.state))

    def _enter(self, state: MachineState) -> None:
        self.state = state
        self.faulted = state in FAULTS
        running, ramp = state in RUNNING, self._machine.ramp
        self.stopping = state is MachineState.QUICK_STOP or running and self.word & ramp != ramp
        self.enabled = self.stopping or running


def machine_of(table: ControlTable | None) -> Machine:
    """Return the machine for the control section of a profile; without one a drive just runs."""
    if table is None:
        return Machine(power_on=(MachineState.OPERATION_ENABLED, 0),
                       after_fault=MachineState.OPERATION_ENABLED)
    exact = -1
    rules = [
        Transition((MachineState.SWITCH_ON_DISABLED, MachineState.QUICK_STOP, *FAULTS), exact,
                   table.enable, None),
        Transition(None, exact, table.enable, MachineState.OPERATION_ENABLED)]
    if table.quick_stop is not None:
        rules += [Transition((MachineState.OPERATION_ENABLED,), exact, table.quick_stop,
                             MachineState.QUICK_STOP),
                  Transition(None, exact, table.quick_stop, None)]
    rules += [Transition(FAULTS, 0, 0, MachineState.FAULT_RELEASED),
              Transition(None, 0, 0, MachineState.READY_TO_SWITCH_ON)]
    # no word was written yet that any other one might equal
    return Machine(tuple(rules), None if table.reset_fault is None else (exact, table.reset_fault),
                   (MachineState.READY_TO_SWITCH_ON, exact))


class MachineStatus(NamedTuple):
    """What status bits can show."""

    operation: OperatingState
    warning: bool = False
    speed: float = 0.0
    setpoint_reached: bool = False


_RULES: tuple[tuple[tuple[str, ...], Callable[[MachineStatus], bool]], ...] = (
    (('ready', 'ready_to_switch_on', 'ready_to_run', 'no_fault', 'ok'),
     lambda r: not r.operation.faulted),
    (('enabled', 'running', 'operation_enabled', 'on', 'active', 'operating'),
     lambda r: r.operation.enabled),
    (('disabled', 'switch_on_disabled'), lambda r: not r.operation.enabled),
    (('fault', 'error', 'alarm', 'tripped', 'failure'), lambda r: r.operation.faulted),
    (('warning',), lambda r: r.warning),
    (('moving', 'rotating', 'motor_running'), lambda r: r.speed != 0.0),
    (('standstill', 'stopped', 'zero_speed', 'at_standstill'), lambda r: r.speed == 0.0),
    (('rotating_right', 'forward', 'direction_forward'), lambda r: r.speed > 0.0),
    (('rotating_left', 'reverse', 'direction_reverse'), lambda r: r.speed < 0.0),
    (('setpoint_reached', 'at_setpoint', 'at_speed', 'speed_reached', 'target_reached',
      'in_position'), lambda r: r.setpoint_reached),
    (('quick_stop', 'quick_stop_active'), lambda r: r.operation.stopping),
    (('no_quick_stop',), lambda r: not r.operation.stopping),
    (('voltage_enabled', 'power_on', 'mains_ok', 'bus_control', 'remote'), lambda r: True),
)
BIT_RULES = {name: rule for names, rule in _RULES for name in names}


class StatusWord:
    """
    Composes one status word.

    :param table: the control section, if this is its status parameter.
    """

    def __init__(self, parameter: Parameter, table: ControlTable | None) -> None:
        self._bits = [(1 << bit, BIT_RULES[name]) for name, bit in parameter.bits
                      if name in BIT_RULES]
        # the later, the more important: where patterns overlap, a fault wins
        found = () if table is None or table.status_parameter != parameter.name else (
            (table.ready, 'ready'), (table.enabled, 'enabled'), (table.fault, 'fault'))
        self._patterns = [(pattern, BIT_RULES[rule]) for pattern, rule in found if pattern]

    def __bool__(self) -> bool:
        """Return whether anything of the word is known; if not, it is a plain register."""
        return bool(self._bits or self._patterns)

    def compose(self, report: MachineStatus, word: int) -> int:
        """
        Return the status word.

        :param word: supplies the bits that no rule knows.
        """
        for mask, rule in self._bits:
            word = word | mask if rule(report) else word & ~mask
        for pattern, rule in self._patterns:
            if not rule(report) and pattern.matches(word):
                word ^= pattern.mask & -pattern.mask
        for pattern, rule in self._patterns:
            if rule(report):
                word = word & ~pattern.mask | pattern.value
        return word
