# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A clock that jumps from one time that somebody waits for to the next.

Threads are real ones, but only one runs at a time: until it waits. Then another one that may go on
does; when none may, time jumps to the next moment that somebody waits for. So nothing takes time
but waiting, a minute passes in as long as it takes to compute what happens in it, and the same
seed always tells the same story: where several may go on, a random generator says who goes first.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import ctypes
from heapq import heappop, heappush
from itertools import count
import math
import random
import threading
from typing import Any

#: when stories begin: s of the steady clock, and ns since 1970 at its 0
BEGIN, EPOCH = 1000.0, 1_700_000_000_000_000_000
#: s between two looks at what a story waits for: in which something happens, and at most
LOOK, SELDOM = 0.001, 0.02
#: turns without time that nobody needs who does not go round in circles
TURNS_MAX = 100_000
#: s of real time after which a thread does not only compute, but hangs; and for it to end then
HANG, END = 60.0, 1.0


class Stuck(AssertionError):
    """Nobody can ever go on, or somebody goes round in circles."""


class _Over(BaseException):
    """The story is over: ends a thread that waits."""


class TurnThread(threading.Thread):
    """A thread that runs when it is its turn: no wall clock says when."""


class Task:
    """
    A thread that runs when it is its turn.

    :ivar rung: somebody woke it, rather than the time for which it waited.
    :ivar thread: what runs.
    """

    def __init__(self, clock: 'JumpingClock', run: Callable[[], object] | None, name: str) -> None:
        self.name = name
        self.rung = False
        self.ticket = 0     # of its wait: what woke it before is out of date
        self._clock = clock
        self._run = run
        self._turn = threading.Lock()       # held until it is its turn
        self._turn.acquire()
        self.thread = TurnThread(target=self._live, name=name, daemon=True)
        self._begun = self._ended = False
        self._joining: list[Task] = []

    def start(self) -> None:
        """Begin, when it is its turn."""
        self._begun = True
        self.thread.start()
        self._clock.tasks.append(self)
        self._clock.wake(self)

    def is_alive(self) -> bool:
        """Tell whether it has begun, and not ended."""
        return self._begun and not self._ended

    def join(self, timeout: float = math.inf) -> None:
        """Wait for its end."""
        if self.is_alive() and self is not self._clock.current:
            self._joining.append(self._clock.current)
            self._clock.block(self._clock.now() + timeout)

    # -- turns ------------------------------------------------------------------------------------

    def give(self) -> None:
        """Let it go on."""
        self._turn.release()

    def rest(self) -> None:
        """Wait for its turn."""
        self._turn.acquire()
        if self._clock.over:
            raise _Over

    def rest_as_the_story(self) -> None:
        """Wait for the turn of who tells the story, can be interrupted, and sees who hangs."""
        before = self._clock.handed_over
        try:
            while not self._turn.acquire(timeout=HANG):
                if self._clock.handed_over == before:
                    raise Stuck(f'{self._clock.current.name} has not waited for {HANG:g} s')
                before = self._clock.handed_over
        except BaseException:
            self._clock.break_off()
            raise

    def end(self) -> None:
        """End it, wherever it is: nobody has a turn any more."""
        if self is not self._clock.current:
            with suppress(RuntimeError):        # it is about to have its turn
                self._turn.release()
        elif self.thread.ident is not None:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(
                ctypes.c_ulong(self.thread.ident), ctypes.py_object(_Over))

    def _live(self) -> None:
        assert self._run is not None
        try:
            self.rest()
            self._run()
        except _Over:
            pass
        except BaseException as error:  # noqa: BLE001  told by the story
            self._clock.failures.append(error)
        self._ended = True
        for task in self._joining:
            self._clock.wake(task)
        self._clock.tasks.remove(self)
        if not self._clock.broken:
            self._clock.hand_over()


class JumpingWakeEvent:
    """Wakes one sleeper; see :class:`drive_can_bridge.clock.WakeEvent`."""

    def __init__(self, clock: 'JumpingClock') -> None:
        self._clock = clock
        self._rung = False
        self._sleeper: Task | None = None

    def wait(self, until: float = math.inf) -> bool:
        """Sleep until then, or until somebody rings; tell whether somebody did."""
        if not self._rung and until > self._clock.now():
            self._sleeper = self._clock.current
            self._clock.block(until)
            self._sleeper = None
        rung, self._rung = self._rung, False
        return rung

    def ring(self) -> None:
        """Wake the sleeper, or the next one at once."""
        self._rung = True
        if self._sleeper is not None:
            self._clock.wake(self._sleeper)


class JumpingLock:
    """A re-entrant lock; see :class:`drive_can_bridge.clock.Lock`."""

    def __init__(self, clock: 'JumpingClock') -> None:
        self._clock = clock
        self._owner: Task | None = None
        self._depth = 0
        self._waiting: list[Task] = []

    def acquire(self, timeout: float = math.inf) -> bool:
        """Take it; False: not in so many s."""
        me, until = self._clock.current, self._clock.now() + timeout
        while self._owner not in (None, me):
            if self._clock.now() >= until:
                return False
            self._waiting.append(me)
            self._clock.block(until)
            if me in self._waiting:
                self._waiting.remove(me)
        self._owner = me
        self._depth += 1
        return True

    def release(self) -> None:
        """Give it back."""
        self._depth -= 1
        if not self._depth:
            self._owner = None
            if self._waiting:
                self._clock.wake(self._waiting.pop(0))

    def __enter__(self) -> 'JumpingLock':
        self.acquire()
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


