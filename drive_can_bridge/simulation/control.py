# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the control word makes a simulated drive do.

.. code-block:: text

    power on ──► disabled ◄──── disable, or any word not listed ──── enabled
                    │  ▲                                              ▲  │
                    │  └──── standstill ◄── stopping ◄── quick_stop ──┼──┘
                    └───────────────────────── enable ────────────────┘
    any state ── trip ──► faulted ── reset_fault (on change, cause gone) ──► disabled

After a fault or a quick stop the word must have been something other than ``enable`` before
``enable`` counts again. A drive without a control section is enabled as long as it has no fault.
"""

import math

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
        """Obey a control word."""
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
        """Clear a fault by hand, at the drive."""
        self.faulted = False
        self.enabled = self._table is None

    def standstill(self) -> None:
        """Take note that the motor has stopped: the end of a quick stop."""
        if self.stopping:
            self.enabled = self.stopping = False
            self._blocked = True
