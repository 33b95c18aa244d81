# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Services of other nodes, called without an executor: answers are polled.

How a client makes sure that a node can answer it: a discovered server may not have discovered the
client yet. Then it drops its answer, though it has done what it was
asked. So before the first call another one is made that changes nothing, through a client that was
made later, until it is answered: endpoints are announced in order, so that a server which knows
the later one knows the earlier ones of this node, too. Nor has this side found all services of a
node when it has found one: what is sent to one that it does not know yet is lost.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
import math
from typing import Any, NamedTuple

from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParameters,
)
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.ros.client.client_node import HasEnd
from drive_can_bridge.ros.client.foreign import foreign

#: what is asked of a node to know that it knows us: of no parameter
GREETING = 'get_parameter_types', GetParameterTypes
#: s after which a greeting is repeated for the first time; then twice as many, up to the second
#: (where the network loses messages, discovery is repaired every 3 s: that is to be noticed soon)
FIRST_PATIENCE, LONGEST_PATIENCE = 0.1, 0.5
#: what changes nothing
ASKING: dict[str, Any] = {
    'get_parameters': GetParameters, 'list_parameters': ListParameters,
    'describe_parameters': DescribeParameters}
#: with effect each time; and some not for everybody who reads (SROS2)
CHANGING: dict[str, Any] = {
    'set_parameters': SetParameters, 'enable': SetBool, 'reset_fault': Trigger}
SERVICES = {**ASKING, **CHANGING}
#: s after which a question that changes nothing is asked again: DDS may lose an answer
AGAIN = 30.0
#: s that a service which is not discovered yet may still be: each is discovered by itself
OFFER_TIMEOUT = 2.0
#: s until a node knows us, or offers what it was asked for
FIND_TIMEOUT = 10.0
#: s without the server until it counts as left
GONE = 2.0
#: s without a question after which a node's clients are closed
_IDLE = 60.0
#: s for which one that has answered counts as the same, and not as restarted
_FRESH = 2.0

#: called with the response, or None: there was none in time
Done = Callable[[Any], None]
#: called instead where the request was not even sent: nothing was done
Unasked = Callable[[], None]


@dataclass(slots=True)
class _Call:
    """
    A request, with the time until which it may be sent, or answered.

    :ivar seen_at: when a server was seen last.
    """

    request: Any
    done: Done
    unasked: Unasked
    deadline: float
    again_at: float
    seen_at: float


class Service:
    """
    A service for any number of requests, several at once.

    :param node: of ours.
    :param timeout: s after which an answer is not waited for any more.
    :param again: s after which a request is repeated while there is no answer.
    """

    def __init__(self, node: HasEnd, service_type: Any, name: str, timeout: float,
                 again: float = math.inf) -> None:
        self._node, self._name = node, name
        self._timeout = timeout
        self._again = again
        self._client = node.end.asking(service_type, name)
        self._waiting: dict[int, _Call] = {}
        self._unsent: list[_Call] = []

    @property
    def ready(self) -> bool:
        """Whether a server is discovered."""
        return self._client.ready

    @property
    def foreign(self) -> bool:
        """Whether only servers of another middleware are discovered, which are sent nothing."""
        return bool(foreign(self._node, self._name))

    @property
    def busy(self) -> bool:
        """Whether a request waits for its answer."""
        return bool(self._waiting or self._unsent)

    @property
    def unsent(self) -> bool:
        """Whether a request waits to be sent."""
        return bool(self._unsent)

    def send(self, request: Any, done: Done, now: float, patience: float = OFFER_TIMEOUT,
             unasked: Unasked | None = None) -> None:
        """
        Send a request, as soon as a server is discovered.

        :param done: called with the response, or None: there was none in time.
        :param patience: s that it may take until it is offered.
        :param unasked: called instead where it was not sent in time; None: ``done`` is.
        """
        call = _Call(request, done, unasked or partial(done, None), now + patience, math.inf, now)
        if self.ready:
            self._send(call, now)
        else:
            self._unsent.append(call)

    def _send(self, call: _Call, now: float) -> None:
        if self.foreign:
            call.unasked()
            return
        if call.again_at == math.inf:   # for the first time
            call.deadline = now + self._timeout
        call.again_at, call.seen_at = now + self._again, now
        self._waiting[self._client.send(call.request)] = call

    def look(self, now: float) -> None:
        """Send what could not be sent before, and deliver the answers that have arrived."""
        if not self.busy:
            return
        ready = self.ready
        unsent, self._unsent = self._unsent, []
        for call in unsent:
            if ready:
                self._send(call, now)
            elif now < call.deadline:
                self._unsent.append(call)
            else:
                call.unasked()
        while self._waiting:
            taken = self._client.take()
            if taken is None:
                break
            number, response = taken
            answered = self._waiting.get(number)
            if answered is not None:
                self._end(answered, response)
        for call in {id(call): call for call in self._waiting.values()}.values():
            if ready:
                call.seen_at = now
            if now >= call.deadline or now - call.seen_at > GONE:
                self._end(call, None)
            elif now >= call.again_at and ready and not self.foreign:
                self._send(call, now)

    def _end(self, call: _Call, response: Any) -> None:
        self._waiting = {number: other for number, other in self._waiting.items()
                         if other is not call}
        call.done(response)

    def forget(self) -> None:
        """Wait for no answer to what was asked."""
        self._waiting.clear()
        self._unsent.clear()

    def close(self) -> None:
        """Wait for no answer any more."""
        self._client.close()


