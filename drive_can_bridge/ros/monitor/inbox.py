# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Topics and services without an executor: looked into when the view is drawn anew.

An executor wakes for every message and makes a Python object of it. A view wants the newest few a
second; the middleware's own queue of depth one throws the others away at next to no cost.
"""

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy, qos_profile_parameters, QoSProfile, ReliabilityPolicy,
)

RCLError = rclpy_implementation.RCLError

#: messages taken at once; what is left waits for the next look
_BATCH = 200
#: s that a service which nobody offers yet may still be found in: each is found by itself
OFFER_TIMEOUT = 2.0


def newest_quality() -> QoSProfile:
    """Return what suits values of which only the newest counts; no publisher waits for us."""
    return QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def latched_quality() -> QoSProfile:
    """Return what suits states that are published on change."""
    return QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.TRANSIENT_LOCAL)


def log_quality() -> QoSProfile:
    """Return what suits ``/rosout``: what was said shortly before we came, too."""
    return QoSProfile(depth=_BATCH, reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Inbox:
    """
    A subscription that is looked into.

    :param take: takes each message.
    """

    def __init__(self, node: Node, message_type: type, topic: str, quality: QoSProfile,
                 take: Callable[[Any], None]) -> None:
        self._node = node
        self._type = message_type
        self._take = take
        self._subscription = node.create_subscription(
            message_type, topic, _never, quality,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False))

    def look(self) -> None:
        """Take what has arrived."""
        handle = self._subscription.handle
        with handle:
            for _ in range(_BATCH):
                try:
                    taken = handle.take_message(self._type, False)
                except RCLError:  # anybody can publish rubbish
                    continue
                if taken is None:
                    return
                self._take(taken[0])

    def close(self) -> None:
        """Unsubscribe."""
        self._node.destroy_subscription(self._subscription)


class Service:
    """
    A service that may be asked again and again, by several at once.

    :param timeout: s after which an answer is not waited for any more.
    """

    def __init__(self, node: Node, service_type: Any, name: str,
                 timeout: float) -> None:
        self._node = node
        self._type = service_type
        self._timeout = timeout
        self._client = node.create_client(service_type, name,
                                          qos_profile=qos_profile_parameters)
        self._waiting: dict[int, tuple[float, Callable[[Any], None]]] = {}
        self._unsent: list[tuple[float, Any, Callable[[Any], None]]] = []

    @property
    def ready(self) -> bool:
        """Somebody offers it."""
        return self._client.service_is_ready()

    @property
    def busy(self) -> bool:
        """Somebody waits for an answer."""
        return bool(self._waiting or self._unsent)

    def send(self, request: Any, done: Callable[[Any], None], now: float,
             patience: float = OFFER_TIMEOUT) -> None:
        """
        Ask, as soon as somebody offers it.

        :param done: takes the response, or None: nobody answered in time.
        :param patience: s that it may take until it is offered.
        """
        if not self.ready:
            self._unsent.append((now + patience, request, done))
            return
        handle = self._client.handle
        with handle:
            number = handle.send_request(request)
        self._waiting[number] = (now + self._timeout, done)

    def look(self, now: float) -> None:
        """Ask what could not be asked before, and hand over the answers that have arrived."""
        unsent, self._unsent = self._unsent, []
        for deadline, request, done in unsent:
            if self.ready:
                self.send(request, done, now)
            elif now < deadline:
                self._unsent.append((deadline, request, done))
            else:
                done(None)
        handle = self._client.handle
        while self._waiting:
            with handle:
                header, response = handle.take_response(self._type.Response)
            if response is None:
                break
            asked = self._waiting.pop(header.request_id.sequence_number, None)
            if asked is not None:
                asked[1](response)
        for number, (deadline, done) in list(self._waiting.items()):
            if now >= deadline and self._waiting.pop(number, None) is not None:
                done(None)

    def forget(self) -> None:
        """Wait for no answer to what was asked."""
        self._waiting.clear()
        self._unsent.clear()

    def close(self) -> None:
        """Wait for no answer any more."""
        self._node.destroy_client(self._client)


def _never(_: Any) -> None:
    raise RuntimeError('messages are looked for, no executor runs')
