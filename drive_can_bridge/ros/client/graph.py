# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A guest who waits for what it asks.

No thread, no executor: everything happens while somebody waits, a little at a time, so that Ctrl-C
comes through.
"""

from collections.abc import Callable
import math
from typing import Any

from rclpy.qos import QoSProfile

from drive_can_bridge.clock import Clock
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.ros.client.calls import NodeCalls
from drive_can_bridge.ros.client.guest import Guest
from drive_can_bridge.ros.client.inbox import Inbox

#: s between two looks at what has arrived
LOOK_PERIOD = 0.002
#: s that an answer may take: many reads that nobody answers are slow
_CALL_TIMEOUT = 120.0


class NoAnswer(DriveCanError):
    """A node does not answer, or has gone."""


class Graph:
    """
    This process in the ROS graph.

    :param guest: what it is there; None: a new one.
    :raises DriveCanError: ROS does not start.
    """

    def __init__(self, clock: Clock, guest: Guest | None = None) -> None:
        self._clock = clock
        self.guest = guest or Guest('client')
        self._calls: dict[float, NodeCalls] = {}
        self._heard: set[str] = set()
        self._diagnostics: Inbox | None = None
        self._statuses: dict[str, tuple[float, dict[str, str]]] = {}

    def now(self) -> float:
        """Return the time."""
        return self._clock.now()

    def close(self) -> None:
        """Leave the graph. Idempotent."""
        self.guest.leave()

    def wait(self, done: Callable[[float], Any], timeout: float) -> bool:
        """
        Wait until something is done; False if it is not in time.

        :param done: is asked again and again with the time, and may look at what has arrived.
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

        :raises NoAnswer: nobody answers.
        :raises DriveCanError: it was closed.
        """
        self._check()
        if timeout not in self._calls:
            self._calls[timeout] = NodeCalls(self.guest, timeout)
        calls, answers = self._calls[timeout], list[Any]()
        calls.ask(node, service, request, answers.append, self._clock.now())

        def look(now: float) -> bool:
            calls.look(now)
            return bool(answers)
        self.wait(look, math.inf)
        if answers[0] is not None:
            self._heard.add(node)
            return answers[0]
        if calls.offered(node, service):
            raise NoAnswer(f'{node} does not answer for {timeout:g} s')
        raise NoAnswer(f'{node} has gone' if node in self._heard
                       else f'{node} does not offer {service}')

    def newest_status(self, name: str, *, age: float, patience: float) -> dict[str, str]:
        """
        Return the facts of the newest diagnostic status of a name; none: there is none.

        :param age: s that it may have; else the next one is waited for, so much longer:
        :param patience: s.
        :raises DriveCanError: it was closed.
        """
        self._check()
        if self._diagnostics is None:
            from diagnostic_msgs.msg import DiagnosticArray
            self._diagnostics = Inbox(self.guest, DiagnosticArray, '/diagnostics',
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
        if not self.guest.open:
            raise DriveCanError('the way to the bridge is closed already')
