# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Acyclic requests of users, and what became of each parameter in them.

A request holds the parameters of one service call. It is answered exactly once, by a
:class:`~drive_can_bridge.core.events.RequestCompleted` event with one outcome per parameter in
the order asked.
"""

from dataclasses import dataclass
from typing import Union

from drive_can_bridge.core.parameters import Parameter


@dataclass(frozen=True)
class Failure:
    """One parameter failed; ``reason`` says why in words."""

    reason: str


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

#: what begins every reason of a failure for which no frame of the drive came
NO_ANSWER = 'no answer'
SENT_UNACKNOWLEDGED = 'sent; this protocol does not acknowledge writes'
BUS_DOWN = 'bus down'
NOT_SENT = 'not sent: the bus takes no frames'
BRIDGE_INACTIVE = 'bridge inactive'
BUSY = 'busy'
OFFLINE = 'drive offline'
NO_ANSWER_OFFLINE = f'{NO_ANSWER}; {OFFLINE}'
_NOTHING_SAID = (NO_ANSWER, BUS_DOWN, NOT_SENT, BRIDGE_INACTIVE, BUSY, OFFLINE)


def is_answer(outcome: Outcome) -> bool:
    """Tell whether an outcome rests on something that the drive said."""
    if isinstance(outcome, Failure):
        return not outcome.reason.startswith(_NOTHING_SAID)
    return not (isinstance(outcome, Written) and outcome.note)


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
