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
             quick stop active       0002h; once it stands and stays there, 0000h
             anything else           0006h; with ``disable_voltage`` 0000h, unless it is to be
                                     enabled
quick stop   anything                0002h
reset fault  anything                0080h
============ ======================= ============================================================

A drive that was sent 000Fh counts as enabled until a status behind a later word says otherwise,
and one that was sent 0002h gets no other word until a status behind that was seen: what is on its
way tells of older times, and 0006h or 0007h in the middle of a quick stop would end its braking.
"""

from typing import Any, Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlAction, TableRules
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.profile import ControlTable, StatusPattern
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.protocols.cia402.states import PATTERNS, State

DISABLE_WORDS = {'disable_operation': states.SWITCH_ON, 'shutdown': states.SHUTDOWN,
                 'disable_voltage': states.DISABLE_VOLTAGE}
#: 605Ah: the drive stays in quick stop active
_STAYS = range(5, 9)
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
        status_parameter=states.STATUS_NAME,
        ready=StatusPattern(*PATTERNS[State.READY_TO_SWITCH_ON]),
        enabled=StatusPattern(*PATTERNS[State.OPERATION_ENABLED]),
        fault=StatusPattern(states.FAULT_BIT, states.FAULT_BIT), running=_RUNNING,
        reaction=StatusPattern(*PATTERNS[State.FAULT_REACTION]),
        braking=StatusPattern(*PATTERNS[State.QUICK_STOP_ACTIVE]))


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
    :ivar state: the newest one; None: not known.
    :ivar status: the word that told it; 0: not known.
    :ivar quick_stop_option: 605Ah; None: the drive has none.
    :ivar velocity_zero: 606Ch said so in *quick stop active*.
    :ivar waited_out: nothing says whether it stands there, and it had its time to. That is enough
        for what users ask for, and says nothing else.
    :ivar mode_bits: what the mode adds to the enable word once the drive is enabled.
    :ivar homing_bits: what is sent beside 000Fh in mode 6; None: the drive is in its own mode.
    :ivar halted: the drive was told to halt: its position is its own.
    """

    def __init__(self, table: ControlTable, options: Any, known: Known) -> None:
        super().__init__(table)
        self.state: State | None = None
        self.status = 0
        self.quick_stop_option: int | None = None
        self.velocity_zero = self.waited_out = False
        self.mode_bits = states.INTERPOLATE if options.mode == 'ip' else 0
        self.homing_bits: int | None = None
        self.halted = False
        self._else_known = known
        self._disable_word = DISABLE_WORDS[options.disable_word]
        self._enable_word = states.ENABLE | (
            states.RAMP_BITS if options.mode == 'vl' and options.ramp_bits else 0)
        self._may_be_enabled = self._quick_stop_unseen = False
        self._still_enabled = False     # by the status behind 0002h, which may be one of before
        self._last = 0

    def word(self, sending: ControlAction, *, asked: ControlAction | None) -> int:
        if sending is ControlAction.DISABLE:
            return self._disabling(asked)
        if sending is ControlAction.ENABLE:
            return self._enabling()
        return super().word(sending, asked=asked)

    def _disabling(self, asked: ControlAction | None) -> int:
        if self._quick_stop_unseen:
            return states.QUICK_STOP
        if self.state is State.QUICK_STOP_ACTIVE:
            ends = self.stays and (self.stands or self.waited_out and asked is not None)
            return states.DISABLE_VOLTAGE if ends else states.QUICK_STOP
        if self._may_be_enabled or self.state in (None, State.OPERATION_ENABLED):
            return self._disable_word
        if self._disable_word == states.DISABLE_VOLTAGE and asked is not ControlAction.ENABLE:
            return states.DISABLE_VOLTAGE
        return states.SHUTDOWN

    def _enabling(self) -> int:
        if self.homing_bits is not None:
            if self._last & _ENABLE_OPERATION:
                # what was halted stays so until homing starts: its old target is still there
                return states.ENABLE | (self.homing_bits or self.mode_bits & states.HALT)
            if self.state is State.SWITCHED_ON:     # until it is back in its mode
                return states.SWITCH_ON
        if self.state is State.OPERATION_ENABLED:
            return self._enable_word | self.mode_bits
        if self.state is State.SWITCHED_ON:
            return states.SWITCH_ON if self._else_known.unready else self._enable_word
        return states.SWITCH_ON if self.state is State.READY_TO_SWITCH_ON else states.SHUTDOWN

    def rests(self, word: int) -> bool:
        return not word & (_ENABLE_OPERATION | states.FAULT_RESET) and word != states.QUICK_STOP

    def left(self, word: int) -> None:
        self._still_enabled = self._still_enabled and word == self._last
        self._last = word
        if word & _ENABLE_OPERATION:
            self._may_be_enabled = True
        elif word == states.QUICK_STOP:
            self._quick_stop_unseen = True

    def reported(self, raw: int, *, behind: bool) -> None:
        self.status = raw
        before, self.state = self.state, states.state_of(raw)
        if self.state is not before:
            self.velocity_zero = self.waited_out = False
        if not behind:
            return
        if self._last == states.QUICK_STOP:
            # it may have been sampled, or on its way, before: a second one was not
            enabled = self.state is State.OPERATION_ENABLED
            self._quick_stop_unseen = enabled and not self._still_enabled
            self._still_enabled = enabled
        if not self._last & _ENABLE_OPERATION and self.state is not State.OPERATION_ENABLED:
            self._may_be_enabled = False

    def forget(self) -> None:
        self.state, self.status = None, 0
        self.velocity_zero = self.waited_out = self.halted = False
        self._quick_stop_unseen, self._still_enabled = self._last == states.QUICK_STOP, False

    def known_disabled(self) -> None:
        """Record that the drive was asked by SDO, and is not enabled."""
        self._may_be_enabled = self._quick_stop_unseen = False
        self._last = 0

    @property
    def stays(self) -> bool:
        """A quick stop does not end by itself."""
        return self.quick_stop_option in _STAYS

    @property
    def stands(self) -> bool:
        """A drive in *quick stop active* says that it stands."""
        return bool(self.status & states.TARGET_REACHED) or self.velocity_zero

    @property
    def holds(self) -> Sentence:
        if self.state is State.QUICK_STOP_ACTIVE and self.stays and self.stands:
            return sentences.quick_stop_holds(State.QUICK_STOP_ACTIVE.value)
        return NOTHING

    @property
    def lacking(self) -> Sentence:
        return self._else_known.mode_lacking

    @property
    def loose(self) -> bool:
        return self.halted

    def remark(self, sending: ControlAction) -> Sentence:
        if sending is ControlAction.ENABLE or self.state not in (
                State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE):
            return together((
                sentences.word_sent_last(self._last), self.lacking, self._else_known.why))
        return sentences.still_braking()


def hint(status: int) -> Sentence:
    """Say what a status word tells about why a drive does not go on; '' for nothing."""
    if status & states.FAULT_BIT or states.state_of(status) in (
            State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE):
        return NOTHING
    if not status & states.VOLTAGE_ENABLED:
        return sentences.voltage_disabled()
    return NOTHING if status & states.REMOTE else sentences.local_control()
