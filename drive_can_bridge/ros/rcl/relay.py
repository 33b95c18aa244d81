# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Requests that an executor of rclpy takes, and answers that it sends, by its public interface."""

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.service import Service
from rclpy.task import Future

#: called with a request, and with the function for its response: once, from any thread
Begin = Callable[[Any, Callable[[Any], None]], None]


class Relay:
    """
    Serves services in the executor that has their node.

    :param later: runs a function in that executor.
    """

    def __init__(self, later: Callable[..., object]) -> None:
        self._later = later

    def serve(self, service: Service, begin: Begin, answered: Callable[[], None]) -> None:
        """
        Serve a service.

        :param answered: called when a response was sent.
        """
        async def callback(request: Any, _: Any) -> Any:
            future = Future()

            def answer(response: Any) -> None:
                future.set_result(response)
                # Executors sleep over what others complete: this wakes it. It looks at all
                # of its tasks before it comes to one of a task's: the response was sent by then.
                self._later(self._later, answered)
            begin(request, answer)
            return await future
        relaying: Any = callback
        service.callback = relaying
        service.callback_group = ReentrantCallbackGroup()
        # a wait that began before, without this service, includes it from now on
        self._later(_look_again)


def _look_again() -> None:
    """Make the executor collect again what it waits for."""
