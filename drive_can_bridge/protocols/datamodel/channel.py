# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The acyclic channel to one station: one frame at a time, paced, timed out, repeated.

Anything that takes several frames (a mapping check, a verified write) is a *procedure*: a
generator that yields steps and is sent their results, so that it reads like the sequence it is.

=================== ==================================================================
step                result sent back
=================== ==================================================================
``Read(n, count)``  the words, or None when nobody answered after all attempts
``Write(n, words)`` (), as soon as the bus has taken the frame (nobody acknowledges it); None when
                    the bus refused it
=================== ==================================================================

Order: stops first (:class:`Lane`). The two other lanes run their procedures one after the other.
Our own and those of users take turns after every step, so that neither a flood of users nor a
silent parameter keeps the other waiting for more than one read. Where our own are the exchange
itself (:class:`Polling`), they run to their end, and users get one step in between and whatever
time is left. A control word goes before all of them, and takes the place of one that has not left
yet (:meth:`~AcyclicChannel.write_first`). What stops a drive waits for nothing but the spacing of
frames (:meth:`~AcyclicChannel.write_now`).

Pace: at least 20 ms lie between two EEPROM writes to a station and between such a write and the
next read (manual, "Scrittura di un parametro": "almeno 20msec"); a frame leaves only while no
cyclic request is under way, because nothing is known about how many requests a drive can hold.

