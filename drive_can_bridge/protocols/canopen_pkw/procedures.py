# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What takes more than one request: parameters of users, and the safe stop.

Every generator here is for :class:`.transactor.MailboxChannel`.
"""

from collections.abc import Hashable, Sequence

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.requests import Outcome, Outcomes, Written
from drive_can_bridge.core.stop_duty import Happened, StopDuty
from drive_can_bridge.protocols.access import Found, Item, ParameterAccess
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement, Span
from drive_can_bridge.protocols.canopen_pkw.pkw import Address
from drive_can_bridge.protocols.canopen_pkw.transactor import (
    Procedure, RegisterRead, RegisterWrite, Reply, Step)
from drive_can_bridge.protocols.safe_stop import STOP_ATTEMPTS, StopWrite
from drive_can_bridge.protocols.transactor import Answered, Refused, Silence, SILENT

NOT_TOGETHER = sentences.not_in_one_frame(
    'two 16-bit parameters in adjacent registers fit, or one of 32 bits')


# -- parameters of users --------------------------------------------------------------------------


class RegisterAccess(ParameterAccess[Span, Step, Reply]):
    """Parameters by register or object; adjacent registers share a request."""

    def read(self, span: Span) -> Procedure[Found]:
        reply = yield RegisterRead(span.address, span.count)
        if isinstance(reply, Answered):
            return reply.content[:span.count]
        return reply.failure if isinstance(reply, Refused) else self.retry.unanswered()

    def write(self, items: Sequence[Item]) -> Procedure[Outcomes]:
        return self._write(items, blind=False)

    def write_blind(self, items: Sequence[Item]) -> Procedure[Outcomes]:
        return self._write(items, blind=True)

    def _write(self, items: Sequence[Item], *, blind: bool) -> Procedure[Outcomes]:
        words: dict[Address, int] = {}
        for parameter, raw in items:
            words.update(zip(self.placement.span(parameter).addresses,
                             self.placement.words(parameter, raw)))
        outcome = yield from self._put(
            RegisterWrite(min(words), tuple(words[address] for address in sorted(words)), blind))
        return (outcome,) * len(items)

    def misfit(self, items: Sequence[Item]) -> Sentence:
        spans = [self.placement.span(parameter) for parameter, _ in items]
        shared = self.placement.plan(spans)
        fits = len(shared) == 1 and sum(span.count for span in spans) == shared[0].count
        return NOTHING if fits else NOT_TOGETHER

    def _put(self, write: RegisterWrite) -> Procedure[Outcome]:
        """
        Write once.

        The device acknowledges. A lost acknowledgement is a failure: sent again, the write could
        be executed twice. What was not sent because the mailbox was out of step is tried again.
        """
        for _ in range(self.retry.attempts):
            reply = yield write
            if isinstance(reply, Answered):
                return Written()
            if isinstance(reply, Refused) or reply.refused or reply.sent:
                return self.failed(reply, 1)
        return self.retry.unanswered()


# -- what the drive is told -----------------------------------------------------------------------


def command(duty: StopDuty, channel: Hashable, write: RegisterWrite, *, runs: bool,
         ) -> Procedure[Reply]:
    """
    Write a setpoint or control word, and record what the drive was commanded.

    What may start it counts from now on, what stops it when it is answered: whether a write
    without an answer was executed, nobody knows. One that was not sent changes nothing.

    :param runs: it may start the drive; as it is now: a neutral value that follows the axis is
        another one when the answer comes.
    """
    before = duty.runs(channel)
    if runs:
        duty.channel(channel, Happened.RUN_WRITTEN)
    reply = yield write
    settled = (runs if isinstance(reply, Answered) else
               before if isinstance(reply, Silence) and not reply.sent else None)
    if settled is not None:
        duty.channel(channel, Happened.RUN_WRITTEN if settled else Happened.STOP_LEFT)
    return reply


# -- the stop -------------------------------------------------------------------------------------


def write_blind_until_answered(
        placement: Placement, each: StopWrite, timeout: float, last: float,
        ) -> Procedure[tuple[Reply, int, Sentence]]:
    """
    Write one thing that stops a drive until it is answered or was tried three times.

    It may be executed twice: that does no harm. As the toggle is inverted with every attempt, not
    even an unknown function byte of the device keeps it from taking notice.

    :param timeout: s for each attempt but the last.
    :param last: s for that.
    """
    reply: Reply = SILENT
    for attempt in range(1, STOP_ATTEMPTS + 1):
        reply = yield RegisterWrite.of(placement, each.parameter, each.raw, blind=True,
                                       timeout=last if attempt == STOP_ATTEMPTS else timeout)
        if not isinstance(reply, Silence):
            break
    return reply, STOP_ATTEMPTS, NOTHING
