# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Who may use the mailbox next.

Anything that takes several requests is a *procedure*: a generator that yields steps (see
:mod:`.mailbox`) and is sent the reply to each, so that it reads like the sequence it is. Every
lane runs its procedures one after the other. A stop comes first, whatever holds the others back;
then the control word, then setpoints; the reads of the round and the requests of users take turns
after every exchange, so that neither a flood of users nor a parameter that nobody answers keeps
the other waiting for more than one.
"""

from collections import deque
from collections.abc import Callable, Generator
from enum import Enum
import math
from typing import Any

from drive_can_bridge.protocols.canopen_pkw.mailbox import Mailbox, Read, Reply, Silence, Step
from drive_can_bridge.protocols.canopen_pkw.pkw import Message

#: s that a stop waits for the answer under way: a device has one request at a time
STOP_PATIENCE = 0.05

Procedure = Generator[Step, Reply, Any]
Done = Callable[[Any], None]


class Lane(Enum):
    """Who a procedure works for; the first comes first."""

    STOP = 'what makes the drive stand still'
    CONTROL = 'control word'
    SETPOINTS = 'setpoints'
    ROUND = 'reads of the round'
    USERS = 'parameter services'


class _Queue:
    """The procedures of one lane, and the step that the first of them wants done."""

    __slots__ = ('_running', 'step', 'waiting')

    def __init__(self) -> None:
        self.waiting: deque[tuple[Procedure, Done]] = deque()
        self.step: Step | None = None
        self._running: tuple[Procedure, Done] | None = None

    def fetch(self) -> Step | None:
        """Return the step to be done next, beginning procedures as needed."""
        while self.step is None and self.waiting:
            self._running = self.waiting.popleft()
            self._go_on(None)
        return self.step

    def resume(self, reply: Reply) -> None:
        """Tell the running procedure what became of its step."""
        self.step = None
        self._go_on(reply)

    def _go_on(self, reply: Reply | None) -> None:
        if self._running is None:
            return  # it was cancelled while its step was under way
        procedure, done = self._running
        try:
            self.step = procedure.send(reply)  # type: ignore[arg-type]  # None begins it
        except StopIteration as stop:
            self._running = None
            done(stop.value)

    @property
    def idle(self) -> bool:
        """Nothing runs and nothing waits."""
        return self._running is None and not self.waiting

    def clear(self) -> None:
        """Forget everything."""
        if self._running is not None:
            self._running[0].close()
        for procedure, _ in self.waiting:
            procedure.close()
        self.waiting.clear()
        self._running = self.step = None


class Channel:
    """
    Runs procedures through a mailbox.

    :ivar now: ``now`` of the call being served, for whoever is called back.
    """

    def __init__(self, mailbox: Mailbox) -> None:
        self.mailbox = mailbox
        self.now = -math.inf
        self._queues = {lane: _Queue() for lane in Lane}
        self._users_next = False
        self._serving: Lane | None = None  # whose step is under way
        self._hurried = False  # and it has to make room
        self._held_until = -math.inf
        self._advancing = False

    # -- queueing ---------------------------------------------------------------------------------

    def run(self, lane: Lane, procedure: Procedure, done: Done, now: float) -> None:
        """Queue a procedure; ``done`` gets its return value."""
        self._queues[lane].waiting.append((procedure, done))
        self.advance(now)

    def is_idle(self, lane: Lane) -> bool:
        """Tell whether a lane has nothing to do."""
        return self._queues[lane].idle

    @property
    def waiting_users(self) -> int:
        """User procedures that have not begun."""
        return len(self._queues[Lane.USERS].waiting)

    def cancel(self, lane: Lane) -> None:
        """
        Forget the procedures of a lane.

        A request under way is still waited for; one for which function 00h goes first is not sent.
        """
        self._queues[lane].clear()
        if self._serving is lane:
            self.mailbox.abandon(math.inf)

    def clear(self) -> None:
        """Forget everything under way. Nobody is told: that is the caller's business."""
        for queue in self._queues.values():
            queue.clear()
        self.mailbox.forget()
        self._serving = None
        self._hurried = False

    def make_room(self, now: float) -> None:
        """Let a stop follow soon: the answer under way is waited for a moment only."""
        if self.mailbox.busy and not self._hurried:
            self._hurried = True
            self.mailbox.abandon(now + STOP_PATIENCE)

    def drop(self, now: float) -> None:
        """Forget everything but the exchange under way, for which a stop waits a moment."""
        for queue in self._queues.values():
            queue.clear()
        self._serving = None
        self.make_room(now)

    def hold(self, until: float) -> None:
        """Begin no exchange before ``until``."""
        self._held_until = until

    # -- input ------------------------------------------------------------------------------------

    def receive(self, message: Message, now: float) -> bool:
        """Take a response; False: nobody asked for it."""
        self.now = now
        reply = self.mailbox.receive(message, now)
        if isinstance(reply, bool):
            return reply
        self._advancing = True  # what the procedure sets in motion waits until it yields
        try:
            self._finish(reply)
        finally:
            self._advancing = False
        self.advance(now)
        return True

    def advance(self, now: float) -> None:
        """Do all that is possible now."""
        self.now = now
        if self._advancing:  # called back from below: whatever was added is seen there
            return
        self._advancing = True
        try:
            while self._advance_once(now):
                pass
        finally:
            self._advancing = False

    def next_timer(self) -> float:
        """Return when ``advance`` wants to be called."""
        if self.mailbox.busy:
            return self.mailbox.deadline
        if all(queue.idle for queue in self._queues.values()):
            return math.inf
        return self._held_until

    # -- inside -----------------------------------------------------------------------------------

    def _advance_once(self, now: float) -> bool:
        """Do the next thing; False when it cannot be done yet."""
        if self.mailbox.busy:
            reply = self.mailbox.handle_timer(now)
            if reply is None:
                return False
            self._finish(reply)
            return True
        step = self._queues[Lane.STOP].fetch()
        if step is not None:
            self._serving = Lane.STOP
            self.mailbox.begin(step, now)
            return True
        if now < self._held_until:
            return False
        for lane in self._order():
            step = self._queues[lane].fetch()
            if step is not None:
                self._serving = lane
                self.mailbox.begin(step, now)
                return True
        return not all(queue.idle for queue in self._queues.values())

    def _order(self) -> tuple[Lane, ...]:
        if self._users_next:
            return Lane.CONTROL, Lane.SETPOINTS, Lane.USERS, Lane.ROUND
        return Lane.CONTROL, Lane.SETPOINTS, Lane.ROUND, Lane.USERS

    def _finish(self, reply: Reply) -> None:
        """End the exchange under way; then it is another lane's turn."""
        lane, self._serving = self._serving, None
        hurried, self._hurried = self._hurried, False
        if lane is None:
            return
        if lane in (Lane.ROUND, Lane.USERS):
            self._users_next = lane is Lane.ROUND
        queue = self._queues[lane]
        if hurried and isinstance(reply, Silence) and isinstance(queue.step, Read):
            return  # it had to make room: it is asked again
        queue.resume(reply)
