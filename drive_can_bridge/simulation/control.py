# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the control word makes a simulated drive do, and what its status word tells of it.

.. code-block:: text

    power on ──► disabled ◄──── disable, or any word not listed ──── enabled
                    │  ▲                                              ▲  │
                    │  └──── standstill ◄── stopping ◄── quick_stop ──┼──┘
                    └───────────────────────── enable ────────────────┘
    any state ── trip ──► faulted ── reset_fault (on change, cause gone) ──► disabled

After a fault or a quick stop the word must have been something other than ``enable`` before
``enable`` counts again. A drive without a control section is enabled as long as it has no fault.
Of a status word, bits are found by their names; then the profile's patterns are met.
"""

from collections.abc import Callable
import math
from typing import NamedTuple

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import ControlTable


class Operation:
    """
    The operating state of one simulated drive.

    :param table: None: there is no control word of the profile's.
    :ivar enabled: torque is on.
    :ivar stopping: on the quick stop ramp; still enabled.
    :ivar faulted: torque is off until the fault is reset.
    """

    def __init__(self, table: ControlTable | None) -> None:
        self._table = table
        self.power_on()

    def power_on(self) -> None:
        """Begin anew: no fault, disabled."""
        self.enabled = self._table is None
        self.stopping = self.faulted = self._blocked = False
        self._word: int | None = None
        self._cause_ends = -math.inf

    def word_written(self, word: int, now: float) -> None:
        table = self._table
        if table is None:
            return
        changed, self._word = word != self._word, word
        if word not in (table.enable, table.quick_stop):
            self._blocked = False
        if self.faulted:
            if word == table.reset_fault and changed and self.reset_allowed(now):
                self.faulted = False
        elif word == table.enable:
            if not self._blocked and not self.stopping:
                self.enabled = True
        elif word == table.quick_stop:
            self.stopping = self.enabled
        else:
            self.enabled = self.stopping = False

    def trip(self, now: float, duration: float = 0.0) -> None:
        """Fail. The cause lasts for some seconds, during which no reset helps."""
        self.faulted = self._blocked = True
        self.enabled = self.stopping = False
        self._cause_ends = now + duration

    def reset_allowed(self, now: float) -> bool:
        """Tell whether the cause of a trip is gone."""
        return now >= self._cause_ends

    def end_cause(self, now: float) -> None:
        """Let a reset help from some time on, at the latest."""
        self._cause_ends = min(self._cause_ends, now)

    def repair(self) -> None:
        """Clear a fault by hand, at the drive; without one nothing happens."""
        if self.faulted:
            self.faulted = False
            self.enabled = self._table is None

    def standstill(self) -> None:
        """Take note that the motor has stopped: the end of a quick stop."""
        if self.stopping:
            self.enabled = self.stopping = False
            self._blocked = True


class State(NamedTuple):
    """What status bits can tell."""

    operation: Operation
    warning: bool = False
    speed: float = 0.0
    setpoint_reached: bool = False


Condition = Callable[[State], bool]

_RULES: tuple[tuple[tuple[str, ...], Condition], ...] = (
    (('ready', 'ready_to_switch_on', 'ready_to_run', 'no_fault', 'ok'),
     lambda s: not s.operation.faulted),
    (('enabled', 'running', 'operation_enabled', 'on', 'active', 'operating'),
     lambda s: s.operation.enabled),
    (('disabled', 'switch_on_disabled'), lambda s: not s.operation.enabled),
    (('fault', 'error', 'alarm', 'tripped', 'failure'), lambda s: s.operation.faulted),
    (('warning',), lambda s: s.warning),
    (('moving', 'rotating', 'motor_running'), lambda s: s.speed != 0.0),
    (('standstill', 'stopped', 'zero_speed', 'at_standstill'), lambda s: s.speed == 0.0),
    (('rotating_right', 'forward', 'direction_forward'), lambda s: s.speed > 0.0),
    (('rotating_left', 'reverse', 'direction_reverse'), lambda s: s.speed < 0.0),
    (('setpoint_reached', 'at_setpoint', 'at_speed', 'speed_reached', 'target_reached',
      'in_position'), lambda s: s.setpoint_reached),
    (('quick_stop', 'quick_stop_active'), lambda s: s.operation.stopping),
    (('no_quick_stop',), lambda s: not s.operation.stopping),
    (('voltage_enabled', 'power_on', 'mains_ok', 'bus_control', 'remote'), lambda s: True),
)
BIT_RULES: dict[str, Condition] = {name: rule for names, rule in _RULES for name in names}


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
        """Tell whether anything of the word is known; if not, it is a plain register."""
        return bool(self._bits or self._patterns)

    def compose(self, state: State, word: int) -> int:
        """
        Return the status word.

        :param word: supplies the bits that no rule knows.
        """
        for mask, rule in self._bits:
            word = word | mask if rule(state) else word & ~mask
        for pattern, rule in self._patterns:
            if not rule(state) and pattern.matches(word):
                word ^= pattern.mask & -pattern.mask
        for pattern, rule in self._patterns:
            if rule(state):
                word = word & ~pattern.mask | pattern.value
        return word
