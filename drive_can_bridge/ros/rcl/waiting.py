# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A thread that waits for requests by itself, in a wait set of rcl.

An executor of rclpy that waits for them looks at everything else, too, several times for each.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, ExitStack
from typing import Any, Protocol

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.service import Service

from drive_can_bridge.ros.rcl.extension import extension, GONE, look_for
from drive_can_bridge.ros.rcl.unfit import Unfit

MEMBERS = (
    'GuardCondition', 'GuardCondition.trigger_guard_condition',
    'GuardCondition.destroy_when_not_in_use', 'Service', 'Service.pointer',
    'WaitSet', 'WaitSet.clear_entities', 'WaitSet.add_guard_condition', 'WaitSet.add_service',
    'WaitSet.wait', 'WaitSet.get_ready_entities')


def look(context: Context) -> None:
    """
    See that there is what this takes, and that it is made as it is here.

    :raises Unfit: it is not.
    """
    look_for(MEMBERS)
    try:
        waiting = Waiting(context)
        waiting.close()
        with context.handle:    # type: ignore[union-attr]
            _wait_set(context.handle, 1)
    except (AttributeError, TypeError) as error:
        raise Unfit(str(error).partition('\n')[0]) from None


def _wait_set(context_handle: Any, services: int) -> Any:
    return extension.WaitSet(0, 1, 0, 0, services, 0, context_handle)


class Waiting:
    """What one thread waits for."""

    def __init__(self, context: Context) -> None:
        self._context: Any = context.handle
        self._guard = extension.GuardCondition(context.handle)

    def wake(self) -> None:
        """Have the thread look what else there is to do. From any thread."""
        try:
            with self._guard:
                self._guard.trigger_guard_condition()
        except GONE:  # stopped
            pass

    def close(self) -> None:
        """Let go of what wakes it."""
        self._guard.destroy_when_not_in_use()

    @contextmanager
    def held(self, services: Iterable[Service]) -> Iterator[Callable[[], list[Service]]]:
        """
        Keep services from being destroyed meanwhile; those that are gone are left out.

        :return: waits until there is a request or :meth:`wake`, and returns who has one.
        """
        with ExitStack() as held:
            present: dict[int, Service] = {}
            for service in services:
                try:
                    held.enter_context(service.handle)
                except InvalidHandle:   # destroyed meanwhile
                    continue
                present[service.handle.pointer] = service
            held.enter_context(self._guard)
            held.enter_context(self._context)
            waiting = _wait_set(self._context, len(present))
            handles = [service.handle for service in present.values()]

            def wait() -> list[Service]:
                waiting.clear_entities()
                waiting.add_guard_condition(self._guard)
                for handle in handles:
                    waiting.add_service(handle)
                waiting.wait(-1)
                return [present[pointer] for pointer in waiting.get_ready_entities('service')]
            yield wait


class Wakeable(Protocol):
    """What a thread waits for that nobody else wakes."""

    def wait(self) -> object:
        """Wait."""

    def ring(self) -> None:
        """Wake it."""


class Sleeping:
    """In place of :class:`Waiting`, where somebody else takes the requests."""

    def __init__(self, wake_event: Wakeable) -> None:
        self._wake_event = wake_event
        self.wake = wake_event.ring

    def close(self) -> None:
        """Have nothing to let go of."""

    @contextmanager
    def held(self, _: Iterable[Service]) -> Iterator[Callable[[], list[Service]]]:
        """Return what waits until :meth:`wake`."""
        def wait() -> list[Service]:
            self._wake_event.wait()
            return []
        yield wait
