# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a round of reads asks for, and what its answers say."""

from collections.abc import Callable, Mapping, Sequence

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.canopen_pkw import addresses
from drive_can_bridge.protocols.canopen_pkw.addresses import Span
from drive_can_bridge.protocols.canopen_pkw.mailbox import Refused
from drive_can_bridge.protocols.canopen_pkw.pkw import Address


class Round:
    """
    The rounds of one drive.

    :param status: the parameter of the status word, if there is one.
    :param warn: takes what the drive refuses, once.
    :ivar plan: what is read.
    :ivar refusals: the names of what the drive refuses, and why, by what was read.
    """

    def __init__(self, drive: DriveConfiguration, status: Parameter | None,
                 warn: Callable[[str], None]) -> None:
        self._drive = drive
        self._addressing: str = drive.options.addressing
        self._word_order: str = drive.options.word_order
        self._spans = [addresses.span_of(parameter, self._addressing)
                       for parameter in drive.cyclic_response]
        self._warn = warn
        self._status = status
        self._status_span = None if status is None else addresses.span_of(
            status, self._addressing)
        self.refusals: dict[Span, str] = {}
        self.plan: list[Span] = []
        self.start_over()

    def start_over(self) -> None:
        """Forget what was refused."""
        self.refusals.clear()
        self.plan = addresses.round_plan(self._drive)

    def refused(self, span: Span, refused: Refused) -> Sequence[Span]:
        """
        Take a refusal; two parameters that share a read are read alone from now on.

        :return: what to read instead.
        """
        wanted = addresses.round_spans(self._drive)
        if span not in wanted:
            parts = sorted({part for part in wanted
                            if set(part.addresses) <= set(span.addresses)})
            place = self.plan.index(span)
            self.plan[place:place + 1] = parts
            return parts
        names = ', '.join(parameter.name for parameter, own in zip(
            self._drive.cyclic_response, self._spans) if own == span)
        if span not in self.refusals:
            self._warn(f'read {names or span.address}: {refused.text}')
        self.refusals[span] = f'{names or span.address} {refused.text}'
        return ()

    def raws(self, words: Mapping[Address, int]) -> list[int | None]:
        """Return the values that a round has brought; None for what was refused."""
        return [self._raw(parameter, span, words)
                for parameter, span in zip(self._drive.cyclic_response, self._spans)]

    def status(self, words: Mapping[Address, int]) -> int | None:
        """Return the status word, if it is among the words."""
        if self._status is None or self._status_span is None:
            return None
        return self._raw(self._status, self._status_span, words)

    def _raw(self, parameter: Parameter, span: Span,
             words: Mapping[Address, int]) -> int | None:
        if any(address not in words for address in span.addresses):
            return None
        return addresses.raw_from_words(
            parameter, [words[address] for address in span.addresses], self._word_order)
