# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
r"""
How a target reaches a drive in mode pp: by an edge of bit 4, which the drive acknowledges.

.. code-block:: text

    bit 4  ____/‾‾‾‾‾‾‾‾‾\______    rises with a new target (bit 5: at once)
    bit 12 ________/‾‾‾‾‾‾‾‾‾\__    acknowledged; the next target waits until it has fallen

One after the other, the newest wins. When its commands cease, an axis that is on its way is halted
(bit 8), until it is armed again: bit 8 falls in the word in which bit 4 rises. If that cut an edge
off before it was acknowledged, its bit 12 may be on its way: it is waited for, or a status that
knows the halt (:data:`.STATUS_LAG`), before the next edge.
"""

import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.reporter import Reporter
from drive_can_bridge.core.setpoints import Setpoints
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.protocols.cia402.state_machine import DriveRules
from drive_can_bridge.protocols.cia402.states import MODES, ServoState, state_of


class SetpointHandshake:
    """
    The targets of one drive.

    :param rules: get the bits of the control word.
    :param timeout: s that a drive may take to acknowledge.
    :param report: is told once that it does not.
    """

    def __init__(self, setpoints: Setpoints, rules: DriveRules, timeout: float,
                 report: Reporter) -> None:
        mode = MODES['pp']
        self._place = next(place for place, each in enumerate(setpoints.items) if (
            each.parameter.index, each.parameter.subindex or 0) == (mode.index, mode.subindex))
        self._setpoint = setpoints.items[self._place]
        self._rules, self._timeout, self._report = rules, timeout, report
        self._waits_since, self._reported = math.inf, False
        self._handed: int | None = None     # the drive was given this one
        self._doubted = False               # or another one, if that frame was lost
        self._rising = False                # bit 4 has yet to travel
        self._before = 0                    # the bits that travel until then
        self._settling = 0                  # status words until bit 12 is none of a cut edge

    def update(self, status: int, now: float) -> None:
        """Go on by a status word, before the next control word is chosen."""
        rules, setpoint = self._rules, self._setpoint
        if state_of(status) is not ServoState.OPERATION_ENABLED:
            self._handed, self._rising, self._settling = None, False, 0
            rules.mode_bits, rules.halted = 0, False
            self._waits_since, self._reported = math.inf, False
            return
        acknowledged = bool(status & states.BIT_12)
        self._settling = 0 if acknowledged else max(0, self._settling - 1)
        self._see_to_acknowledge(acknowledged, now)
        if not setpoint.armed:
            self.disarmed(acknowledged=acknowledged)
        elif rules.mode_bits & states.NEW_SETPOINT:
            if acknowledged and not self._rising:
                rules.mode_bits = 0
        elif self._new and not acknowledged and not self._settling:
            self._before = rules.mode_bits
            rules.mode_bits, self._rising = states.NEW_SETPOINT | states.AT_ONCE, True
        rules.halted = rules.mode_bits == states.HALT

    def disarmed(self, *, acknowledged: bool = False) -> None:
        """Halt an axis that is on its way, if its setpoint is not armed any more."""
        rules = self._rules
        if self._setpoint.armed:
            return
        if self._rising:        # bit 8 would fall alone
            rules.mode_bits, self._rising = self._before, False
        elif rules.mode_bits & states.NEW_SETPOINT:
            rules.mode_bits = 0
            self._settling = 0 if acknowledged else states.STATUS_LAG + 1
        if self._handed is not None:
            rules.mode_bits, self._handed = states.HALT, None
        rules.halted = rules.mode_bits == states.HALT

    def _see_to_acknowledge(self, acknowledged: bool, now: float) -> None:
        """Report once that bit 12 does not rise with bit 4, or does not fall behind it."""
        setpoint = self._setpoint
        high = not self._rising and bool(self._rules.mode_bits & states.NEW_SETPOINT)
        waits = setpoint.armed and (not acknowledged if high else (
            acknowledged and self._new))
        if not waits:
            self._waits_since = math.inf
            self._reported = self._reported and not (high and acknowledged)
            return
        self._waits_since = min(self._waits_since, now)
        if now >= self._waits_since + self._timeout and not self._reported:
            self._reported = True
            self._report.note(Noted(
                sentences.target_not_acknowledged(self._timeout, int(high)), warning=True))

    @property
    def _new(self) -> bool:
        """The target is not known to be the one that the drive has."""
        return self._doubted or self._setpoint.raw != self._handed

    def carried(self, word: int, setpoints: list[int]) -> None:
        """Record a telegram that was made: the edge hands over what is in it."""
        target = setpoints[self._place]
        if word & states.NEW_SETPOINT:
            if self._rising:
                self._handed, self._rising, self._doubted = target, False, False
            elif target != self._handed:
                self._doubted = True
