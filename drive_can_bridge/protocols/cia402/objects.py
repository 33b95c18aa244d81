# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Objects of a drive as its set-up reads and writes them, and how the set-up ends.

Whatever nobody answers ends it. A refusal says that there is no such object only where the drive
says so (06020000h, 06090011h): it may be write only, or not to be had in this state.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.protocols.cia402.transactor import ObjectRead, Procedure, Transfer
from drive_can_bridge.protocols.transactor import Refused, Silence


class SetUpState(Enum):
    """What the set-up has come to."""

    READY = 'ready'
    DIFFERS = 'differs'
    RUNS = 'runs on'
    SILENT = 'no answer any more'
    ABSENT = 'no answer at all'


@dataclass(frozen=True)
class SetUpOutcome:
    """
    The end of the set-up.

    :param text: what differs, how it runs on, or what is not answered.
    :param status: the last status word, where it is ready.
    :param remedy: says what to do about what differs.
    """

    found: SetUpState
    text: Sentence = NOTHING
    status: int = 0
    remedy: Callable[[str], Sentence] = sentences.drive_to_correct


class SetUpEnd(Exception):
    """The set-up ends here."""

    def __init__(self, outcome: SetUpOutcome) -> None:
        super().__init__(outcome.text)
        self.outcome = outcome


class ObjectAccess:
    """
    Reads and writes numbers.

    :param attempts: how often a write is tried: it stays the same.
    :ivar abort: the code with which the last transfer was refused; None: it was not.
    """

    def __init__(self, attempts: int) -> None:
        self.abort: int | None = None
        self._attempts = attempts

    @property
    def absent(self) -> bool:
        """The drive says that it has no such object as was asked for last."""
        return self.abort in sdo.ABSENT

    def transfer(self, ask: Transfer) -> Procedure[ObjectRead | Refused]:
        """Do one transfer. :raises SetUpEnd: nobody answers."""
        reply = yield ask
        if isinstance(reply, Silence):
            raise SetUpEnd(SetUpOutcome(SetUpState.SILENT, sentences.object_unanswered(
                at_object(ask.index, ask.subindex))))
        self.abort = reply.code if isinstance(reply, Refused) else None
        return reply

    def read(self, index: int, subindex: int = 0, length: int = 4, *, signed: bool = False,
             ) -> Procedure[int | None]:
        """
        Read a number; None: the drive refuses.

        :param length: its bytes, where the drive does not tell, or answers with four always.
        :raises SetUpEnd: nobody answers.
        """
        reply = yield from self.transfer(Transfer(index, subindex))
        if isinstance(reply, Refused):
            return None
        word = reply.word(length, signed=signed)
        data = reply.content if word is None else word.to_bytes(length, 'little')
        return int.from_bytes(data, 'little', signed=signed)

    def put(self, index: int, subindex: int, value: int, length: int, meant: str = '',
            ) -> Procedure[Sentence]:
        """
        Write a number; return the refusal.

        :param meant: what it stands for there.
        :raises SetUpEnd: nobody answers.
        """
        data = (value & (1 << 8 * length) - 1).to_bytes(length, 'little')
        reply = yield from self.transfer(Transfer(index, subindex, data, attempts=self._attempts))
        return NOTHING if isinstance(reply, ObjectRead) else sentences.object_refused(
            what=at_object(index, subindex), why=reply.meaning, meant=meant)

    def must(self, index: int, subindex: int, value: int, length: int) -> Procedure[None]:
        """Write a number. :raises SetUpEnd: nobody answers, or the drive refuses."""
        refusal = yield from self.put(index, subindex, value, length)
        if refusal:
            raise differs(refusal)


def differs(text: Sentence, remedy: Callable[[str], Sentence] = sentences.drive_to_correct,
            ) -> SetUpEnd:
    """Return what ends the set-up of a drive that does not fit."""
    return SetUpEnd(SetUpOutcome(SetUpState.DIFFERS, text, remedy=remedy))


def at_object(index: int, subindex: int = 0) -> str:
    """
    Write where an object is.

    >>> at_object(0x1600, 3)
    '1600h.03h'
    """
    return f'{index:04X}h.{subindex:02X}h'
