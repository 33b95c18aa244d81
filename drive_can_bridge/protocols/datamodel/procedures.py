# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What takes more than one acyclic frame: reading and writing parameters, checking and writing maps.

Every function here is a generator for :class:`.channel.AcyclicChannel`.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Union

from drive_can_bridge.core.parameters import Parameter, ParameterType, Storage
from drive_can_bridge.core.requests import (
    Failure, NO_ANSWER_OFFLINE, NOT_SENT, Outcome, ReadRequest, ReadValue, Request,
    SENT_UNACKNOWLEDGED, Written,
)
from drive_can_bridge.core.words import value_text
from drive_can_bridge.protocols.datamodel.channel import Procedure, Read, Step, Words, Write
from drive_can_bridge.protocols.datamodel.extended import CYCLIC_PARAMETER, SLOTS
from drive_can_bridge.protocols.datamodel.mapping import effective, padded
from drive_can_bridge.protocols.patience import Patience

Reply = Union[Words, None]

NOT_WRITABLE = f'parameter {CYCLIC_PARAMETER} is never written: its number marks cyclic frames'


@dataclass(frozen=True)
class Conditions(Patience):
    """
    What the procedures need to know of their drive.

    :param offset: added to every parameter number that goes over the wire.
    :param together: parameters that fit one write frame.
    """

    verify: bool
    offset: int
    together: int = SLOTS

    def wire_number(self, parameter: Parameter) -> int:
        """Return the parameter's number on the wire."""
        return (parameter.number or 0) + self.offset


class Maps(NamedTuple):
    """The eight map entries of a drive; those of a response map that was not read are None."""

    request: Words
    response: Words | None


def groups(numbers: Sequence[int], size: int = SLOTS) -> list[list[int]]:
    """
    Split parameter numbers into runs of consecutive ones, each of which fits a frame.

    >>> groups([31, 30, 209, 210, 211, 212, 213])
    [[30, 31], [209, 210, 211, 212], [213]]
    """
    runs: list[list[int]] = []
    for number in sorted(set(numbers)):
        if runs and runs[-1][-1] == number - 1 and len(runs[-1]) < size:
            runs[-1].append(number)
        else:
            runs.append([number])
    return runs


def of_request(request: Request, conditions: Conditions) -> Procedure:
    """Return the procedure that serves a request of a user."""
    if isinstance(request, ReadRequest):
        return read_parameters(request.parameters, conditions)
    if request.atomic:
        return write_together(request.items, conditions)
    return write_parameters(request.items, conditions)


def read_parameters(parameters: Sequence[Parameter], conditions: Conditions,
                    ) -> Generator[Step, Reply, tuple[Outcome, ...]]:
    """Read parameters; consecutive numbers share a frame, and a shared frame may fail alone."""
    words: dict[int, int] = {}
    failures: dict[int, Failure] = {}
    pending = groups([conditions.wire_number(parameter) for parameter in parameters])
    while pending:
        run = pending.pop(0)
        reply = yield Read(run[0], len(run))
        if reply is not None:
            words.update(zip(run, reply))
        elif conditions.offline():
            break
        elif len(run) > 1:
            # one bad number makes the drive ignore the whole frame: ask for each alone
            pending[:0] = [[number] for number in run]
        else:
            failures[run[0]] = conditions.unanswered()

    def outcome(parameter: Parameter) -> Outcome:
        number = conditions.wire_number(parameter)
        if number in words:
            return ReadValue(parameter.raw_from_word(words[number]))
        return failures.get(number) or conditions.unanswered()

    return tuple(map(outcome, parameters))


def write_parameters(items: Sequence[tuple[Parameter, int]], conditions: Conditions,
                     ) -> Generator[Step, Reply, tuple[Outcome, ...]]:
    """Write parameters one after the other; after one that an absent drive missed, none."""
    outcomes: list[Outcome] = []
    for parameter, raw in items:
        outcome = yield from write_parameter(parameter, raw, conditions)
        outcomes.append(outcome)
        if isinstance(outcome, Failure) and outcome.reason in (NO_ANSWER_OFFLINE, NOT_SENT):
            outcomes += [outcome] * (len(items) - len(outcomes))
            break
    return tuple(outcomes)


