# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What one drive answers to the cycles that command it, whichever session sends them.

An answer that does not come in time is missed, and after ``missed_limit`` of those in a row the
drive is lost. What it answers to cycles of before shows nothing (:mod:`.exchange_book`).
"""

import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.session import Session, Stage
from drive_can_bridge.core.stop_duty import CYCLE, Do, Happened
from drive_can_bridge.protocols.exchange_book import CycleTimer, ExchangeBook
from drive_can_bridge.protocols.timing_advice import TimingAdvice


class CycleAnswers:
    """
    The answers of one drive.

    :param silence: what is said of a drive that does not answer.
    :param advice: what to look at then.
    :param in_turn: not each cycle asks this drive: the one that asks it settles the one before.
    :param timer: says when cycles are due, where others are in step; None: one of its own.
    :param period_max: the longest period that is allowed for this drive.
    :ivar session: of the drive.
    :ivar book: counts the cycles, and the answers.
    :ivar timing: says what would have held.
    :ivar due: when the answer counts as missed; infinity: with the next cycle, or there is none.
    :ivar confirms: an answer to a cycle shows that what the drive was told by it has arrived.
    :ivar by_number: it shows nothing of a control word, which only a status behind that does.
    """

    def __init__(self, session: Session, *, silence: str, advice: str = '',
                 in_turn: bool = False, timer: CycleTimer | None = None,
                 period_max: float = math.inf) -> None:
        self.session = session
        self.timing = TimingAdvice(session.configuration, session.report, period_max)
        self.book = ExchangeBook(session.configuration, session.statistics, timer)
        self.confirms, self.by_number = True, False
        self._silent = sentences.silent(silence, advice)
        self.in_turn = in_turn
        self.due = math.inf
        self._silence = silence

    def handle_timer(self, now: float) -> None:
        """Settle what is due."""
        if now >= self.due:
            self.settle(now)

    def stop(self) -> None:
        """Expect no answer; one on its way is no surprise, though."""
        self.forget()
        self.book.expect_nothing()
        self.due = math.inf

    def expect(self, now: float, until: float, *, runs: bool) -> None:
        """
        Record that the drive was sent a cycle.

        :param until: when the answer counts as missed; infinity: with the next cycle.
        :param runs: it holds anything but neutral and ``disable``.
        """
        self.book.asked(now, runs=runs)
        self.due = until

    def expects(self, what: str, now: float, received_at: float) -> bool:
        """Return whether an answer belongs to the last cycle; others are late, or rejected."""
        if self.wanted:
            return True
        late = self.book.late(received_at)
        if late is not None or not self.book.take_stale():
            if late is None:
                self.book.too_many(received_at)
            self.session.report.unasked(
                sentences.unasked(what), late, now, would_hold=self._would_hold)
        if self.timing.since < math.inf:
            self.timing.came(received_at)
        self._confirm_stop()
        return False

    def answered(self, received_at: float) -> None:
        """Record the answer to the last cycle."""
        book = self.book
        missed = not book.awaiting
        book.answered(received_at)
        book.answer_received(received_at)
        if self.timing.since < math.inf:
            self.timing.came(received_at)
        if missed:
            self.session.report.unasked(
                NOTHING, book.overdue, received_at, would_hold=self._would_hold, taken=True)
        self._confirm_stop()

    def _would_hold(self, late: float) -> Sentence:
        return self.timing.late(late) if self.session.online else NOTHING

    @property
    def wanted(self) -> bool:
        """
        An answer would belong to the last cycle.

        Of a stop, all do that may still come; of drives that are asked in turn, also one that is
        missed, as long as the next has not been asked for.
        """
        book = self.book
        return book.awaiting or book.outstanding and (
            self.in_turn or self.session.stage is Stage.STOPPING)

    def _confirm_stop(self) -> None:
        """Record an answer that acknowledges what was commanded last, if it does."""
        if self.confirms and self.book.stop_shown:
            self.stop_answered()
        if self.book.stop_shown:
            self.session.neutral_stop.answered()

    def stop_answered(self) -> None:
        """Record that what cycles command was acknowledged, and what else was, if they show it."""
        duty = self.session.duty
        if self.session.online and not self.by_number:
            duty.happened(Happened.ANSWERED)
        else:       # what else it was told while it was silent, it may have missed
            duty.channel(CYCLE, Happened.ANSWERED)

    def settle(self, now: float, *, early: bool = False) -> None:
        """
        End an exchange: what has not arrived by now does not count for it any more.

        :param early: the next one was brought forward. The answer may still come, to that one.
        """
        self.due = math.inf
        book, session = self.book, self.session
        session.exchange_ended()
        if book.awaiting and not early:
            too_many = book.missed()
            if session.stage is not Stage.STOPPING:
                limit = session.configuration.missed_limit
                if too_many and session.online:
                    self.timing.lost(book.answered_at)
                session.exchange_missed(
                    sentences.silent_for_cycles(self._silence, limit) if too_many else NOTHING,
                    now)

    def forget(self) -> None:
        """Count what is missed from 0 again."""
        self.book.missed_in_row = 0

    def lose(self, reason: Sentence, now: float) -> None:
        """
        Lose a drive that has not answered often enough, and go on with cycles.

        :param reason: '' if it does not count as lost yet.
        """
        if reason:
            self.forget()
            session = self.session
            if session.online:
                session.lose(reason, now)
            elif session.duty.happened(Happened.UNANSWERED) is Do.STOP_BY_NUMBER:
                session.report.warn(sentences.stop_not_answered(), may_run=True)
            session.report.guess(self._silent)
