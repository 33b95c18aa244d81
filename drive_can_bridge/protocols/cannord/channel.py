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

from collections.abc import Callable, Hashable
from dataclasses import dataclass
import math
from typing import NamedTuple

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.outbox import Left
from drive_can_bridge.core.retry import RetryPolicy
from drive_can_bridge.protocols.cannord.parameter_frame import (
    ParameterFrame, ParameterLayout, Response, RESPONSES, Task,
)
from drive_can_bridge.protocols.channel import Channel
from drive_can_bridge.protocols.courier import Courier

READS = frozenset((Task.READ, Task.READ_ARRAY, Task.READ_ELEMENTS))
#: responses that carry a word; the high half of the value says nothing then
WORDS = frozenset((Response.WORD, Response.ARRAY_WORD, Response.ELEMENTS, Response.REFUSED))


@dataclass(frozen=True)
class Ask:
    """
    A task for the inverter.

    :param value: what is written; a negative word as it is (see :meth:`.ParameterLayout.encode`).
    """

    task: Task
    number: int
    index: int = 0
    value: int = 0


class Reply(NamedTuple):
    """
    What became of a task.

    :param response: None when nobody answered after all attempts.
    :param contrary: the response to a write that has another value than the one written.
    :param sent: False for a write that the bus refused.
    """

    response: ParameterFrame | None
    contrary: ParameterFrame | None = None
    sent: bool = True




class TaskCourier(Courier[Ask, Reply]):
    """
    Hands tasks to the inverter, and tells which response belongs to them.

    :param layout: where the fields of a frame are.
    :param send: takes the payload of a task, and who is told whether it left.
    :param retry: how long and how often the inverter is asked.
    """

    busy = False
    deadline = math.inf

    def __init__(self, layout: ParameterLayout, send: Callable[[bytes, Left], None],
                 retry: RetryPolicy) -> None:
        self._retry = retry
        self._layout = layout
        self._send = send
        self._task: Ask | None = None
        self._contrary: ParameterFrame | None = None
        self._refused = False   # the bus did not take it

    @property
    def silence(self) -> float:
        return self._retry.timeout

    def begin(self, step: Ask, now: float) -> None:
        self._task, self._contrary, self._refused = step, None, False
        self.busy = True
        self.deadline = now + self._retry.timeout

        def left(sent: bool, then: float) -> None:
            # a read that the bus refused is repeated when its time is over
            if not sent and self._task is step and step.task not in READS:
                self._refused = True
                self.wake(then)
        self._send(self._layout.encode(step.task, step.number, step.index, step.value), left)

    def receive(self, data: bytes) -> Reply:
        """
        Take a parameter frame of the inverter.

        :raises RemoteProtocolError: malformed, or not the response to the task under way.
        """
        response = self._layout.decode(data)
        task = self._task
        if task is None:
            raise RemoteProtocolError('parameter response that nobody asked for')
        if not _belongs(response, task):
            raise RemoteProtocolError(f'parameter response {response.identifier} for '
                                      f'P{response.number}.{response.index} does not belong to '
                                      f'task {task.task} for P{task.number}.{task.index}')
        if task.task not in READS and response.identifier != Response.REFUSED and not _echoes(
                response, task):
            self._contrary = response
            raise RemoteProtocolError(f'response to writing P{task.number}.{task.index} with '
                                      'another value')
        self.forget()
        return Reply(response)

    def handle_timer(self, now: float) -> Reply | bool:
        if not self._refused and now < self.deadline:
            return False
        reply = Reply(None, None if self._refused else self._contrary, sent=not self._refused)
        self.forget()
        return reply

    def forget(self) -> None:
        self._task = None
        self.busy = False
        self.deadline = math.inf

    def attempts(self, step: Ask) -> int:
        return self._retry.attempts if step.task in READS else 1

    def unanswered(self, step: Ask, reply: Reply) -> bool:
        return reply.response is None and reply.sent

    def key(self, step: Ask) -> Hashable:
        return step.number, step.index


class TaskChannel(Channel[Ask, Reply]):
    """Runs procedures, one task at a time. See :class:`TaskCourier` for the parameters."""

    def __init__(self, layout: ParameterLayout, send: Callable[[bytes, Left], None],
                 retry: RetryPolicy) -> None:
        self.courier = TaskCourier(layout, send, retry)
        super().__init__(self.courier)

    def receive(self, data: bytes, now: float) -> None:
        """
        Take a parameter frame of the inverter.

        :raises RemoteProtocolError: malformed, or not the response to the task under way.
        """
        self.ended(self.courier.receive(data), now)


def _belongs(response: ParameterFrame, task: Ask) -> bool:
    """Tell whether a response answers a task, as far as its address is concerned."""
    if response.number != task.number:
        return False
    if response.identifier == Response.REFUSED:
        # whether a refusal repeats the sub-index is not documented
        return response.index in (task.index, 0)
    return response.identifier in RESPONSES[task.task] and response.index == task.index


def _echoes(response: ParameterFrame, task: Ask) -> bool:
    """Tell whether a response to a write holds the value that was written."""
    width = 0xFFFF if response.identifier in WORDS else 0xFFFFFFFF
    return response.value & width == task.value & width
