# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
``~/home``: into mode 6, start, wait, and back to the mode.

Each step is seen before the next one: a control word in an answered cycle, a mode in 6061h, the
end in the status word. Nothing arms meanwhile. Whatever stops the drive stops this too; the mode
is written back then as soon as the drive is disabled, and until that is acknowledged the drive is
not enabled: bit 4 of its own mode would start homing.
"""

from collections.abc import Callable, Generator, Sequence
from enum import Enum
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control import ControlCompleted, ControlRequest
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.events import Noted
from drive_can_bridge.core.messages import NOTHING, Sentence, together
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.protocols.cia402.bring_up import LOOK_PERIOD
from drive_can_bridge.protocols.cia402.channel import Ask, Reply, SdoChannel
from drive_can_bridge.protocols.cia402.control import DriveRules
from drive_can_bridge.protocols.cia402.states import State

#: a mode that changes now would change how the drive brakes
_MOVING = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION)
_DONE = states.BIT_12 | states.TARGET_REACHED
#: s within arming_tolerance that are *it stands*, where 606Ch is 0, or the drive has none
_STILL = 0.1
#: likewise where it says otherwise, which may be noise: so much of control_timeout
_STILL_ANYWAY = 0.5
#: periods that it takes at least to be seen standing: bit 4 falls, then four samples
_LATCHING_PERIODS = 5
#: s until a mode that the drive did not take is written again
_WRITE_AGAIN = 1.0


class Step(Enum):
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
        self._step = Step.NONE
        self._deadline = math.inf
        self._stay: list[int] = []      # where held axes are, and since when
        self._since = -math.inf
        self._looking = self._no_velocity = False       # 606Ch says so, or nothing
        self._now = -math.inf           # of the last sample
        self._fresh = self._lowered = False
        self._failure = self.not_back = NOTHING
        self._write_at = -math.inf      # the mode of a drive that was stopped

    @property
    def under_way(self) -> bool:
        """Nothing arms, and the mode is not the drive's own."""
        return self._step is not Step.NONE

    def refusal(self) -> Sentence:
        """Say why it cannot begin now; '' if it can."""
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
        self._deadline = now + self._timeout
        self._go(Step.LOWERING)

    def next_timer(self) -> float:
        """Return when it has lasted too long."""
        return self._deadline

    def handle_timer(self, now: float) -> None:
        """End what lasts too long."""
        if now < self._deadline:
            return
        if self._step is not Step.LATCHING:
            self._now = now
            self._end(sentences.homing_timed_out(self._timeout, self._step.value))
            return
        self._deadline = math.inf
        failure = together((
            self._failure, self._session.setpoints.untold_text or sentences.homing_moves_on()))
        self._machine.drop(failure)     # in its mode it would jump back
        self._answer(False, failure)
        self._session.control_changed(now)

    def stop(self) -> None:
        """Forget it: the channel was cleared, or the drive is lost."""
        if self.under_way:
            self._answer(False, self._stopped())
            self._finish()

    def sampled(self, status: int, raws: Sequence[int], now: float) -> None:
        """Take a sample, after its status word and what follows from that."""
        step, self._now = self._step, now
        if step is Step.NONE:
            return
        if not self._machine.operating:
            self._interrupted(status)
            return
        behind = self._fresh and not self._machine.word_due
        self._fresh = not self._machine.word_due
        if step is Step.LOWERING and behind:
            self._go(Step.ENTERING)
            self._change(states.HOMING_MODE, self._entered)
        elif step is Step.RUNNING:
            self._look(status, behind)
        elif step is Step.LATCHING:
            self._latch(raws, behind)
        elif step is Step.HOLDING and behind:
            self._go(Step.LEAVING)
            self._change(self._mode, self._left)

    # -- steps ------------------------------------------------------------------------------------

    def _go(self, step: Step) -> None:
        self._step, self._fresh = step, False

    def _look(self, status: int, behind: bool) -> None:
        if not status & states.BIT_12:
            self._lowered = True
        if not behind:
            return
        if status & states.BIT_13:
            self._end(sentences.homing_failed())
        elif self._lowered and status & _DONE == _DONE:
            self._end(NOTHING)

    def _entered(self, failure: Sentence) -> None:
        if self._step is not Step.ENTERING or failure and not self._machine.operating:
            return      # what was stopped meanwhile goes back with the next sample
        if failure:
            self._end(failure)
            return
        self._lowered = False       # what bit 12 was before, it was in another mode
        self._rules.homing_bits = states.START
        self._go(Step.RUNNING)

    def _end(self, failure: Sentence) -> None:
        """Come to the end of the motion: bit 4 falls, and the position is latched anew."""
        drive, self._failure = self._session.configuration, failure
        self._deadline = self._now + max(
            drive.control_timeout, _LATCHING_PERIODS * drive.period)
        self._rules.homing_bits = 0
        self._stay, self._looking, self._no_velocity = [], False, False
        self._go(Step.LATCHING)

    def _latch(self, raws: Sequence[int], behind: bool) -> None:
        """Take where the axis is, as soon as it stands: unless it is homed, it has to brake."""
        setpoints = self._session.setpoints
        setpoints.measure(raws, driven=False)
        if not setpoints.known:     # a sample that was cut short says nothing
            return
        where = [each.neutral for each in setpoints.held]
        if not behind or not self._stay or any(
                abs(position - stay) * abs(each.parameter.scale) > each.parameter.arming_tolerance
                for position, stay, each in zip(where, self._stay, setpoints.held)):
            self._stay, self._since, self._no_velocity = where, self._now, False
        still = self._now - self._since
        # not by bit 10: with bit 4 low it says no more than that homing was ended
        stands = self._no_velocity and still >= _STILL or (
            still >= _STILL_ANYWAY * self._session.configuration.control_timeout)
        if not self._failure or (stands if where else behind):
            self._deadline = math.inf
            self._go(Step.HOLDING)
        elif where and still >= _STILL and not self._looking:
            self._looking = True
            self._channel.run(self._look_at_velocity(), self._looked, self._now)

    def _look_at_velocity(self) -> Generator[Ask, Reply, bool]:
        """Return whether 606Ch is 0, or the drive has none."""
        reply = yield Ask(states.VELOCITY, attempts=1)
        if reply.abort is not None or reply.data is not None and not any(reply.data):
            return True
        yield Ask(pause=LOOK_PERIOD)
        return False

    def _looked(self, no_velocity: bool) -> None:
        self._looking, self._no_velocity = False, no_velocity

    def _left(self, failure: Sentence) -> None:
        if self._step is not Step.LEAVING:
            return
        told = failure or self._failure
        if failure and self._machine.operating:
            self._machine.drop(failure)     # in whatever mode it is, it is not driven
        elif failure:                       # it was stopped meanwhile
            told = self._stopped()
        self._answer(not told, told or sentences.homed())
        if failure:
            self._go(Step.HOLDING)
        else:
            self._finish()

    def _interrupted(self, status: int) -> None:
        """Go back to the mode of a drive that was stopped, as soon as it is disabled."""
        if self._request is not None:
            self._answer(False, self._stopped())
        self._rules.homing_bits = 0
        self._deadline = math.inf
        if states.state_of(status) not in _MOVING and self._step is not Step.LEAVING and (
                self._now >= self._write_at):
            self._go(Step.LEAVING)
            # it may show it when it is enabled
            self._channel.run(self._write(self._mode, self._session.retry.attempts),
                              self._written, self._now)

    @staticmethod
    def _write(mode: int, attempts: int = 1) -> Generator[Ask, Reply, Sentence]:
        reply = yield Ask(states.MODE, 0, mode.to_bytes(1, 'little'), attempts=attempts)
        return NOTHING if reply.data is not None else sentences.mode_refused(mode)

    def _written(self, failure: Sentence) -> None:
        if self._step is not Step.LEAVING:
            return
        if not failure:
            self._finish()
            return
        if not self.not_back:
            self._session.report.note(Noted(failure, warning=True))
        self.not_back, self._write_at = failure, self._now + _WRITE_AGAIN
        self._go(Step.HOLDING)

    def _change(self, mode: int, then: Callable[[Sentence], None]) -> None:
        step = self._step

        def look() -> Generator[Ask, Reply, Sentence]:
            if failure := (yield from self._write(mode)):
                return failure
            until = self._channel.now + self._session.configuration.control_timeout
            while self._step is step and self._machine.operating and self._channel.now < until:
                shown = yield Ask(states.MODE_SHOWN)
                if shown.abort is not None or shown.data and shown.data[0] == mode:
                    return NOTHING
                yield Ask(pause=LOOK_PERIOD)
            return sentences.mode_refused(mode)
        # PDOs do not pass through the channel: its own time may be that of long ago
        self._channel.run(look(), then, self._now)

    def _stopped(self) -> Sentence:
        """Say how far it came; the watch for faults adds which one it was that stopped it."""
        step = self._step.value
        return (sentences.fault_while_homing(step) if self._machine.fault else
                sentences.homing_stopped(step))

    def _answer(self, success: bool, message: Sentence) -> None:
        request, self._request = self._request, None
        if request is not None:
            self._session.report.note(ControlCompleted(request, success, message))

    def _finish(self) -> None:
        self._rules.homing_bits = None
        self._deadline, self._write_at, self.not_back = math.inf, -math.inf, NOTHING
        self._go(Step.NONE)
        self._session.interlock.hold(False)
