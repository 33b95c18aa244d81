# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A hidden node that calls services and waits for their answers.

No thread: everything happens while somebody waits. rcl's wait does not end at a signal, so it is
cut into slices; Ctrl-C comes through between two of them.
"""

from collections.abc import Callable
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_parameters, QoSProfile

from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.ros.acquaintance import (
    FIRST_PATIENCE, GREETING, SERVICES, wanted_with, WRITING,
)
from drive_can_bridge.ros.guest import Guest

_SLICE = 0.05
#: s that a server may take to be found, or to know us
_FIND_TIMEOUT = 10.0
#: s that an answer may take: many reads that nobody answers are slow
_CALL_TIMEOUT = 120.0
#: s after which a question that changes nothing is asked again: DDS may lose an answer
_AGAIN = 30.0
#: s without the server until it has gone
_GONE = 2.0


class NoAnswer(DriveCanError):
    """A node does not answer, or has gone."""


class Graph:
    """
    This process in the ROS graph.

    :raises DriveCanError: ROS does not start.
    """

    def __init__(self) -> None:
        self._guest = Guest('client')
        self.node = self._guest.node
        self._executor = SingleThreadedExecutor(context=self._guest.context)
        self._executor.add_node(self.node)
        self._clients: dict[tuple[str, str], Any] = {}
        self._known: set[str] = set()

    def close(self) -> None:
        """Leave the graph. Idempotent."""
        if self._guest.context.ok():
            self._executor.shutdown()
        self._guest.leave()

    def wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait until a condition is true; False if it does not become so in time."""
        deadline = time.monotonic() + timeout
        while not condition():
            left = deadline - time.monotonic()
            if left <= 0.0:
                return False
            self._executor.spin_once(timeout_sec=min(_SLICE, left))
        return True

    def nodes_with(self, service: str, service_type: str) -> list[str]:
        """Return the full names of the nodes that offer a service of this name and type."""
        ending = f'/{service}'
        return sorted(name.removesuffix(ending)
                      for name, types in self.node.get_service_names_and_types()
                      if name.endswith(ending) and service_type in types)

    def everything(self) -> list[object]:
        """Return all nodes and services that have been discovered."""
        return [*sorted(self.node.get_node_names_and_namespaces()),
                *sorted(self.node.get_service_names_and_types())]

    def call(self, node: str, service: str, request: Any, timeout: float = _CALL_TIMEOUT) -> Any:
        """
        Call a parameter service of a node.

        :raises NoAnswer: nobody answers.
        :raises DriveCanError: it was closed.
        """
        self._check()
        client = self._client(node, service)
        self._acquaint(node)
        if not self.wait(client.service_is_ready, _FIND_TIMEOUT):
            raise NoAnswer(f'{node} does not offer {service}')
        futures = [client.call_async(request)]
        began = seen = asked = time.monotonic()
        try:
            while not self.wait(lambda: any(each.done() for each in futures), 4 * _SLICE):
                now = time.monotonic()
                if client.service_is_ready():
                    seen = now
                if now - seen > _GONE or now - began > timeout:
                    self._known.discard(node)
                    raise NoAnswer(f'{node} has gone' if now - seen > _GONE
                                   else f'{node} does not answer for {timeout:g} s')
                if service != WRITING and now - asked > _AGAIN:
                    futures.append(client.call_async(request))
                    asked = now
        finally:
            for each in futures:
                client.remove_pending_request(each)
        return next(each.result() for each in futures if each.done())

    def statuses(self, taken: Callable[[Any], bool], timeout: float) -> bool:
        """
        Wait for a diagnostic status.

        :param taken: is told each one; True: that was it.
        :raises DriveCanError: it was closed.
        """
        self._check()
        done: list[bool] = []

        def look(message: DiagnosticArray) -> None:
            if any(taken(status) for status in message.status):
                done.append(True)
        subscription = self.node.create_subscription(
            DiagnosticArray, '/diagnostics', look, QoSProfile(depth=50))
        try:
            return self.wait(lambda: bool(done), timeout)
        finally:
            self.node.destroy_subscription(subscription)

    def _check(self) -> None:
        if not self._guest.context.ok():
            raise DriveCanError('the way to the bridge is closed already')

    def _client(self, node: str, service: str) -> Any:
        key = node, service
        if key not in self._clients:
            self._known.discard(node)
            for name in wanted_with(service):
                self._clients[node, name] = self.node.create_client(
                    SERVICES[name], f'{node}/{name}', qos_profile=qos_profile_parameters)
        return self._clients[key]

    def _acquaint(self, node: str) -> None:
        """Return when a node knows our clients."""
        if node in self._known:
            return
        deadline = time.monotonic() + _FIND_TIMEOUT
        name, kind = GREETING
        greeting = self.node.create_client(kind, f'{node}/{name}',
                                           qos_profile=qos_profile_parameters)
        patience = FIRST_PATIENCE
        futures: list[Any] = []
        try:
            self.wait(greeting.service_is_ready, _FIND_TIMEOUT)
            while time.monotonic() < deadline:
                futures.append(greeting.call_async(kind.Request()))
                if self.wait(lambda: any(each.done() for each in futures), patience):
                    self._known.add(node)
                    return
                patience *= 2.0
        finally:
            self.node.destroy_client(greeting)
        raise NoAnswer(f'{node} does not answer')
