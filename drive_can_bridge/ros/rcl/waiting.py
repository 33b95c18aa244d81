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
    Check that the members used here exist, and can be made as they are here.

    :raises Unfit: they do not, or cannot.
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
    """The wait set of one thread."""

    def __init__(self, context: Context) -> None:
        self._context: Any = context.handle
        self._guard = extension.GuardCondition(context.handle)

    def wake(self) -> None:
        """Wake the thread. From any thread."""
        try:
            with self._guard:
                self._guard.trigger_guard_condition()
        except GONE:  # stopped
            pass

    def close(self) -> None:
        """Destroy the guard condition."""
        self._guard.destroy_when_not_in_use()

    @contextmanager
    def held(self, services: Iterable[Service]) -> Iterator[Callable[[], list[Service]]]:
        """
        Hold services so that they are not destroyed meanwhile; leave out those that are.

        :return: waits until there is a request or :meth:`wake`, and returns the services that have
            one.
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
    """An event that a thread waits for."""

    def wait(self) -> object:
        """Wait."""

    def ring(self) -> None:
        """Wake it."""


class Sleeping:
    """In place of :class:`Waiting`, where the executor takes the requests."""

    def __init__(self, wake_event: Wakeable) -> None:
        self._wake_event = wake_event
        self.wake = wake_event.ring

    def close(self) -> None:
        """Do nothing: there is nothing to close."""

    @contextmanager
    def held(self, _: Iterable[Service]) -> Iterator[Callable[[], list[Service]]]:
        """Return the function that waits until :meth:`wake`."""
        def wait() -> list[Service]:
            self._wake_event.wait()
            return []
        yield wait
