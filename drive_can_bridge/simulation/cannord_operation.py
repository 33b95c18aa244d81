# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The state machine of a simulated NORD inverter: control words in, states out.

.. code-block:: text

    power on ──► switch-on disabled ──b0=0──► ready to switch on ──b0=1──► switched on
                  ▲  ▲  ▲                        ▲      │  ▲                 │    ▲
                  │  │  │          standstill    │      │  └──────b0=0───────┘    │ b3=0
                  │  │  └─ b1=0 or               │  b0=1, b3=1                b3=1│
                  │  │     b2=0 anywhere else    │      ▼                    ▼    │
                  │  └── standstill ── quick stop ◄─b2=0── operation enabled ─────┘
                  └── b7 0→1, cause gone ── fault ◄── trip, from any state

(``b0=0`` of an enabled inverter ramps down first, "standstill" on the way to ready.) A word with
b10 = 0 is ignored as a whole. Sources: BU 0050 page 30 (bits) and page 38 (states); where the two
differ, on what b3 = 0 leads to, page 38 counts.
"""

import math

from drive_can_bridge.protocols.cannord import states
from drive_can_bridge.protocols.cannord.states import State
from drive_can_bridge.simulation.control import Operation

#: status bits of a state: of the two that stand for OFF2 and OFF3 see :attr:`~.status`
_STATUS = {
    State.SWITCH_ON_DISABLED: 0x40,
    State.READY_TO_SWITCH_ON: 0x31,
    State.SWITCHED_ON: 0x33,
    State.OPERATION_ENABLED: 0x37,
    State.QUICK_STOP: 0x17,
    State.FAULT: 0x08,
}
#: OFF2 and OFF3 in the control word, and how far on they stand in the status word
_OFF = states.NO_DISABLE_VOLTAGE | states.NO_QUICK_STOP
_OFF_SHIFT = 3
#: the parameter set, in both
_SET = states.PARAMETER_SETS - 1 << states.PARAMETER_SET_SHIFT


class InverterOperation(Operation):
    """
    The operating state of one simulated inverter.

    :ivar state: never "not ready" or "fault reaction": both would be over at once.
    :ivar word: the last control word with valid data.
    """

    def __init__(self) -> None:
        super().__init__(None)

    def power_on(self) -> None:
        self.word = _OFF
        self._cause_ends = -math.inf
        self._enter(State.SWITCH_ON_DISABLED)

    def word_written(self, word: int, now: float) -> None:
        if not word & states.DATA_VALID:
            return
        rising = word & ~self.word & states.FAULT_RESET
        self.word = word
        if self.state is State.FAULT:
            if rising and self.reset_allowed(now):
                self._enter(State.SWITCH_ON_DISABLED)
        else:
            self._enter(self._after(word))

    def trip(self, now: float, duration: float = 0.0) -> None:
        self._cause_ends = now + duration
        self._enter(State.FAULT)

    def repair(self) -> None:
        if self.state is State.FAULT:
            self._enter(State.SWITCH_ON_DISABLED)

    def standstill(self) -> None:
        """Take note that the motor has stopped: the end of a quick stop, or of a shutdown."""
        if self.state is State.QUICK_STOP:
            self._enter(State.SWITCH_ON_DISABLED)
        elif self.shutting_down:
            self._enter(State.READY_TO_SWITCH_ON)

    @property
    def shutting_down(self) -> bool:
        """On the ramp to zero, because bit 0 was taken away from an enabled inverter."""
        return self.state is State.OPERATION_ENABLED and not self.word & states.SWITCH_ON

    @property
    def setpoint_counts(self) -> bool:
        """The ramp goes to the setpoint, not to zero."""
        return bool(self.word & states.ENABLE_SETPOINT) and not self.shutting_down

    @property
    def frozen(self) -> bool:
        """The ramp stands where it is."""
        return (self.state is State.OPERATION_ENABLED and not self.shutting_down
                and not self.word & states.RELEASE_RAMP)

    @property
    def reversed(self) -> bool:
        """The setpoint changes its sign; rotation right has priority."""
        return bool(self.word & states.ROTATE_LEFT) and not self.word & states.ROTATE_RIGHT

    @property
    def parameter_set(self) -> int:
        return states.parameter_set_of(self.word)

    @property
    def status(self) -> int:
        """Bits 0 to 6 of the status word, and the parameter set."""
        bits = _STATUS[self.state] | self.word & _SET
        if self.state in (State.SWITCH_ON_DISABLED, State.FAULT):
            bits |= (self.word & _OFF) << _OFF_SHIFT
        return bits

    def _after(self, word: int) -> State:
        """Return the state that a control word leads to; the first rule that applies wins."""
        state = self.state
        if not word & states.NO_DISABLE_VOLTAGE:
            return State.SWITCH_ON_DISABLED
        if state is State.QUICK_STOP:
            return state            # ends at standstill only
        if not word & states.NO_QUICK_STOP:
            enabled = state is State.OPERATION_ENABLED
            return State.QUICK_STOP if enabled else State.SWITCH_ON_DISABLED
        if not word & states.SWITCH_ON:
            # an enabled inverter ramps down first
            return state if state is State.OPERATION_ENABLED else State.READY_TO_SWITCH_ON
        if state is State.SWITCH_ON_DISABLED:
            return state            # left with bit 0 = 0 only
        if word & states.ENABLE_OPERATION:
            return State.OPERATION_ENABLED
        return State.SWITCHED_ON

    def _enter(self, state: State) -> None:
        self.state = state
        self.faulted = state is State.FAULT
        self.enabled = state in (State.OPERATION_ENABLED, State.QUICK_STOP)
        # b4 = 0 uses the quick stop ramp, too, but leaves the inverter enabled
        self.stopping = state is State.QUICK_STOP or (
            state is State.OPERATION_ENABLED and not self.word & states.ENABLE_RAMP)
