# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Reading and writing parameters of an inverter, in words that users understand.

Every generator here is for :class:`.transactor.TaskChannel`.
"""

from collections.abc import Iterable

from drive_can_bridge.core import sentences
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.core.parameters import Parameter, ParameterType, Storage
from drive_can_bridge.core.requests import (
    Failure, FailureKind, Outcome, ReadValue, RetryPolicy, Written)
from drive_can_bridge.core.roles import Cells
from drive_can_bridge.protocols.access import Found, OneByOne, ParameterAccess, read_back
from drive_can_bridge.protocols.cannord.parameter_frame import (
    ParameterFrame, ResponseId, Task, WRITE_TASKS)
from drive_can_bridge.protocols.cannord.process_data import Samples
from drive_can_bridge.protocols.cannord.transactor import (
    Contradiction, ParameterTask, Procedure, Reply, TaskChannel)
from drive_can_bridge.protocols.transactor import Answered, Refused

WRONG_INDEX = 3
PROCESS_DATA_ONLY = sentences.process_data_only()


def cells(parameter: Parameter) -> Cells:
    """Return what a parameter addresses: a task without sub-index acts on the first element."""
    return (frozenset() if parameter.number is None
            else frozenset([(parameter.number, parameter.subindex or 0)]))


def signed_cells(parameters: Iterable[Parameter]) -> Cells:
    """Return where these have words with a sign."""
    return frozenset().union(*(
        cells(parameter) for parameter in parameters if parameter.type is ParameterType.INT16))


def write_refusal(parameter: Parameter) -> Sentence:
    """Return why no task writes a parameter; '' if one can."""
    return PROCESS_DATA_ONLY if parameter.number is None else NOTHING


class TaskAccess(ParameterAccess[Parameter, ParameterTask, Reply]):
    """
    Parameters by number and sub-index, one a task.

    :param samples: what was received in process data.
    :param persist: write to EEPROM where the profile does not say where.
    :param signed: where the profile lists words with a sign, which raw names do not have.
    """

    not_atomic = sentences.not_in_one_frame('a CANnord frame carries one parameter')

    def __init__(self, channel: TaskChannel, retry: RetryPolicy, *,
                 samples: Samples, persist: bool, signed: Cells) -> None:
        super().__init__(channel, retry, OneByOne())
        self._samples = samples
        self._persist = persist
        self._signed = signed

    def read(self, span: Parameter) -> Procedure[Found]:
        answer = yield from self._ask(span)
        if isinstance(answer, Failure):
            return answer
        double = answer.double
        if span.width_known and double != (span.type.bits == 32):
            return Failure(FailureKind.REFUSED, _width_text(span, double=double))
        return (answer.answered,)

    def aside(self, parameter: Parameter, *, write: bool) -> Outcome | None:
        if parameter.number is not None:
            return None
        if write:
            return Failure(FailureKind.INVALID, PROCESS_DATA_ONLY)
        raw = self._samples.last(parameter.name)
        return ReadValue(raw) if raw is not None else Failure(
            FailureKind.INVALID, sentences.process_data_not_received())

    # -- parts ------------------------------------------------------------------------------------

    def write_one(self, parameter: Parameter, raw: int) -> Procedure[Outcome]:
        """
        Write one parameter; the response acknowledges it.

        Where nobody but the drive knows how wide the parameter is, it is read first.
        """
        double = parameter.type.bits == 32
        if not parameter.width_known:
            answer = yield from self._ask(parameter)
            if isinstance(answer, Failure):
                return answer
            double = answer.double
            if not double and not -0x8000 <= raw <= 0xFFFF:
                return Failure(
                    FailureKind.INVALID, sentences.not_in_bits(raw, 16, -0x8000, 0xFFFF))
        if not double and cells(parameter) & self._signed:
            raw = (raw + 0x8000 & 0xFFFF) - 0x8000
        array = parameter.subindex is not None
        persistent = (self._persist if parameter.storage is None
                      else parameter.storage is Storage.EEPROM)
        answer = yield from self._carry_out(
            parameter, WRITE_TASKS[array, double, persistent], raw, attempts=1)
        return answer if isinstance(answer, Failure) else Written()

    def _ask(self, parameter: Parameter) -> Procedure[ParameterFrame | Failure]:
        """Read one parameter."""
        return self._carry_out(
            parameter, Task.READ if parameter.subindex is None else Task.READ_ARRAY)

    def _carry_out(self, parameter: Parameter, task: Task, value: int = 0,
                   attempts: int | None = None,
                   ) -> Procedure[ParameterFrame | Failure]:
        """Send a task; return the response, or why there is none that counts."""
        reply = yield ParameterTask(task, parameter.number or 0, parameter.subindex or 0, value)
        if isinstance(reply, Answered):
            return reply.content
        if isinstance(reply, Contradiction) and reply.response is not None:
            # without its sign where users see none
            wrote = parameter.raw_from_word(parameter.word_from_raw(value)) if (
                parameter.width_known) else value
            return read_back(parameter, parameter.raw_from_word(reply.response.answered), wrote)
        if isinstance(reply, Refused) and reply.code == WRONG_INDEX and (
                parameter.subindex is not None):
            found = yield ParameterTask(Task.READ_ELEMENTS, parameter.number or 0)
            if isinstance(found, Answered) and found.content.identifier == ResponseId.ELEMENTS:
                return Failure(FailureKind.REFUSED, sentences.no_such_element(
                    reply.code, reply.meaning, parameter.number or 0, found.content.word))
        return self.failed(reply, attempts)


def _width_text(parameter: Parameter, *, double: bool) -> Sentence:
    width = 'a double word' if double else 'a word'
    wanted = 'int32 or uint32' if double else 'bool, int16 or uint16'
    return sentences.other_width(width, parameter.type.value, wanted)
