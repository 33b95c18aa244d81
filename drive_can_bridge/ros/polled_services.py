# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Services of one node that a :class:`~.service_thread.ServiceThread` serves, not an executor."""

from collections.abc import Mapping
from functools import partial
import threading
from typing import Any

from rclpy.node import Node
from rclpy.qos import qos_profile_parameters
from rclpy.service import Service

from drive_can_bridge.ros.polled_group import PolledGroup
from drive_can_bridge.ros.service_thread import Answer, Callback, ServiceThread


class PolledServices:
    """
    Such services, and how many of their callers wait.

    :param callbacks: by name, with the type of the service.
    :ivar calls: how many wait for their answer.
    """

    def __init__(self, node: Node, thread: ServiceThread,
                 callbacks: Mapping[str, tuple[Any, Callback]]) -> None:
        self._thread = thread
        self.calls = 0
        self._counting = threading.Lock()
        self._services: dict[Service, Callback] = {
            node.create_service(kind, f'~/{name}', _never, callback_group=PolledGroup(),
                                qos_profile=qos_profile_parameters): partial(self._take, callback)
            for name, (kind, callback) in callbacks.items()}

    def serve(self) -> None:
        """Begin to serve."""
        for service, callback in self._services.items():
            self._thread.serve(service, callback, self.ended)

    def destroy(self) -> None:
        """Let go of the services. Before the node is destroyed."""
        self._thread.forget(list(self._services))

    def ended(self) -> None:
        """Take note that one caller less waits: it was answered, or nothing comes of it."""
        with self._counting:
            self.calls -= 1

    def _take(self, callback: Callback, request: Any, answer: Answer) -> None:
        with self._counting:
            self.calls += 1
        callback(request, answer)


def _never(_: Any, response: Any) -> Any:
    raise RuntimeError('such services are taken by a thread of their own')
