# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What takes more than one request: parameters of users, the round of reads, the safe stop.

Every function here is a generator for :class:`.mailbox.MailboxChannel`.
"""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Union

from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.requests import (
    Failure, NO_ANSWER_OFFLINE, NOT_SENT, Outcome, ReadRequest, ReadValue, Request, Written,
)
from drive_can_bridge.protocols.canopen_pkw import addresses
from drive_can_bridge.protocols.canopen_pkw.addresses import Span
from drive_can_bridge.protocols.canopen_pkw.mailbox import (
    Answered, Procedure, Read, Refused, Reply, Silence, Step, Write,
)
from drive_can_bridge.protocols.canopen_pkw.pkw import Address
from drive_can_bridge.protocols.patience import Patience

NOT_TOGETHER = ('cannot be written in one frame, nothing was written: two 16-bit parameters in '
                'adjacent registers fit, or one of 32 bits')


@dataclass(frozen=True)
class Conditions(Patience):
    """
    What the procedures need to know of their drive.

    :param addressing: how listed parameters are reached.
    :param word_order: of 32-bit values.
    """

    addressing: str
    word_order: str

    def span(self, parameter: Parameter) -> Span:
        """Return what a parameter takes."""
        return addresses.span_of(parameter, self.addressing)


# -- parameters of users --------------------------------------------------------------------------


def of_request(request: Request, conditions: Conditions) -> Procedure:
    """Return the procedure that serves a request of a user."""
    if isinstance(request, ReadRequest):
        return read_parameters(request.parameters, conditions)
    if request.atomic:
        return write_together(request.items, conditions)
    return write_parameters(request.items, conditions)


def read_parameters(parameters: Sequence[Parameter], conditions: Conditions,
                    ) -> Generator[Step, Reply, tuple[Outcome, ...]]:
    """Read parameters; adjacent registers share a request, and a shared request may fail alone."""
    spans = [conditions.span(parameter) for parameter in parameters]
    words: dict[Address, int] = {}
    failures: dict[Span, Failure] = {}
    pending = addresses.plan(spans)
    while pending:
        span = pending.pop(0)
        reply = yield Read(span.address, span.count)
        if isinstance(reply, Answered):
            words.update(zip(span.addresses, reply.words))
            continue
        if isinstance(reply, Silence) and conditions.offline():
            break
        pending[:0] = _parts(span, spans)
        failures[span] = conditions.unanswered() if isinstance(
            reply, Silence) else Failure(reply.text)

    def outcome(parameter: Parameter, span: Span) -> Outcome:
        if all(address in words for address in span.addresses):
            return ReadValue(addresses.raw_from_words(
                parameter, [words[address] for address in span.addresses],
                conditions.word_order))
        return failures.get(span) or conditions.unanswered()

    return tuple(map(outcome, parameters, spans))


def _parts(shared: Span, spans: Sequence[Span]) -> list[Span]:
    """Return the spans that a request covers besides itself."""
    return sorted({span for span in spans if span != shared
                   and set(span.addresses) <= set(shared.addresses)})


def write_parameters(items: Sequence[tuple[Parameter, int]], conditions: Conditions,
                     ) -> Generator[Step, Reply, tuple[Outcome, ...]]:
    """Write parameters one after the other; after one that an absent drive missed, none."""
    outcomes: list[Outcome] = []
    for parameter, raw in items:
        words = addresses.words_from_raw(parameter, raw, conditions.word_order)
        outcome = yield from _write(conditions.span(parameter).address, words, conditions)
        outcomes.append(outcome)
        if isinstance(outcome, Failure) and outcome.reason in (NO_ANSWER_OFFLINE, NOT_SENT):
            outcomes += [outcome] * (len(items) - len(outcomes))
            break
    return tuple(outcomes)


def write_together(items: Sequence[tuple[Parameter, int]], conditions: Conditions,
                   ) -> Generator[Step, Reply, tuple[Outcome, ...]]:
    """Write parameters in one request, or nothing (``set_parameters_atomically``)."""
    words: dict[Address, int] = {}
    spans = [conditions.span(parameter) for parameter, _ in items]
    for span, (parameter, raw) in zip(spans, items):
        words.update(zip(span.addresses, addresses.words_from_raw(
            parameter, raw, conditions.word_order)))
    shared = addresses.plan(spans)
    if len(shared) != 1 or sum(span.count for span in spans) != shared[0].count:
        return (Failure(NOT_TOGETHER),) * len(items)
    outcome = yield from _write(
        shared[0].address, tuple(words[address] for address in shared[0].addresses), conditions)
    return (outcome,) * len(items)


def _write(address: Address, words: tuple[int, ...], conditions: Conditions,
           ) -> Generator[Step, Reply, Outcome]:
    """
    Write once.

    The device acknowledges. A lost acknowledgement is a failure: sent again, the write could be
    executed twice. What was not sent because the mailbox was out of step is tried again.
    """
    reply: Reply = Silence()
    for _ in range(conditions.attempts):
        reply = yield Write(address, words)
        if isinstance(reply, Answered):
            return Written()
        if isinstance(reply, Refused):
            return Failure(reply.text)
        if reply.refused:
            return Failure(NOT_SENT)
        if reply.sent:
            return conditions.unanswered(1)
    return conditions.unanswered()


# -- the exchange ---------------------------------------------------------------------------------


#: what a round of reads brought: the words of all registers; None: something was not answered
RoundResult = Union[dict[Address, int], None]
#: what became of the last writes: why which one may not have been executed
Farewell = Generator[Step, Reply, list[str]]


class LastWrite(NamedTuple):
    """
    Something that makes a drive stand still.

    :param name: of the parameter.
    """

    name: str
    span: Span
    words: tuple[int, ...]


def read_round(spans: Sequence[Span], answered: Callable[[Span, tuple[int, ...]], None],
               refused: Callable[[Span, Refused], Sequence[Span]],
               ) -> Generator[Step, Reply, RoundResult]:
    """
    Read all registers of a round. A read that nobody answers ends it.

    :param answered: told of every answer when it arrives.
    :param refused: told of every refusal; returns what to read instead.
    :return: what was read; without the registers of reads that were refused.
    """
    words: dict[Address, int] = {}
    pending = list(spans)
    while pending:
        span = pending.pop(0)
        reply = yield Read(span.address, span.count, attempts=1)
        if isinstance(reply, Silence):
            return None
        if isinstance(reply, Refused):
            pending[:0] = refused(span, reply)
            continue
        found = reply.words[:span.count]
        words.update(zip(span.addresses, found))
        answered(span, found)
    return words


def write_until_answered(writes: Sequence[LastWrite], attempts: int, timeout: float,
                         last: float) -> Farewell:
    """
    Tell a drive to stand still, each thing until it is answered or was tried ``attempts`` times.

    It may be executed twice: that does no harm. As the toggle is inverted with every attempt, not
    even an unknown function byte of the device keeps it from taking notice.

    :param timeout: s for each attempt but the last.
    :param last: s for that.
    :return: what failed, in words.
    """
    failed = []
    for name, span, words in writes:
        reply: Reply = Silence()
        for attempt in range(1, attempts + 1):
            reply = yield Write(span.address, words, blind=True,
                                timeout=last if attempt == attempts else timeout)
            if not isinstance(reply, Silence):
                break
        if isinstance(reply, Refused):
            failed.append(f'{name} {reply.text}')
        elif isinstance(reply, Silence):
            failed.append(f'{name} not taken by the bus' if reply.refused else
                          f'{name} not acknowledged in {attempts} attempts')
    return failed
