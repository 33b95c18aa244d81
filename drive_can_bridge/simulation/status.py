# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Status words of a simulated drive: bits found by their names, then the profile's patterns."""

from collections.abc import Callable
from typing import NamedTuple

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import ControlTable
from drive_can_bridge.simulation.control import Operation


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