Quarantine (:mod:`..quarantine`): after a read that nobody answered, the same parameters are not
read again for as long as one waits for an answer. Where an answer does not say what it answers
(11-bit identifiers), nothing at all is read, for the time that is configured, and whatever arrives
then begins the silence anew.
"""

from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass
from enum import Enum
import math
from typing import Any, Union

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.outbox import Left
from drive_can_bridge.protocols.quarantine import Quarantine

#: s between an unacknowledged write and the next acyclic frame, so that a drive with a single
#: receive buffer has fetched the first; and, where answers carry no address, between an answer and
#: the next read
SPACING = 0.001
#: s that a stop waits for an EEPROM at most: it takes 20 ms
STOP_EEPROM_WAIT = 0.025


@dataclass(frozen=True)
class Read:
    """
    Read ``count`` consecutive parameters.

    :param attempts: None: as configured.
    :param late_will_do: the late answer to the same question is as good as any: no quarantine.
    :param timeout: s to wait for the answer; None: as configured.
    """

    number: int
    count: int = 1
    attempts: int | None = None
    late_will_do: bool = False
    timeout: float | None = None

    @property
    def key(self) -> tuple[int, int]:
        """What an answer with a 29-bit identifier repeats."""
        return self.number, self.count


@dataclass(frozen=True)
class Write:
    """Write consecutive parameters."""

    number: int
    words: tuple[int, ...]
    eeprom: bool


Step = Union[Read, Write]
Words = tuple[int, ...]
Procedure = Generator[Step, Union[Words, None], Any]
Done = Callable[[Any], None]
Send = Callable[[Frame, Union[Left, None]], None]
#: what a procedure is told of a write that left
SENT: Words = ()


class Lane(Enum):
    """Who a procedure works for."""

    STOP = 'the confirmation of stops'
    OWN = 'map checks and polling'
    USERS = 'parameter services'


@dataclass(frozen=True)
class Polling:
    """
    What is different where the exchange itself goes through the channel.

    :param quarantine: s of silence after a read that nobody answered, or an answer that nobody
        asked for.
    """

    quarantine: float


class _Queue:
    """The procedures of one lane, and the step that the first of them wants done."""

    __slots__ = ('_running', 'attempts_left', 'repeated', 'step', 'waiting')

    def __init__(self) -> None:
        self.waiting: deque[tuple[Procedure, Done]] = deque()
        self.attempts_left = 0
        self.repeated = False  # nobody answered the attempt before
        self.step: Step | None = None
        self._running: tuple[Procedure, Done] | None = None

    def fetch(self, attempts: int) -> Step | None:
        """Return the step to be done next, beginning procedures as needed."""
        while self.step is None and self.waiting:
            self._running = self.waiting.popleft()
            self.resume(None, attempts)
        return self.step

    def resume(self, result: Words | None, attempts: int) -> None:
        """Tell the running procedure what became of its step."""
        if self._running is None:
            raise RuntimeError('no procedure to resume')
        procedure, done = self._running
        self.repeated = False
        try:
            step = self.step = procedure.send(result)
        except StopIteration as stop:
            self._running = self.step = None
            done(stop.value)
        else:
            if isinstance(step, Read):
                self.attempts_left = step.attempts or attempts

    def clear(self) -> None:
        """Forget everything."""
        if self._running is not None:
            self._running[0].close()
        for procedure, _ in self.waiting:
            procedure.close()
        self.waiting.clear()
        self._running = self.step = None


class AcyclicChannel:
    """
    Runs procedures, one frame at a time.

    :param encode_read: (number, count) -> frame.
    :param encode_write: (number, words) -> frame.
    :param timeout: s to wait for an answer.
    :param attempts: how often a read is sent before it counts as unanswered.
    :param eeprom_gap: s after an EEPROM write.
    :param send: takes frames that are to leave now, and who is told whether they did.
    :param wrote: takes every write that left.
    :param polling: given where the exchange itself goes through the channel. Writes that go first
        then do not wait for the answer of a read: nobody answers writes.
    :ivar now: ``now`` of the call being served, for whoever is called back.
    :ivar asked_at: when the last read was sent.
    """

    def __init__(self, *, encode_read: Callable[[int, int], Frame],
                 encode_write: Callable[[int, Words], Frame], send: Send,
                 timeout: float, attempts: int, eeprom_gap: float,
                 wrote: Callable[[Write], None] = lambda _: None,
                 polling: Polling | None = None) -> None:
        self._wrote = wrote
        self._encode_read = encode_read
        self._encode_write = encode_write
        self._emit = send
        self.timeout = timeout
        self.attempts = attempts
        self.now = -math.inf
        self.asked_at = -math.inf
        self._eeprom_gap = eeprom_gap
        self._polling = polling
        self._polled = polling is not None
        self._quarantine = Quarantine()
        self._queues = {lane: _Queue() for lane in Lane}
        self._stop, own, users = self._queues.values()
        self._orders = (own, users), (users, own)
        self._own, self._users = own, users
        self._users_next = False
        self._serving = own  # whose step is under way, or was last
        self._first: tuple[Write, Left] | None = None
        self._urgent: deque[tuple[Write, Left]] = deque()
        self._stop_wait_until = -math.inf  # whatever the EEPROM's gap may be
        self._leaving = False  # the write of the step under way was handed out
        self._busy = False  # something may be waiting or under way
        self._advancing = False
        self._outstanding = False
        self._deadline = math.inf
        self._not_before = -math.inf
        self._eeprom_free_at = -math.inf
        self._held_until = -math.inf

    # -- queueing ---------------------------------------------------------------------------------

    def run(self, procedure: Procedure, done: Done, now: float, lane: Lane = Lane.OWN) -> None:
        """Queue a procedure; ``done`` gets its return value."""
        self._queues[lane].waiting.append((procedure, done))
        self._busy = True
        self.advance(now)

    def write_first(self, write: Write, left: Left, now: float) -> None:
        """
        Write something before everything that waits.

        It takes the place of such a write that has not left yet: what is outdated is not sent.

        :param left: called when the bus has taken or refused the frame.
        """
        self._first = (write, left)
        self._busy = True
        self.advance(now)

    def write_now(self, write: Write, left: Left, now: float) -> None:
        """
        Write what stops a drive: after nothing but other such writes, whatever is under way.

        What waits with :meth:`write_first`, or to be written to the same parameter, is outdated:
        it is not sent any more.
        """
        self._first = None
        self._urgent = deque(each for each in self._urgent if each[0].number != write.number)
        self._urgent.append((write, left))
        self._stop_wait_until = now + STOP_EEPROM_WAIT
        self._busy = True
        self.advance(now)

    def write_at_once(self, write: Write, left: Left, now: float) -> None:
        """Write something without waiting for anything."""
        self._send_write(write, left, now)

    def clear(self) -> None:
        """
        Forget everything under way. Nobody is told: that is the caller's business.

        An answer may still be on its way. It must not meet the next read.
        """
        if self._outstanding:
            self._be_quiet(self._deadline)
        for queue in self._queues.values():
            queue.clear()
        self._first = None
        self._urgent.clear()
        self._busy = self._leaving = False
        self._outstanding = False
        self._deadline = math.inf
        self._held_until = -math.inf

    def time_lost(self, now: float) -> None:
        """Take note that nobody listened until now: an answer may lie in some buffer."""
        self.now = now
        self._quarantine.time_lost(now)
        if self._outstanding and self._polled:
            self._time_out(now)
        elif self._outstanding:  # its answer will say what it answers
            self._deadline = max(self._deadline, now)

    @property
    def waiting_users(self) -> int:
        """User procedures that have not begun."""
        return len(self._users.waiting)

    @property
    def outstanding(self) -> Read | None:
        """The read that waits for its answer, if any."""
        step = self._serving.step
        return step if self._outstanding and isinstance(step, Read) else None

    @property
    def free_at(self) -> float:
        """When the next write to RAM may follow."""
        return self._not_before

    def hold(self, until: float) -> None:
        """Send nothing before ``until``: a cyclic request is under way."""
        self._held_until = until

    def release(self, now: float) -> None:
        """Go on: the cyclic request was answered."""
        self._held_until = -math.inf
        if self._busy:
            self.advance(now)

    # -- input ------------------------------------------------------------------------------------

    def receive(self, words: Words, now: float) -> None:
        """Take the answer of the outstanding read (the caller has matched it)."""
        self.now = now
        if self._polled:  # a second answer, if there is one, must not meet the next read
            self._not_before = max(self._not_before, now + SPACING)
        elif self._serving.repeated:  # it may be the answer to the attempt before
            self._be_quiet(self._deadline)
        self._finish(words)
        self.advance(now)

    def disturbed(self, now: float) -> None:
        """Take note of an answer that nobody asked for: more may follow."""
        self._be_quiet(now)

    def advance(self, now: float) -> None:
        """Do all that is possible now."""
        self.now = now
        if self._advancing:  # called back from below: whatever was added is seen there
            return
        self._advancing = True
        try:
            while self._busy and self._advance_once(now):
                pass
        finally:
            self._advancing = False

    def _advance_once(self, now: float) -> bool:
        """Do the next thing; False when it cannot be done yet."""
        if self._urgent:
            if now < self._urgent_at:
                return False
            self._send_write(*self._urgent.popleft(), now)
            return True
        if self._leaving:
            return False
        if self._outstanding:
            if now < self._deadline:
                return self._polled and self._advance_first(now)
            self._time_out(now)
            return True
        if self._first is not None:
            return self._advance_first(now)
        queue = self._choose()
        if queue is None:
            self._busy = self._first is not None or bool(self._urgent)
            return True
        ready_at = self._ready_at(queue)
        if now < ready_at or self._quarantined(queue) and (
                self._quarantine.holds(self._key(queue.step), now, now - ready_at)):
            return False
        self._send(queue, now)
        return True

    def _time_out(self, now: float) -> None:
        """Give up the read that waits for its answer, or have it repeated."""
        self._be_quiet(now)
        if self._serving.attempts_left <= 0:
            self._finish(None)
        else:
            self._outstanding = False
            self._serving.repeated = True
            self._change_turns()

    def _be_quiet(self, since: float) -> None:
        """Do not ask again what an answer after ``since`` could be mistaken for."""
        if self._polling is not None:
            self._quarantine.begin(None, since + self._polling.quarantine)
            return
        step = self._serving.step
        if isinstance(step, Read) and not step.late_will_do:
            self._quarantine.begin(step.key, since + self.timeout)

    def _quarantined(self, queue: _Queue) -> bool:
        """Tell whether a quarantine, if there is one, concerns the step of a queue."""
        step = queue.step
        return isinstance(step, Read) and (
            # its own second attempt may get the late answer to the first: that is as good
            self._polled or not (queue.repeated or step.late_will_do))

    def _key(self, step: Step | None) -> tuple[int, int] | None:
        return step.key if isinstance(step, Read) and not self._polled else None

    def _advance_first(self, now: float) -> bool:
        """Write what goes before everything else, if there is such a thing and it may go."""
        if self._first is None:
            return False
        write, left = self._first
        if now < self._writable_at(write):
            return False
        self._first = None
        self._send_write(write, left, now)
        return True

    def next_timer(self) -> float:
        """Return when ``advance`` wants to be called."""
        if not self._busy:
            return math.inf
        if self._urgent:
            return self._urgent_at
        if self._leaving:
            return math.inf
        if self._outstanding:
            if self._first is not None and self._polled:
                return min(self._deadline, self._writable_at(self._first[0]))
            return self._deadline
        if self._first is not None:
            return self._writable_at(self._first[0])
        soonest = math.inf
        for queue in self._order():
            if queue.step is not None:
                soonest = min(soonest, self._ready_at(queue))
                if not self._steps_aside(queue):
                    break
        return soonest

    # -- inside -----------------------------------------------------------------------------------

    def _order(self) -> tuple[_Queue, ...]:
        """Return the queues in the order in which they are served now."""
        if self._stop.step is not None:
            return (self._stop,)
        return self._orders[self._users_next]

    def _choose(self) -> _Queue | None:
        """Return the queue whose step is to be done next; None when there is nothing to do."""
        chosen: _Queue | None = None
        self._stop.fetch(self.attempts)
        for queue in self._order():
            if queue.fetch(self.attempts) is None:
                continue
            if not self._steps_aside(queue):
                return queue
            if chosen is None or self._ready_at(queue) < self._ready_at(chosen):
                chosen = queue
        return chosen

    def _steps_aside(self, queue: _Queue) -> bool:
        """Tell whether the other queue goes on while the step of this one is in quarantine."""
        return not self._polled and self._quarantined(queue) and (
            self._quarantine.ready_at(self._key(queue.step)) > self.now)

    def _finish(self, result: Words | None) -> None:
        """End the step under way; then it is the other lane's turn."""
        queue = self._serving
        self._outstanding = False
        self._deadline = math.inf
        self._change_turns()
        queue.resume(result, self.attempts)
        if queue is self._own and queue.step is None:
            self._users_next = True

    def _change_turns(self) -> None:
        """Let the other lane go next, after a step or an attempt at one."""
        if self._serving is self._users:
            self._users_next = False
        elif not self._polled:
            self._users_next = True

    def _ready_at(self, queue: _Queue) -> float:
        """Return when the step of a queue may be done."""
        step = queue.step
        # "20 ms between one write and the next", says the manual of writes to the EEPROM, not that
        # the next has to go there, too. Setpoints and control words do not wait.
        if queue is self._stop:
            ready = max(self._not_before, min(self._eeprom_free_at, self._stop_wait_until))
        else:
            ready = max(self._held_until, self._not_before, self._eeprom_free_at)
        if isinstance(step, Write):
            return ready
        if self._quarantined(queue):
            return max(ready, self._quarantine.ready_at(self._key(step)))
        return ready

    @property
    def _urgent_at(self) -> float:
        """When the next write that stops the drive may leave."""
        if not self._urgent[0][0].eeprom:
            return self._not_before
        return max(self._not_before, min(self._eeprom_free_at, self._stop_wait_until))

    def _writable_at(self, write: Write) -> float:
        ready = max(self._held_until, self._not_before)
        return max(ready, self._eeprom_free_at) if write.eeprom else ready

    def _send(self, queue: _Queue, now: float) -> None:
        self._serving = queue
        step = queue.step
        if isinstance(step, Read):
            self._emit(self._encode_read(step.number, step.count), None)
            self._outstanding = True
            self.asked_at = now
            queue.attempts_left -= 1
            self._deadline = now + (self.timeout if step.timeout is None else step.timeout)
        elif step is not None:
            self._leaving = True
            self._send_write(step, self._step_left, now)

    def _step_left(self, sent: bool, now: float) -> None:
        """Tell the procedure under way whether its write has left, and go on."""
        if self._leaving:  # else it was forgotten meanwhile
            self._leaving = False
            self.now = now
            self._finish(SENT if sent else None)
            self.advance(now)

    def _send_write(self, write: Write, told: Left, now: float) -> None:
        self._not_before = now + SPACING
        if write.eeprom:
            self._eeprom_free_at = now + self._eeprom_gap

        def left(sent: bool, then: float) -> None:
            if write.eeprom:    # the pause begins when the frame is on its way
                self._eeprom_free_at = max(self._eeprom_free_at, then + self._eeprom_gap)
            if sent:
                self._wrote(write)
            told(sent, then)
        self._emit(self._encode_write(write.number, write.words), left)
