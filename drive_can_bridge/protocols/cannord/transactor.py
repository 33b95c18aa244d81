# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parameter channel to one inverter: one task at a time, matched by number, sub-index and value.

A response belongs to a task when response identifier, number and sub-index fit, and, after a
write, the value too (BU 0050 demands all four). Whatever does not fit is not taken: it may be the
late response to an earlier task. A response to a write that fits in all but the value is
remembered, so that somebody can be told when nothing better follows.

A read is repeated when nobody answers. A write is not: its response may have been lost after it
was carried out, and a second one would be carried out again. A parameter whose task nobody
answered is left alone until a late response must have come: its value may be older than a write in
between, and look like the response to that write.
"""

from collections.abc import Generator, Hashable
from dataclasses import dataclass
from typing import Union

from drive_can_bridge.core import frame_sentences, sentences
from drive_can_bridge.core.errors import RemoteProtocolError, Unasked
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.outbox import Outbox
from drive_can_bridge.core.requests import RetryPolicy
from drive_can_bridge.protocols.cannord.parameter_frame import (
    error_text, ParameterFrame, ParameterLayout, ResponseId, Task)
from drive_can_bridge.protocols.channel import Channel
from drive_can_bridge.protocols.transactor import (
    Answered, NOT_TAKEN, Refused, ResultT, Silence, SILENT, Transactor)


@dataclass(frozen=True)
class ParameterTask:
    """
    A task for the inverter.

    :param value: what is written; a negative word as it is (see :meth:`.ParameterLayout.encode`).
    """

    task: Task
    number: int
    index: int = 0
    value: int = 0


@dataclass(frozen=True)
class Contradiction(Silence):
    """Nothing but the response to a write that has another value than the one written."""

    response: ParameterFrame | None = None


Reply = Union[Answered[ParameterFrame], Refused, Silence]


class TaskTransactor(Transactor[ParameterTask, Reply]):
    """
    Sends tasks to the inverter, and matches responses to them.

    :param layout: where the fields of a frame are.
    :param outbox: takes the frames.
    :param identifier: of tasks; ``extended``: it has 29 bits.
    :param retry: how long and how often the inverter is asked.
    """

    def __init__(self, layout: ParameterLayout, outbox: Outbox, identifier: int, *,
                 extended: bool, retry: RetryPolicy) -> None:
        super().__init__(retry)
        self._layout, self._outbox = layout, outbox
        self._identifier, self._extended = identifier, extended

    def begin(self, step: ParameterTask, now: float) -> None:
        self.silent = SILENT
        self.expect(step, now + self.retry.timeout)

        def left(sent: bool, then: float) -> None:
            # a read that the bus refused is repeated when its time is over
            if not sent and step.task.writes:
                self.end(step, NOT_TAKEN, then)
        payload = self._layout.encode(step.task, step.number, step.index, step.value)
        self._outbox.put(Frame(self._identifier, payload, self._extended), left)

    def receive(self, answer: bytes, now: float) -> Reply:
        response, task = self._layout.decode(answer), self.step
        if task is None:
            raise Unasked(sentences.unasked('parameter response'))
        if not _belongs(response, task):
            raise Unasked(frame_sentences.other_task_answered(
                response.identifier, response.number, response.index,
                task.task, task.number, task.index))
        refused = response.identifier == ResponseId.REFUSED
        if task.task.writes and not refused and not _echoes(response, task):
            self.silent = Contradiction(response=response)
            raise RemoteProtocolError(
                frame_sentences.other_value_echoed(task.number, task.index))
        self.finish()
        return Refused(response.word, error_text(response.word)) if refused else Answered(response)

    def answers(self, answer: bytes, step: ParameterTask) -> bool:
        """Return whether a response may be that to a task that was given up."""
        return _belongs(self._layout.decode(answer), step)

    def attempts(self, step: ParameterTask) -> int:
        return 1 if step.task.writes else self.retry.attempts

    def key(self, step: ParameterTask) -> Hashable:
        return step.number      # a late refusal may not say of which element


TaskChannel = Channel[ParameterTask, Reply]
#: yields steps, is sent what became of each, and returns something
Procedure = Generator[ParameterTask, Reply, ResultT]


def _belongs(response: ParameterFrame, task: ParameterTask) -> bool:
    """Return whether a response answers a task, as far as its address is concerned."""
    if response.number != task.number:
        return False
    if response.identifier == ResponseId.REFUSED:
        # whether a refusal repeats the sub-index is not documented
        return response.index in (task.index, 0)
    return response.identifier in task.task.responses and response.index == task.index


def _echoes(response: ParameterFrame, task: ParameterTask) -> bool:
    """Return whether a response to a write holds the value that was written."""
    # the high half of a word says nothing
    width = 0xFFFFFFFF if response.double else 0xFFFF
    return response.value & width == task.value & width
