# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The polled exchange of a device: rounds of reads, one a period, as samples.

A complete round is a sample. The status word counts from the moment it was read, before the round
is complete.
"""

from collections.abc import Callable
import math

from drive_can_bridge.core.events import ProcessDataReceived
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.canopen.node import Node
from drive_can_bridge.protocols.canopen_pkw.mailbox import MailboxChannel
from drive_can_bridge.protocols.canopen_pkw.round import Round, Words
from drive_can_bridge.protocols.channel import Lane
from drive_can_bridge.protocols.exchange_book import ExchangeBook

SILENT = ('no complete round of reads: drive silent, not operational, or other COB-IDs than '
          'configured')


class PolledExchange:
    """
    The exchange with one device.

    :param node: one whose heartbeats have ceased is not found by its answers.
    :param found: called when a round was answered by a drive that was offline.
    :param silent: takes why a drive that was online counts as lost.
    :ivar timer: when the next round is due.
    :ivar received_at: when the last answer was received.
    :ivar status_known: the status was read just now, or there is none to be read.
    """

    def __init__(self, session: Session, channel: MailboxChannel, node: Node, *,
                 found: Callable[[float], None], silent: Callable[[str, float], None]) -> None:
        drive = session.configuration
        self._session = session
        self._channel = channel
        self._node = node
        self._found = found
        self._silent = silent
        self._round = Round(drive, session.report.warn)
        self._book = ExchangeBook(drive, session.statistics)
        self.timer = self._book.timer
        self.received_at = -math.inf
        self.status_known = not self._round.has_status

    def forget(self) -> None:
        """Forget what the drive refuses."""
        self._round.start_over()

    def cancel(self) -> None:
        """Leave the round that is under way alone."""
        self._channel.cancel(Lane.OWN)
        self._book.missed_in_row = 0

    def stop(self) -> None:
        """Begin no further round."""
        self.timer.stop()
        self._round.refusals.clear()

    @property
    def due(self) -> float:
        """When the next round is to begin; infinity: not before this one has ended."""
        return self.timer.due if self._channel.is_idle(Lane.OWN) else math.inf

    def begin(self, now: float) -> None:
        """Begin a round."""
        self._book.begin(now)
        self._channel.run(self._round.read(self._answered), self._ended, now)

    def warnings(self) -> list[str]:
        """Say what the drive refuses, and what to do."""
        return [f'poll of {text}: correct cyclic_response or the profile'
                for text in self._round.refusals.values()]

    def _answered(self, words: Words) -> None:
        """Take an answer; the status counts from the moment it was read."""
        if self._session.online:
            self._take_status(words)

    def _take_status(self, words: Words) -> None:
        now, control = self._channel.now, self._session.control
        raw = self._round.status(words)
        if raw is not None and control is not None:
            self.status_known = True
            control.status_received(raw, now)
        self._session.control_changed(now)
        self.status_known = not self._round.has_status

    def _ended(self, words: Words | None) -> None:
        now, session = self._channel.now, self._session
        if words is None:
            self._miss(now)
            return
        self._book.missed_in_row = 0
        raws = self._round.raws(words)
        if not session.online:
            if self._node.heartbeat_lost:
                return
            session.gate.measured(raws)   # before anything is written
            self._found(now)
            self._take_status(words)
        session.gate.measured(raws)
        if None in raws:
            return  # something was refused: there is no complete sample
        self._book.answered(self.received_at)
        session.report.note(ProcessDataReceived(
            tuple(raw for raw in raws if raw is not None), self.received_at))

    def _miss(self, now: float) -> None:
        if not self._book.missed():
            return
        session = self._session
        if session.online:
            limit = session.configuration.missed_limit
            self._silent(f'no complete round of reads for {limit} periods', now)
        elif not self._node.heartbeat_lost:
            session.report.advice = SILENT
