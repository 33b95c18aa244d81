# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Topics without an executor: looked into when the view is drawn anew.

An executor wakes for every message and makes a Python object of it. A view wants the newest few a
second; the middleware's own queue of depth one throws the others away at next to no cost.
"""

from collections.abc import Callable
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.type_support import check_is_valid_msg_type

from drive_can_bridge.ros.client.calls import HasHandle

RCLError = rclpy_implementation.RCLError

#: messages taken at once; what is left waits for the next look
_BATCH = 200


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

    def __init__(self, node: HasHandle, message_type: Any, topic: str, quality: QoSProfile,
                 take: Callable[[Any], None]) -> None:
        self._type = message_type
        self._take = take
        check_is_valid_msg_type(message_type)
        with node.handle:
            self._handle: Any = rclpy_implementation.Subscription(
                node.handle, message_type, topic, quality.get_c_qos_profile())

    def look(self) -> None:
        """Take what has arrived."""
        with self._handle:
            for _ in range(_BATCH):
                try:
                    taken = self._handle.take_message(self._type, False)
                except RCLError:  # anybody can publish rubbish
                    continue
                if taken is None:
                    return
                self._take(taken[0])

    def close(self) -> None:
        """Unsubscribe."""
        self._handle.destroy_when_not_in_use()
