# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Requests that an executor of rclpy takes, and answers that it sends, by what rclpy promises."""

from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.service import Service
from rclpy.task import Future

#: takes a request, and what is to be called with the response, once, from any thread
Begin = Callable[[Any, Callable[[Any], None]], None]


class Relay:
    """
    Has services served by the executor that has their node.

    :param later: has something done by that executor.
    """

    def __init__(self, later: Callable[..., object]) -> None:
        self._later = later

    def serve(self, service: Service, begin: Begin, answered: Callable[[], None]) -> None:
        """
        Have a service served.

        :param answered: called when a response was sent.
        """
        async def callback(request: Any, _: Any) -> Any:
            future = Future()

            def answer(response: Any) -> None:
                future.set_result(response)
                # Executors sleep over what somebody else completes: this wakes it. It looks at all
                # of its tasks before it comes to one of a task's: the response was sent by then.
                self._later(self._later, answered)
            begin(request, answer)
            return await future
        relaying: Any = callback
        service.callback = relaying
        service.callback_group = ReentrantCallbackGroup()
        # one that waits since before, and for nothing of this service, waits for it from now on
        self._later(_look_again)


def _look_again() -> None:
    """Have the executor look what it has to wait for."""
