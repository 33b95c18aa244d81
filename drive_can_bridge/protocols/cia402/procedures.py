# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Parameters of users by SDO.

Every generator here is for :class:`.transactor.SdoChannel`. What is written goes to the RAM;
it is acknowledged, and not read back. No parameter has more than four bytes, so that no download
takes segments; an object that is longer, which a raw name may find, is refused in words.
"""

from dataclasses import replace

from drive_can_bridge.core import sentences
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.requests import Failure, FailureKind, Outcome, Written
from drive_can_bridge.core.roles import Cells
from drive_can_bridge.protocols.access import Found, ParameterAccess
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.protocols.canopen.sdo import EXPEDITED_MAX
from drive_can_bridge.protocols.cia402.pdo import is_map, width
from drive_can_bridge.protocols.cia402.states import STATUS_WORD
from drive_can_bridge.protocols.cia402.transactor import (
    ObjectRead, Procedure, Reply, Transfer)
from drive_can_bridge.protocols.transactor import Refused

NO_OBJECT = sentences.no_object()
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


class SdoAccess(ParameterAccess[Parameter, Transfer, Reply]):
    """Parameters by index and sub-index, one a transfer."""

    not_atomic = sentences.not_in_one_frame('an SDO carries one object')

    def read(self, span: Parameter) -> Procedure[Found]:
        reply = yield Transfer(span.index or 0, span.subindex or 0)
        if not isinstance(reply, ObjectRead):
            return self.failed(reply)
        data, wanted = reply.content, width(span)
        if not 1 <= len(data) <= EXPEDITED_MAX:
            return _no_number(data)
        if not _own_width(span):
            return (reply.number(),)
        if span.type is ParameterType.BOOL:
            return (data[0],)
        if len(data) > wanted and reply.padded is None and reply.sized:
            status = yield Transfer(STATUS_WORD)     # is that its way with everything?
            reply = replace(reply, padded=isinstance(status, ObjectRead) and status.padded)
        word = reply.word(wanted, signed=span.type.signed)
        if word is None:
            return Failure(FailureKind.REFUSED, sentences.other_length(len(data), span.type.value))
        return (word,)

    def aside(self, parameter: Parameter, *, write: bool) -> Outcome | None:
        return Failure(FailureKind.INVALID, NO_OBJECT) if parameter.index is None else None

    # -- parts ------------------------------------------------------------------------------------

    def write_one(self, parameter: Parameter, raw: int) -> Procedure[Outcome]:
        """Write one parameter; of one whose width only the drive knows, it is asked first."""
        length = width(parameter)
        if not _own_width(parameter):
            reply = yield Transfer(parameter.index or 0, parameter.subindex or 0)
            if isinstance(reply, ObjectRead):
                length = len(reply.content)
                if not 1 <= length <= EXPEDITED_MAX:
                    return _no_number(reply.content)
            elif reply != Refused(sdo.READ_OF_WRITE_ONLY):
                return self.failed(reply)
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
        return Written() if isinstance(reply, ObjectRead) else self.failed(reply, 1, timeout)


def _no_number(data: bytes) -> Failure:
    return Failure(FailureKind.REFUSED, sentences.too_long(len(data)))


def _own_width(parameter: Parameter) -> bool:
    """Return whether a profile says how wide a parameter is; the drive knows for raw names."""
    return parameter.listed
