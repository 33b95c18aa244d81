# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The control word of a drive that does not get it cyclically, or does not answer cyclically.

The control word is written when it changes, before everything else that waits; one that stops the
drive waits for nothing at all. Nothing acknowledges that: as long as the status says that the
drive takes no notice, the word is written again, less and less often. Where that wears an
EEPROM (or may), only a drive that runs on although it shall not gets its word again, a few times.
A pulse is written as often as it has to leave.
The status word is read twice a second, and twenty times while a request is under way. What has its
slot in the cyclic telegrams is none of this module's business. When a word is written again, says
:mod:`..acyclic_output`.
"""

import math

from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.stop_duty import CONTROL_WORD, Happened
from drive_can_bridge.protocols.acyclic_output import AcyclicOutput
from drive_can_bridge.protocols.datamodel.channel import (
    AcyclicChannel, ParameterCourier, Procedure,
)
from drive_can_bridge.protocols.datamodel.numbers import Numbers

#: s between two looks at the status word, while a request is under way and otherwise
STATUS_PERIOD_PENDING = 0.05
STATUS_PERIOD = 0.5
#: s until a word that the bus refused is written again
REFUSED_PAUSE = 0.02


class AcyclicControl:
    """
    Control by acyclic frames, of a session that has control.

    :param word: parameter of the control word; None: it is sent cyclically.
    :param status: parameter of the status word; None: it comes cyclically, or there is none.
    """

    def __init__(self, session: Session, control: ControlMachine, channel: AcyclicChannel,
                 courier: ParameterCourier, numbers: Numbers, output: AcyclicOutput, *,
                 word: Parameter | None, status: Parameter | None) -> None:
        self._look_at = math.inf    # when the status word is to be read
        self._session = session
        self._control = control
        self._channel = channel
        self._courier = courier
        self._word = word
        self._status = status
        self._numbers = numbers
        self._output = output
        self._reading = False
        self._outdated = False  # what is being read was asked before the word left
        self._watching = False

    def begin(self, now: float) -> None:
        """Handle a drive that was found: it gets its word, and its status is looked at."""
        self._output.forget_word()
        self._watching = True
        if self._status is not None:
            self._look_at = now

    def end(self) -> None:
        """Leave the status of a lost drive alone."""
        self._watching = False
        self._look_at = math.inf
        if self._word is not None:
            self._output.again_at = math.inf

    def stop(self) -> None:
        """Plan nothing any more. The channel was cleared."""
        self.end()
        self._reading = False

    def update(self, now: float) -> None:
        """Write the control word if it changed, or if the drive takes no notice of it."""
        word, output = self._control.word, self._output
        if self._word is None or word == output.word and not output.word_due(now):
            return
        output.word_begun(word)
        write = (self._courier.write_now if self._control.stopping
                 else self._courier.write_first)
        runs = not self._control.at_rest
        write(self._numbers.write(self._word, word),
              lambda sent, then: self._left(word, sent, then, runs=runs), now)
        if self._watching and self._status is not None:
            self._look_at = now

    def next_timer(self) -> float:
        """Return when the status is to be looked at, or a word to be written again."""
        if self._word is None:
            return self._look_at
        return min(self._look_at, self._output.next_timer())

    def handle_timer(self, now: float) -> None:
        """Do what is due."""
        if now >= self._look_at:
            self._look(now)
        if self._word is not None and self._output.handle_timer(now):
            self._session.see_to_control_word(now)

    # -- inside -----------------------------------------------------------------------------------

    def _look(self, now: float) -> None:
        """Read the status word, unless that is under way."""
        self._look_at = math.inf
        if self._status is not None and not self._reading:
            self._reading = True
            self._outdated = False
            self._channel.run(self._read(self._status), self._received, now)

    def _left(self, word: int, sent: bool, now: float, *, runs: bool) -> None:
        if not sent:
            self._output.word_refused(word, now + REFUSED_PAUSE)
            return
        self._session.duty.channel(
            CONTROL_WORD, Happened.RUN_LEFT if runs else Happened.STOP_LEFT)
        self._outdated = self._reading
        # of a drive that is lost, others see to the stop
        self._output.word_left(now, word, again=self._watching)
        self._session.control_changed(now)

    def _read(self, status: Parameter) -> Procedure:
        words = yield self._numbers.read(status)
        return None if words is None else status.raw_from_word(words[0])

    def _received(self, raw: int | None) -> None:
        now = self._channel.now
        self._reading = False
        if not self._watching:
            return
        if not self._outdated:
            self._session.gate.status(raw, now)
            self._session.control_changed(now)
        self._look_at = now if self._outdated else min(self._look_at, now + (
            STATUS_PERIOD_PENDING if self._control.pending else STATUS_PERIOD))
