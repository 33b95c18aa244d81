# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The control word on its way through the mailbox.

It is written when it changes. Whether the drive got it, its answer says. A word that stops the
drive may be executed twice: when its answer is missing, it is written again soon, before anything
else, and with every round from then on. Any other word is read back first, and written again only
if it is not there. Where it cannot be read back it is not repeated, and the control machine gives
up by itself.

A word that the drive refuses ends what the user wanted, with the reason that the drive gives. A
refused ``disable`` is tried again and again: a device under local control, say, takes it as soon
as it is back under remote control.
"""

from collections.abc import Generator
import math

from drive_can_bridge.core import sentences
from drive_can_bridge.core.control_machine import ControlMachine
from drive_can_bridge.core.sentences import NOTHING, Sentence
from drive_can_bridge.core.session import Session
from drive_can_bridge.core.stop_duty import CONTROL_WORD
from drive_can_bridge.protocols.acyclic_output import AcyclicOutput
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement
from drive_can_bridge.protocols.canopen_pkw.mailbox import (
    Answered, MailboxChannel, Read, Refused, Reply, Silence, Step, Write,
)
from drive_can_bridge.protocols.canopen_pkw.procedures import tell
from drive_can_bridge.protocols.channel import Lane, STOP_PATIENCE
from drive_can_bridge.protocols.safe_stop import STOP_ATTEMPTS

#: s until a ``disable`` that was refused is written again
RETRY_AFTER = 0.25


class ControlWriter:
    """
    Writes the control word of one drive.

    :ivar refusal: why the drive does not take the word, '' if it does.
    """

    def __init__(self, session: Session, control: ControlMachine,
                 channel: MailboxChannel, output: AcyclicOutput) -> None:
        drive = session.configuration
        self.refusal = NOTHING
        self._session = session
        self._control = control
        self._channel = channel
        self._parameter = drive.profile.parameters[control.table.parameter]
        self._disable = control.table.disable   # may be written any number of times
        self._placement = Placement.of(drive)
        self._span = self._placement.span(self._parameter)
        self._refresh: float = (
            drive.options.refresh_interval if self._parameter in drive.cyclic_request else 0.0)
        self._output = output
        self._settled: int | None = None    # the drive has it, or has refused it
        self._settled_at = -math.inf
        self._doubtful: int | None = None   # sent, but not answered
        self._hurried: int | None = None    # the stop that others have made room for

    def forget(self) -> None:
        """Record that nothing is known of the drive."""
        self._settled = self._doubtful = self._hurried = None
        self.refusal = NOTHING

    def update(self, now: float, *, known: bool) -> None:
        """
        Write the word if the drive does not have it, or not lately.

        :param known: the status was read just now. A word that may start the drive is repeated
            only then: a drive that was off meanwhile, unseen, must not start by a repetition.
        """
        word = self._control.word
        fresh = self._refresh <= 0.0 or now < self._settled_at + self._refresh
        if self._settled == word and fresh and not self._output.word_due(now):
            return
        repeated = self._settled == word or self._control.operating
        if repeated and not known and word != self._disable:
            return
        if self._control.stopping and word not in (self._hurried, self._settled):
            self._hurried = word
            self._channel.make_room(now)
        elif not self._control.stopping:
            self._hurried = None
        if self._channel.is_idle(Lane.CONTROL):
            self._channel.run(self._write(), lambda _: None, now, Lane.CONTROL)

    def _write(self) -> Generator[Step, Reply, None]:
        """Write the newest word, until it is answered or silence says to wait a while."""
        unanswered = 0
        while True:
            word, stopping = self._control.word, self._control.stopping
            if self._output.holds_word():
                return
            if word == self._doubtful and not stopping:
                there = yield from self._read_back(word)
                if there is None:
                    return
                if there:
                    self._settle(word)
                    if word == self._control.word:
                        return
                    continue
                word, stopping = self._control.word, self._control.stopping
            # the last has the time that any request has: a slow device is no silent one
            again = stopping and unanswered < STOP_ATTEMPTS - 1
            timeout = min(STOP_PATIENCE, self._session.retry.timeout) if again else None
            before, again_at = self._settled, self._output.again_at
            self._output.word_begun(word)
            if word != before:
                self._settled = None    # from now on nobody knows: a stop does not rely on it
            reply = yield from tell(
                self._session.duty, CONTROL_WORD,
                Write.of(self._placement, self._parameter, word, blind=stopping, timeout=timeout),
                runs=word != self._disable)
            if isinstance(reply, Silence):
                unanswered += stopping
                self._settled = None if reply.sent else before
                if reply.sent:
                    self._doubtful = word
                else:   # as if it had not been begun
                    self._output.word_unanswered(self._channel.now)
                    self._output.again_at = again_at
                if word == self._control.word and not again:
                    if stopping:
                        self._tell_silence(word)
                    return
                continue
            if isinstance(reply, Refused):
                self._take_refusal(word, reply.text)
            else:
                self.refusal = NOTHING
                self._settle(word)
            if word == self._control.word:
                return

    def _read_back(self, word: int) -> Generator[Step, Reply, bool | None]:
        """Tell whether the drive has a word that was not answered; None: nobody knows."""
        if not self._parameter.readable:
            return None
        reply = yield Read(self._span.address, self._span.count, attempts=1)
        if not isinstance(reply, Answered):
            return None
        found = self._placement.raw(self._parameter, reply.words)
        self._doubtful = None
        return self._parameter.word_from_raw(found) == self._parameter.word_from_raw(word)

    def _take_refusal(self, word: int, reason: Sentence) -> None:
        now = self._channel.now
        text = sentences.write_refused(f'{self._parameter.name} {word:04X}h', reason)
        if text != self.refusal:
            self._session.report.warn(sentences.write_failed(text))
        self.refusal = text
        self._doubtful = None
        self._settled, self._settled_at = word, now
        if word == self._disable:
            self._output.again_at = now + RETRY_AFTER
        self._control.word_refused(word, reason, now)
        self._session.control_changed(now)

    def _tell_silence(self, word: int) -> None:
        """Say that a word that stops the drive is not acknowledged, once until one is."""
        text = sentences.write_unanswered(f'{self._parameter.name} {word:04X}h')
        if text != self.refusal:
            self._session.report.warn(
                sentences.write_failed(text), may_run=self._session.owed)
        self.refusal = text

    def _settle(self, word: int) -> None:
        """Record that the drive has a word."""
        self._doubtful = None
        self._settled, self._settled_at = word, self._channel.now
        if self._output.word_left(self._channel.now, word):
            self._session.control_changed(self._channel.now)
