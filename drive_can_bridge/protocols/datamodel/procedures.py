# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What takes more than one acyclic frame: parameters of users, checking and writing maps.

Numbers in a profile are those of the drive's manual. What goes over the wire, in identifiers,
telegrams and map entries, is ``number + parameter_offset``; a few drives count from 0 on one side
and from 1 on the other.

Every generator here is for :class:`.transactor.AcyclicChannel`.
"""

from collections.abc import Container, Iterable, Sequence
from typing import NamedTuple

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import Parameter, ParameterType, Storage
from drive_can_bridge.core.requests import (
    Failure, FailureKind, NOT_SENT, Outcome, Outcomes, RetryPolicy, Written)
from drive_can_bridge.protocols.access import (
    Found, Item, ParameterAccess, ParameterPlacement, read_back)
from drive_can_bridge.protocols.datamodel.extended import CYCLIC_PARAMETER, SLOTS
from drive_can_bridge.protocols.datamodel.options import effective, padded
from drive_can_bridge.protocols.datamodel.transactor import (
    AcyclicChannel, ParameterRead, ParameterWrite, Procedure, Reply, Step, Words)
from drive_can_bridge.protocols.polled_exchange import Chunk, plan_reads


class Numbers(ParameterPlacement[Chunk]):
    """
    The numbers of one drive, on the wire.

    :ivar offset: added to every parameter number.
    """

    def __init__(self, drive: DriveConfiguration) -> None:
        self.offset: int = drive.options.parameter_offset

    def number(self, parameter: Parameter) -> int:
        """Return the number of a parameter."""
        return (parameter.number or 0) + self.offset

    def numbers(self, parameters: Iterable[Parameter]) -> tuple[int, ...]:
        """Return the numbers of parameters, in their order."""
        return tuple(map(self.number, parameters))

    def span(self, parameter: Parameter) -> Chunk:
        return Chunk(self.number(parameter))

    def addresses(self, span: Chunk) -> range:
        return span.addresses

    def plan(self, spans: Sequence[Chunk], *, known: Container[int] = ()) -> list[Chunk]:
        """
        Cover everything by as few reads as possible.

        :param known: numbers that may be read although nobody wants them.
        """
        return plan_reads(spans, SLOTS, known=known)

    def read(self, parameter: Parameter) -> ParameterRead:
        """Return the step that reads a parameter."""
        return ParameterRead(self.number(parameter))

    def write(self, parameter: Parameter, raw: int) -> ParameterWrite:
        """Return the step that writes a parameter; one of unknown storage counts as EEPROM."""
        return ParameterWrite(self.number(parameter), self.words(parameter, raw),
                              parameter.storage is not Storage.RAM)


NOT_WRITABLE = sentences.never_written(CYCLIC_PARAMETER)


class Put(NamedTuple):
    """
    What became of words that a drive was to get.

    :param found: what the drive has now; None: nobody answered; (): nobody looked.
    :param sent: False: the bus did not take the write.
    """

    found: Words | None
    sent: bool = True


def put(write: ParameterWrite, *, look: bool, verify: bool = True) -> Procedure[Put]:
    """
    Write words and read them back, since writes are not acknowledged.

    A write is never repeated: it may be a command, and the read-back tells what became of it.

    :param look: write nothing where the drive has the words already: EEPROM cells wear.
    :param verify: read them back.
    """
    read = ParameterRead(write.number, len(write.words))
    if look:
        found = yield read
        if found is None or found == write.words:
            return Put(found)
    sent = yield write
    if sent is None:
        return Put(None, sent=False)
    if not verify:
        return Put(())
    found = yield read
    return Put(found)


class DataModelAccess(ParameterAccess[Chunk, Step, Reply]):
    """
    Parameters by number; runs of consecutive ones share a frame.

    :param verify: read back what was written.
    :param together: parameters that fit one write frame.
    """

    def __init__(self, channel: AcyclicChannel, retry: RetryPolicy, numbers: Numbers, *,
                 verify: bool, together: int) -> None:
        super().__init__(channel, retry, numbers)
        self._numbers = numbers
        self._verify = verify
        self._together = together

    def aside(self, parameter: Parameter, *, write: bool) -> Outcome | None:
        never = write and self._numbers.number(parameter) == CYCLIC_PARAMETER
        return Failure(FailureKind.INVALID, NOT_WRITABLE) if never else None

    def read(self, span: Chunk) -> Procedure[Found]:
        # one bad number makes the drive ignore the whole frame
        words = yield ParameterRead(span.address, span.size)
        return self.retry.unanswered() if words is None else words

    def misfit(self, items: Sequence[Item]) -> Sentence:
        numbers = sorted(parameter.number or 0 for parameter, _ in items)
        consecutive = numbers == list(range(numbers[0], numbers[0] + len(numbers)))
        volatile = all(parameter.storage is Storage.RAM for parameter, _ in items)
        if len(items) <= self._together and consecutive and volatile:
            return NOTHING
        what = ('one parameter fits' if self._together == 1 else
                f'at most {self._together} parameters with consecutive numbers and storage ram '
                'fit')
        return sentences.not_in_one_frame(what)

    def write(self, items: Sequence[Item]) -> Procedure[Outcomes]:
        return self._write(items, look=True)

    def write_blind(self, items: Sequence[Item]) -> Procedure[Outcomes]:
        return self._write(items, look=False)

    def _write(self, items: Sequence[Item], *, look: bool) -> Procedure[Outcomes]:
        numbers = [self._numbers.number(parameter) for parameter, _ in items]
        first = min(numbers)
        words = [0] * len(items)
        for number, (parameter, raw) in zip(numbers, items):
            words[number - first] = parameter.word_from_raw(raw)
        readable = all(parameter.readable for parameter, _ in items)
        write = ParameterWrite(first, tuple(words), any(
            parameter.storage is not Storage.RAM for parameter, _ in items))
        became = yield from put(write, look=look and write.eeprom and readable,
                                verify=self._verify and readable)
        if not became.sent:
            return (NOT_SENT,) * len(items)
        if became.found is None:
            return (self.retry.unanswered(),) * len(items)
        if not became.found:
            return (Written(sentences.sent_unacknowledged()),) * len(items)
        return tuple(
            _compare(parameter, parameter.raw_from_word(became.found[number - first]), raw)
            for number, (parameter, raw) in zip(numbers, items))


class Maps(NamedTuple):
    """The eight map entries of a drive; those of a response map that was not read are None."""

    request: Words
    response: Words | None


def read_maps(request_base: int, response_base: int, *, needed: tuple[int, ...] | None = None,
              ) -> Procedure[Maps | None]:
    """
    Read both maps, each in one frame; None: no answer.

    :param needed: request map of a drive that is being cycled. Any other one ends the look at
        once, because each further cycle would put setpoints into wrong parameters.
    """
    request = yield ParameterRead(request_base, SLOTS, attempts=1, late_will_do=True)
    if request is None:
        return None
    if needed is not None and effective(request) != needed:
        return Maps(request, None)
    response = yield ParameterRead(response_base, SLOTS, attempts=1, late_will_do=True)
    return Maps(request, response)


def write_maps(request_base: int, response_base: int, *, request: Sequence[int],
               response: Sequence[int]) -> Procedure[tuple[Sentence, bool]]:
    """
    Rewrite both maps in the safe order: request slot 0 off first and on last.

    With slot 0 at zero the drive ignores every request word, so no half-written map can ever
    route a setpoint into the wrong parameter. Each entry is read back before the next.

    :return: '' on success, else what failed; False: the drive did not keep what was written.
    """
    wanted_request, wanted_response = padded(request), padded(response)
    sequence = [(request_base, 0)]
    sequence += list(enumerate(wanted_request[1:], request_base + 1))
    sequence += list(enumerate(wanted_response, response_base))
    sequence += [(request_base, wanted_request[0])]
    for number, word in sequence:
        became = yield from put(ParameterWrite(number, (word,), eeprom=True), look=True)
        if not became.sent:
            return sentences.write_refused(f'map parameter {number}:', sentences.not_sent()), True
        if not became.found:
            return sentences.no_answer_for_map(number), True
        if became.found[0] != word:
            return sentences.write_read_back(
                f'map parameter {number}', became.found[0], word), False
    return NOTHING, True


def _compare(parameter: Parameter, found: int, wanted: int) -> Outcome:
    if found == wanted or parameter.type is ParameterType.BOOL and bool(found) is bool(wanted):
        return Written()
    return read_back(parameter, found, wanted)
