# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Topics without an executor: their messages are polled.

An executor wakes for every message and makes a Python object of it. A view wants the newest few a
second; the middleware's own queue of depth one throws the others away at next to no cost.
"""

from collections.abc import Callable
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from drive_can_bridge.ros.client.client_node import HasEnd

#: messages taken at once; what is left waits for the next look
_BATCH = 200


def newest_quality() -> QoSProfile:
    """Return what suits values of which only the newest counts; no publisher waits for us."""
    return QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def log_quality() -> QoSProfile:
    """Return what suits ``/rosout``: recent lines are delivered to late joiners, too."""
    return QoSProfile(depth=_BATCH, reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.TRANSIENT_LOCAL)


def undemanding_quality() -> QoSProfile:
    """Return the quality of a subscription that matches every publisher."""
    return QoSProfile(depth=_BATCH, reliability=ReliabilityPolicy.BEST_EFFORT)


class NewestPublisher:
    """A publisher of the newest message only."""

    def __init__(self, node: HasEnd, message_type: Any, topic: str) -> None:
        self._writing = node.end.writing(message_type, topic, QoSProfile(depth=1))

    def publish(self, message: Any) -> None:
        """Publish a message."""
        self._writing.publish(message)

    def close(self) -> None:
        """Destroy the publisher."""
        self._writing.close()


class Inbox:
    """
    A subscription whose messages are polled.

    :param take: called with each message.
    """

    def __init__(self, node: HasEnd, message_type: Any, topic: str, quality: QoSProfile,
                 take: Callable[[Any], None]) -> None:
        self._take = take
        self._reading = node.end.reading(message_type, topic, quality)

    def look(self) -> None:
        """Deliver the messages that have arrived."""
        for _ in range(_BATCH):
            try:
                message = self._reading.take()
            except RuntimeError:  # any publisher may send malformed bytes
                continue
            if message is None:
                return
            self._take(message)

    def close(self) -> None:
        """Unsubscribe."""
        self._reading.close()
