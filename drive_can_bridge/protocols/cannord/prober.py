# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How one CANnord inverter orders its parameter frames.

What is open is settled by reads that an inverter has to refuse. ``value_order``: an array read of
a parameter that is no array is refused with error 4, and error numbers are in PWE2, the low word
(BU 0060 page 54). ``index_byte``: an array read with a sub-index that does not exist is refused
with error 3; in the other byte FFh means nothing, and element 0 answers. The error number stands
out in either order, so that neither key needs the other.
"""

from typing import NamedTuple

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.protocols.cannord.identifiers import (
    broadcasts, identifier, MessageObject)
from drive_can_bridge.protocols.cannord.parameter_frame import (
    error_text, ERRORS, NUMBER_MAX, ParameterLayout, ResponseId, Task)
from drive_can_bridge.protocols.scanner import (
    Asking, conclude, Conversation, Finding, Prober, Question, spaced)

#: what to ask where the profile names no parameter of that kind
SIMPLE = (514, 513)
ARRAYS = (102, 700)
TELEGRAM_TIMEOUT = 513
#: words from here on are numbers below 0
_NEGATIVE = 0x8000
_NOT_AN_ARRAY = 4
_WRONG_SUBINDEX = 3
_TRIES = 4
#: sub-index that no array reaches, in byte 2 or in byte 3
_BEYOND = 0xFF
_NUMBER_AND_TASK = slice(0, 2)


class _Answer(NamedTuple):
    data: bytes

    @property
    def response(self) -> int:
        return self.data[1] >> 4

    @property
    def words(self) -> tuple[int, int]:
        return int.from_bytes(self.data[4:6], 'little'), int.from_bytes(self.data[6:8], 'little')

    @property
    def alone(self) -> tuple[int, str] | None:
        """The only word that is not 0, and the order in which it is the low one."""
        first, second = self.words
        if bool(first) == bool(second):
            return None
        return (second, 'high_first') if second else (first, 'low_first')

    @property
    def error(self) -> int | None:
        """The error number of a refusal, whatever the order; None: it is none, or unknown."""
        alone = self.alone
        refused = self.response == ResponseId.REFUSED
        return alone[0] if refused and alone and alone[0] in ERRORS else None


_Asking = Asking[_Answer | None]


class CannordProber(Prober):
    """Asks one inverter."""

    def __init__(self, drive: DriveConfiguration) -> None:
        station, extended = drive.station, drive.options.extended_identifiers
        self._task, self._response, process_request = (
            identifier(kind, station, extended=extended) for kind in (
                MessageObject.PARAMETER_TASK, MessageObject.PARAMETER_RESPONSE,
                MessageObject.PROCESS_REQUEST))
        super().__init__(drive, [Route.of(each, extended=extended) for each in (
            self._task, process_request, *broadcasts(station, extended=extended))])
        self._extended: bool = extended

    def converse(self) -> Conversation:
        timeout = yield from self._ask(Task.READ, TELEGRAM_TIMEOUT)
        # -0.1 s is none, as 0 is
        if timeout is not None and timeout.response == ResponseId.WORD and any(
                timeout.words) and max(timeout.words) < _NEGATIVE:
            self.notes.append(frame_sentences.supervises_telegrams())
        findings = [(yield from self._value_order()), (yield from self._index_byte())]
        if not self.answered:
            return [Finding(key, None, frame_sentences.no_tasks_answered())
                    for key, _, _ in findings]
        return findings

    def _value_order(self) -> Asking[Finding]:
        votes: dict[str, list[str]] = {}
        for number in self._numbers(SIMPLE, arrays=False):
            refusal = yield from self._twice(Task.READ_ARRAY, number)
            if refusal is None or refusal.error is None or refusal.alone is None:
                continue
            votes.setdefault(refusal.alone[1], []).append(
                frame_sentences.array_read_refused(
                    number, error_text(refusal.error),
                    '6, 7' if refusal.alone[1] == 'high_first' else '4, 5', spaced(refusal.data)))
            value = yield from self._ask(Task.READ, number)
            if value is not None and value.response == ResponseId.WORD and value.alone is not None:
                votes.setdefault(value.alone[1], []).append(
                    frame_sentences.parameter_reads(number, value.alone[0], spaced(value.data)))
            if refusal.error == _NOT_AN_ARRAY:
                break
        return conclude('value_order', votes, what='answers',
                        missing=frame_sentences.no_refusal_with_number())

    def _index_byte(self) -> Asking[Finding]:
        told = frame_sentences.no_array()
        for number in self._numbers(ARRAYS, arrays=True):
            results = {}
            for key, ind in (('low', _BEYOND), ('high', _BEYOND << 8)):
                results[key] = yield from self._twice(Task.READ_ARRAY, number, ind)
            if any(each is not None and each.error == _NOT_AN_ARRAY for each in results.values()):
                continue
            told = frame_sentences.array_read(number, [
                frame_sentences.subindex_in_byte(_BEYOND, place, _told(results[key]))
                for key, place in (('low', 2), ('high', 3))])
            wrong = [key for key, each in results.items()
                     if each is not None and each.error == _WRONG_SUBINDEX]
            served = [key for key, each in results.items()
                      if each is not None and each.response in Task.READ_ARRAY.responses]
            if len(wrong) == len(served) == 1:
                return Finding('index_byte', wrong[0], told)
        return Finding('index_byte', None, told)

    # -- asking -----------------------------------------------------------------------------------

    def _ask(self, task: Task, number: int, ind: int = 0) -> _Asking:
        data = ParameterLayout().encode(task, number)
        data = data[:2] + ind.to_bytes(2, 'little') + data[4:]
        expected = {*task.responses, ResponseId.REFUSED}

        def fits(answer: bytes) -> bool:
            return (int.from_bytes(answer[_NUMBER_AND_TASK], 'little') & 0xFFF == number
                    and answer[1] >> 4 in expected)

        answer = yield from self.ask(
            Question(Frame(self._task, data, self._extended), self._response, fits))
        return None if answer is None else _Answer(answer)

    def _twice(self, task: Task, number: int, ind: int = 0) -> _Asking:
        """Ask twice: a stale answer comes once; values may change, refusals do not."""
        first = yield from self._ask(task, number, ind)
        second = yield from self._ask(task, number, ind)
        if first is None or second is None or first.response != second.response:
            return None
        if first.response == ResponseId.REFUSED and first.words != second.words:
            return None
        return second

    def _numbers(self, others: tuple[int, ...], *, arrays: bool) -> list[int]:
        """Return numbers of arrays, or of parameters that are none, as far as anybody knows."""
        indices: dict[int, set[int | None]] = {}
        for parameter in self.drive.profile.parameters.values():
            number = parameter.number
            if number is not None and number <= NUMBER_MAX and parameter.readable:
                indices.setdefault(number, set()).add(parameter.subindex)
        known = [number for number, found in indices.items() if (found != {None}) is arrays]
        return list(dict.fromkeys((*known[:_TRIES], *others)))


def _told(answer: _Answer | None) -> str:
    if answer is None:
        return frame_sentences.not_twice()
    if answer.response == ResponseId.REFUSED:
        error = 'an error' if answer.error is None else error_text(answer.error)
        return f'{error} ({spaced(answer.data)})'
    return f'a value ({spaced(answer.data)})'
