# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Parameter services of other nodes, asked by clients that stay, once these are known there.

See :mod:`drive_can_bridge.ros.acquaintance`.
"""

from collections.abc import Callable
import math
from typing import Any, NamedTuple

from rclpy.node import Node

from drive_can_bridge.ros.acquaintance import FIRST_PATIENCE, GREETING, SERVICES, wanted_with
from drive_can_bridge.ros.monitor.inbox import Service

#: s without a question after which a node's clients are closed
_IDLE = 60.0
#: s for which one that has answered is taken for the same, and not for one that was started anew
_FRESH = 2.0

#: takes the response, or None: nobody answered in time
Done = Callable[[Any], None]


class ParameterCalls:
    """
    Asks, and hands the answers over in :meth:`look`.

    :param node: of ours.
    :param timeout: s after which an answer is not waited for any more.
    """

    def __init__(self, node: Node, timeout: float) -> None:
        self._node = node
        self._timeout = timeout
        self._hosts: dict[str, _Host] = {}

    @property
    def busy(self) -> bool:
        """Somebody waits for an answer."""
        return any(host.busy for host in self._hosts.values())

    def ask(self, host: str, service: str, request: Any, done: Done, now: float) -> None:
        """
        Ask a node, as soon as it offers the service and knows us.

        :param service: one of the parameter services, as ``get_parameters``.
        """
        if host not in self._hosts:
            self._hosts[host] = _Host(self._node, host, self._timeout)
        self._hosts[host].ask(service, request, done, now)

    def drop(self, host: str, service: str) -> None:
        """Wait for no answer of this service any more."""
        if host in self._hosts:
            self._hosts[host].drop(service)

    def look(self, now: float) -> None:
        """Ask what could not be asked before, and hand over the answers that have arrived."""
        for name, host in list(self._hosts.items()):
            host.look(now)
            if host.asked_at + _IDLE < now and not host.busy:
                del self._hosts[name]
                host.close()


class _Question(NamedTuple):
    deadline: float
    service: Service
    request: Any
    done: Done


class _Host:
    """
    A node that is asked.

    :ivar asked_at: when it was asked last.
    """

    def __init__(self, node: Node, name: str, timeout: float) -> None:
        self.asked_at = self._heard_at = -math.inf
        self._node, self._name, self._timeout = node, name, timeout
        self._services: dict[str, Service] = {}
        self._greeting: Service | None = None   # newer than the others
        self._greet_at = self._pause = 0.0
        self._waiting: list[_Question] = []

    @property
    def busy(self) -> bool:
        return bool(self._waiting) or any(each.busy for each in self._services.values())

    def ask(self, service: str, request: Any, done: Done, now: float) -> None:
        self.asked_at = now
        if service not in self._services:
            self._get_to_know(service)
        if not self._waiting:
            self._greet_at, self._pause = now, FIRST_PATIENCE
        self._waiting.append(_Question(
            now + self._timeout, self._services[service], request, done))
        self._send(now)

    def drop(self, service: str) -> None:
        found = self._services.get(service)
        if found is not None:
            found.forget()
            self._waiting = [each for each in self._waiting if each.service is not found]

    def look(self, now: float) -> None:
        self._greet(now)
        self._send(now)
        for service in list(self._services.values()):
            if service.busy:
                service.look(now)

    def close(self) -> None:
        for service in (self._greeting, *self._services.values()):
            if service is not None:
                service.close()

    def _get_to_know(self, service: str) -> None:
        for name in wanted_with(service):
            self._services[name] = self._client(name, SERVICES[name])
        if self._greeting is not None:
            self._greeting.close()
        self._greeting = self._client(*GREETING)
        self._heard_at = -math.inf

    def _client(self, service: str, kind: Any) -> Service:
        return Service(self._node, kind, f'{self._name}/{service}', self._timeout)

    def _greet(self, now: float) -> None:
        greeting = self._greeting
        if greeting is None or not self._waiting:
            return
        if now >= self._greet_at and greeting.ready:
            greeting.send(GREETING[1].Request(), self._told(now, _nothing), now)
            self._greet_at = now + self._pause
            self._pause *= 2.0
        greeting.look(now)

    def _told(self, asked_at: float, done: Done) -> Done:
        def told(response: Any) -> None:
            if response is not None:
                self._heard_at = max(self._heard_at, asked_at)
            done(response)
        return told

    def _send(self, now: float) -> None:
        """Send what waits, if the node knows us."""
        waiting, self._waiting = self._waiting, []
        for each in waiting:
            if now - self._heard_at <= _FRESH:
                each.service.send(each.request, self._told(now, each.done), now, self._timeout)
            elif now < each.deadline:
                self._waiting.append(each)
            else:
                each.done(None)


def _nothing(_: Any) -> None:
    pass