class JumpingClock:
    """
    Virtual time; see :class:`drive_can_bridge.clock.Clock`. Whoever makes it has the first turn.

    :param seed: says who goes first where several may.
    :ivar failures: what ended threads.
    :ivar handed_over: how often the turn has changed.
    :ivar broken: the story was broken off in the turn of somebody else: nobody has one any more.
    """

    def __init__(self, seed: int = 0) -> None:
        self.seed = seed
        self.chance = random.Random(seed)
        self.tasks: list[Task] = []
        self.failures: list[BaseException] = []
        self.over = self.broken = False
        self.handed_over = 0
        self._main = self.current = Task(self, None, 'the story')
        self._time = BEGIN
        self._coming: list[tuple[float, int, Task, int]] = []
        self._ready: list[Task] = []
        self._number = count()
        self._turns = 0
        self._stuck: Stuck | None = None

    # -- what everybody is handed -----------------------------------------------------------------

    def now(self) -> float:
        """Return the steady time in s."""
        return self._time

    def stamp(self) -> int:
        """Return the time of the day, in ns since 1970."""
        return EPOCH + round(self._time * 1e9)

    def used(self) -> float:
        """Return the s of a processor that this thread has used: computing takes no time."""
        return 0.0

    def wake_event(self) -> JumpingWakeEvent:
        """Return what a thread waits by."""
        return JumpingWakeEvent(self)

    def lock(self) -> JumpingLock:
        """Return what keeps others out."""
        return JumpingLock(self)

    def worker(self, run: Callable[[], object], name: str) -> Task:
        """Return a thread that can be started."""
        return Task(self, run, name)

    def wait(self, until: float) -> None:
        """Sleep until then."""
        while until > self._time:
            self.block(until)

    # -- for stories ------------------------------------------------------------------------------

    def live(self, seconds: float) -> None:
        """Let time pass."""
        self.wait(self._time + seconds)
        self.check()

    def stand_still(self, seconds: float) -> None:
        """Let time pass in which nobody runs."""
        self._time += seconds

    def until(self, condition: Callable[[], Any], what: str = '', limit: float = 60.0) -> Any:
        """Let time pass until a condition holds; return what it returned."""
        end = self._time + limit
        while not (found := condition()):
            self.check()
            if self._time >= end:
                raise AssertionError(f'{limit:g} s went by without {what or condition}')
            coming = self._coming[0][0] if self._coming else math.inf
            self.wait(self._time + max(LOOK, min(SELDOM, coming - self._time)))
        return found

    def check(self) -> None:
        """Raise what ended a thread."""
        if self.failures:
            raise self.failures[0]

    def close(self) -> None:
        """End all threads that are left; return when they have."""
        self.over = True
        while self.tasks and not self.broken:
            left = len(self.tasks)
            for task in list(self.tasks):
                self.wake(task)
            self.block(math.inf)
            if len(self.tasks) == left:
                break

    # -- turns ------------------------------------------------------------------------------------

    def wake(self, task: Task) -> None:
        """Let somebody who waits go on, as soon as it is its turn."""
        if task not in self._ready and task is not self.current:
            task.ticket += 1
            self._ready.append(task)

    def block(self, until: float) -> None:
        """Wait until then, or until somebody wakes us. The caller looks which it was."""
        if self.broken:
            raise _Over if isinstance(threading.current_thread(), TurnThread) else Stuck(
                'the story was broken off: nobody has a turn')
        me = self.current
        if until < math.inf:
            heappush(self._coming, (until, next(self._number), me, me.ticket))
        elif self.over and me is self._main:
            self._ready.append(me)
        self.hand_over()
        if me is not self._main:
            me.rest()
            return
        me.rest_as_the_story()
        if self._stuck is not None:
            stuck, self._stuck = self._stuck, None
            raise stuck

    def break_off(self) -> None:
        """End all threads where they are, because somebody keeps his turn to himself."""
        self.over = self.broken = True
        for task in list(self.tasks):
            task.end()
        for task in list(self.tasks):
            task.thread.join(END)

    def hand_over(self) -> None:
        """Let the next one go on."""
        self._turns += 1
        self.handed_over += 1
        if self._turns > TURNS_MAX:
            self._fail(f'{self.current.name} and others go round in circles')
        while not self._ready:
            if not self._coming:
                self._fail('nobody waits for anything that can happen')
                break
            until, _, task, ticket = heappop(self._coming)
            if ticket != task.ticket:
                continue
            if until > self._time:
                self._time, self._turns = until, 0
            self.wake_at(task)
            while self._coming and self._coming[0][0] <= self._time:
                _, _, task, ticket = heappop(self._coming)
                if ticket == task.ticket:
                    self.wake_at(task)
        chosen = self.chance.randrange(len(self._ready)) if len(self._ready) > 1 else 0
        self.current = self._ready.pop(chosen)
        self.current.give()

    def wake_at(self, task: Task) -> None:
        """Let somebody go on whose time has come."""
        task.ticket += 1
        self._ready.append(task)

    def _fail(self, why: str) -> None:
        self._stuck = Stuck(why)
        self._turns = 0
        if self._main not in self._ready:
            self.wake_at(self._main)


@contextmanager
def jumping(seed: int) -> Iterator[JumpingClock]:
    """Give a clock to a story; its threads end with it."""
    clock = JumpingClock(seed)
    try:
        yield clock
        clock.check()
    finally:
        clock.close()
