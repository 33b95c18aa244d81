# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Carry results from the bus threads to the executor that serves the callers.

A future of rclpy must be completed in its executor's own thread; completing it elsewhere races
with the executor's wait. So results are put into a queue, a guard condition wakes the executor,
and its callback completes the futures: one at a time, because an executor resumes what waits for
them newest first, and callers are to be answered in the order in which their results came.
"""

from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.task import Future

RCLError = rclpy_implementation.RCLError


class Mailbox:
    """Completes futures in the executor thread of ``node``."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._waiting: deque[tuple[Callable[[Any], None], Any]] = deque()
        self._guard = node.create_guard_condition(self._deliver,
                                                  callback_group=ReentrantCallbackGroup())

    def complete(self, future: Future, result: Any) -> None:
        """Complete a future soon. From any thread."""
        self.post(lambda value: None if future.done() else future.set_result(value), result)

    def post(self, callback: Callable[[Any], None], argument: Any = None) -> None:
        """Call something soon, in the executor's thread. From any thread."""
        self._waiting.append((callback, argument))
        self._wake()

    def _wake(self) -> None:
        try:
            self._guard.trigger()
        except (InvalidHandle, RCLError):  # shutting down: nobody is left to be told
            pass

    def _deliver(self) -> None:
        if self._waiting:
            callback, argument = self._waiting.popleft()
            if self._waiting:
                self._wake()
            callback(argument)
