# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The only module that reads the time, waits, and starts threads.

All others are created with a :class:`Clock`. The executables create a
:class:`SteadyClock`; a test has one that jumps from one awaited time to the next,
and runs one thread at a time.
"""

from collections import deque
from collections.abc import Callable
from functools import partial
import math
import threading
import time
from typing import Generic, Protocol, TypeVar

from drive_can_bridge.memory import data_limit

#: CLOCK_MONOTONIC does not count suspends of the machine; the drives do
_CLOCK = getattr(time, 'CLOCK_BOOTTIME', time.CLOCK_MONOTONIC)

#: s that may be slept at once; more is an error where the end has no place in a time of the system
_LONGEST = 1e9

Item = TypeVar('Item')


class WakeEvent(Protocol):
    """Wakes one sleeper. A ring without a sleeper is kept for the next; several count once."""

    def wait(self, until: float = math.inf) -> bool:
        """Sleep until then, or until a ring; return whether there was one."""

    def ring(self) -> None:
        """Wake the sleeper, or the next one at once. From any thread."""


class Worker(Protocol):
    """A thread of this program."""

    def start(self) -> None:
        """Start."""

    def is_alive(self) -> bool:
        """Return whether it has begun, and not ended."""

    def join(self, timeout: float = math.inf) -> None:
        """Wait until it has ended, for so many s; not at all if it is this one, or never began."""


class Lock(Protocol):
    """A re-entrant lock, for code that waits while it has it."""

    def acquire(self, timeout: float = math.inf) -> bool:
        """Acquire it; return False: not in so many s."""

    def release(self) -> None:
        """Release it, as often as it was acquired."""

    def __enter__(self) -> object: ...

    def __exit__(self, *_: object) -> None: ...


class Clock(Protocol):
    """The time, and all waiting for it."""

    @property
    def now(self) -> Callable[[], float]:
        """The steady time in s, which cannot be set, and which includes suspends."""

    def stamp(self) -> int:
        """Return the time of the day, in ns since 1970: for stamps, and for people."""

    def used(self) -> float:
        """Return the s of a processor that this thread has used."""

    def wake_event(self) -> WakeEvent:
        """Return an event by which a thread waits, for a time or for a ring."""

    def lock(self) -> Lock:
        """Return a lock that is held even while its thread waits."""

    def worker(self, run: Callable[[], object], name: str) -> Worker:
        """Return a thread that can be started; the process does not wait for it."""

    def wait(self, until: float) -> None:
        """Sleep until then."""


class Bell:
    """
    A wake event for half of what ``threading.Event`` costs.

    That makes a new lock for every wait and takes three of them; that is more CPU time than the
    exchange needs to send a frame. Here it is one lock, which is free while the event rings.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._silence = threading.Lock()
        self._silence.acquire()

    def wait(self, until: float = math.inf) -> bool:
        """Sleep until then, or until a ring; return whether there was one."""
        timeout = until - self._now()
        if timeout > threading.TIMEOUT_MAX:
            return self._silence.acquire()
        return self._silence.acquire(timeout=timeout if timeout > 0.0 else 0.0)

    def ring(self) -> None:
        """Wake the sleeper, or the next one at once. From any thread."""
        try:
            self._silence.release()
        except RuntimeError:  # it rings already
            pass


class SystemThread(threading.Thread):
    """A thread that may be joined in any state, and starts even if memory is short."""

    def start(self) -> None:
        """Start."""
        with data_limit.room():
            super().start()

    def join(self, timeout: float | None = None) -> None:
        """Wait for its end."""
        if self.is_alive() and self is not threading.current_thread():
            super().join(None if timeout == math.inf else timeout)


class SystemLock:
    """A re-entrant lock."""

    def __init__(self) -> None:
        self._lock = threading.RLock()

    def acquire(self, timeout: float = math.inf) -> bool:
        """Acquire it; return False: not in so many s."""
        return self._lock.acquire(timeout=-1 if timeout == math.inf else timeout)

    def release(self) -> None:
        """Release it."""
        self._lock.release()

    def __enter__(self) -> 'SystemLock':
        self._lock.acquire()
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.release()


class SteadyClock:
    """
    The clock of this machine, and its threads.

    :ivar now: read several times for each frame, hence no function of ours around it.
    :ivar stamp: likewise.
    """

    def __init__(self) -> None:
        self.now: Callable[[], float] = partial(time.clock_gettime, _CLOCK)
        self.stamp: Callable[[], int] = time.time_ns

    def used(self) -> float:
        """Return the s of a processor that this thread has used."""
        return time.thread_time()

    def wake_event(self) -> Bell:
        """Return an event."""
        return Bell(self.now)

    def lock(self) -> SystemLock:
        """Return a lock."""
        return SystemLock()

    def worker(self, run: Callable[[], object], name: str) -> SystemThread:
        """Return a thread that can be started."""
        return SystemThread(target=run, name=name, daemon=True)

    def wait(self, until: float) -> None:
        """Sleep until then."""
        time.sleep(min(max(0.0, until - self.now()), _LONGEST))


def time_of_day(at: float) -> str:
    """Return a time of the system clock for people, where this process runs: ``14:05:09``."""
    return time.strftime('%H:%M:%S', time.localtime(at))


class Mailbox(Generic[Item]):
    """
    A queue that any thread puts into, and one thread reads, in order.

    :param limit: so many may wait.
    """

    def __init__(self, clock: Clock, limit: float = math.inf) -> None:
        self._now = clock.now
        self._items: deque[Item] = deque()
        self._limit = limit
        self._wake = clock.wake_event()

    def put(self, item: Item, *, always: bool = False) -> bool:
        """
        Put an item, without waiting; return False: too many wait already.

        :param always: however many wait.
        """
        if len(self._items) >= self._limit and not always:
            return False
        self._items.append(item)
        self._wake.ring()
        return True

    def get(self, until: float = math.inf) -> Item:
        """
        Wait for the next item, and return it.

        :raises TimeoutError: there was none until then.
        """
        while not self._items:
            if not self._wake.wait(until) and not self._items:
                raise TimeoutError
        return self._items.popleft()

    def __len__(self) -> int:
        """Return how many wait."""
        return len(self._items)
