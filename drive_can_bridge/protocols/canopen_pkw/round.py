# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A round of reads: what it asks for, and what its answers say."""

from collections.abc import Callable, Generator, Mapping, Sequence

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.process_image import status_word
from drive_can_bridge.protocols.canopen_pkw.addresses import (
    instead_of, Placement, round_plan, round_spans, Span,
)
from drive_can_bridge.protocols.canopen_pkw.mailbox import (
    Read, Refused, Reply, Silence, Step,
)
from drive_can_bridge.protocols.canopen_pkw.pkw import Address

#: the words of all registers that were read; those that were refused are missing
Words = dict[Address, int]


class Round:
    """
    The rounds of one drive.

    :param warn: takes what the drive refuses, once.
    :ivar has_status: a status word is among what is read.
    :ivar refusals: the names of what the drive refuses, and why, by what was read.
    """

    def __init__(self, drive: DriveConfiguration, warn: Callable[[str], None]) -> None:
        self._drive = drive
        self._placement = Placement.of(drive)
        self._spans = [self._placement.span(parameter) for parameter in drive.cyclic_response]
        self._warn = warn
        status = status_word(drive)
        self._status = None if status is None else (status, self._placement.span(status))
        self.has_status = status is not None
        self.refusals: dict[Span, str] = {}
        self._plan: list[Span] = []
        self.start_over()

    def start_over(self) -> None:
        """Forget what was refused."""
        self.refusals.clear()
        self._plan = round_plan(self._drive)

    def read(self, answered: Callable[[Words], None]) -> Generator[Step, Reply, Words | None]:
        """
        Read everything once, each in one attempt.

        :param answered: told of every answer when it arrives.
        :return: what was read; None: something was not answered.
        """
        words: Words = {}
        pending = list(self._plan)
        while pending:
            span = pending.pop(0)
            reply = yield Read(span.address, span.count, attempts=1)
            if isinstance(reply, Silence):
                return None
            if isinstance(reply, Refused):
                pending[:0] = self._instead(span, reply)
                continue
            self.refusals.pop(span, None)
            found = dict(zip(span.addresses, reply.words))
            words.update(found)
            answered(found)
        return words

    def _instead(self, span: Span, refused: Refused) -> Sequence[Span]:
        """Take a refusal: two parameters that share a read are read alone from now on."""
        parts = instead_of(span, round_spans(self._drive))
        if parts:
            place = self._plan.index(span)
            self._plan[place:place + 1] = parts
            return parts
        names = ', '.join(parameter.name for parameter, own in zip(
            self._drive.cyclic_response, self._spans) if own == span)
        if span not in self.refusals:
            self._warn(f'read {names or span.address}: {refused.text}')
        self.refusals[span] = f'{names or span.address} {refused.text}'
        return parts

    def raws(self, words: Mapping[Address, int]) -> list[int | None]:
        """Return the values that a round has brought; None for what was refused."""
        return [self._placement.raw_among(parameter, span, words)
                for parameter, span in zip(self._drive.cyclic_response, self._spans)]

    def status(self, words: Mapping[Address, int]) -> int | None:
        """Return the status word, if it is among the words."""
        return None if self._status is None else self._placement.raw_among(
            *self._status, words)
