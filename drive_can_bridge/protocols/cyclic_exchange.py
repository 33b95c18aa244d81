# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The exchange of protocols with a cyclic service: all setpoints and the control word, once a period.

A family says how its telegrams are encoded and sent, what an answer means, and when cycles begin;
here stands what every such session has to see to, and what is not answered in :mod:`.answers`:

* *The beat.* A cycle begins when its time has come. What has not been answered by then is missed.
* *What has left.* What the bus did not take counts for nothing: a cycle has been sent when all its
  frames have left.
* *The end.* The last cycles before silence are counted. Where a drive that ran has not shown that
  it heard one of those that stop it, an answer is waited for a moment, and then it gets more of
  them, until one is answered.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from functools import partial
import math
from typing import Generic, Protocol, TypeVar

from drive_can_bridge.compiled import mypyc_attr
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.outbox import Left
from drive_can_bridge.core.stop_duty import CYCLE, Happened
from drive_can_bridge.protocols.answers import CycleAnswers
from drive_can_bridge.protocols.exchange_book import CycleTimer

#: cyclic frames with neutral setpoints that are sent before a drive is left alone
STOP_CYCLES = 3
#: more of them for one that ran and has not shown that it heard one
MORE_CYCLES = 3
#: s that an answer to the cycles of a stop is waited for, where none has come
LAST_ANSWER = 0.1
#: s between a cycle and one that is brought forward because commands are too old
EXPIRY_SPACING = 0.05

TelegramT = TypeVar('TelegramT')


class CycleSender(Protocol[TelegramT]):
    """What a family does for its cycles: its session, or that of a group."""

    def encode_cycle(self, raws: list[int]) -> TelegramT:
        """
        Make a telegram.

        :param raws: of all setpoints, with the control word among them if it has its slot.
        """

    def send_cycle(self, telegram: TelegramT, now: float) -> None:
        """Hand out its frames, and say from whom an answer is expected."""

    def last_cycle_left(self, now: float) -> None:
        """Handle the last cycle before silence; that of a stop was answered or waited for."""


@mypyc_attr(native_class=False)
@dataclass(frozen=True)
class Cycle(Generic[TelegramT]):
    """
    What cycles hold until something changes.

    :ivar word: the control word, if there is one.
    :ivar runs: it is anything but neutral and ``disable``.
    """

    telegram: TelegramT
    word: int | None
    runs: bool


class Ending(Enum):
    """How far a stop has come."""

    LAST = 'its last cycles'
    WAITING = 'they have left, and an answer is waited for'
    MORE = 'more than a drive gets that answers'
    WAITING_LONGER = 'those have left as well'


