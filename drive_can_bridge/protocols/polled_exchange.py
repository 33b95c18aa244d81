# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The exchange of protocols without a cyclic service: rounds of reads, one a period, as samples.

How a round is read, the family says. A complete one is a sample, and finds a drive that was
offline; one with a read that nobody answered is missed. One with a read that the drive refused is
neither: there is no complete sample.
"""

from collections.abc import Generator, Sequence
import math
from typing import Any, Protocol

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import ProcessDataReceived
from drive_can_bridge.core.sentences import NOTHING
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.channel import Channel, Priority
from drive_can_bridge.protocols.exchange_book import ExchangeBook

#: of a round, in the order of samples; None: of what was refused
Raws = Sequence[int | None]


class Polled(Protocol):
    """What a family says about its rounds; the session itself."""

    @property
    def present(self) -> bool:
        """A drive is there, should it answer."""

    def read_round(self) -> Generator[Any, Any, Raws | None]:
        """Read everything; return None when a read was not answered."""

    def round_found(self, now: float) -> None:
        """Handle a drive that was offline and has answered a round."""

    def round_answered(self, raws: Raws, now: float, *, found: bool) -> None:
        """
        Take a round before it becomes a sample.

        :param found: the drive was found by it.
        """


class PolledExchange:
    """
    The rounds of one drive.

    :ivar timer: when the next round is due.
    :ivar reading: a round is under way.
    :ivar received_at: when the last answer was received.
    """

    def __init__(self, session: Session, rounds: Polled, channel: Channel[Any, Any]) -> None:
        self._session, self._rounds = session, rounds
        self._channel = channel
        self._book = ExchangeBook(session.configuration, session.statistics)
        self._void = False  # this round began before the process stood still
        self.timer = self._book.timer
        self.reading = False
        self.received_at = -math.inf

    @property
    def silent(self) -> bool:
        """The last round was missed."""
        return self._book.missed_in_row > 0

    def begin(self, now: float) -> None:
        """Begin a round; none is under way."""
        self._book.begin(now)
        self.reading, self._void = True, False
        self._channel.run(self._rounds.read_round(), self._ended, now)

    def wait(self, now: float, patience: float) -> None:
        """Let a period pass: the round under way has not ended, and has so many s for it."""
        self.timer.begun(now)
        if now - self._book.began_at > patience:
            self._miss(now)

    def forget(self) -> None:
        """Count anew what is missed."""
        self._book.missed_in_row = 0

    def disregard(self) -> None:
        """Record that the round under way, if any, says nothing."""
        self._void = self.reading

    def cancel(self) -> None:
        """Leave the round that is under way alone."""
        self._channel.cancel(Priority.OWN)
        self.reading = False

    def stop(self) -> None:
        """Begin no further round; that under way is cancelled with others."""
        self.timer.stop()
        self.reading = False

    def _ended(self, raws: Raws | None) -> None:
        now, session = self._channel.now, self._session
        self.reading = False
        if self._void:
            return
        if raws is None:
            self._miss(now)
            return
        self.forget()
        fresh = not session.online
        if fresh:
            if not self._rounds.present:
                return
            session.interlock.measured(raws)     # before anything is written
            self._rounds.round_found(now)
        self._rounds.round_answered(raws, now, found=fresh)
        session.interlock.measured(raws)
        sample = tuple(raw for raw in raws if raw is not None)
        if len(sample) == len(raws):
            self._book.answered(self.received_at)
            session.report.note(ProcessDataReceived(sample, self.received_at))

    def _miss(self, now: float) -> None:
        session, limit = self._session, self._session.configuration.missed_limit
        session.exchange_missed(sentences.no_round(limit) if self._book.missed() else NOTHING, now)
