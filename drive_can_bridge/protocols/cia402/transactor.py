# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The acyclic channel to one drive: SDO, one transfer at a time, matched by object.

An answer says which object it is about, so that only the late answer to a transfer of the same
object could be mistaken for that to another one.
"""

from collections.abc import Callable, Generator, Hashable
from dataclasses import dataclass
import math
from typing import Union

from drive_can_bridge.core import frame_sentences, sentences
from drive_can_bridge.core.errors import RemoteProtocolError, Unasked
from drive_can_bridge.core.outbox import Outbox
from drive_can_bridge.core.process_image import LastSent
from drive_can_bridge.core.requests import RetryPolicy
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.protocols.canopen.sdo import SdoCommand, SdoMessage
from drive_can_bridge.protocols.channel import Channel, LATE_MAX, STOP_PATIENCE
from drive_can_bridge.protocols.cia402.states import STATUS_WORD
from drive_can_bridge.protocols.telegrams import Direction
from drive_can_bridge.protocols.transactor import (
    Answered, NOT_TAKEN, Refused, ResultT, Silence, SILENT, Transactor)

#: what every node has: device type, error register, identity; a refusal will do, too
ASIDE = (0x1000, 0), (0x1001, 0), (0x1018, 0), (0x1018, 1)
#: bytes of an object that are read at most
LENGTH_MAX = 256
_TIMED_OUT, _TOO_LONG, _BROKEN_OFF = 0x05040000, 0x05040005, 0x08000000


@dataclass(frozen=True)
class Transfer:
    """
    A transfer.

    :param data: what is written; None: the object is read.
    :param attempts: how often it is tried; None: a read as configured, a write once.
    :param timeout: s to wait for the answer; None: as configured.
    :param pause: s in which nothing is asked; then it is no transfer.
    :param again: it is the one before once more, which nobody has answered.
    """

    index: int = 0
    subindex: int = 0
    data: bytes | None = None
    attempts: int | None = None
    timeout: float | None = None
    pause: float = 0.0
    again: bool = False


@dataclass(frozen=True)
class ObjectRead(Answered[bytes]):
    """
    What was read; nothing after a write.

    :param sized: the drive has told how long the object is.
    :param padded: the drive answers with four bytes whatever the size, its status word, too; None:
        that has not been asked for yet.
    """

    content: bytes = b''
    sized: bool = True
    padded: bool | None = None

    def number(self, length: int | None = None, *, signed: bool = False) -> int:
        """Return the first bytes, or all, as a number."""
        return int.from_bytes(self.content[:length], 'little', signed=signed)

    def word(self, length: int, *, signed: bool) -> int | None:
        """
        Return what was read as a word of so many bytes; None: it has another length.

        More bytes are taken of a drive only that fills all up to four, where those are 00 or, of
        what is signed, the sign.
        """
        content, rest = self.content[:length], self.content[length:] if self.sized else b''
        sign = b'\xFF' if signed and content and content[-1] & 0x80 else b'\0'
        if len(content) < length or rest and not (
                self.padded and set(rest) in ({0}, set(sign))):
            return None
        return int.from_bytes(content, 'little')


Reply = Union[ObjectRead, Refused, Silence]


class SdoTransactor(Transactor[Transfer, Reply]):
    """
    Does one transfer at a time.

    What takes segments is broken off by an abort where it is not gone on with: a drive that waits
    for the request of the next one may take no other request, not even that to stop. That holds,
    too, for an upload whose answer says only after it was given up that it takes segments.

    :param outbox: takes the frames.
    :param sent: is told the setpoints and control words that left.
    """

    def __init__(self, node: int, outbox: Outbox, retry: RetryPolicy, sent: LastSent) -> None:
        super().__init__(retry)
        self._node = node
        self._outbox = outbox
        self._sent = sent
        self._places = {(each.index, each.subindex or 0): place
                        for place, each in enumerate(sent.parameters)}
        self._toggle = 0
        self._collected: bytearray | None = None    # of an object that takes segments
        self._abandoned = False                     # no further one is asked for
        self._padded: bool | None = None            # four bytes answer everything
        # the last upload that nothing has answered yet, and until when something may
        self._open_upload: tuple[Transfer | None, float] = None, -math.inf

    def begin(self, step: Transfer, now: float) -> None:
        self._collected = None
        if step.pause:
            self.silent = ObjectRead()
            self.expect(step, now + step.pause)
            return
        self.silent = SILENT
        self.expect(step, now + (self.retry.timeout if step.timeout is None else step.timeout))

        def left(sent: bool, then: float) -> None:
            if step.data is None:
                return      # a read that the bus refused is repeated when its time is over
            if not sent:
                self.end(step, NOT_TAKEN, then)
            elif (step.index, step.subindex) in self._places:
                self._sent.take((int.from_bytes(step.data, 'little'),),
                                self._places[step.index, step.subindex])
        if step.data is None:
            self._open_upload = step, self.deadline + self.silence + LATE_MAX
        frame = sdo.encode_upload(self._node, step.index, step.subindex) if step.data is None \
            else sdo.encode_download(self._node, step.index, step.subindex, step.data)
        self._outbox.put(frame, left)

    def receive(self, answer: bytes, now: float) -> Reply | bool:
        found, step = self.decode(answer), self.step
        if found.kind is SdoCommand.SEGMENT:
            return self._take_segment(found, now)
        upload, until = self._open_upload
        if upload is not None and _belongs(found, upload):
            self._open_upload = None, -math.inf
            if upload is not step and now < until:
                if found.kind is SdoCommand.UPLOAD_BEGUN:
                    self._give_up(_BROKEN_OFF, upload)
                raise Unasked(frame_sentences.sdo_given_up(answer.hex(' ').upper()))
        if step is None or not _belongs(found, step):
            raise Unasked(sentences.unasked(f'SDO response {answer.hex(" ").upper()}'))
        if found.kind is SdoCommand.UPLOAD_BEGUN:
            self._collected, self._toggle = bytearray(), 0
            return self._ask_segment(now)
        self.finish()
        if found.kind is SdoCommand.ABORT:
            return Refused(found.number, sdo.describe(found.number))
        if found.object == (STATUS_WORD, 0) and found.kind is SdoCommand.UPLOADED and found.last:
            self._padded = len(found.data) > 2
        return ObjectRead(found.data, found.last, self._padded)

    def decode(self, answer: bytes) -> SdoMessage:
        """
        Decode a response.

        :raises RemoteProtocolError: it is none.
        """
        return sdo.decode(Direction.RESPONSE, answer, segments=self._collected is not None)

    def answers(self, answer: bytes, step: Transfer) -> bool:
        """
        Return whether a response may be that to a transfer that was given up.

        :param answer: well-formed for one who expects segments.
        """
        return _belongs(sdo.decode(Direction.RESPONSE, answer), step)

    def _take_segment(self, found: SdoMessage, now: float) -> Reply | bool:
        if self._collected is None or found.toggle != self._toggle:
            raise RemoteProtocolError(frame_sentences.sdo_out_of_turn())
        self._collected += found.data
        self._toggle ^= sdo.TOGGLE
        if not found.last:
            if len(self._collected) <= LENGTH_MAX:
                return self._ask_segment(now)
            self._give_up(_TOO_LONG, self.step)     # not the drive's word: what came is the reply
        data = bytes(self._collected)
        self.finish()
        return ObjectRead(data, True, self._padded)

    def _ask_segment(self, now: float) -> Reply | bool:
        if self._abandoned:
            self.forget()
            return SILENT
        self.deadline = now + self.retry.timeout
        self._outbox.put(sdo.request(self._node, SdoMessage(
            SdoCommand.SEGMENT_WANTED, None, toggle=self._toggle)))
        return True

    def _give_up(self, code: int, step: Transfer | None) -> None:
        if step is not None:
            self._outbox.put(sdo.request(self._node, SdoMessage(
                SdoCommand.ABORT, (step.index, step.subindex), number=code)))

    def handle_timer(self, now: float) -> Reply | bool:
        if self._collected is not None and self.busy and now >= self.deadline:
            self._give_up(_TIMED_OUT, self.step)    # the drive waits for the next segment
        return super().handle_timer(now)

    def finish(self) -> None:
        super().finish()
        self._collected, self._abandoned = None, False

    def forget(self) -> None:
        if self._collected is not None:
            self._give_up(_BROKEN_OFF, self.step)
        super().forget()

    def attempts(self, step: Transfer) -> int:
        if step.attempts is not None or step.pause:
            return step.attempts or 1
        return self.retry.attempts if step.data is None else 1

    def again(self, step: Transfer) -> bool:
        return step.again

    def repeatable(self, step: Transfer, *, users: bool) -> bool:
        return not users or step.data is None

    def aside(self, is_late: Callable[[Hashable], bool]) -> Transfer | None:
        return next((Transfer(*place, attempts=1, timeout=min(STOP_PATIENCE, self.retry.timeout))
                     for place in ASIDE if not is_late(place)), None)

    def abandon(self, until: float) -> None:
        self._abandoned = self.busy
        self.deadline = min(self.deadline, until)

    def key(self, step: Transfer) -> Hashable | None:
        return None if step.pause else (step.index, step.subindex)


SdoChannel = Channel[Transfer, Reply]
#: yields steps, is sent what became of each, and returns something
Procedure = Generator[Transfer, Reply, ResultT]


def _belongs(found: SdoMessage, step: Transfer) -> bool:
    if step.pause:
        return False
    place = step.index, step.subindex
    if found.kind is SdoCommand.ABORT:    # of a command that it does not know, some say no object
        return found.object in (place, (0, 0))
    asked = SdoCommand.UPLOAD if step.data is None else SdoCommand.DOWNLOAD
    return found.object == place and found.kind.answers(asked)


