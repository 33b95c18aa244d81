# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Where the parameters of a drive stand, by whatever its telegrams address them.

A family says what a parameter takes (a *span*), which words that are, and which spans one read can
bring. Requests of users, rounds, and the books of what was sent, go by that.
"""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from typing import Any, Generic, TypeVar

from drive_can_bridge.core.last_sent import LastSent
from drive_can_bridge.core.parameters import Parameter

#: what one read asks for, and what one parameter takes
SpanT = TypeVar('SpanT', bound=Hashable)


class ParameterPlacement(ABC, Generic[SpanT]):
    """Where the parameters of one drive stand, and how their values lie in the words there."""

    @abstractmethod
    def span(self, parameter: Parameter) -> SpanT:
        """Return what a parameter takes."""

    @abstractmethod
    def addresses(self, span: SpanT) -> Sequence[Hashable]:
        """Return the address of each word of a span."""

    @abstractmethod
    def plan(self, spans: Sequence[SpanT]) -> list[SpanT]:
        """Cover everything by as few reads as possible."""

    def raw(self, parameter: Parameter, words: Sequence[int]) -> int:
        """Return the raw integer of a parameter, given the words of its span; more do no harm."""
        return parameter.raw_from_word(words[0])

    def words(self, parameter: Parameter, raw: int) -> tuple[int, ...]:
        """Return the words of a parameter's span."""
        return (parameter.word_from_raw(raw),)

    def raw_among(self, parameter: Parameter, span: SpanT,
                  words: Mapping[Any, int]) -> int | None:
        """
        Return the raw integer of a parameter; None: not all of it is there.

        :param span: of the parameter.
        :param words: by address.
        """
        addresses = self.addresses(span)
        if any(address not in words for address in addresses):
            return None
        return self.raw(parameter, [words[address] for address in addresses])


class OneByOne(ParameterPlacement[Parameter]):
    """Parameters of drives that answer for one at a time, as one word of whatever width."""

    def span(self, parameter: Parameter) -> Parameter:
        return parameter

    def addresses(self, span: Parameter) -> tuple[Parameter]:
        return (span,)

    def plan(self, spans: Sequence[Parameter]) -> list[Parameter]:
        return list(dict.fromkeys(spans))


class SentWrites(Generic[SpanT]):
    """
    Which of the writes that left are setpoints and control words: what a drive was told last.

    :param sent: where that is kept.
    """

    def __init__(self, sent: LastSent, placement: ParameterPlacement[SpanT]) -> None:
        self._sent = sent
        self._placement = placement
        self._spans = [placement.span(parameter) for parameter in sent.parameters]

    def note(self, span: SpanT, words: Sequence[int]) -> None:
        """Record a write that left."""
        found = dict(zip(self._placement.addresses(span), words))
        for place, parameter in enumerate(self._sent.parameters):
            raw = self._placement.raw_among(parameter, self._spans[place], found)
            if raw is not None:
                self._sent.take((raw,), place)
