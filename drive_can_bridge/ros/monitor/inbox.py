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
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

RCLError = rclpy_implementation.RCLError

#: messages taken at once; what is left waits for the next look
_BATCH = 200
#: s after which an answer is not waited for any more
CALL_TIMEOUT = 5.0


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


class Call:
    """
    One request to a service, sent as soon as somebody offers it.

    :param done: takes the response, or None: nobody answered.
    """

    def __init__(self, node: Node, service_type: Any, name: str, request: Any,
                 done: Callable[[Any], None], now: float) -> None:
        self._node = node
        self._type = service_type
        self._request = request
        self._done = done
        self._deadline = now + CALL_TIMEOUT
        self._client = node.create_client(service_type, name)
        self._sent = False

    def look(self, now: float) -> bool:
        """Do what can be done now; return whether the call is over."""
        handle = self._client.handle
        if not self._sent and self._client.service_is_ready():
            with handle:
                handle.send_request(self._request)
            self._sent = True
        response = None
        if self._sent:
            with handle:
                _, response = handle.take_response(self._type.Response)
        if response is None and now < self._deadline:
            return False
        self.close()
        self._done(response)
        return True

    def close(self) -> None:
        """Wait for no answer."""
        self._node.destroy_client(self._client)


def _never(_: Any) -> None:
    raise RuntimeError('messages are looked for, no executor runs')
