# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The acyclic channel to one drive: procedures, priorities, repetitions, what must not be asked yet.

Anything that takes several exchanges (a verified write, a map check, a round of reads) is a
*procedure*: a generator that yields steps and is sent what became of each, so that it reads like
the sequence it is. What the steps are, and how one of them is done, is the family's business: its
:class:`.Transactor` does one exchange at a time. Everything else is done here, for all families.

*Order.* Procedures of one :class:`Priority` run one after the other. A stop comes first, whatever
holds the others back; then the control word, then setpoints. Our own procedures and those of users
take turns after every step, and after every attempt at one, so that neither a flood of users nor a
parameter that nobody answers keeps the other waiting for more than one. Where answers do not say
what they answer (``anonymous``), our own are rounds that must not be torn: they run to their end,
users get one step in between and whatever time is left.

*Repetitions.* A step that nobody answered is done again as often as its transactor says. Others
may have their turn between its attempts.

*Quarantine* (:class:`Quarantine`). After a step that nobody answered, nothing is asked that the
late answer could be mistaken for, for as long as such an answer may come. The attempts at one step
do not wait for each other where answers say what they answer: the late one is as good. Where they
do not, nothing at all is asked, and whatever arrives meanwhile restarts the silence.

*Stops* wait for no quarantine where answers say what they answer. One to the same question may
still be on its way then, and proves nothing of the stop. So as many answers as may be late ones
are not believed; after each, the step is done again at once, which makes no difference to a drive
that has heard it. A question is answered once at most: the next answer is to the stop. Where more
than one may be late, something else is asked behind the first (:meth:`.Transactor.aside`): when
that is answered, nothing older comes any more, however many answers were lost.
"""

from collections import deque
from collections.abc import Callable, Generator, Hashable
from enum import Enum
import math
from typing import Any, Generic

from drive_can_bridge.compiled import mypyc_attr
from drive_can_bridge.protocols.transactor import ANYTHING, ReplyT, StepT, Transactor


#: s by which the read after a quarantine may be late, and it still was listened to
PUNCTUAL = 0.0005
#: s for the reader to fetch what a process that stood still finds in its buffers
CATCHING_UP = 0.01
#: quarantines that are remembered before those that are long over are forgotten
REMEMBERED = 32
#: s that a stop waits for the answer under way, where a device has one request at a time
STOP_PATIENCE = 0.05
#: s, beyond those that a transactor expects it, after which an answer counts as nobody's
LATE_MAX = 0.5
#: so many questions that were given up are remembered
LATE_COUNT = 16
Done = Callable[[Any], None]


class Quarantine:
    """
    What must not be asked for yet.

    Questions that a late answer cannot be mistaken for have keys of their own.
    """

    __slots__ = ('_begun', '_until')

    def __init__(self) -> None:
        self._begun: deque[tuple[float, Hashable]] = deque(maxlen=REMEMBERED)
        # until when; and whether somebody has yet to listen at its end
        self._until: dict[Hashable, tuple[float, bool]] = {}

    def begin(self, key: Hashable, until: float) -> None:
        """Do not ask before ``until``, or later where that was said before."""
        if len(self._until) >= REMEMBERED:
            self._forget(until)
        self._until[key] = max(self.ready_at(key), until), True
        self._begun.append((until, key))

    def ready_at(self, key: Hashable) -> float:
        """Return when the question may be asked."""
        return self._until[key][0] if key in self._until else -math.inf

    def answered(self, key: Hashable) -> None:
        """Record an answer, taken to be that to the oldest question of this key."""
        for entry in self._begun:
            if entry[1] == key:
                self._begun.remove(entry)
                return

    def late(self, key: Hashable, now: float) -> int:
        """Return how many answers to the question may still come, at most."""
        return sum(each == key and now < until + LATE_MAX for until, each in self._begun)

    def holds(self, key: Hashable, now: float, late: float) -> bool:
        """
        Return whether to listen on although it is time to ask.

        :param late: s since it was time to ask.
        """
        until, unlistened = self._until.get(key, (-math.inf, False))
        if not unlistened:
            return False
        if late <= PUNCTUAL:
            self._until[key] = until, False
            return False
        self._until[key] = now + CATCHING_UP, False
        return True

    def over(self, key: Hashable) -> None:
        """Record that no answer to the question comes any more."""
        self._begun = deque((each for each in self._begun if each[1] != key), maxlen=REMEMBERED)

    def handle_stall(self, before: float, now: float) -> None:
        """Extend each quarantine whose end, or late answers, fell into the stall."""
        self._begun = deque((
            (max(until, now) if before < until + LATE_MAX else until, key)
            for until, key in self._begun), maxlen=REMEMBERED)
        for key, (until, unlistened) in self._until.items():
            if unlistened:
                self._until[key] = max(until, now + CATCHING_UP), unlistened

    def _forget(self, now: float) -> None:
        """Forget quarantines that have ended long ago, or else the oldest."""
        over = [key for key, (until, _) in self._until.items() if until < now - 1.0]
        for key in over or [min(self._until, key=self.ready_at)]:
            del self._until[key]


class Priority(Enum):
    """What a procedure is for; the first comes first."""

    STOP = 'what makes the drive stand still'
    CONTROL = 'control word'
    SETPOINTS = 'setpoints'
    OWN = 'rounds, map checks and the like'
    USERS = 'parameter services'


class _Queue(Generic[StepT, ReplyT]):
    """The procedures of one priority, and the step that the first of them wants done."""

    __slots__ = (
        '_running', '_transactor', 'attempts_left', 'priority', 'repeated', 'step', 'waiting')

    def __init__(self, priority: Priority, transactor: Transactor[StepT, ReplyT]) -> None:
        self.priority = priority
        self.waiting: deque[tuple[Generator[StepT, ReplyT, Any], Done]] = deque()
        self.step: StepT | None = None
        self.attempts_left = 0
        self.repeated = False  # nobody answered the same before
        self._running: tuple[Generator[StepT, ReplyT, Any], Done] | None = None
        self._transactor = transactor

    def fetch(self) -> StepT | None:
        """Return the step to be done next, beginning procedures as needed."""
        while self.step is None and self.waiting:
            self._running = self.waiting.popleft()
            self.resume(None)
        return self.step

    def resume(self, reply: ReplyT | None) -> None:
        """Send the running procedure what became of its step; None begins it."""
        if self._running is None:
            raise RuntimeError('no procedure to resume')
        procedure, done = self._running
        self.repeated = False
        try:
            step = procedure.send(reply)  # type: ignore[arg-type]
        except StopIteration as stop:
            self._running = self.step = None
            done(stop.value)
        else:
            self.step = step
            self.repeated = self._transactor.again(step)
            self.attempts_left = self._transactor.attempts(step)

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


@mypyc_attr(allow_interpreted_subclasses=True)
class Channel(Generic[StepT, ReplyT]):
    """
    Runs procedures through a transactor.

    :ivar now: ``now`` of the call being served, for callbacks.
    """

    def __init__(self, transactor: Transactor[StepT, ReplyT]) -> None:
        self.now = -math.inf
        self._transactor = transactor
        transactor.wake = self.wake
        self._queues: dict[Priority, _Queue[StepT, ReplyT]] = {
            priority: _Queue(priority, transactor) for priority in Priority}
        stop, control, setpoints, own, users = self._queues.values()
        self._stop = stop
        self._aside: _Queue[StepT, ReplyT] = _Queue(Priority.STOP, transactor)  # amid a stop
        self._orders = (control, setpoints, own, users), (control, setpoints, users, own)
        self._users_next = False
        self._serving: _Queue[StepT, ReplyT] | None = None  # whose step is under way
        self._hurried = False  # and it has to make room
        self._late_answers = 0  # so many answers to a stop may be to what was asked before
        self._deadline = math.inf  # of the exchange under way, as it was at first
        self._quarantine = Quarantine()
        #: what was given up without an answer, and when
        self._given_up: deque[tuple[float, StepT]] = deque(maxlen=LATE_COUNT)
        self._held_until = -math.inf
        self._awake = False  # something may be waiting or under way
        self._advancing = False

    # -- answers that come too late ---------------------------------------------------------------

    def late(self, received_at: float, answer: Any = None) -> float | None:
        """
        Record an answer to nothing that is under way.

        :param answer: as :meth:`.Transactor.answers` wants it.
        :return: how many s ago the step was given up that it answers; None: there is none.
        """
        horizon = received_at - LATE_MAX - self._transactor.silence
        for place, (at, step) in enumerate(self._given_up):
            if at >= horizon and self._transactor.answers(answer, step):
                del self._given_up[place]
                return max(0.0, received_at - at)
        return None

    def late_answers(self, step: StepT) -> int:
        """Return how many late answers may be taken for that to a step of a stop."""
        transactor = self._transactor
        return 0 if transactor.anonymous else (
            self._quarantine.late(transactor.late_key(step), self.now))

    # -- queueing ---------------------------------------------------------------------------------

    def run(self, procedure: Generator[StepT, ReplyT, Any], done: Done, now: float,
            priority: Priority = Priority.OWN) -> None:
        """Queue a procedure; ``done`` gets its return value."""
        self._queues[priority].waiting.append((procedure, done))
        self.wake(now)

    def is_idle(self, priority: Priority) -> bool:
        """Return whether nothing is to be done at a priority."""
        return self._queues[priority].idle

    @property
    def waiting_users(self) -> int:
        """User procedures that have not begun."""
        return len(self._queues[Priority.USERS].waiting)

    def cancel(self, priority: Priority) -> None:
        """Forget the procedures of a priority; an exchange under way is still waited for."""
        queue = self._queues[priority]
        if self._serving is queue:
            self._expect_late()
            self._serving = None
            self._transactor.abandon(math.inf)
        queue.clear()
        if queue is self._stop:
            self._clear_aside()

    def clear(self) -> None:
        """
        Forget everything under way, without results: the caller reports that.

        An answer may still be on its way. It must not meet the next question, and is no surprise.
        """
        step = self._expect_late()
        if step is not None and self._deadline < math.inf:  # else nothing answers it
            self._given_up.append((self._deadline, step))
        for queue in (*self._queues.values(), self._aside):
            queue.clear()
        self._transactor.forget()
        self._serving = None
        self._hurried = self._awake = False

    def make_room(self, now: float) -> None:
        """Make room for a stop: the answer under way is waited for a moment only."""
        if self._transactor.busy and not self._hurried:
            self._hurried = True
            self._transactor.abandon(now + STOP_PATIENCE)

    def drop(self, now: float) -> None:
        """Forget everything but the exchange under way, for which a stop waits a moment."""
        for priority in Priority:
            self.cancel(priority)
        self.make_room(now)

    def hold(self, until: float) -> None:
        """Begin nothing before ``until``, but what stops the drive."""
        self._held_until = until

    def release(self, now: float) -> None:
        """Go on."""
        self._held_until = -math.inf
        if self._awake:
            self.advance(now)

    # -- input ------------------------------------------------------------------------------------

    def receive(self, answer: Any, now: float) -> bool:
        """
        Handle an answer, in the form that the transactor wants; False: it is unasked.

        :raises RemoteProtocolError: malformed, or not the answer to what is under way.
        """
        reply = self._transactor.receive(answer, now)
        if isinstance(reply, bool):
            return reply
        self.now = now
        step = None if self._serving is None else self._serving.step
        if step is not None:
            self._quarantine.answered(self._transactor.late_key(step))
        if self._serving is self._stop and self._late_answers:
            self._late_answers -= 1
            self._hurried, reply = True, self._transactor.silent
            if self._late_answers and step is not None:
                self._ask_aside(self._transactor.late_key(step))
        self._end(reply)
        self.advance(now)
        return True

    def disturbed(self, now: float) -> None:
        """Record an unasked answer: more may follow."""
        self._quarantine.begin(ANYTHING, now + self._transactor.silence)

    def wake(self, now: float) -> None:
        """Advance, with everything checked: there is something new."""
        self._awake = True
        self.advance(now)

    def handle_stall(self, now: float) -> None:
        """Record a stall until now: an answer may lie in some buffer."""
        self._quarantine.handle_stall(self.now, now)
        self.now = now
        if self._transactor.busy:
            self._deadline = max(self._deadline, now)
            reply = self._transactor.handle_stall(now)
            if reply is not False:
                self._end(reply)  # type: ignore[arg-type]  # True is never returned

    def advance(self, now: float) -> None:
        """Do all that is possible now."""
        self.now = now
        if self._advancing:  # called back from below: whatever was added is seen there
            return
        self._advancing = True
        try:
            while self._awake and self._advance_once(now):
                pass
        finally:
            self._advancing = False

    @property
    def due(self) -> float:
        """When ``advance`` wants to be called."""
        if not self._awake:
            return math.inf
        soonest = self._transactor.express_at(self._held_until)
        if self._transactor.busy:
            return min(soonest, self._transactor.deadline)
        if soonest < math.inf:
            return soonest
        for queue in self._order():
            if queue.step is not None:
                key = self._key(queue, queue.step)
                soonest = min(soonest, self._ready_at(queue, queue.step, key))
                if not self._steps_aside(queue):
                    break
            elif queue.waiting:     # begun only when it can be done: held
                return min(soonest, self._held_until)
        return soonest

    # -- inside -----------------------------------------------------------------------------------

    def _advance_once(self, now: float) -> bool:
        """Do the next thing; False when it cannot be done yet."""
        transactor = self._transactor
        went = transactor.express(now, self._held_until)
        if went:
            return True
        if transactor.busy:
            reply = transactor.handle_timer(now)
            if reply is False:
                return False
            self._finish(reply)  # type: ignore[arg-type]  # True is never returned
            return True
        if went is not None:
            return False
        queue = self._choose(now)
        if queue is None or queue.step is None:
            self._awake = not all(queue.idle for queue in self._queues.values()) or (
                transactor.express_at(self._held_until) < math.inf)
            return self._awake and now >= self._held_until
        step = queue.step
        key = self._key(queue, step)
        ready_at = self._ready_at(queue, step, key)
        if now < ready_at or key is not None and (
                self._quarantine.holds(key, now, now - ready_at)):
            return False
        if queue is self._stop and not queue.repeated:
            self._late_answers = self.late_answers(step)
        self._serving = queue
        queue.attempts_left -= 1
        transactor.begin(step, now)
        self._deadline = transactor.deadline
        return False    # nothing more until it has ended

    def _order(self) -> tuple[_Queue[StepT, ReplyT], ...]:
        """Return the queues in the order in which they are served now."""
        return self._orders[self._users_next] if self._stop.idle else (self._aside, self._stop)

    def _choose(self, now: float) -> _Queue[StepT, ReplyT] | None:
        """Return the queue whose step is to be done next; None when there is nothing to do."""
        if self._aside.step is not None:
            return self._aside
        if self._stop.fetch() is not None:
            return self._stop
        if now < self._held_until:
            return None     # what is begun later tells newer things
        chosen: tuple[float, _Queue[StepT, ReplyT]] | None = None
        for queue in self._order():
            step = queue.step if queue.step is not None or not queue.waiting else queue.fetch()
            if step is None:
                continue
            if not self._steps_aside(queue):
                return queue
            ready_at = self._ready_at(queue, step, self._key(queue, step))
            if chosen is None or ready_at < chosen[0]:
                chosen = ready_at, queue
        return None if chosen is None else chosen[1]

    def _key(self, queue: _Queue[StepT, ReplyT], step: StepT) -> Hashable | None:
        """Return which quarantine, if it has begun, concerns the step of a queue."""
        transactor = self._transactor
        if not transactor.anonymous and (queue.repeated or queue.priority is Priority.STOP):
            return None
        return transactor.key(step)

    def _ready_at(self, queue: _Queue[StepT, ReplyT], step: StepT,
                  key: Hashable | None) -> float:
        """Return when the step of a queue may be done."""
        stop = queue.priority is Priority.STOP
        ready = self._transactor.ready_at(step, stop=stop)
        if not stop:
            ready = max(ready, self._held_until)
        if queue.priority is Priority.USERS:
            ready = max(ready, self._transactor.held_until(step, self.now))
        return ready if key is None else max(ready, self._quarantine.ready_at(key))

    def _steps_aside(self, queue: _Queue[StepT, ReplyT]) -> bool:
        """Return whether others go on while the step of this queue is in quarantine."""
        if self._transactor.anonymous or queue.step is None:
            return False
        if queue.priority is Priority.USERS and (
                self._transactor.held_until(queue.step, self.now) > self.now):
            return True
        key = self._key(queue, queue.step)
        return key is not None and self._quarantine.ready_at(key) > self.now

    def _ask_aside(self, late_key: Hashable) -> None:
        """Ask something between two attempts at a stop, to learn that nothing older comes."""
        transactor = self._transactor
        step = transactor.aside(lambda key: self._quarantine.late(key, self.now) > 0)
        if step is None:
            return

        def asking() -> Generator[StepT, ReplyT, None]:
            reply = yield step
            if not transactor.unanswered(step, reply):
                self._late_answers = 0
                self._quarantine.over(late_key)
        self._aside.waiting.append((asking(), lambda _: None))
        self._aside.fetch()

    def _clear_aside(self) -> None:
        if self._serving is self._aside:
            self._expect_late()
            self._serving = None
            self._transactor.abandon(math.inf)
        self._aside.clear()

    def _expect_late(self) -> StepT | None:
        """Record that the answer under way is not waited for any more; return to what it is."""
        if self._serving is None or not self._transactor.busy:
            return None
        step = self._serving.step
        key = None if step is None else self._transactor.key(step)
        if key is not None:
            self._quarantine.begin(key, self._deadline + self._transactor.silence)
        return step

    def _end(self, reply: ReplyT) -> None:
        """End the exchange under way; what that sets in motion waits."""
        self._advancing = True
        try:
            self._finish(reply)
        finally:
            self._advancing = False

    def _finish(self, reply: ReplyT) -> None:
        """End the exchange under way; then it is the turn of others."""
        queue, self._serving = self._serving, None
        hurried, self._hurried = self._hurried, False
        if queue is None:
            return
        transactor = self._transactor
        step = queue.step
        if step is None:
            return
        silent = transactor.unanswered(step, reply)
        since = self.now if silent and not hurried else max(self.now, self._deadline)
        if silent:
            self._given_up.append((since, step))
        # what answers a repetition may be the answer to the attempt before
        if silent or queue.repeated and not transactor.anonymous:
            key = transactor.key(step)
            if key is not None:
                self._quarantine.begin(key, since + transactor.silence)
        # it had to make room, or is not believed: that was no attempt
        if silent and hurried and transactor.repeatable(
                step, users=queue.priority is Priority.USERS):
            queue.attempts_left += 1
        if silent and queue.attempts_left > 0:
            queue.repeated = True
        else:
            queue.step = None
            queue.resume(reply)
        if queue.priority is Priority.USERS:
            self._users_next = False
        elif queue.priority is Priority.OWN and (
                queue.step is None or not transactor.anonymous):
            self._users_next = True