class NodeCalls:
    """
    Calls services of nodes, after making sure that they know the clients.

    :param node: of ours.
    :param timeout: s after which an answer is not waited for any more.
    """

    def __init__(self, node: HasEnd, timeout: float) -> None:
        self._node = node
        self._timeout = timeout
        self._hosts: dict[str, _Host] = {}

    @property
    def busy(self) -> bool:
        """Whether a request waits for its answer."""
        return any(host.busy for host in self._hosts.values())

    def ask(self, host: str, service: str, request: Any, done: Done, now: float,
            patience: float = FIND_TIMEOUT, unasked: Unasked | None = None) -> None:
        """
        Call a service of a node, as soon as it offers it and knows us.

        :param service: one of :data:`SERVICES`.
        :param patience: s that it may take, once it knows us, until it is offered.
        :param unasked: called instead where it was not sent in time; None: ``done`` is.
        """
        if host not in self._hosts:
            self._hosts[host] = _Host(self._node, host, self._timeout)
        self._hosts[host].ask(service, request, done, now, patience,
                              unasked or partial(done, None))

    def close(self) -> None:
        """Drop all requests and clients."""
        while self._hosts:
            self._hosts.popitem()[1].close()

    def offered(self, host: str, service: str) -> bool:
        """Return whether a service that was asked for is offered."""
        return host in self._hosts and self._hosts[host].offered(service)

    def drop(self, host: str, service: str) -> None:
        """Wait for no answer of this service any more."""
        if host in self._hosts:
            self._hosts[host].drop(service)

    def look(self, now: float) -> None:
        """Send what could not be sent before, and deliver the answers that have arrived."""
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
    unasked: Unasked
    patience: float


class _Host:
    """
    A node that is asked.

    :ivar asked_at: when a service of it was called last.
    """

    def __init__(self, node: HasEnd, name: str, timeout: float) -> None:
        self.asked_at = self._heard_at = -math.inf
        self._node, self._name, self._timeout = node, name, timeout
        self._services: dict[str, Service] = {}
        self._greeting: Service | None = None   # newer than the others
        self._greet_at = self._pause = 0.0
        self._waiting: list[_Question] = []

    @property
    def busy(self) -> bool:
        return bool(self._waiting) or any(each.busy for each in self._services.values())

    def ask(self, service: str, request: Any, done: Done, now: float, patience: float,
            unasked: Unasked) -> None:
        self.asked_at = now
        if service not in self._services:
            self._get_to_know(service)
        if not self._waiting:
            self._greet_at, self._pause = now, FIRST_PATIENCE
        self._waiting.append(_Question(
            now + min(self._timeout, FIND_TIMEOUT), self._services[service], request, done,
            unasked, min(patience, self._timeout)))
        self._send(now)

    def offered(self, service: str) -> bool:
        return service in self._services and self._services[service].ready

    def drop(self, service: str) -> None:
        found = self._services.get(service)
        if found is not None:
            found.forget()
            self._waiting = [each for each in self._waiting if each.service is not found]

    def look(self, now: float) -> None:
        self._greet(now)
        self._send(now)
        for service in list(self._services.values()):
            service.look(now)

    def close(self) -> None:
        for service in (self._greeting, *self._services.values()):
            if service is not None:
                service.close()

    def _get_to_know(self, service: str) -> None:
        # those that change nothing are made together: a greeting is enough for them all
        for name in ASKING if service in ASKING else (service,):
            self._services[name] = self._client(
                name, SERVICES[name], AGAIN if name in ASKING else math.inf)
        if self._greeting is not None:
            self._greeting.close()
        self._greeting = self._client(*GREETING)
        self._heard_at = -math.inf

    def _client(self, service: str, kind: Any, again: float = math.inf) -> Service:
        return Service(self._node, kind, f'{self._name}/{service}', self._timeout, again)

    def _greet(self, now: float) -> None:
        greeting = self._greeting
        if greeting is None or not self._waiting:
            return
        if now >= self._greet_at and greeting.ready:
            if greeting.foreign:
                waiting, self._waiting = self._waiting, []
                for each in waiting:
                    each.unasked()
                return
            greeting.send(GREETING[1].Request(), self._told(now, lambda _: None), now)
            self._greet_at = now + self._pause
            self._pause = min(2.0 * self._pause, LONGEST_PATIENCE)
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
                each.service.send(each.request, self._told(now, each.done), now, each.patience,
                                  each.unasked)
            elif now < each.deadline:
                self._waiting.append(each)
            else:
                each.unasked()


