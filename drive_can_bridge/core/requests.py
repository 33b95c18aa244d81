# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Acyclic requests of users, what became of each parameter in them, and how often a drive is asked.

A request holds the parameters of one service call. It is answered exactly once, by a
:class:`~drive_can_bridge.core.events.RequestCompleted` event with one outcome per parameter in
the order asked.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Union

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.core.parameters import Parameter


@dataclass(frozen=True)
class Failure:
    """One parameter failed; ``reason`` says why in words."""

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


Outcome = Union[Failure, ReadValue, Written]
#: of a request: one for each name
Outcomes = tuple[Outcome, ...]

#: codes of failures for which no frame of the drive came
SILENT = frozenset(['no_answer', 'no_answer_offline', 'no_answer_because'])
ABSENT = frozenset(['drive_offline', 'drive_offline_because'])
_NOTHING_SAID_TEXTS = (
    'no answer', sentences.drive_offline(), sentences.bus_down(), sentences.not_sent(),
    sentences.bridge_inactive(), sentences.busy())
_NOTHING_SAID = SILENT | ABSENT | {'bus_down', 'not_sent', 'bridge_inactive', 'busy'}


def is_answer(outcome: Outcome) -> bool:
    """Tell whether an outcome rests on something that the drive said."""
    if isinstance(outcome, Failure):
        return outcome.reason.code not in _NOTHING_SAID
    return not (isinstance(outcome, Written) and outcome.note)


def tells_nothing(reason: str) -> bool:
    """Tell whether a reason that came as mere text says that no frame of the drive came."""
    return reason.startswith(_NOTHING_SAID_TEXTS)


@dataclass(frozen=True, eq=False)
class ReadRequest:
    """Read parameters, each one if need be alone."""

    parameters: tuple[Parameter, ...]

    def __len__(self) -> int:
        return len(self.parameters)


@dataclass(frozen=True, eq=False)
class WriteRequest:
    """
    Write parameters in order.

    :param items: (parameter, raw integer).
    :param atomic: all in one frame, or none.
    :param blind: sent although nobody answers: the drive may hear although its answers get lost.
    """

    items: tuple[tuple[Parameter, int], ...]
    atomic: bool = False
    blind: bool = False

    def __len__(self) -> int:
        return len(self.items)


Request = Union[ReadRequest, WriteRequest]


def _never() -> bool:
    return False


@dataclass(slots=True)
class RetryPolicy:
    """
    What everybody who asks a drive has to know; one for each drive, whose time-out may change.

    :param timeout: s to wait for an answer.
    :param attempts: how often a read is sent before it counts as unanswered.
    :param offline: tells whether nobody is there; then one unanswered frame ends a request.
    """

    timeout: float
    attempts: int
    offline: Callable[[], bool] = _never

    def unanswered(self, attempts: int | None = None, timeout: float | None = None) -> Failure:
        """Say that nobody answered; None: as often, and in so many s, as configured."""
        if self.offline():
            return Failure(sentences.no_answer_offline())
        return Failure(sentences.no_answer(
            self.timeout if timeout is None else timeout,
            self.attempts if attempts is None else attempts))
