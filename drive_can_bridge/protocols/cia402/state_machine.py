# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Which control word serves what is wanted of a drive of CiA 402, by what it reports.

============ ======================= ============================================================
wanted       the drive reports       word
============ ======================= ============================================================
enable       switch on disabled      0006h (before 000Fh is sent at all)
             ready to switch on      0007h
             switched on, enabled    000Fh, with the bits of the mode
disable      operation enabled, or   ``disable_word``: 0007h, 0006h or 0000h
             nobody knows
             quick stop active       0002h; once it stands and stays there, 0000h (which ends the
                                     braking, so never before)
             anything else           0006h; with ``disable_voltage`` 0000h, unless it is to be
                                     enabled
quick stop   anything                0002h
reset fault  anything                0080h
============ ======================= ============================================================

A drive that was sent 000Fh counts as enabled until a status behind a later word says otherwise,
and one that was sent 0002h gets no other word until a status behind that was seen: what is on its
way tells of older times, and 0006h or 0007h in the middle of a quick stop would end its braking.
A status may be :data:`.STATUS_LAG` answered cycles behind its word: until then it counts only if
it shows what nothing before that word can have led to.
"""

from typing import Any, Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction, TableRules
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.profile import ControlTable, StatusPattern
from drive_can_bridge.core.status_bits import STATUS_NAME
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.protocols.cia402.standstill import Standstill
from drive_can_bridge.protocols.cia402.states import PATTERNS, ServoState

DISABLE_WORDS = {'disable_operation': states.SWITCH_ON, 'shutdown': states.SHUTDOWN,
                 'disable_voltage': states.DISABLE_VOLTAGE}
_ENABLE_OPERATION = 0x0008
#: a motor may turn: operation enabled, quick stop, fault reaction
_RUNNING = StatusPattern(0x0004, 0x0004)


def control_table(options: Any) -> ControlTable:
    """
    Return words and conditions in the form in which profiles give them.

    :param options: of the drive.
    """
    return ControlTable(
        parameter='', disable=states.SHUTDOWN, enable=states.ENABLE,
        quick_stop=states.QUICK_STOP, reset_fault=states.FAULT_RESET,
        status_parameter=STATUS_NAME,
        ready=StatusPattern(*PATTERNS[ServoState.READY_TO_SWITCH_ON]),
        enabled=StatusPattern(*PATTERNS[ServoState.OPERATION_ENABLED]),
        fault=StatusPattern(states.FAULT_BIT, states.FAULT_BIT), running=_RUNNING,
        reaction=StatusPattern(*PATTERNS[ServoState.FAULT_REACTION]),
        braking=StatusPattern(*PATTERNS[ServoState.QUICK_STOP_ACTIVE]))


class Known(Protocol):
    """What the status word of a drive does not say; the session itself."""

    @property
    def mode_lacking(self) -> Sentence:
        """What it lacks to be driven although it reports enabled; '' if nothing."""

    @property
    def unready(self) -> Sentence:
        """What has to be seen before it is enabled; '' if nothing."""

    @property
    def why(self) -> Sentence:
        """What else it says of why it is not enabled; '' if nothing."""


class DriveRules(TableRules):
    """
    The words of one drive.

    :param known: what else is known of it.
    :param standing: whether its axis stands.
    :ivar state: the newest one; None: not known.
    :ivar status: the word that told it; 0: not known.
    :ivar may_run: 000Fh was sent, and no status behind a later word has said otherwise.
    :ivar mode_bits: what the mode adds to the enable word once the drive is enabled.
    :ivar homing_bits: what is sent beside 000Fh in mode 6; None: the drive is in its own mode.
    :ivar halted: the drive was told to halt: its position is its own.
    """

    def __init__(self, table: ControlTable, options: Any, known: Known, standstill: Standstill,
                 ) -> None:
        super().__init__(table)
        self.state: ServoState | None = None
        self.status = 0
        self.standstill = standstill
        self.mode_bits = states.INTERPOLATE if options.mode == 'ip' else 0
        self.homing_bits: int | None = None
        self.halted = False
        self._else_known = known
        self._disable_word = DISABLE_WORDS[options.disable_word]
        self._enable_word = states.ENABLE | (
            states.RAMP_BITS if options.mode == 'vl' and options.ramp_bits else 0)
        self._seen_enabled = False      # since 000Fh
        self._quick_stop_unseen = False
        self._taken_on_trust = False    # 0000h went out although nothing says that it stands
        self._last = self._answers = 0  # the word, and how many status words have come behind it

    def word(self, sending: ControlAction, *, asked: ControlAction | None) -> int:
        if sending is ControlAction.DISABLE:
            return self._disabling(asked)
        if sending is ControlAction.ENABLE:
            return self._enabling()
        return super().word(sending, asked=asked)

    def _disabling(self, asked: ControlAction | None) -> int:
        if self._quick_stop_unseen:
            return states.QUICK_STOP
        if self.state is ServoState.QUICK_STOP_ACTIVE:
            on_trust = not self.standstill.holds
            if on_trust and (asked is None or not self.standstill.untold):
                return states.QUICK_STOP
            self._taken_on_trust = on_trust
            return states.DISABLE_VOLTAGE
        if self.may_run or self.state in (None, ServoState.OPERATION_ENABLED):
            return self._disable_word
        if self._disable_word == states.DISABLE_VOLTAGE and asked is not ControlAction.ENABLE:
            return states.DISABLE_VOLTAGE
        return states.SHUTDOWN

    def _enabling(self) -> int:
        if self.homing_bits is not None:
            if self._last & _ENABLE_OPERATION:
                # what was halted stays so until homing starts: its old target is still there
                return states.ENABLE | (self.homing_bits or self.mode_bits & states.HALT)
            if self.state is ServoState.SWITCHED_ON:     # until it is back in its mode
                return states.SWITCH_ON
        if self.state is ServoState.OPERATION_ENABLED:
            return self._enable_word | self.mode_bits
        if self.state is ServoState.SWITCHED_ON:
            return states.SWITCH_ON if self._else_known.unready else self._enable_word
        return states.SWITCH_ON if self.state is ServoState.READY_TO_SWITCH_ON else states.SHUTDOWN

    def rests(self, word: int) -> bool:
        return not word & (_ENABLE_OPERATION | states.FAULT_RESET) and word != states.QUICK_STOP

    def left(self, word: int) -> None:
        if word != self._last:
            self._answers = 0
            self._quick_stop_unseen = word == states.QUICK_STOP
            self._taken_on_trust = self._taken_on_trust and not self._quick_stop_unseen
        self._last = word
        if word & _ENABLE_OPERATION:
            self._seen_enabled = self._seen_enabled and self.may_run
            self.may_run = True

    def reported(self, raw: int, *, behind: bool) -> None:
        self.status, self.state = raw, states.state_of(raw)
        enabled = self.state is ServoState.OPERATION_ENABLED
        self._seen_enabled = self._seen_enabled or enabled
        if not behind:
            return
        self._answers += 1
        # one that has left it knows a later word: status words do not overtake each other
        known = self._answers > states.STATUS_LAG or self._seen_enabled and not enabled
        if known or self.state is ServoState.QUICK_STOP_ACTIVE:
            self._quick_stop_unseen = False
        if known and not self._last & _ENABLE_OPERATION and not enabled:
            self.may_run = False

    def forget(self) -> None:
        # it may be in its quick stop still
        self._quick_stop_unseen = (
            self._quick_stop_unseen or self._last == states.QUICK_STOP
            or self.state is ServoState.QUICK_STOP_ACTIVE)
        self.state, self.status, self._answers = None, 0, 0
        self.halted = self._taken_on_trust = False
        self.standstill.forget()

    def known_disabled(self) -> None:
        """Record that the drive was asked by SDO, and is not enabled."""
        self.may_run = self._quick_stop_unseen = False
        self._last = self._answers = 0

    @property
    def holds(self) -> Sentence:
        if self.standstill.holds:
            return sentences.quick_stop_holds(ServoState.QUICK_STOP_ACTIVE.value)
        return together((
            sentences.quick_stop_holds(ServoState.QUICK_STOP_ACTIVE.value),
            sentences.nothing_says_standing())) if self.standstill.untold else NOTHING

    def proviso(self) -> Sentence:
        on_trust, self._taken_on_trust = self._taken_on_trust, False
        return sentences.nothing_says_standing() if on_trust else NOTHING

    @property
    def lacking(self) -> Sentence:
        return self._else_known.mode_lacking

    @property
    def loose(self) -> bool:
        return self.halted

    def remark(self, sending: ControlAction) -> Sentence:
        if sending is ControlAction.ENABLE or self.state not in (
                ServoState.OPERATION_ENABLED, ServoState.QUICK_STOP_ACTIVE):
            return together((
                sentences.word_sent_last(self._last), self.lacking, self._else_known.why))
        if sending is ControlAction.QUICK_STOP and self.state is ServoState.OPERATION_ENABLED:
            return NOTHING      # it does not obey, and is disabled
        return sentences.still_braking()


def hint(status: int) -> Sentence:
    """Return why a drive does not go on, by its status word; '': unknown."""
    if status & states.FAULT_BIT or states.state_of(status) in (
            ServoState.OPERATION_ENABLED, ServoState.QUICK_STOP_ACTIVE):
        return NOTHING
    if not status & states.VOLTAGE_ENABLED:
        return sentences.voltage_disabled()
    return NOTHING if status & states.REMOTE else sentences.local_control()