def write_parameter(parameter: Parameter, raw: int, conditions: Conditions,
                    ) -> Generator[Step, Reply, Outcome]:
    """
    Write one parameter and read it back, since nobody acknowledges writes.

    EEPROM cells wear: what is there already is not written again. A write is never repeated: it
    may be a command, and the read-back tells what became of it.
    """
    number = conditions.wire_number(parameter)
    if number == CYCLIC_PARAMETER:
        return Failure(NOT_WRITABLE)
    word = parameter.word_from_raw(raw)
    eeprom = parameter.storage is not Storage.RAM
    if eeprom and parameter.readable:
        reply = yield Read(number)
        if reply is None:
            return conditions.unanswered()
        if reply[0] == word:
            return Written()
    sent = yield Write(number, (word,), eeprom)
    if sent is None:
        return Failure(NOT_SENT)
    if not (conditions.verify and parameter.readable):
        return Written(SENT_UNACKNOWLEDGED)
    reply = yield Read(number)
    if reply is None:
        return conditions.unanswered()
    return _compare(parameter, parameter.raw_from_word(reply[0]), raw)


def write_together(items: Sequence[tuple[Parameter, int]], conditions: Conditions,
                   ) -> Generator[Step, Reply, tuple[Outcome, ...]]:
    """Write consecutive parameters in one frame, or nothing (``set_parameters_atomically``)."""
    refusal = together_refusal(items, conditions.together)
    if refusal:
        return (Failure(refusal),) * len(items)
    if len(items) == 1:
        outcome = yield from write_parameter(*items[0], conditions)
        return (outcome,)
    ordered = sorted(items, key=lambda item: item[0].number or 0)
    first = conditions.wire_number(ordered[0][0])
    words = tuple(parameter.word_from_raw(raw) for parameter, raw in ordered)
    sent = yield Write(first, words, eeprom=False)
    if sent is None:
        return (Failure(NOT_SENT),) * len(items)
    if not (conditions.verify and all(parameter.readable for parameter, _ in ordered)):
        return (Written(SENT_UNACKNOWLEDGED),) * len(items)
    reply = yield Read(first, len(words))
    if reply is None:
        return (conditions.unanswered(),) * len(items)
    return tuple(
        _compare(parameter, parameter.raw_from_word(
            reply[conditions.wire_number(parameter) - first]), raw)
        for parameter, raw in items)


def together_refusal(items: Sequence[tuple[Parameter, int]], size: int = SLOTS) -> str:
    """Say why these parameters do not fit one write frame; '' if they do."""
    if len(items) < 2:
        return ''
    numbers = sorted(parameter.number or 0 for parameter, _ in items)
    consecutive = numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    volatile = all(parameter.storage is Storage.RAM for parameter, _ in items)
    if len(items) <= size and consecutive and volatile:
        return ''
    what = ('one parameter fits' if size == 1 else
            f'at most {size} parameters with consecutive numbers and storage ram fit')
    return f'cannot be written in one frame, nothing was written: {what}'


def read_maps(request_base: int, response_base: int, *, needed: tuple[int, ...] | None = None,
              ) -> Generator[Step, Reply, Union[Maps, None]]:
    """
    Read both maps, each in one frame; None when nobody answers.

    :param needed: request map of a drive that is being cycled. Any other one ends the look at
        once, because each further cycle would put setpoints into wrong parameters.
    """
    request = yield Read(request_base, SLOTS, attempts=1, late_will_do=True)
    if request is None:
        return None
    if needed is not None and effective(request) != needed:
        return Maps(request, None)
    response = yield Read(response_base, SLOTS, attempts=1, late_will_do=True)
    return Maps(request, response)


def write_maps(request_base: int, response_base: int, *, request: Sequence[int],
               response: Sequence[int]) -> Generator[Step, Reply, str]:
    """
    Rewrite both maps in the safe order: request slot 0 off first and on last.

    With slot 0 at zero the drive ignores every request word, so no half-written map can ever
    route a setpoint into the wrong parameter. Each entry is read back before the next.

    :return: '' on success, else what failed.
    """
    wanted_request, wanted_response = padded(request), padded(response)
    sequence = [(request_base, 0)]
    sequence += list(enumerate(wanted_request[1:], request_base + 1))
    sequence += list(enumerate(wanted_response, response_base))
    sequence += [(request_base, wanted_request[0])]
    for number, word in sequence:
        reply = yield Read(number)
        if reply is not None and reply[0] == word:
            continue
        if reply is not None:
            yield Write(number, (word,), eeprom=True)
            reply = yield Read(number)
        if reply is None:
            return f'no answer for map parameter {number}'
        if reply[0] != word:
            return f'map parameter {number}: read back {reply[0]} instead of {word}'
    return ''


def _compare(parameter: Parameter, found: int, wanted: int) -> Outcome:
    if found == wanted or parameter.type is ParameterType.BOOL and bool(found) is bool(wanted):
        return Written()
    return Failure(f'read back {value_text(parameter.value_from_raw(found))} '
                   f'instead of {value_text(parameter.value_from_raw(wanted))}')
