# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How the parameters of a drive are read and written for users, and where they stand.

A family says what a parameter takes (a *span*), which words that are, and which spans one read can
bring. Requests of users, rounds, and the books of what was sent, go by that.

What a request needs is the same for all families: as few frames as possible, a shared frame that
fails must take no name along, an absent drive is not asked twice, nothing is written after it, and
every parameter gets its outcome. Only how one frame is read, and how one parameter is written, is
the family's. All functions here are generators for :class:`.channel.Channel`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Hashable, Mapping, Sequence
from typing import Any, Generic, TypeVar, Union

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.process_image import LastSent
from drive_can_bridge.core.requests import (
    Failure, FailureKind, NOT_SENT, Outcome, Outcomes, ReadRequest, ReadValue, Request,
    RetryPolicy, WriteRequest)
from drive_can_bridge.core.text import value_text
from drive_can_bridge.protocols.channel import Channel, Priority
from drive_can_bridge.protocols.transactor import Refused, ReplyT, Silence, StepT

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
    Which of the writes that left are setpoints and control words: what a drive was commanded last.

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


Item = tuple[Parameter, int]
#: the words that a read brought, one for each address of its span
Found = Union[tuple[int, ...], Failure]


def read_back(parameter: Parameter, found: int, wanted: int) -> Failure:
    """Return that a drive has another raw integer than the one that was written."""
    return Failure(FailureKind.REFUSED, sentences.read_back_differs(
        value_text(parameter.value_from_raw(found)), value_text(parameter.value_from_raw(wanted))))


class ParameterAccess(ABC, Generic[SpanT, StepT, ReplyT]):
    """
    The parameters of one drive: serves the requests of users in their turn on its channel.

    A family says how one frame is read (:meth:`read`), how one is written (:meth:`write_one`; or
    :meth:`write`, and what fits into it, :meth:`misfit`).

    :param retry: what is said when nobody answers.
    :param placement: where the parameters stand.
    :cvar not_atomic: why several do not fit one frame, where it carries one.
    """

    not_atomic: Sentence

    def __init__(self, channel: Channel[StepT, ReplyT], retry: RetryPolicy,
                 placement: ParameterPlacement[SpanT]) -> None:
        self.channel = channel
        self.retry = retry
        self.placement = placement
        #: of writes that are being served: what became of their first names
        self._known: dict[Request, list[Outcome]] = {}

    @property
    def waiting(self) -> int:
        """How many requests wait behind the one being served."""
        return self.channel.waiting_users

    def serve(self, request: Request, done: Callable[[Outcomes], None], now: float,
              priority: Priority = Priority.USERS) -> None:
        """Queue a request; ``done`` gets an outcome for each name."""
        self.channel.run(self._read_all(request.parameters) if isinstance(request, ReadRequest)
                         else self._write_all(request), done, now, priority)

    def cancel(self) -> None:
        """Drop all of them without an answer."""
        self.channel.cancel(Priority.USERS)

    def known(self, request: Request) -> Outcomes:
        """Return what became of the first names of one that was forgotten, and forget that."""
        return tuple(self._known.pop(request, ()))

    # -- what a family knows ----------------------------------------------------------------------

    @abstractmethod
    def read(self, span: SpanT) -> Generator[StepT, ReplyT, Found]:
        """Read what one frame can bring."""

    def write(self, items: Sequence[Item]) -> Generator[StepT, ReplyT, Outcomes]:
        """Write what fits one frame, and see that the drive has it."""
        (parameter, raw), = items
        return ((yield from self.write_one(parameter, raw)),)

    def write_one(self, parameter: Parameter, raw: int) -> Generator[StepT, ReplyT, Outcome]:
        """Write likewise, where a frame carries one parameter."""
        raise NotImplementedError

    def write_blind(self, items: Sequence[Item]) -> Generator[StepT, ReplyT, Outcomes]:
        """Write without reading anything from the drive first."""
        return self.write(items)

    def misfit(self, items: Sequence[Item]) -> Sentence:
        """Return why several parameters do not fit one frame; '' if they do."""
        return self.not_atomic

    def aside(self, parameter: Parameter, *, write: bool) -> Outcome | None:
        """Return the outcome for a parameter that no frame can reach; None: one can."""
        return None

    # -- what is the same for all -----------------------------------------------------------------

    def failed(self, reply: Refused | Silence, attempts: int | None = None,
               timeout: float | None = None) -> Failure:
        """Return what became of a request; ``attempts`` in ``timeout`` s: as configured."""
        if isinstance(reply, Refused):
            return reply.failure
        return NOT_SENT if reply.refused else self.retry.unanswered(attempts, timeout)

    def _read_all(self, parameters: Sequence[Parameter]) -> Generator[StepT, ReplyT, Outcomes]:
        """Read parameters; what shares a frame with one that fails is asked for alone."""
        placement = self.placement
        spans = [placement.span(parameter) for parameter in parameters]
        words: dict[Hashable, int] = {}
        failures: dict[SpanT, Failure] = {}
        gone: Failure | None = None
        pending = placement.plan([span for parameter, span in zip(parameters, spans)
                                  if self.aside(parameter, write=False) is None])
        while pending and gone is None:
            span = pending.pop(0)
            found = yield from self.read(span)
            if not isinstance(found, Failure):
                words.update(zip(placement.addresses(span), found))
            elif found.kind is FailureKind.OFFLINE:
                gone = found
            else:
                failures[span] = found
                covered = set(placement.addresses(span))
                pending[:0] = [part for part in dict.fromkeys(spans)
                               if part != span and covered.issuperset(placement.addresses(part))]

        def outcome(parameter: Parameter, span: SpanT) -> Outcome:
            known = self.aside(parameter, write=False)
            if known is not None:
                return known
            raw = placement.raw_among(parameter, span, words)
            if raw is not None:
                return ReadValue(raw)
            return failures.get(span) or gone or self.retry.unanswered()

        return tuple(map(outcome, parameters, spans))

    def _write_all(self, request: WriteRequest) -> Generator[StepT, ReplyT, Outcomes]:
        """
        Write parameters one after the other; after one that an absent drive missed, none.

        Or all in one frame, or none (``set_parameters_atomically``).
        """
        items = request.items
        write = self.write_blind if request.blind else self.write
        if request.atomic and len(items) > 1:
            misfit = self.misfit(items)
            together = () if misfit else (yield from write(items))
            return together or (Failure(FailureKind.INVALID, misfit),) * len(items)
        outcomes = self._known[request] = []
        gone: Failure | None = None
        for parameter, raw in items:
            outcome = self.aside(parameter, write=True) or gone
            if outcome is None:
                outcome, = yield from write([(parameter, raw)])
                if isinstance(outcome, Failure) and outcome.kind in (
                        FailureKind.OFFLINE, FailureKind.NOT_SENT):
                    gone = outcome
            outcomes.append(outcome)
        return self.known(request)
