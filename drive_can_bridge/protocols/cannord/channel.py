# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parameter channel to one inverter: one task at a time, matched, timed out, reads repeated.

What takes several tasks is a *procedure*: a generator that yields :class:`Ask` and is sent the
:class:`Reply`. Procedures run one after the other.

A response belongs to a task when response identifier, number and sub-index fit, and, after a
write, the value too (BU 0050 demands all four). Whatever does not fit is not taken: it may be the
late response to an earlier task. A response to a write that fits in all but the value is
remembered, so that somebody can be told when nothing better follows.

A read is repeated when nobody answers. A write is not: its response may have been lost after it
was carried out, and a second one would be carried out again. A parameter whose task nobody
answered is left alone until a late response must have come (:mod:`..quarantine`): its value may be
older than a write in between, and look like the response to that write.
"""

from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass
import math
from typing import Any, NamedTuple

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.outbox import Left
from drive_can_bridge.protocols.cannord.parameter_frame import (
    ParameterFrame, ParameterLayout, Response, RESPONSES, Task,
)
from drive_can_bridge.protocols.quarantine import Quarantine

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


Procedure = Generator[Ask, Reply, Any]
Done = Callable[[Any], None]


class _Job(NamedTuple):
    procedure: Procedure
    done: Done
    own: bool


class TaskChannel:
    """
    Runs procedures, one task at a time.

    :param layout: where the fields of a frame are.
    :param send: takes the payload of a task, and who is told whether it left.
    :param timeout: s to wait for a response.
    :param attempts: how often a read is sent before it counts as unanswered.
    :ivar now: ``now`` of the call being served, for whoever is called back.
    """

    def __init__(self, layout: ParameterLayout, send: Callable[[bytes, Left], None], *,
                 timeout: float, attempts: int) -> None:
        self._layout = layout
        self._send = send
        self.timeout = timeout
        self.attempts = attempts
        self.now = -math.inf
        self._waiting: deque[_Job] = deque()
        self._running: _Job | None = None
        self._task: Ask | None = None
        self._waits = False  # the task has not been sent yet
        self._contrary: ParameterFrame | None = None
        self._attempts_left = 0
        self._repeated = False
        self._deadline = math.inf
        self._quarantine = Quarantine()

    @property
    def waiting_users(self) -> int:
        """Procedures of users that have not begun."""
        return sum(not job.own for job in self._waiting)

    @property
    def outstanding(self) -> Ask | None:
        """The task that waits for its response, if any."""
        return None if self._waits else self._task

    def run(self, procedure: Procedure, done: Done, now: float, *, own: bool = False) -> None:
        """
        Queue a procedure; ``done`` gets its return value.

        :param own: not on behalf of users; goes before what they wait for.
        """
        self.now = now
        job = _Job(procedure, done, own)
        if own:
            self._waiting.appendleft(job)
        else:
            self._waiting.append(job)
        self._begin_waiting(now)

    def clear(self) -> None:
        """Forget everything under way. Nobody is told: that is the caller's business."""
        self._be_quiet(self._deadline)
        jobs = [*self._waiting] if self._running is None else [self._running, *self._waiting]
        self._waiting.clear()
        self._running = self._task = None
        self._waits = False
        self._deadline = math.inf
        for job in jobs:
            job.procedure.close()

    def receive(self, data: bytes, now: float) -> None:
        """
        Take a parameter frame of the inverter.

        :raises RemoteProtocolError: malformed, or not the response to the task under way.
        """
        self.now = now
        response = self._layout.decode(data)
        task = self.outstanding
        if task is None:
            raise RemoteProtocolError('parameter response that nobody asked for')
        if not self._belongs(response, task):
            raise RemoteProtocolError(f'parameter response {response.identifier} for '
                                      f'P{response.number}.{response.index} does not belong to '
                                      f'task {task.task} for P{task.number}.{task.index}')
        if task.task not in READS and response.identifier != Response.REFUSED and not _echoes(
                response, task):
            self._contrary = response
            raise RemoteProtocolError(f'response to writing P{task.number}.{task.index} with '
                                      'another value')
        if self._repeated:  # it may be the response to the attempt before
            self._be_quiet(self._deadline)
        self._finish(Reply(response), now)

    def handle_timer(self, now: float) -> None:
        """Repeat or give up what is overdue."""
        self.now = now
        task = self._task
        if task is None or now < self._deadline:
            return
        if self._waits:
            self._begin(task, now)
            return
        self._be_quiet(now)
        if self._attempts_left > 0:
            self._repeated = True
            self._transmit(task, now)
        else:
            self._finish(Reply(None, self._contrary), now)

    def next_timer(self) -> float:
        """Return when ``handle_timer`` has something to do."""
        return self._deadline

    # -- inside -----------------------------------------------------------------------------------

    @staticmethod
    def _belongs(response: ParameterFrame, task: Ask) -> bool:
        if response.number != task.number:
            return False
        if response.identifier == Response.REFUSED:
            # whether a refusal repeats the sub-index is not documented
            return response.index in (task.index, 0)
        return (response.identifier in RESPONSES[task.task]
                and response.index == task.index)

    def _begin_waiting(self, now: float) -> None:
        """Begin procedures until one of them has a task under way, or none is left."""
        while self._running is None and self._waiting:
            self._running = self._waiting.popleft()
            self._resume(None, now)

    def _finish(self, reply: Reply, now: float) -> None:
        self._task = None
        self._deadline = math.inf
        self._resume(reply, now)
        self._begin_waiting(now)

    def _resume(self, reply: Reply | None, now: float) -> None:
        """Tell the running procedure what became of its task, and send the next one."""
        if self._running is None:
            raise RuntimeError('no procedure to resume')
        procedure, done, _ = self._running
        try:
            task = next(procedure) if reply is None else procedure.send(reply)
        except StopIteration as stop:
            self._running = None
            done(stop.value)
            return
        self._contrary = None
        self._attempts_left = self.attempts if task.task in READS else 1
        self._repeated = False
        self._begin(task, now)

    def _begin(self, task: Ask, now: float) -> None:
        """Send a task, unless a late response could be mistaken for that to this one."""
        self._task = task
        key = task.number, task.index
        ready_at = self._quarantine.ready_at(key)
        self._waits = now < ready_at or self._quarantine.holds(key, now, now - ready_at)
        if self._waits:
            self._deadline = self._quarantine.ready_at(key)
        else:
            self._transmit(task, now)

    def _be_quiet(self, since: float) -> None:
        """Ask nothing that a response after ``since`` could be mistaken for."""
        task = self.outstanding
        if task is not None:
            self._quarantine.begin((task.number, task.index), since + self.timeout)

    def _transmit(self, task: Ask, now: float) -> None:
        self._attempts_left -= 1
        self._deadline = now + self.timeout
        self._send(self._layout.encode(task.task, task.number, task.index, task.value),
                   self._left)

    def _left(self, sent: bool, now: float) -> None:
        """Give up a write that the bus refused; a read is repeated when its time is over."""
        if not sent and self._task is not None and self._task.task not in READS:
            self.now = now
            self._finish(Reply(None, sent=False), now)


def _echoes(response: ParameterFrame, task: Ask) -> bool:
    """Tell whether a response to a write holds the value that was written."""
    width = 0xFFFF if response.identifier in WORDS else 0xFFFFFFFF
    return response.value & width == task.value & width