class CyclicExchange(Generic[TelegramT]):
    """
    The cycles that command one drive, or several at once.

    :param answers: of that drive, or of the one whose session has the setpoints.
    :param slot: of the control word; None: it is not sent cyclically.
    :ivar audience: whom a whole cycle tells: the answers of this drive, and of others.
    :ivar timer: when the next cycle is due.
    :ivar cycles_left: still to be sent before silence; -1: no end is planned.
    :ivar again: this cycle follows one of which the bus has not taken everything.
    """

    def __init__(self, answers: CycleAnswers, sender: CycleSender[TelegramT], *,
                 slot: int | None) -> None:
        self.audience = [answers]
        self.timer: CycleTimer = answers.book.timer
        self.cycles_left = -1
        self.again = False
        self._answers, self._session, self._sender = answers, answers.session, sender
        self._slot = slot
        self._cycle: Cycle[TelegramT] | None = None
        self._raws: list[int] | None = None     # in it, until it has left
        self._frames_out = 0                    # of which nobody has said what became of them
        self._whole = True                      # the bus has taken all others of this cycle
        self._ending: Ending | None = None      # cycles go on, or run out for no stop

    @property
    def word(self) -> int | None:
        """The control word of the last cycle."""
        return None if self._cycle is None else self._cycle.word

    @property
    def runs(self) -> bool:
        """The last cycle holds anything but neutral and ``disable``."""
        return self._cycle is not None and self._cycle.runs

    @property
    def sending_more(self) -> bool:
        """More cycles of a stop are under way: the first were not all acknowledged."""
        return self._ending in (Ending.MORE, Ending.WAITING_LONGER)

    @property
    def _waiting(self) -> bool:
        """The last cycles have left, and an answer is waited for."""
        return self._ending in (Ending.WAITING, Ending.WAITING_LONGER)

    @property
    def cycling(self) -> bool:
        """Cycles are being sent."""
        return self.timer.due < math.inf

    @property
    def leaving(self) -> bool:
        """They are the last ones before silence."""
        return self.cycles_left >= 0 and self.timer.due < math.inf

    # -- the beat ---------------------------------------------------------------------------------

    @property
    def due(self) -> float:
        """When :meth:`handle_timer` has something to do."""
        due, expires_at = self.timer.due, self._session.setpoints.expires_at
        if expires_at < due:
            due = expires_at
        answer_due = self._answers.due
        return due if due < answer_due else answer_due

    def handle_timer(self, now: float) -> None:
        """Do what is due once a period. The fast path of the timer."""
        session, answers, timer = self._session, self._answers, self.timer
        if now < timer.due:
            answers.handle_timer(now)
            if self._expire(now) and session.setpoints.changed:
                # a drive has that long for its answer
                timer.no_later(max(now, timer.began_at + EXPIRY_SPACING))
            return
        if self._ending and self._waiting:
            self._send_more(now)
            if now < timer.due:     # that was all
                return
        if not answers.in_turn or now >= answers.due:
            self.settle(answers, now)
        if timer.due == math.inf:   # what was missed has ended the cycles
            return
        self._expire(now)
        control, cycle = session.control, self._cycle
        if (session.setpoints.changed or cycle is None
                or control is not None and control.word != cycle.word):
            cycle = self._cycle = self._make()
        answers.book.begin(now, timer.stop_spacing if self.cycles_left >= 0 else None)
        self._frames_out = 0
        self.again, self._whole = not self._whole, True
        self._sender.send_cycle(cycle.telegram, now)

    def _expire(self, now: float) -> bool:
        """Make setpoints neutral that no fresh command keeps; return whether there were any."""
        expired = self._session.interlock.expire(now)
        if expired:
            self._session.commands_expired(now)
        return expired

    def settle(self, answers: CycleAnswers, now: float) -> None:
        """
        Close the exchange with one drive, before the next one begins.

        Exchanges of a stop follow each other closely.
        """
        answers.settle(now, early=self.cycles_left < 0 and answers.book.early(now))

    def start(self, now: float, *, in_turn: bool = False) -> None:
        """
        Schedule the first cycle, a period after the last one at least.

        :param in_turn: it waits for the turn of this drive, if it has one.
        """
        self._plan(-1)
        self._answers.forget()
        period, phase = self._session.configuration.period, self._session.phase
        first = max(now, self.timer.began_at + period)
        if in_turn and phase is not None:
            first += (phase - first) % period
        self.timer.start(first)

    def stop(self) -> None:
        """Send nothing more, and expect no answer; one on its way is no surprise, though."""
        self._plan(-1)
        self.timer.stop()
        self._answers.stop()

    def hurry(self, now: float, *, setpoints: bool) -> None:
        """
        Bring the next cycle forward where it stops the drive.

        :param setpoints: it does so, too, where only they have changed.
        """
        control = self._session.control
        if control is not None and control.stopping and not self._ending and (
                self._slot is not None and control.word != self.word
                or setpoints and self._session.setpoints.changed):
            self.timer.hurry(now)

    def hand_out_neutral(self, now: float) -> None:
        """Bring the next cycle forward: only its answer acknowledges the stop."""
        self._answers.book.invalidate()
        self.timer.hurry(now)

    # -- sending ----------------------------------------------------------------------------------

    def put(self, frame: Frame, *to: CycleAnswers) -> None:
        """
        Hand out a frame of the cycle that has begun.

        :param to: whose drives it may start, where that is not only this one.
        """
        self._frames_out += 1
        self._session.outbox.put(frame, partial(self._left, to) if to else self._alone_left)

    def expect_answer(self, now: float, until: float = math.inf) -> None:
        """
        Record that the drive itself was sent the cycle.

        :param until: when the answer counts as missed; infinity: with the next cycle.
        """
        self._answers.expect(now, until, runs=self.runs)

    def await_frame(self) -> Left:
        """Count a frame that another object sends; return what to call when it has left."""
        self._frames_out += 1
        return self._alone_left

    def _alone_left(self, sent: bool, now: float) -> None:
        self._left((self._answers,), sent, now)

    def _make(self) -> Cycle[TelegramT]:
        session, word = self._session, None
        raws = [setpoint.raw for setpoint in session.setpoints.items]
        runs, control = not session.setpoints.at_rest, session.control
        if control is not None:
            word = control.word
            if self._slot is not None:
                raws.insert(self._slot, word)
                runs = runs or not control.at_rest
        session.setpoints.changed = False
        self._raws = raws
        return Cycle(self._sender.encode_cycle(raws), word, runs)

    def _left(self, to: Iterable[CycleAnswers], sent: bool, now: float) -> None:
        """
        Record a frame.

        One that may start somebody counts even alone; otherwise a cycle counts only when the bus
        has taken every frame of it.
        """
        session, runs = self._session, self.runs
        self._frames_out -= 1
        if not sent:
            self._whole = False
        elif runs:
            for each in to:
                each.book.invalidate()   # also of those who are not asked by it
                each.session.duty.channel(CYCLE, Happened.RUN_LEFT)
        if self._frames_out or not self._whole:
            return
        if not runs:
            for each in self.audience:
                each.session.duty.channel(CYCLE, Happened.STOP_LEFT)
            session.neutral_stop.all_left()
        if self._raws is not None:      # the first time that it left
            session.sent.take(self._raws)
            self._raws = None
        control = session.control
        if control is not None and self._slot is not None and control.word == self.word:
            fresh = control.word_due    # else it has changed since, or the drive was lost
            control.word_sent(now)
            if fresh or control.word != self.word:
                session.control_changed(now)
            if control.pulsing:
                self.timer.no_later(now + self.timer.stop_spacing)
        if self.cycles_left > 0:
            self.cycles_left -= 1
            if self.cycles_left == 0:
                self._last_left(now)

    # -- the end ----------------------------------------------------------------------------------

    @property
    def longest_stop(self) -> float:
        """How many s the last cycles before silence take at most."""
        return (STOP_CYCLES + MORE_CYCLES) * self.timer.stop_spacing + 2 * LAST_ANSWER

    def stop_soon(self, now: float) -> None:
        """Schedule the last cycles before silence, soon."""
        soon = max(now, self.timer.began_at + self.timer.stop_spacing)
        if self.timer.due < math.inf:
            self._plan(STOP_CYCLES)
            self.timer.no_later(soon)
        else:   # those of a stop before this one have left, what goes by writes is under way
            self.run_out(soon)
        self._ending = Ending.LAST
        self._answers.book.invalidate()      # one of these is to be answered
        self.timer.hurry(now)

    def run_out(self, first: float) -> None:
        """Send the last cycles before silence, beginning then."""
        self._plan(STOP_CYCLES)
        self.timer.start(first)

    def _plan(self, cycles_left: int) -> None:
        self.cycles_left, self._ending = cycles_left, None

    def _last_left(self, now: float) -> None:
        """End the stop, at once or when a drive has answered."""
        if self._ending and self._unacknowledged:
            self._ending = Ending.WAITING_LONGER if self.sending_more else Ending.WAITING
            self.timer.start(now + LAST_ANSWER)
        else:
            self._sender.last_cycle_left(now)

    def _send_more(self, now: float) -> None:
        """Send more cycles to those that have not acknowledged one; end it, if there are none."""
        if self.sending_more or not self._unacknowledged:
            self._end(now)
            return
        self._ending, self.cycles_left = Ending.MORE, MORE_CYCLES
        if self._session.configuration.period <= LAST_ANSWER:   # late answers have come by now
            for each in self.audience:      # or are held; the last cycle is to show the stop
                each.book.give_up(MORE_CYCLES - 1)

    def wait_out(self, now: float) -> None:
        """Come to the end of a stop that only waits for an answer, if that came."""
        if self._ending and self._ending is not Ending.LAST and not self._unacknowledged:
            self._end(now)

    def _end(self, now: float) -> None:
        self._ending, self.cycles_left = Ending.LAST, 0
        self._sender.last_cycle_left(now)

    def end_stop(self) -> None:
        """End the stop of all: nothing more is sent."""
        self.mark_silent()
        for each in self.audience:
            if not each.session.stopped:
                each.session.stop_left()

    @property
    def _unacknowledged(self) -> bool:
        """Whether a drive that ran has not acknowledged any of the last cycles."""
        return any(each.session.unacknowledged for each in self.audience)

    def mark_silent(self) -> None:
        """Record which drives ran and have answered none of the last cycles."""
        for each in self.audience:
            if each.session.unacknowledged:
                each.session.duty.happened(Happened.SILENT)
