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

from collections.abc import Callable, Iterable
from functools import partial
import math
from typing import Generic, TypeVar

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.outbox import Left
from drive_can_bridge.core.sentences import Sentence
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.stop_duty import CYCLE, Happened
from drive_can_bridge.protocols.answers import Answers
from drive_can_bridge.protocols.cycle_timer import CycleTimer

#: cyclic frames with neutral setpoints that are sent before a drive is left alone
STOP_CYCLES = 3
#: more of them for one that ran and has not shown that it heard one
MORE_CYCLES = 3
#: s that an answer to the cycles of a stop is waited for, where none has come
LAST_ANSWER = 0.1
#: s between a cycle and one that is brought forward because commands are too old
EXPIRY_SPACING = 0.05

TelegramT = TypeVar('TelegramT')


class CyclicExchange(Answers, Generic[TelegramT]):
    """
    The cycles that tell one drive, or several at once, and the answers of the first of them.

    :param encode: makes a telegram of the raw integers of all setpoints, with the control word
        among them if it has its slot.
    :param send: (telegram, now): hands out its frames (:meth:`put`), and says from whom an answer
        is expected (:meth:`expect_answer`).
    :param slot: of the control word; None: it is not sent cyclically.
    :param ended: (now): called when the last cycle before silence has left, and that of a stop was
        answered or waited for; None: that ends the stop.
    :param silence: this and what follows are those of :class:`.Answers`.
    :ivar audience: whom a whole cycle tells: the answers of this drive, and of others.
    :ivar timer: when the next cycle is due.
    :ivar word: the control word of the last cycle.
    :ivar cycles_left: still to be sent before silence; -1: no end is planned.
    :ivar again: this cycle follows one of which the bus has not taken everything.
    :ivar insisting: the last cycles are more than a drive gets that answers.
    :ivar runs: the last cycle holds anything but neutral and ``disable``.
    """

    def __init__(self, session: Session, encode: Callable[[list[int]], TelegramT],
                 send: Callable[[TelegramT, float], None], *, slot: int | None, silence: str,
                 advice: str = '', missed: Callable[[Sentence, float], None] | None = None,
                 ended: Callable[[float], None] | None = None,
                 settled: Callable[[], None] | None = None, in_turn: bool = False,
                 timer: CycleTimer | None = None) -> None:
        super().__init__(session, silence=silence, advice=advice, missed=missed, settled=settled,
                         in_turn=in_turn, timer=timer)
        self.audience: list[Answers] = [self]
        self.timer: CycleTimer = self.book.timer
        self.word: int | None = None
        self.cycles_left = -1
        self.again = self.insisting = self.runs = False
        self._encode, self._send = encode, send
        self._slot = slot
        self._ended = ended or self._end_stop
        self._telegram: TelegramT | None = None
        self._raws: list[int] | None = None     # in it, until it has left
        self._frames_out = 0                    # of which nobody has said what became of them
        self._whole = True                      # the bus has taken all others of this cycle
        self._stopping = False                  # the last cycles are those of a stop
        self._waiting = False                   # they have left, and an answer is waited for

    @property
    def cycling(self) -> bool:
        """Cycles are being sent."""
        return self.timer.due < math.inf

    @property
    def leaving(self) -> bool:
        """They are the last ones before silence."""
        return self.cycles_left >= 0 and self.timer.due < math.inf

    # -- the beat ---------------------------------------------------------------------------------

    def next_timer(self) -> float:
        """Return when :meth:`handle_timer` has something to do."""
        due, expires_at = self.timer.due, self.session.setpoints.expires_at
        if expires_at < due:
            due = expires_at
        return due if due < self._answer_due else self._answer_due

    def handle_timer(self, now: float) -> None:
        """Do what is due once a period. The fast path of the timer."""
        if now < self.timer.due:
            if now >= self._answer_due:
                self.settle(now)
            if self.session.gate.expire(now) and self.session.setpoints.changed:
                # a drive has that long for its answer
                self.timer.no_later(max(now, self.timer.began_at + EXPIRY_SPACING))
            return
        if self._waiting and not self._insist(now):
            return
        if not self._in_turn or now >= self._answer_due:
            self.settle(now)
        if self.timer.due == math.inf:  # what was missed has ended the cycles
            return
        session = self.session
        session.gate.expire(now)
        control = session.control
        telegram = self._telegram
        if (session.setpoints.changed or telegram is None
                or control is not None and control.word != self.word):
            telegram = self._telegram = self._make()
        self.book.begin(now, self.timer.stop_spacing if self.cycles_left >= 0 else None)
        self._frames_out = 0
        self.again, self._whole = not self._whole, True
        self._send(telegram, now)

    def start(self, now: float, *, in_turn: bool = False) -> None:
        """
        Let the first cycle follow, a period after the last one at least.

        :param in_turn: it waits for the turn of this drive, if it has one.
        """
        self._plan(-1)
        self.forget()
        period, phase = self.session.configuration.period, self.session.phase
        first = max(now, self.timer.began_at + period)
        if in_turn and phase is not None:
            first += (phase - first) % period
        self.timer.start(first)

    def stop(self) -> None:
        """Send nothing more, and expect no answer; one on its way is no surprise, though."""
        self._plan(-1)
        self.timer.stop()
        super().stop()

    def hurry(self, now: float, *, setpoints: bool) -> None:
        """
        Bring the next cycle forward where it stops the drive.

        :param setpoints: it does so, too, where only they have changed.
        """
        control = self.session.control
        if control is not None and control.stopping and not self._stopping and (
                self._slot is not None and control.word != self.word
                or setpoints and self.session.setpoints.changed):
            self.timer.hurry(now)

    def hand_out_neutral(self, now: float) -> None:
        """Bring the next cycle forward: only its answer shows that the drive was told to stop."""
        self.book.doubt()
        self.timer.hurry(now)

    # -- sending ----------------------------------------------------------------------------------

    def put(self, frame: Frame, *to: Answers) -> None:
        """
        Hand out a frame of the cycle that has begun.

        :param to: whose drives it may start, where that is not only this one.
        """
        self._frames_out += 1
        self.session.outbox.put(frame, partial(self._left, to) if to else self._alone_left)

    def expect_answer(self, now: float, until: float = math.inf) -> None:
        """
        Record that the drive itself was sent the cycle.

        :param until: when the answer counts as missed; infinity: with the next cycle.
        """
        self.expect(now, until, runs=self.runs)

    def await_frame(self) -> Left:
        """Count a frame to the cycle that somebody else hands out, and tells what became of."""
        self._frames_out += 1
        return self._alone_left

    def _alone_left(self, sent: bool, now: float) -> None:
        self._left((self,), sent, now)

    def _make(self) -> TelegramT:
        session = self.session
        raws = [setpoint.raw for setpoint in session.setpoints.items]
        self.runs = not session.setpoints.at_rest
        control = session.control
        if control is not None:
            self.word = control.word
            if self._slot is not None:
                raws.insert(self._slot, self.word)
                self.runs = self.runs or not control.at_rest
        session.setpoints.changed = False
        self._raws = raws
        return self._encode(raws)

    def _left(self, to: Iterable[Answers], sent: bool, now: float) -> None:
        """
        Record a frame.

        One that may start somebody counts even alone; otherwise a cycle counts only when the bus
        has taken every frame of it.
        """
        session = self.session
        self._frames_out -= 1
        if not sent:
            self._whole = False
        elif self.runs:
            for each in to:
                each.book.doubt()   # also of those who are not asked by it
                each.session.duty.channel(CYCLE, Happened.RUN_LEFT)
        if self._frames_out or not self._whole:
            return
        if not self.runs:
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
        """Let the last cycles before silence follow soon."""
        soon = max(now, self.timer.began_at + self.timer.stop_spacing)
        if self.timer.due < math.inf:
            self._plan(STOP_CYCLES)
            self.timer.no_later(soon)
        else:   # those of a stop before this one have left, what goes by writes is under way
            self.run_out(soon)
        self._stopping = True
        self.book.doubt()       # one of these is to be answered
        self.timer.hurry(now)

    def run_out(self, first: float) -> None:
        """Send the last cycles before silence, beginning then."""
        self._plan(STOP_CYCLES)
        self.timer.start(first)

    def _plan(self, cycles_left: int) -> None:
        self.cycles_left = cycles_left
        self._stopping = self._waiting = self.insisting = False

    def _last_left(self, now: float) -> None:
        """Come to an end, at once or when somebody has answered."""
        self._waiting = self._stopping and self._unheard
        if self._waiting:
            self.timer.start(now + LAST_ANSWER)
        else:
            self._ended(now)

    def _insist(self, now: float) -> bool:
        """Begin with more cycles for who has not shown to have heard one; False: that is all."""
        if self.insisting or not self._unheard:
            self._end(now)
            return False
        self._waiting, self.insisting = False, True
        self.cycles_left = MORE_CYCLES
        if self.session.configuration.period <= LAST_ANSWER:   # late answers have come by now
            for each in self.audience:
                each.book.forget_asked()
        return True

    def wait_out(self, now: float) -> None:
        """Come to the end of a stop that only waits for an answer, if that came."""
        if (self._waiting or self.insisting) and not self._unheard:
            self._end(now)

    def _end(self, now: float) -> None:
        self._waiting = self.insisting = False
        self.cycles_left = 0
        self._ended(now)

    def _end_stop(self, now: float) -> None:
        self.doubt_the_end()
        for each in self.audience:
            if not each.session.stopped:
                each.session.stop_left()

    @property
    def _unheard(self) -> bool:
        """Whether somebody who ran has not shown to have heard one of the last cycles."""
        return any(each.session.unshown for each in self.audience)

    def doubt_the_end(self) -> None:
        """Record who ran, and has answered none of the last cycles."""
        for each in self.audience:
            if each.session.unshown:
                each.session.duty.happened(Happened.SILENT)
