# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A client node that waits for its answers.

No thread, no executor: everything happens while a caller waits, a little at a time, so that Ctrl-C
comes through.
"""

from collections.abc import Callable
import math
from typing import Any

from rclpy.qos import QoSProfile

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import DriveCanError, NoAnswer
from drive_can_bridge.ros.client.calls import NodeCalls
from drive_can_bridge.ros.client.client_node import ClientNode
from drive_can_bridge.ros.client.subscriptions import Inbox

#: s between two looks at what has arrived
LOOK_PERIOD = 0.002
#: s that an answer may take: many reads without an answer are slow
_CALL_TIMEOUT = 120.0


class Graph:
    """
    This process in the ROS graph.

    :param client_node: its client node; None: a new one.
    :raises DriveCanError: ROS does not start.
    """

    def __init__(self, clock: Clock, client_node: ClientNode | None = None) -> None:
        self._clock = clock
        self.client_node = client_node or ClientNode('client')
        self._calls: dict[float, NodeCalls] = {}
        self._heard: set[str] = set()
        self._diagnostics: Inbox | None = None
        self._statuses: dict[str, tuple[float, dict[str, str]]] = {}

    def now(self) -> float:
        """Return the time of the steady clock, in s."""
        return self._clock.now()

    def close(self) -> None:
        """Leave the graph. Idempotent."""
        self.client_node.leave()

    def wait(self, done: Callable[[float], Any], timeout: float) -> bool:
        """
        Wait until something is done; return False if it is not in time.

        :param done: called again and again with the time; may poll what has arrived.
        """
        deadline = self._clock.now() + timeout
        while True:
            now = self._clock.now()
            if done(now):
                return True
            if now >= deadline:
                return False
            now = self._clock.now()     # looking took its time
            self._clock.wait(min(now + LOOK_PERIOD, deadline))

    def call(self, node: str, service: str, request: Any, timeout: float = _CALL_TIMEOUT) -> Any:
        """
        Call a parameter service of a node.

        :raises NoAnswer: there is no answer.
        :raises DriveCanError: the graph was closed.
        """
        self._check()
        if timeout not in self._calls:
            self._calls[timeout] = NodeCalls(self.client_node, timeout)
        calls, answers, asked = self._calls[timeout], list[Any](), True
        began = self._clock.now()

        def unasked() -> None:
            nonlocal asked
            asked = False
            answers.append(None)
        calls.ask(node, service, request, answers.append, self._clock.now(), unasked=unasked)

        def look(now: float) -> bool:
            calls.look(now)
            return bool(answers)
        self.wait(look, math.inf)
        if answers[0] is not None:
            self._heard.add(node)
            return answers[0]
        if calls.offered(node, service):
            raise NoAnswer(sentences.node_unanswering(
                node=node, timeout=round(self._clock.now() - began)), asked=asked)
        raise NoAnswer(sentences.node_gone(node) if node in self._heard
                       else sentences.no_such_service(node=node, service=service), asked=asked)

    def newest_status(self, name: str, *, age: float, patience: float) -> dict[str, str]:
        """
        Return the facts of the newest diagnostic status of a name; none: there is none.

        :param age: s that it may have; else the next one is waited for, so much longer:
        :param patience: s.
        :raises DriveCanError: the graph was closed.
        """
        self._check()
        if self._diagnostics is None:
            from diagnostic_msgs.msg import DiagnosticArray
            self._diagnostics = Inbox(self.client_node, DiagnosticArray, '/diagnostics',
                                      QoSProfile(depth=50), self._take_statuses)
        inbox = self._diagnostics

        def look(now: float) -> bool:
            inbox.look()
            return name in self._statuses and now - self._statuses[name][0] <= age
        return self._statuses[name][1] if self.wait(look, age + patience) else {}

    def _take_statuses(self, message: Any) -> None:
        for status in message.status:
            self._statuses[status.name] = self._clock.now(), {
                pair.key: pair.value for pair in status.values}

    def _check(self) -> None:
        if not self.client_node.open:
            raise DriveCanError(sentences.way_closed())
