# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Reading and writing parameters of an inverter, in words that users understand.

Every function that has tasks to send is a generator for :class:`.channel.TaskChannel`.
"""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

from drive_can_bridge.core.parameters import Parameter, Storage
from drive_can_bridge.core.requests import (
    Failure, NO_ANSWER_OFFLINE, NOT_SENT, Outcome, ReadRequest, ReadValue, Request, Written,
)
from drive_can_bridge.core.words import value_text
from drive_can_bridge.protocols.cannord.channel import Ask, Procedure, Reply
from drive_can_bridge.protocols.cannord.parameter_frame import (
    error_text, ParameterFrame, Response, Task, WRITE_TASKS,
)
from drive_can_bridge.protocols.patience import Patience

WRONG_INDEX = 3
PROCESS_DATA_ONLY = 'exists in process data only'
NOT_ATOMIC = ('cannot be written in one frame, nothing was written: a CANnord frame carries one '
              'parameter')
_DOUBLE = (Response.DOUBLE, Response.ARRAY_DOUBLE)


@dataclass(frozen=True)
class Conditions(Patience):
    """
    What the procedures need to know of their drive.

    :param last_value: (parameter name) -> raw integer last received in process data, or None.
    :param persist: write to EEPROM where the profile does not say where.
    """

    last_value: Callable[[str], int | None]
    persist: bool


def of_request(request: Request, conditions: Conditions) -> Procedure:
    """Return the procedure that serves a request of a user."""
    if isinstance(request, ReadRequest):
        return read_parameters(request.parameters, conditions)
    if request.atomic:
        return write_together(request.items, conditions)
    return write_parameters(request.items, conditions)


def read_parameters(parameters: Sequence[Parameter], conditions: Conditions,
                    ) -> Generator[Ask, Reply, tuple[Outcome, ...]]:
    """Read parameters one after the other; after one that an absent drive missed, none."""
    outcomes: list[Outcome] = []
    gone: Failure | None = None
    for parameter in parameters:
        outcome: Outcome
        if parameter.number is None:
            outcome = _received(parameter, conditions)
        elif gone is not None:
            outcome = gone
        else:
            outcome = yield from read_parameter(parameter, conditions)
            gone = _gone(outcome)
        outcomes.append(outcome)
    return tuple(outcomes)


def read_parameter(parameter: Parameter, conditions: Conditions,
                   ) -> Generator[Ask, Reply, Outcome]:
    """Read one parameter that has a number."""
    answer = yield from _read(parameter, conditions)
    if isinstance(answer, Failure):
        return answer
    if parameter.width_known and (answer.identifier in _DOUBLE) != (parameter.type.bits == 32):
        return Failure(_width_text(parameter, answer))
    value = answer.value if answer.identifier in _DOUBLE else answer.word
    return ReadValue(parameter.raw_from_word(value))


def write_parameters(items: Sequence[tuple[Parameter, int]], conditions: Conditions,
                     ) -> Generator[Ask, Reply, tuple[Outcome, ...]]:
    """Write parameters one after the other; after one that an absent drive missed, none."""
    outcomes: list[Outcome] = []
    gone: Failure | None = None
    for parameter, raw in items:
        outcome: Outcome
        if parameter.number is None:
            outcome = Failure(PROCESS_DATA_ONLY)
        elif gone is not None:
            outcome = gone
        else:
            outcome = yield from write_parameter(parameter, raw, conditions)
            gone = _gone(outcome)
        outcomes.append(outcome)
    return tuple(outcomes)


def write_parameter(parameter: Parameter, raw: int, conditions: Conditions,
                    ) -> Generator[Ask, Reply, Outcome]:
    """
    Write one parameter that has a number; the response acknowledges it.

    Where nobody but the drive knows how wide the parameter is, it is read first.
    """
    double = parameter.type.bits == 32
    if not parameter.width_known:
        answer = yield from _read(parameter, conditions)
        if isinstance(answer, Failure):
            return answer
        double = answer.identifier in _DOUBLE
        if not double and not -0x8000 <= raw <= 0xFFFF:
            return Failure(f'{raw} is not representable in 16 bits: -32768 to 65535')
    array = parameter.subindex is not None
    persistent = (conditions.persist if parameter.storage is None
                  else parameter.storage is Storage.EEPROM)
    reply = yield Ask(WRITE_TASKS[array, double, persistent], parameter.number or 0,
                      parameter.subindex or 0, raw)
    if reply.response is not None:
        if reply.response.identifier != Response.REFUSED:
            return Written()
        refusal = yield from _refusal(parameter, reply.response)
        return refusal
    if not reply.sent:
        return Failure(NOT_SENT)
    if reply.contrary is not None:
        found = parameter.raw_from_word(
            reply.contrary.value if double else reply.contrary.word)
        return Failure(f'read back {value_text(parameter.value_from_raw(found))} '
                       f'instead of {value_text(parameter.value_from_raw(raw))}')
    return conditions.unanswered(1)


def write_together(items: Sequence[tuple[Parameter, int]], conditions: Conditions,
                   ) -> Generator[Ask, Reply, tuple[Outcome, ...]]:
    """Write in one frame, or nothing (``set_parameters_atomically``)."""
    if len(items) > 1:
        return (Failure(NOT_ATOMIC),) * len(items)
    outcomes = yield from write_parameters(items, conditions)
    return outcomes


# -- parts ----------------------------------------------------------------------------------------


def _read(parameter: Parameter, conditions: Conditions,
          ) -> Generator[Ask, Reply, ParameterFrame | Failure]:
    task = Task.READ if parameter.subindex is None else Task.READ_ARRAY
    reply = yield Ask(task, parameter.number or 0, parameter.subindex or 0)
    if reply.response is None:
        return conditions.unanswered()
    if reply.response.identifier == Response.REFUSED:
        refusal = yield from _refusal(parameter, reply.response)
        return refusal
    return reply.response


def _refusal(parameter: Parameter, response: ParameterFrame) -> Generator[Ask, Reply, Failure]:
    """Say why the drive refused; where an element does not exist, also how many there are."""
    text = f'refused by the drive: {error_text(response.word)}'
    if response.word == WRONG_INDEX and parameter.subindex is not None:
        reply = yield Ask(Task.READ_ELEMENTS, parameter.number or 0)
        answer = reply.response
        if answer is not None and answer.identifier == Response.ELEMENTS:
            noun = 'element' if answer.word == 1 else 'elements'
            text = f'{text}; P{parameter.number} has {answer.word} {noun}'
    return Failure(text)


def _received(parameter: Parameter, conditions: Conditions) -> Outcome:
    """Answer for a parameter that travels in process data only."""
    raw = conditions.last_value(parameter.name)
    if raw is not None:
        return ReadValue(raw)
    return Failure(f'{PROCESS_DATA_ONLY}, and none with it was received')


def _gone(outcome: Outcome) -> Failure | None:
    """Return the failure that all others of a request would meet, too; None: it is no such."""
    return outcome if isinstance(outcome, Failure) and outcome.reason in (
        NO_ANSWER_OFFLINE, NOT_SENT) else None


def _width_text(parameter: Parameter, answer: ParameterFrame) -> str:
    width = 'a double word' if answer.identifier in _DOUBLE else 'a word'
    wanted = 'int32 or uint32' if answer.identifier in _DOUBLE else 'bool, int16 or uint16'
    return (f'the drive answers with {width}, the profile says {parameter.type.value}: '
            f'correct the profile to {wanted}')
