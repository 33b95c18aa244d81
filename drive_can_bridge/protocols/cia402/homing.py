# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``~/home``: into mode 6, start, wait, and back to the mode.

Each step is seen before the next one: a control word in an answered cycle, a mode in 6061h, the
end in the status word. Nothing arms meanwhile. Whatever stops the drive stops this too; the mode
is written back then as soon as the drive is disabled, and until that is acknowledged the drive is
not enabled: bit 4 of its own mode would start homing.

Bits of the homing before do not count, and a status may be :data:`.STATUS_LAG` answered cycles
behind its control word; a position, as many samples. So an end is seen as follows:

======== ==========================================================================================
error    bit 13 that was low, later than the status may be behind; or that still stands
         :data:`STILL` s behind the start
attained bit 12 that was low, later than the status may be behind; or, of a drive that is done at
         once, bits 12 and 10 that stand without 13 for a while, in which the position stays where
         it is, but for one change
======== ==========================================================================================
"""

from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlCompleted, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.protocols.cia402.node_set_up import POLL_PERIOD
from drive_can_bridge.protocols.cia402.standstill import Band, IN_A_ROW, LONG, place_of, STILL
from drive_can_bridge.protocols.cia402.state_machine import DriveRules
from drive_can_bridge.protocols.cia402.transactor import (
    ObjectRead, Procedure, SdoChannel, Transfer)
from drive_can_bridge.protocols.transactor import Refused

_DONE = states.BIT_12 | states.TARGET_REACHED
#: 6098h: the present position becomes the reference, and nothing moves
_ON_THE_SPOT = (b'\x23', b'\x25')     # 35, 37
#: of control_timeout: for so long, at least STILL, a drive stands that is done at once
_AT_ONCE = 0.25
#: samples behind the one that is latched
_LATCHING_SAMPLES = 3
#: periods that it takes at least to be seen standing: bit 4 falls, then five samples
_LATCHING_PERIODS = 6
#: s until a mode that the drive did not take is written again
_WRITE_AGAIN = 1.0


class HomingStep(Enum):
    """How far it has come."""

    NONE = 'not under way'
    LOWERING = 'before mode 6'
    ENTERING = 'changing to mode 6'
    RUNNING = 'on its way'
    LATCHING = 'behind its end'
    HOLDING = 'before going back to the mode'
    LEAVING = 'going back to the mode'


class Homing:
    """
    The homing of one drive.

    :param mode: number of the mode to go back to.
    :ivar not_back: that the drive does not take it; '' as far as is known.
    """

    def __init__(self, session: Session, machine: ControlMachine, rules: DriveRules,
                 channel: SdoChannel, mode: int) -> None:
        self._session, self._machine, self._rules = session, machine, rules
        self._channel, self._mode = channel, mode
        self._timeout: float = session.configuration.options.homing_timeout
        self._request: ControlRequest | None = None
        self._step = HomingStep.NONE
        self.due = math.inf
        self._standstill = rules.standstill
        self._latches = [Band(place_of(each.parameter, each.measured))
                         for each in session.setpoints.held]
        # samples in which axes stay in their bands; the oldest one is latched
        self._stay: deque[Sequence[int]] = deque(maxlen=_LATCHING_SAMPLES + 1)
        self._now = -math.inf           # of the last sample
        self._fresh = False
        self._on_the_spot = False
        self._answers, self._started_at = 0, -math.inf  # cycles answered behind the start
        self._no_error = self._lowered = False          # bits 13 and 12, seen low since
        self._done_since, self._done_in_a_row = math.inf, 0     # bits 12 and 10 without 13
        self._failure = self.not_back = NOTHING
        self._write_at = -math.inf      # the mode of a drive that was stopped

    @property
    def under_way(self) -> bool:
        """Nothing arms, and the mode is not the drive's own."""
        return self._step is not HomingStep.NONE

    def refusal(self) -> Sentence:
        """Return why it cannot begin now; '' if it can."""
        if self.under_way:
            return sentences.homing_under_way()
        if not self._machine.operating:
            return sentences.homing_needs_enabled()
        if any(each.armed and not each.parameter.limit for each in self._session.setpoints.items):
            return sentences.homing_needs_disarmed()
        return NOTHING

    def begin(self, request: ControlRequest, now: float) -> None:
        """Begin; answered by exactly one ``ControlCompleted``."""
        self._request, self._failure = request, NOTHING
        self._session.interlock.hold(True)
        self._rules.homing_bits = 0
        self.due = now + self._timeout
        self._go(HomingStep.LOWERING)

    def handle_timer(self, now: float) -> None:
        """End what lasts too long."""
        if now < self.due:
            return
        if self._step is not HomingStep.LATCHING:
            self._now = now
            self._end(sentences.homing_timed_out(self._timeout, self._step.value))
            return
        self.due = math.inf
        failure = together((
            self._failure, self._session.setpoints.untold_text or sentences.homing_moves_on()))
        self._machine.drop(failure)     # in its mode it would jump back
        self._answer(False, failure)
        self._session.control_changed(now)

    def stop(self) -> None:
        """Forget it: the channel was cleared, or the drive is lost."""
        if self.under_way:
            self._answer_stopped()
            self._finish()

    def sampled(self, status: int, raws: Sequence[int], now: float) -> None:
        """Go on by a sample, after its status word and what follows from that."""
        step, self._now = self._step, now
        if step is HomingStep.NONE:
            return
        if not self._machine.operating:
            self._interrupted(status)
            return
        behind = self._fresh and not self._machine.word_due
        self._fresh = not self._machine.word_due
        if step is HomingStep.LOWERING and behind:
            self._go(HomingStep.ENTERING)
            self._change(states.HOMING_MODE, self._entered)
        elif step is HomingStep.RUNNING and not self._machine.word_due:
            self._advance(status)
        elif step is HomingStep.LATCHING:
            self._latch(raws, behind)
        elif step is HomingStep.HOLDING and behind:
            self._go(HomingStep.LEAVING)
            self._change(self._mode, self._left)

    # -- steps ------------------------------------------------------------------------------------

    def _go(self, step: HomingStep) -> None:
        self._step, self._fresh = step, False

    def _advance(self, status: int) -> None:
        """Look for the end in a status behind the start."""
        self._answers += 1
        if self._answers == 1:
            self._started_at = self._now
        attained, failed = status & states.BIT_12, status & states.BIT_13
        if self._answers > states.STATUS_LAG:       # before, it may be that of the other mode
            self._no_error = self._no_error or not failed
            self._lowered = self._lowered or not attained
        done = status & _DONE == _DONE and not failed
        self._done_in_a_row = self._done_in_a_row + 1 if done else 0
        if failed and (self._no_error or self._now - self._started_at >= STILL):
            self._end(sentences.homing_failed())
        elif not done:
            self._standstill.end()
        elif self._lowered or self._done_at_once():
            self._end(NOTHING)

    def _done_at_once(self) -> bool:
        """Return whether it was done before that could be seen: its bits stand, and so does it."""
        if self._on_the_spot:
            return self._done_in_a_row >= IN_A_ROW
        band = self._standstill.band
        if self._done_in_a_row == 1 or band.left > 1 or band.creeps:
            self._standstill.begin(self._now)
            self._done_since = self._now
        duration = max(STILL, _AT_ONCE * self._session.configuration.control_timeout)
        return band.seen_at - self._done_since >= duration

    def _entered(self, failure: Sentence) -> None:
        if self._step is not HomingStep.ENTERING or failure and not self._machine.operating:
            return      # what was stopped meanwhile goes back with the next sample
        if failure:
            self._end(failure)
            return
        self._rules.homing_bits = states.START
        self._answers, self._no_error, self._lowered, self._done_in_a_row = 0, False, False, 0
        self._go(HomingStep.RUNNING)

    def _end(self, failure: Sentence) -> None:
        """Come to the end of the motion: bit 4 falls, and the position is latched again."""
        drive, self._failure = self._session.configuration, failure
        self.due = self._now + max(   # it may have to brake first
            drive.control_timeout + LONG, _LATCHING_PERIODS * drive.period)
        self._rules.homing_bits = 0
        self._stay.clear()
        self._standstill.begin(self._now)
        self._go(HomingStep.LATCHING)

    def _latch(self, raws: Sequence[int], behind: bool) -> None:
        """Latch where the axis is, as soon as it stands: unless it is homed, it has to brake."""
        setpoints = self._session.setpoints
        setpoints.measure(raws, driven=False)
        if not setpoints.known:     # a sample that was cut short says nothing
            return
        if not behind:
            return
        left = [band.left for band in self._latches]
        for band, each in zip(self._latches, setpoints.held):
            if not self._stay:
                band.begin()
            band.take(raws[each.place], self._now)
        if [band.left for band in self._latches] != left:
            self._stay.clear()
        self._stay.append(raws)
        # not by bit 10: with bit 4 low it says no more than that homing was ended
        if not setpoints.held or len(self._stay) == self._stay.maxlen and (
                not self._failure or self._standstill.stands):
            setpoints.measure(self._stay[0], driven=False)
            self._standstill.end()
            self.due = math.inf
            self._go(HomingStep.HOLDING)

    def _left(self, failure: Sentence) -> None:
        if self._step is not HomingStep.LEAVING:
            return
        told = failure or self._failure
        if failure and self._machine.operating:
            self._machine.drop(failure)     # in whatever mode it is, it is not driven
        elif failure:                       # it was stopped meanwhile
            self._answer_stopped()
        self._answer(not told, told or sentences.homed())
        if failure:
            self._go(HomingStep.HOLDING)
        else:
            self._finish()

    def _interrupted(self, status: int) -> None:
        """Go back to the mode of a drive that was stopped, as soon as it is disabled."""
        if self._request is not None:
            self._answer_stopped()
        self._rules.homing_bits = 0
        self.due = math.inf
        # a mode that changes now would change how the drive brakes
        if (states.state_of(status) not in states.MOVING and self._now >= self._write_at
                and self._step is not HomingStep.LEAVING):
            self._go(HomingStep.LEAVING)
            # it may show it when it is enabled
            self._channel.run(self._write(self._mode, self._session.retry.attempts),
                              self._written, self._now)

    @staticmethod
    def _write(mode: int, attempts: int = 1) -> Procedure[Sentence]:
        reply = yield Transfer(states.MODE, 0, mode.to_bytes(1, 'little'), attempts=attempts)
        return NOTHING if isinstance(reply, ObjectRead) else sentences.mode_refused(mode)

    def _written(self, failure: Sentence) -> None:
        if self._step is not HomingStep.LEAVING:
            return
        if not failure:
            self._finish()
            return
        if not self.not_back:
            self._session.report.note(Noted(failure, warning=True))
        self.not_back, self._write_at = failure, self._now + _WRITE_AGAIN
        self._go(HomingStep.HOLDING)

    def _change(self, mode: int, then: Callable[[Sentence], None]) -> None:
        step = self._step

        def look() -> Procedure[Sentence]:
            if failure := (yield from self._write(mode)):
                return failure
            until = self._channel.now + self._session.configuration.control_timeout
            while self._step is step and self._machine.operating and self._channel.now < until:
                shown = yield Transfer(states.MODE_SHOWN)
                if isinstance(shown, Refused) or isinstance(shown, ObjectRead) and (
                        shown.content[:1] == bytes((mode,))):
                    break
                yield Transfer(pause=POLL_PERIOD)
            else:
                return sentences.mode_refused(mode)
            if mode == states.HOMING_MODE:
                method = yield Transfer(states.HOMING_METHOD)
                self._on_the_spot = isinstance(method, ObjectRead) and (
                    method.content[:1] in _ON_THE_SPOT)
            return NOTHING
        # PDOs do not pass through the channel: its own time may be that of long ago
        self._channel.run(look(), then, self._now)

    def _answer_stopped(self) -> None:
        """Answer how far it came; the watch for faults adds which one it was that stopped it."""
        step = self._step.value
        self._answer(False, sentences.fault_while_homing(step) if self._machine.fault else
                     sentences.homing_stopped(step), by_fault=self._machine.fault)

    def _answer(self, success: bool, message: Sentence, *, by_fault: bool = False) -> None:
        request, self._request = self._request, None
        if request is not None:
            self._session.report.note(ControlCompleted(request, success, message, by_fault))

    def _finish(self) -> None:
        self._rules.homing_bits = None
        self.due, self._write_at, self.not_back = math.inf, -math.inf, NOTHING
        self._go(HomingStep.NONE)
        self._session.interlock.hold(False)
