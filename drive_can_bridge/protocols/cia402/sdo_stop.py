# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The stop of a drive by SDO, which no mapping can misroute; also of a node that NMT has stopped.

In the NMT state *stopped* a node answers no SDO and takes no PDO (CiA 301), and its motor goes on
as before. So one that may be in it is sent NMT *pre-operational* first, and 6040h right behind.
What says that it may be: its heartbeat; or that neither the control word nor its repetition was
answered, and neither a heartbeat nor a PDO shows that it is in another state.
"""

from collections.abc import Sequence
from dataclasses import replace

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.session import Session
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.canopen.network import NmtCommand, NmtState
from drive_can_bridge.protocols.canopen.node import WatchedNode
from drive_can_bridge.protocols.cia402.pdo import width
from drive_can_bridge.protocols.cia402.transactor import Procedure, Reply, SdoChannel, Transfer
from drive_can_bridge.protocols.safe_stop import (
    ANSWER_TIME, STOP_ATTEMPTS, StopWrite, write_until_answered)
from drive_can_bridge.protocols.transactor import SILENT

#: s between two NMT commands to a node that may be stopped, and for which they are repeated
NMT_SPACING, NMT_TIME = 0.05, 1.0
_ATTEMPTS_UNTIL_NMT = 2
_ROUNDING = 1e-6

StopProcedure = Procedure[list[Sentence]]


class SdoStop:
    """
    The writes that make one drive stand still.

    :param timeout: s for each attempt.
    """

    def __init__(self, session: Session, node: WatchedNode, channel: SdoChannel,
                 timeout: float) -> None:
        self._session, self._node, self._channel = session, node, channel
        self._timeout = timeout
        self._answer_time = max(ANSWER_TIME, session.configuration.parameter_timeout)

    @property
    def longest(self) -> float:
        """How many s it takes at most beyond the attempts at each write."""
        return _ATTEMPTS_UNTIL_NMT * self._answer_time + NMT_TIME

    def writes(self, writes: Sequence[StopWrite], *, unanswered: bool = False) -> StopProcedure:
        """
        Stop it, each thing until it is acknowledged or was tried three times.

        :param unanswered: it was told by cycles, and has answered none.
        :return: what failed, in words.
        """
        began, nmt = self._channel.now, self._session.configuration.options.nmt_start

        def write(each: StopWrite) -> Procedure[tuple[Reply, int, Sentence]]:
            parameter = each.parameter
            data = parameter.word_from_raw(each.raw).to_bytes(width(parameter), 'little')
            step = Transfer(parameter.index or 0, parameter.subindex or 0, data,
                            attempts=STOP_ATTEMPTS, timeout=self._timeout)
            if not each.is_word:
                return (yield step), STOP_ATTEMPTS, NOTHING
            reply, attempts = yield from self._word(
                replace(step, attempts=1), unanswered=unanswered)
            hint = not nmt and self._may_be_stopped(began)
            return reply, attempts, sentences.node_may_be_stopped() if hint else NOTHING
        return write_until_answered(writes, write)

    def _word(self, word: Transfer, *, unanswered: bool) -> Procedure[tuple[Reply, int]]:
        """Write the control word; return what became of it, and the number of attempts."""
        began, attempts = self._channel.now, 0
        waited = began if unanswered else began + _ATTEMPTS_UNTIL_NMT * self._answer_time
        while True:
            may_be_stopped = self._may_be_stopped(began)
            due = self._said_stopped or may_be_stopped and self._channel.now > waited - _ROUNDING
            if due and self._session.configuration.options.nmt_start:
                return (yield from self._wake(word, attempts))
            if attempts >= STOP_ATTEMPTS and (due or not may_be_stopped):
                return SILENT, attempts
            reply = yield replace(word, again=attempts > 0)
            attempts += 1
            if reply is not SILENT:
                return reply, attempts

    def _wake(self, word: Transfer, attempts: int) -> Procedure[tuple[Reply, int]]:
        """Send NMT so that the node answers SDO, and the control word behind it, till it does."""
        until = self._channel.now + NMT_TIME - 0.5 * NMT_SPACING
        command = network.encode_nmt(NmtCommand.ENTER_PRE_OPERATIONAL, self._node.number)
        reply: Reply = SILENT
        while reply is SILENT and self._channel.now < until:
            self._session.outbox.put(command)
            reply = yield replace(word, timeout=NMT_SPACING, again=attempts > 0)
            attempts += 1
        return reply, attempts

    @property
    def _said_stopped(self) -> bool:
        return self._node.said(self._channel.now) is NmtState.STOPPED

    def _may_be_stopped(self, since: float) -> bool:
        """Return whether nothing shows that it is in another state; a PDO since then does."""
        return self._node.pdo_at < since and self._node.said(self._channel.now) in (
            None, NmtState.STOPPED)
