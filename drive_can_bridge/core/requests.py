# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Acyclic requests of users, the outcome of each parameter in them, and how often a drive is asked.

A request holds the parameters of one service call. It is answered exactly once, by a
:class:`~drive_can_bridge.core.events.RequestCompleted` event with one outcome per parameter in
the order asked.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Union

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.parameters import Parameter


class FailureKind(Enum):
    """Why a parameter was not read or written, for programs."""

    NO_ANSWER = 'the drive was asked, and did not answer'
    OFFLINE = 'the drive is not there, or takes no requests'
    NOT_SENT = 'the bus takes no frames'
    REFUSED = 'the drive refused, or has something else than was written'
    ABSENT = 'the drive says that it has no such parameter'
    INVALID = 'the drive cannot be asked for that'
    UNAVAILABLE = 'the bridge does not serve it now, whatever the drive'

    @property
    def unheard(self) -> bool:
        """Whether no frame of the drive came: it may have done it all the same, or be absent."""
        return self not in (FailureKind.REFUSED, FailureKind.ABSENT, FailureKind.INVALID)

    @property
    def of_bridge(self) -> bool:
        """Whether it is no fault of the parameter: all others would have failed alike."""
        return self in (FailureKind.OFFLINE, FailureKind.UNAVAILABLE)


@dataclass(frozen=True)
class Failure:
    """One parameter failed; ``reason`` says why in words."""

    kind: FailureKind
    reason: Sentence


@dataclass(frozen=True)
class ReadValue:
    """A parameter was read."""

    raw: int


@dataclass(frozen=True)
class Written:
    """
    A parameter was written.

    :param note: what the user should know about the certainty of it; usually ''.
    """

    note: str = ''


#: refusals of CANopen that mean that there is no such object, or no such sub-index
ABSENT_CODES = frozenset((0x06020000, 0x06090011))
NOT_SENT = Failure(FailureKind.NOT_SENT, sentences.not_sent())

Outcome = Union[Failure, ReadValue, Written]
#: of a request: one for each name
Outcomes = tuple[Outcome, ...]

#: how reasons begin, in this order
_TEXTS: dict[str, FailureKind] = {
    sentences.no_answer_offline(): FailureKind.OFFLINE,
    sentences.no_answer_briefly(): FailureKind.NO_ANSWER,
    sentences.drive_offline(): FailureKind.OFFLINE,
    sentences.not_sent(): FailureKind.NOT_SENT,
    sentences.bus_down(): FailureKind.UNAVAILABLE,
    sentences.bridge_inactive(): FailureKind.UNAVAILABLE,
    sentences.busy(): FailureKind.UNAVAILABLE,
    **{sentences.refused_by_drive(code, f'{code:08X}h'): FailureKind.ABSENT
       for code in ABSENT_CODES},
}


def refused(code: int, reason: Sentence) -> Failure:
    """Return what became of a request that a CANopen node refused with an abort code."""
    return Failure(FailureKind.ABSENT if code in ABSENT_CODES else FailureKind.REFUSED, reason)


def is_answer(outcome: Outcome) -> bool:
    """Return whether an outcome rests on an answer of the drive."""
    if isinstance(outcome, Failure):
        return not outcome.kind.unheard
    return not (isinstance(outcome, Written) and outcome.note)


def kind_of(reason: str) -> FailureKind:
    """Return the kind of a failure whose reason came as mere text, through ROS."""
    return next((kind for text, kind in _TEXTS.items() if reason.startswith(text)),
                FailureKind.REFUSED)


@dataclass(frozen=True, eq=False)
class ReadRequest:
    """A request to read parameters, each one by itself if need be."""

    parameters: tuple[Parameter, ...]

    def __len__(self) -> int:
        return len(self.parameters)


@dataclass(frozen=True, eq=False)
class WriteRequest:
    """
    A request to write parameters in order.

    :param items: (parameter, raw integer).
    :param atomic: all in one frame, or none.
    :param blind: sent without an answer: the drive may receive although its answers get lost.
    """

    items: tuple[tuple[Parameter, int], ...]
    atomic: bool = False
    blind: bool = False

    def __len__(self) -> int:
        return len(self.items)


Request = Union[ReadRequest, WriteRequest]


@dataclass(slots=True)
class RetryPolicy:
    """
    How long and how often a drive is asked; one for each drive, whose time-out may change.

    :param timeout: s to wait for an answer.
    :param attempts: how often a read is sent before it counts as unanswered.
    :param offline: returns whether the drive is absent; then one unanswered frame ends a request.
    """

    timeout: float
    attempts: int
    offline: Callable[[], bool] = lambda: False

    def unanswered(self, attempts: int | None = None, timeout: float | None = None) -> Failure:
        """Return the failure for no answer; None: as often, and in so many s, as configured."""
        if self.offline():
            return Failure(FailureKind.OFFLINE, sentences.no_answer_offline())
        return Failure(FailureKind.NO_ANSWER, sentences.no_answer(
            self.timeout if timeout is None else timeout,
            self.attempts if attempts is None else attempts))
