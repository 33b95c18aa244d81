# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The quality of service of each kind of topic."""

from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter as NodeParameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from drive_can_bridge.ros.rcl.nodes import overrides

#: s between two counts of subscribers
COUNT_PERIOD = 0.1
#: the default policies, and that which makes a topic a latched one
_OVERRIDABLE = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY,
                QoSPolicyKind.DURABILITY)


def state_quality() -> QoSProfile:
    """Return what suits values once per exchange: reliable, a short history."""
    return QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


def command_quality() -> QoSProfile:
    """
    Return the quality for setpoints: the newest wins, and what was lost is outdated.

    Best effort: after a pause of this process, reliable middleware delivers again what was sent
    meanwhile, seconds late. A few messages of history all the same: a refused value must not push
    a good one, sent just before it, out of the queue between two cycles.
    """
    return QoSProfile(depth=8, reliability=ReliabilityPolicy.BEST_EFFORT)


def publisher(node: Node, kind: Any, topic: str, quality: QoSProfile) -> Publisher:
    """Create a publisher whose quality of service may be overridden."""
    return node.create_publisher(kind, topic, quality,
                                 qos_overriding_options=overriding(node, topic))


def overriding(node: Node, topic: str) -> QoSOverridingOptions | None:
    """
    Return the overriding options of a topic; None: nothing is overridden.

    Declaring three parameters for each of a dozen topics costs every drive some milliseconds at
    start; few users override.
    """
    prefix = f'qos_overrides.{node.resolve_topic_name(topic)}.'
    if any(name.startswith(prefix) for name in overrides(node)):
        return QoSOverridingOptions(policy_kinds=_OVERRIDABLE)
    return None


def quality_overrides(node: Node) -> list[NodeParameter]:
    """Return the parameters of a node that override qualities of topics."""
    return [parameter for name, parameter in overrides(node).items()
            if name.startswith('qos_overrides.')]


class Audience:
    """Counts the subscribers of one topic."""

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        self._listens = False
        self._count_at = 0.0

    def listens(self, now: float) -> bool:
        """Return whether there are any; ``now`` is of the steady clock."""
        if now >= self._count_at:
            self._count_at = now + COUNT_PERIOD
            self._listens = bool(self._publisher.get_subscription_count())
        return self._listens
