# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Parameters of users by SDO.

Every generator here is for :class:`.transactor.SdoChannel`. What is written goes to the RAM;
it is acknowledged, and not read back. No parameter has more than four bytes, so that no download
takes segments; an object that is longer, which a raw name may find, is refused in words.
"""

from collections.abc import Sequence

from drive_can_bridge.core import requests, sentences
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.requests import (
    Failure, FailureKind, NOT_SENT, Outcome, Outcomes, RetryPolicy, Written)
from drive_can_bridge.core.roles import Cells
from drive_can_bridge.protocols.access import Found, Item, OneByOne, ParameterAccess
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.protocols.canopen.sdo import EXPEDITED_MAX
from drive_can_bridge.protocols.cia402.pdo import is_map, width
from drive_can_bridge.protocols.cia402.states import STATUS_WORD
from drive_can_bridge.protocols.cia402.transactor import (
    Procedure, SdoChannel, Transfer, TransferResult)

NO_OBJECT = sentences.no_object()
NOT_ATOMIC = sentences.not_in_one_frame('an SDO carries one object')
#: cell of every mapping parameter
MAP = 'communication'
#: s that a drive may take until it acknowledges that all is stored: CiA 301 sets no limit. Told
#: once more, it would wear its memory once more.
STORE_TIMEOUT = 5.0


def cells(parameter: Parameter) -> Cells:
    """Return what a parameter addresses."""
    index = parameter.index
    if index is None:
        return frozenset()
    if is_map(index):
        return frozenset(((index, parameter.subindex or 0), MAP))
    return frozenset(((index, parameter.subindex or 0),))


def refused(code: int) -> Failure:
    """Return that a drive refused a transfer."""
    return requests.refused(code, sentences.refused_by_drive(code, sdo.describe(code)))


class SdoAccess(ParameterAccess[Parameter, Transfer, TransferResult]):
    """Parameters by index and sub-index, one a transfer."""

    def __init__(self, channel: SdoChannel, retry: RetryPolicy) -> None:
        super().__init__(channel, retry, OneByOne())

    def read(self, span: Parameter) -> Procedure[Found]:
        reply = yield Transfer(span.index or 0, span.subindex or 0)
        failure = self._failure(reply)
        if failure is not None:
            return failure
        data, wanted = reply.data or b'', width(span)
        if not _own_width(span):
            return (int.from_bytes(data, 'little'),)
        if span.type is ParameterType.BOOL:
            return (data[0],)
        if len(data) > wanted and reply.padded is None and reply.sized:
            status = yield Transfer(STATUS_WORD)     # is that its way with everything?
            reply = reply._replace(padded=status.padded)
        word = reply.word(wanted, signed=span.type.signed)
        if word is None:
            return Failure(FailureKind.REFUSED, sentences.other_length(len(data), span.type.value))
        return (word,)

    def write(self, items: Sequence[Item]) -> Procedure[Outcomes]:
        (parameter, raw), = items
        return ((yield from self._write(parameter, raw)),)

    def aside(self, parameter: Parameter, *, write: bool) -> Outcome | None:
        return Failure(FailureKind.INVALID, NO_OBJECT) if parameter.index is None else None

    def misfit(self, items: Sequence[Item]) -> Sentence:
        return NOT_ATOMIC

    # -- parts ------------------------------------------------------------------------------------

    def _write(self, parameter: Parameter, raw: int) -> Procedure[Outcome]:
        """Write one parameter; of one whose width only the drive knows, it is asked first."""
        length = width(parameter)
        if not _own_width(parameter):
            reply = yield Transfer(parameter.index or 0, parameter.subindex or 0)
            failure = self._failure(reply)
            if failure is None:
                length = len(reply.data or b'')
            elif reply.abort != sdo.READ_OF_WRITE_ONLY:
                return failure
            elif not parameter.width_known:
                return Failure(FailureKind.INVALID, sentences.width_unknown())
            low, high = -1 << 8 * length - 1, (1 << 8 * length) - 1
            if not low <= raw <= high:
                return Failure(
                    FailureKind.INVALID, sentences.not_in_bits(raw, 8 * length, low, high))
        data = (raw & (1 << 8 * length) - 1).to_bytes(length, 'little')
        timeout = self.retry.timeout
        if parameter.stores:
            timeout = max(timeout, STORE_TIMEOUT)
        reply = yield Transfer(parameter.index or 0, parameter.subindex or 0, data,
                               timeout=timeout)
        if reply.data is not None:
            return Written()
        if reply.abort is not None:
            return refused(reply.abort)
        return self.retry.unanswered(1, timeout) if reply.sent else NOT_SENT

    def _failure(self, reply: TransferResult) -> Failure | None:
        """Return why what was read is no object of one to four bytes; None: it is."""
        if reply.abort is not None:
            return refused(reply.abort)
        if reply.data is None:
            return self.retry.unanswered()
        if not 1 <= len(reply.data) <= EXPEDITED_MAX:
            return Failure(FailureKind.REFUSED, sentences.too_long(len(reply.data)))
        return None


def _own_width(parameter: Parameter) -> bool:
    """Return whether a profile says how wide a parameter is; the drive knows for raw names."""
    return parameter.listed
