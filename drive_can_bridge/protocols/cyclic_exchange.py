# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The exchange of protocols with a cyclic service: all setpoints and the control word, once a period.

A session says when cycles begin and how its telegrams are encoded; here stands what every such
session has to see to. What the bus did not take counts for nothing: a cycle has been sent when all
its frames have left. The last cycles before silence are counted; where a drive that ran has
answered none of those that stop it, the answer to the last one is waited for a moment.
"""

from collections.abc import Callable
import math
from typing import Generic, TypeVar

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.exchange_book import ExchangeBook

#: cyclic frames with neutral setpoints that are sent before a drive is left alone
STOP_CYCLES = 3
#: s that an answer to the cycles of a stop is waited for, where none has come
LAST_ANSWER = 0.1
#: what the drive is told by cycles, for the books of what it was told
CYCLE = 'cycle'

TelegramT = TypeVar('TelegramT')


class CyclicExchange(Generic[TelegramT]):
    """
    The cycles of one drive.

    :param book: counts them, and the answers.
    :param encode: makes a telegram of the raw integers of all setpoints, with the control word
        among them if it has its slot.
    :param slot: of the control word; None: it is not sent cyclically.
    :param left: called when a cycle has left.
    :param ended: called when the last cycle before silence has left, and that of a stop was
        answered or waited for.
    :param unheard: tells whether somebody who ran may not have heard the stop; None: the drive
        has answered none of its cycles.
    :ivar word: the control word of the last cycle.
    :ivar cycles_left: still to be sent before silence; -1: no end is planned.
    :ivar whole: the bus has taken all frames of the last cycle so far.
    """

    def __init__(self, session: Session, book: ExchangeBook,
                 encode: Callable[[list[int]], TelegramT], *, slot: int | None,
                 ended: Callable[[float], None],
                 left: Callable[[], None] | None = None,
                 unheard: Callable[[], bool] | None = None) -> None:
        self.word: int | None = None
        self.cycles_left = -1
        self.whole = True
        self._session = session
        self._book = book
        self._timer = book.timer
        self._encode = encode
        self._slot = slot
        self._ended = ended
        self._told = left
        self._unheard = self._unanswered if unheard is None else unheard
        self._telegram: TelegramT | None = None
        self._raws: list[int] | None = None     # in it, until it has left
        self._runs = False                      # it holds anything but neutral and disable
        self._frames_out = 0                    # of which nobody has said what became of them
        self._stopping = False                  # the last cycles are those of a stop
        self._waiting = False                   # they have left, and an answer is waited for

    # -- sending ----------------------------------------------------------------------------------

    def begin(self, now: float) -> TelegramT:
        """Begin a cycle: return what is to be sent now. The fast path of the timer."""
        session = self._session
        session.gate.expire(now)
        control = session.control
        telegram = self._telegram
        if (session.setpoints.changed or telegram is None
                or control is not None and control.word != self.word):
            telegram = self._telegram = self._make()
        self._book.begin(now, self._timer.stop_spacing if self.cycles_left >= 0 else None)
        self._frames_out = 0
        self.whole = True
        return telegram

    def put(self, frame: Frame) -> None:
        """Hand out a frame of the cycle that has begun."""
        self._frames_out += 1
        self._session.outbox.put(frame, self._left)

    def _make(self) -> TelegramT:
        session = self._session
        raws = [setpoint.raw for setpoint in session.setpoints.items]
        self._runs = not session.setpoints.at_rest
        control = session.control
        if control is not None:
            self.word = control.word
            if self._slot is not None:
                raws.insert(self._slot, self.word)
                self._runs = self._runs or not control.at_rest
        session.setpoints.changed = False
        self._raws = raws
        return self._encode(raws)

    def _left(self, sent: bool, now: float) -> None:
        """
        Take note of a frame.

        One that may start somebody counts even alone; otherwise a cycle counts only when the bus
        has taken every frame of it.
        """
        session = self._session
        self._frames_out -= 1
        if not sent:
            self.whole = False
        elif self._runs:
            session.told.note_unacknowledged(CYCLE, runs=True)
        if self._frames_out or not self.whole:
            return
        if not self._runs:
            session.told.note(CYCLE, runs=False)
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
                self._timer.no_later(now + self._timer.stop_spacing)
        if self._told is not None:
            self._told()
        if self.cycles_left > 0:
            self.cycles_left -= 1
            if self.cycles_left == 0:
                self._end(now)

    def start(self, now: float, *, in_turn: bool = False) -> None:
        """
        Let the first cycle follow, a period after the last one at least.

        :param in_turn: it waits for the turn of this drive, if it has one.
        """
        self._plan(-1)
        self._book.missed_in_row = 0
        period, phase = self._session.configuration.period, self._session.phase
        first = max(now, self._timer.began_at + period)
        if in_turn and phase is not None:
            first += (phase - first) % period
        self._timer.start(first)

    # -- the end ----------------------------------------------------------------------------------

    @property
    def longest_stop(self) -> float:
        """How many s the last cycles before silence take at most."""
        return STOP_CYCLES * self._timer.stop_spacing + LAST_ANSWER

    def stop_soon(self, now: float) -> None:
        """Let the last cycles before silence follow soon."""
        soon = max(now, self._timer.began_at + self._timer.stop_spacing)
        if self._timer.due < math.inf:
            self._plan(STOP_CYCLES)
            self._timer.no_later(soon)
        else:   # those of a stop before this one have left, what goes by writes is under way
            self.run_out(soon)
        self._stopping = True
        self._timer.hurry(now)

    def run_out(self, first: float) -> None:
        """Send the last cycles before silence, beginning then."""
        self._plan(STOP_CYCLES)
        self._timer.start(first)

    def _plan(self, cycles_left: int) -> None:
        self.cycles_left = cycles_left
        self._stopping = self._waiting = False

    def _end(self, now: float) -> None:
        """Come to an end, at once or when somebody has answered."""
        self._waiting = self._stopping and self._unheard()
        if self._waiting:
            self._timer.start(now + LAST_ANSWER)
        else:
            self._ended(now)

    def wait_out(self, now: float, *, due: bool = False) -> bool:
        """
        Come to an end after all, if an answer came, or its time is over.

        :param due: it is.
        :return: the last cycle has left: nothing more is sent.
        """
        if self._waiting and (due or not self._unheard()):
            self._waiting = False
            self._ended(now)
            return True
        return self._waiting

    def _unanswered(self) -> bool:
        """Tell whether a drive that ran has answered none of the last cycles but one."""
        return self._session.told.ran and self._book.missed_in_row >= STOP_CYCLES - 1

    def doubt_the_end(self) -> None:
        """Take note of a drive that ran, and has answered none of its last cycles."""
        if self._unanswered():
            self._session.told.doubt()

    def stop(self) -> None:
        """Send nothing more."""
        self._plan(-1)
        self._timer.stop()
        self._book.expect_nothing()
