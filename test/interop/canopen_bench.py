# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The packages ``canopen``, ``canopen_asyncio`` and ``uc2canopen`` on the bench (``clocked/``).

What they wait by, and what their threads are, comes from the clock of the bench: queues,
conditions, event loops, the time of the day, and of python-can the notifier and periodic frames.
Their protocol is their own.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, ExitStack
import importlib
import math
import queue
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from bus import End
import can
from jumping import JumpingClock, JumpingWakeEvent
from world import World

from drive_can_bridge.core.frame import Frame

#: package -> module -> what of it waits
_CANOPEN = {'sdo.client': ('queue', 'time'), 'pdo.base': ('threading',),
            'nmt': ('threading', 'time'), 'emcy': ('threading', 'time'),
            'network': ('threading', 'can'), 'profiles.p402': ('time',)}
WAITING = {'canopen': _CANOPEN, 'canopen_asyncio': _CANOPEN,
           'uc2canopen': {'sdo': ('threading', 'time'), 'client': ('threading', 'time', 'can')}}


class Condition:
    """In place of :class:`threading.Condition`: nobody else runs until one waits."""

    def __init__(self, clock: JumpingClock) -> None:
        self._clock = clock
        self._sleeping: list[JumpingWakeEvent] = []

    def __enter__(self) -> None:
        """Keep nobody out."""

    def __exit__(self, *_: object) -> None:
        """Let nobody in."""

    def wait(self, timeout: float) -> bool:
        wake_event = self._clock.wake_event()
        self._sleeping.append(wake_event)
        return wake_event.wait(self._clock.now() + timeout)

    def notify_all(self) -> None:
        while self._sleeping:
            self._sleeping.pop().ring()


class Event:
    """In place of :class:`threading.Event`, for one that waits."""

    def __init__(self, clock: JumpingClock) -> None:
        self._clock = clock
        self._wake = clock.wake_event()
        self._is_set = False

    def set(self) -> None:
        self._is_set = True
        self._wake.ring()

    def clear(self) -> None:
        self._is_set = False

    def wait(self, timeout: float) -> bool:
        until = self._clock.now() + timeout
        while not self._is_set and self._wake.wait(until):
            pass
        return self._is_set


class Loop(asyncio.BaseEventLoop):
    """An event loop that sleeps by the clock; what it does in threads has threads of the clock."""

    def __init__(self, clock: JumpingClock) -> None:
        super().__init__()
        self._by, self._wake = clock, clock.wake_event()
        self._selector = self       # there are no files

    def time(self) -> float:
        return self._by.now()

    def select(self, timeout: float | None) -> list[Any]:
        self._wake.wait(math.inf if timeout is None else self._by.now() + timeout)
        return []

    def _process_events(self, events: list[Any]) -> None:
        assert not events

    def _write_to_self(self) -> None:
        self._wake.ring()

    def run_in_executor(self, executor: Any, func: Callable[..., Any], *args: Any) -> Any:
        future = self.create_future()

        def run() -> None:
            try:
                result = func(*args)
            except Exception as error:  # noqa: BLE001  raised where it is awaited
                self.call_soon_threadsafe(future.set_exception, error)
            else:
                self.call_soon_threadsafe(future.set_result, result)
        self._by.worker(run, 'of an event loop').start()
        return future


class Queue:
    """In place of :class:`queue.Queue`."""

    def __init__(self, clock: JumpingClock) -> None:
        self._clock = clock
        self._wake = clock.wake_event()
        self._items: deque[Any] = deque()

    def put(self, item: Any) -> None:
        self._items.append(item)
        self._wake.ring()

    def empty(self) -> bool:
        return not self._items

    def get(self, block: bool, timeout: float) -> Any:
        until = self._clock.now() + timeout
        while not self._items:
            if not self._wake.wait(until):
                raise queue.Empty
        return self._items.popleft()


class Periodic:
    """A frame that is sent again and again."""

    def __init__(self, clock: JumpingClock, bus: 'Bus', message: can.Message, period: float,
                 ) -> None:
        self._clock, self._bus, self._message, self._period = clock, bus, message, period
        self._ending = clock.wake_event()
        clock.worker(self._run, f'{message.arbitration_id:X} again and again').start()

    def _run(self) -> None:
        due = self._clock.now()
        while not self._ending.wait(due):
            self._bus.send(self._message)
            due += self._period

    def stop(self) -> None:
        self._ending.ring()

    def modify_data(self, message: can.Message) -> None:
        self._message = message


class Bus:
    """An end of a wire, as python-can has a bus."""

    channel_info = 'the bench'

    def __init__(self, world: World, channel: str) -> None:
        self._clock = world.clock
        self._end = End(world.wires.of(channel))

    def send(self, message: can.Message) -> None:
        self._end.send(Frame(message.arbitration_id, bytes(message.data),
                             message.is_extended_id), 0.0)

    def recv(self, timeout: float) -> can.Message | None:
        frame = self._end.receive(timeout)
        return None if frame is None else can.Message(
            timestamp=1e-9 * self._clock.stamp(), arbitration_id=frame.identifier,
            data=frame.data, is_extended_id=frame.extended)

    def send_periodic(self, message: can.Message, period: float) -> Periodic:
        return Periodic(self._clock, self, message, period)

    def shutdown(self) -> None:
        self._end.close()


class Notifier:
    """In place of :class:`can.Notifier`."""

    exception = None

    def __init__(self, clock: JumpingClock, bus: Bus, listeners: list[Any], cycle: float = 1.0,
                 ) -> None:
        self._bus, self._listeners, self._cycle = bus, listeners, cycle
        self._ending = False
        self._thread = clock.worker(self._run, 'notifier')
        self._thread.start()

    def _run(self) -> None:
        while not self._ending:
            message = self._bus.recv(self._cycle)
            if message is not None:
                for listener in self._listeners:
                    listener(message)

    def add_listener(self, listener: Any) -> None:
        self._listeners.append(listener)

    def stop(self, timeout: float) -> None:
        self._ending = True
        self._thread.join(timeout)


@contextmanager
def by_the_clock_of(world: World, package: str = 'canopen') -> Iterator[None]:
    """Have a package wait by the clock of a world; buses that it opens are those of that world."""
    clock = world.clock

    def notifier(bus: Bus, listeners: list[Any], *cycle: float) -> Notifier:
        return Notifier(clock, bus, listeners, *cycle)
    places = {
        'queue': SimpleNamespace(Queue=lambda: Queue(clock), Empty=queue.Empty),
        'threading': SimpleNamespace(Condition=lambda: Condition(clock), Lock=clock.lock,
                                     Event=lambda: Event(clock)),
        'time': SimpleNamespace(
            time=lambda: 1e-9 * clock.stamp(), monotonic=clock.now,
            sleep=lambda seconds: clock.wait(clock.now() + seconds)),
        'can': SimpleNamespace(**{
            **vars(can), 'Notifier': notifier, 'interface': SimpleNamespace(
                Bus=lambda interface, channel: Bus(world, channel))}),
    }
    with ExitStack() as stack:
        for module, names in WAITING[package].items():
            for name in names:
                stack.enter_context(patch.object(
                    importlib.import_module(f'{package}.{module}'), name, places[name]))
        yield


def connect(network: Any, world: World, channel: str) -> None:
    """Connect a network to a bus of the bench."""
    network.bus = Bus(world, channel)
    network.connect()
