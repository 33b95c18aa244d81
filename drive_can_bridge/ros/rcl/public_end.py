# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
An end in the ROS graph by rclpy's public interface: a node, and an executor that is polled.

Slower: importing it takes 0.25 s, and each look some tenths of a millisecond.
"""

from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import qos_profile_parameters, QoSProfile
from rclpy.subscription import Subscription
from rclpy.task import Future

#: turns of the executor in one look
_TURNS_MAX = 200


class PublicEnd:
    """See :class:`.end.TopicEnd`."""

    def __init__(self, context: Context, name: str) -> None:
        self._node = Node(
            name, context=context, use_global_arguments=False, enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[Parameter('start_type_description_service', value=False)])
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        self._came = 0

    def spin(self) -> None:
        """Handle what has arrived."""
        idle = 0
        for _ in range(_TURNS_MAX):
            before = self._came
            # malformed bytes are another node's fault
            with suppress(RuntimeError):
                self._executor.spin_once(timeout_sec=0.0)
            idle = 0 if self._came != before else idle + 1
            if idle == 2:   # the first turn may have handled something else
                return

    def came(self) -> None:
        """Count an arrival."""
        self._came += 1

    def services(self) -> Sequence[tuple[str, list[str]]]:
        """Return all services."""
        return self._node.get_service_names_and_types()

    def topics(self) -> Sequence[tuple[str, list[str]]]:
        """Return all topics."""
        return self._node.get_topic_names_and_types()

    def servers(self, service: str) -> int:
        """Return how many offer a service."""
        return int(self._node.count_services(service))

    def who_reads(self, topic: str) -> list[bytes]:
        """Return the gids of a topic's subscribers; the topic as the middleware names it."""
        return [bytes(found.endpoint_gid)
                for found in self._node.get_subscriptions_info_by_topic(topic, no_mangle=True)]

    def asking(self, kind: Any, name: str) -> '_PublicAsking':
        """Return a client."""
        return _PublicAsking(self, self._node, self._node.create_client(
            kind, name, qos_profile=qos_profile_parameters))

    def reading(self, kind: Any, topic: str, quality: QoSProfile) -> '_PublicReading':
        """Return a subscription."""
        return _PublicReading(self, self._node, kind, topic, quality)

    def writing(self, kind: Any, topic: str, quality: QoSProfile) -> '_PublicWriting':
        """Return a publisher."""
        return _PublicWriting(self._node, self._node.create_publisher(kind, topic, quality))

    def close(self) -> None:
        """Remove the node from the graph."""
        self._executor.shutdown(timeout_sec=0.0)
        self._node.destroy_node()


class _Arrivals:
    """What has arrived and waits to be taken, the oldest first; at most the last ``kept``."""

    def __init__(self, end: PublicEnd, kept: int | None = None) -> None:
        self._end = end
        self._waiting: deque[Any] = deque(maxlen=kept)

    def add(self, found: Any) -> None:
        self._end.came()
        self._waiting.append(found)

    def take(self) -> Any:
        if not self._waiting:
            self._end.spin()
        return self._waiting.popleft() if self._waiting else None


class _PublicAsking:
    def __init__(self, end: PublicEnd, node: Node, client: Client) -> None:
        self._node, self._client = node, client
        self._number = 0
        self._answers = _Arrivals(end)
        self.take = self._answers.take

    @property
    def ready(self) -> bool:
        return bool(self._client.service_is_ready())

    def send(self, request: Any) -> int:
        self._number += 1
        number = self._number

        def done(future: Future) -> None:
            self._answers.add((number, future.result()))
        self._client.call_async(request).add_done_callback(done)
        return number

    def close(self) -> None:
        self._node.destroy_client(self._client)


class _PublicReading:
    def __init__(self, end: PublicEnd, node: Node, kind: Any, topic: str,
                 quality: QoSProfile) -> None:
        self._node = node
        messages = _Arrivals(end, quality.depth or None)
        self.take = messages.take
        self._subscription: Subscription = node.create_subscription(
            kind, topic, messages.add, quality)

    def close(self) -> None:
        self._node.destroy_subscription(self._subscription)


class _PublicWriting:
    def __init__(self, node: Node, publisher: Publisher) -> None:
        self._node, self._publisher = node, publisher

    def publish(self, message: Any) -> None:
        self._publisher.publish(message)

    def close(self) -> None:
        self._node.destroy_publisher(self._publisher)
