# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The rounds of reads of one device: what each asks for, and what the device refuses of it."""

from collections.abc import Sequence

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.process_image import status_word
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.canopen_pkw.addresses import (
    instead_of, Placement, round_plan, round_spans, Span)
from drive_can_bridge.protocols.canopen_pkw.pkw import Address
from drive_can_bridge.protocols.canopen_pkw.transactor import (
    MailboxChannel, Procedure, RegisterRead)
from drive_can_bridge.protocols.canopen_pkw.writers import Writers
from drive_can_bridge.protocols.polled_exchange import Raws
from drive_can_bridge.protocols.transactor import Refused, Silence


class Rounds:
    """
    The rounds of one drive.

    :param writers: write setpoints between two reads: commands do not wait for slow rounds.
    :ivar blank: there is no status to be read.
    :ivar gap: what the last one asked for in vain, though others were answered, in words.
    :ivar refusals: the names of what the drive refuses, and why, by what was read.
    """

    def __init__(self, session: Session, channel: MailboxChannel,
                 writers: Writers) -> None:
        drive = self._drive = session.configuration
        self._session = session
        self._channel = channel
        self._writers = writers
        self._placement = Placement.of(drive)
        self._spans = [self._placement.span(parameter) for parameter in drive.cyclic_response]
        status = status_word(drive)
        self._status = None if status is None else (status, self._placement.span(status))
        self.blank = status is None
        self.gap = NOTHING
        self.refusals: dict[Span, Sentence] = {}
        self._words: dict[Address, int] = {}    # those of refused registers are missing
        self._plan: list[Span] = []
        self.restart()

    def restart(self) -> None:
        """Forget what was refused."""
        self.gap = NOTHING
        self.refusals.clear()
        self._plan = round_plan(self._drive)

    def read(self) -> Procedure[Raws | None]:
        """Read everything once, each in one attempt; return None if something went unanswered."""
        self._words = {}
        pending = list(self._plan)
        while pending:
            span = pending.pop(0)
            if self._words and self._session.online:
                self._writers.write_setpoints(self._channel.now)
            reply = yield RegisterRead(span.address, span.count, attempts=1)
            if isinstance(reply, Silence):
                self.gap = NOTHING if not self._words else sentences.one_read_unanswered(
                    self._names(span))
                return None
            if isinstance(reply, Refused):
                pending[:0] = self._instead(span, reply)
                continue
            self.refusals.pop(span, None)
            found = dict(zip(span.addresses, reply.content))
            self._words.update(found)
            if self._session.online:
                self._take_status(found)
        return [self._placement.raw_among(parameter, span, self._words)
                for parameter, span in zip(self._drive.cyclic_response, self._spans)]

    def ended(self, now: float, *, found: bool) -> None:
        """Hand on the status of a drive that was found by this round."""
        if found:
            self._take_status(self._words)
        elif self._status is not None and self._status_among(self._words) is None:
            self._session.interlock.status(None, now)
            self._session.control_changed(now)

    def _take_status(self, words: dict[Address, int]) -> None:
        now, interlock = self._channel.now, self._session.interlock
        raw = self._status_among(words)
        if raw is not None:
            interlock.status(raw, now)
        interlock.follow()
        self._writers.write_control(now, known=self.blank or raw is not None)

    def _status_among(self, words: dict[Address, int]) -> int | None:
        return None if self._status is None else self._placement.raw_among(*self._status, words)

    def _instead(self, span: Span, refused: Refused) -> Sequence[Span]:
        """Handle a refusal: two parameters that share a read are read alone from now on."""
        parts = instead_of(span, round_spans(self._drive))
        if parts:
            place = self._plan.index(span)
            self._plan[place:place + 1] = parts
            return parts
        names = self._names(span)
        if span not in self.refusals:
            self._session.report.warn(sentences.read_refused(names, refused.text))
        self.refusals[span] = sentences.write_refused(names, refused.text)
        return parts

    def _names(self, span: Span) -> str:
        """Name what a read is for."""
        return ', '.join(parameter.name for parameter, own in zip(
            self._drive.cyclic_response, self._spans)
            if set(own.addresses) <= set(span.addresses)) or str(span.address)

    def warnings(self) -> list[Sentence]:
        """Return what the drive refuses, and what to do."""
        return [sentences.poll_refused(text) for text in self.refusals.values()]
