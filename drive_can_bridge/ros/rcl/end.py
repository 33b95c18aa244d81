# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
One end in the ROS graph: clients, subscriptions and publishers without an executor.

Straight from rclpy's extension, where it has what that takes; else as :mod:`.public_end` does it,
each client, publisher and subscription by itself. So is whatever differs in this rclpy.
"""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from rclpy.context import Context
from rclpy.qos import qos_profile_parameters, QoSProfile
from rclpy.type_support import check_is_valid_msg_type, check_is_valid_srv_type

from drive_can_bridge.ros.rcl.extension import extension, look_for
from drive_can_bridge.ros.rcl.unfit import Unfit

#: what it takes; every other way of making things is found out when they are made
MEMBERS = (
    'Node', 'Node.get_count_services', 'Client', 'Client.service_server_is_available',
    'Client.send_request', 'Client.take_response', 'Publisher', 'Publisher.publish',
    'Subscription', 'Subscription.take_message', 'rclpy_get_service_names_and_types',
    'rclpy_get_topic_names_and_types', 'rclpy_get_subscriptions_info_by_topic',
    'rmw_service_info_t.request_id', 'rmw_request_id_t.sequence_number',
    *(f'{kind}.destroy_when_not_in_use'
      for kind in ('Node', 'Client', 'Publisher', 'Subscription')))
#: what something that is not made in this way raises, or not used in this way
_OTHERWISE = AttributeError, TypeError

#: name and types of each
Names = Sequence[tuple[str, list[str]]]


class Asking(Protocol):
    """A client of a service."""

    @property
    def ready(self) -> bool:
        """Whether a server is discovered."""

    def send(self, request: Any) -> int:
        """Send a request; return its number."""

    def take(self) -> tuple[int, Any] | None:
        """Return the oldest answer, with the number of its request; None: there is none."""

    def close(self) -> None:
        """Drop the open requests."""


class ReadingEnd(Protocol):
    """A subscription."""

    def take(self) -> Any:
        """
        Return the oldest message; None: there is none.

        :raises RuntimeError: it cannot be read.
        """

    def close(self) -> None:
        """Unsubscribe."""


class Writing(Protocol):
    """A publisher."""

    def publish(self, message: Any) -> None:
        """Publish a message."""

    def close(self) -> None:
        """Destroy the publisher."""


class _Asking:
    def __init__(self, node: Any, kind: Any, name: str) -> None:
        check_is_valid_srv_type(kind)
        self._kind = kind.Response
        with node:
            self._handle = extension.Client(
                node, kind, name, qos_profile_parameters.get_c_qos_profile())

    @property
    def ready(self) -> bool:
        with self._handle:
            return bool(self._handle.service_server_is_available())

    def send(self, request: Any) -> int:
        with self._handle:
            return int(self._handle.send_request(request))

    def take(self) -> tuple[int, Any] | None:
        with self._handle:
            header, response = self._handle.take_response(self._kind)
        return None if response is None else (header.request_id.sequence_number, response)

    def close(self) -> None:
        self._handle.destroy_when_not_in_use()


class _Reading:
    def __init__(self, node: Any, kind: Any, topic: str, quality: QoSProfile) -> None:
        check_is_valid_msg_type(kind)
        self._kind = kind
        with node:
            self._handle = extension.Subscription(
                node, kind, topic, quality.get_c_qos_profile())

    def take(self) -> Any:
        with self._handle:
            taken = self._handle.take_message(self._kind, False)
        return None if taken is None else taken[0]

    def close(self) -> None:
        self._handle.destroy_when_not_in_use()


class _Writing:
    def __init__(self, node: Any, kind: Any, topic: str, quality: QoSProfile) -> None:
        check_is_valid_msg_type(kind)
        with node:
            self._handle = extension.Publisher(node, kind, topic, quality.get_c_qos_profile())

    def publish(self, message: Any) -> None:
        with self._handle:
            self._handle.publish(message)

    def close(self) -> None:
        self._handle.destroy_when_not_in_use()


class _PrivateEnd:
    """:param node: of the extension."""

    def __init__(self, node: Any) -> None:
        self._node = node

    def services(self) -> Names:
        with self._node:
            found: Names = extension.rclpy_get_service_names_and_types(self._node)
        return found

    def topics(self) -> Names:
        with self._node:
            found: Names = extension.rclpy_get_topic_names_and_types(self._node, False)
        return found

    def servers(self, service: str) -> int:
        with self._node:
            return int(self._node.get_count_services(service))

    def who_reads(self, topic: str) -> list[bytes]:
        with self._node:
            readers = extension.rclpy_get_subscriptions_info_by_topic(self._node, topic, True)
        return [bytes(reader['endpoint_gid']) for reader in readers]

    def asking(self, kind: Any, name: str) -> Asking:
        return _Asking(self._node, kind, name)

    def reading(self, kind: Any, topic: str, quality: QoSProfile) -> ReadingEnd:
        return _Reading(self._node, kind, topic, quality)

    def writing(self, kind: Any, topic: str, quality: QoSProfile) -> Writing:
        return _Writing(self._node, kind, topic, quality)

    def close(self) -> None:
        self._node.destroy_when_not_in_use()


def _node(context: Context, name: str) -> Any:
    """Return a node of the extension: no arguments of the process, no /rosout."""
    handle: Any = context.handle
    with handle:
        try:
            return extension.Node(name, '', handle, None, False, False)
        except TypeError:   # since rclpy 9 it wants the quality of /rosout, too
            return extension.Node(name, '', handle, None, False, False,
                                  QoSProfile(depth=1).get_c_qos_profile())


class TopicEnd:
    """
    The clients, subscriptions and publishers of one node.

    :param name: of a node of its own.
    :param told: called once with why this is slower than it might be.
    :param of: a node of rclpy, which this is instead; then the name is that of another one, which
        is only made if need be.
    """

    def __init__(self, context: Context, name: str, told: Callable[[str], object],
                 of: Any = None) -> None:
        self._context, self._name, self._told = context, name, told
        self._private: _PrivateEnd | None = None
        self._public: Any = None    # a PublicEnd
        self._own = of is None
        try:
            look_for(MEMBERS)
            self._private = _PrivateEnd(_node(context, name) if of is None else of.handle)
        except (Unfit, *_OTHERWISE) as error:
            self._give_up(error)

    def _give_up(self, error: Exception) -> None:
        """Use the public interface from now on."""
        if self._public is None:
            # its import takes 0.25 s, and it is seldom needed
            from drive_can_bridge.ros.rcl.public_end import PublicEnd
            self._public = PublicEnd(
                self._context, self._name if self._private is None else f'{self._name}_too')
            self._told(str(error).partition('\n')[0])

    def _do(self, what: str, *arguments: Any) -> Any:
        if self._private is not None and self._public is None:
            try:
                return getattr(self._private, what)(*arguments)
            except _OTHERWISE as error:
                self._give_up(error)
        return getattr(self._public, what)(*arguments)

    def services(self) -> Names:
        """Return all services that have been discovered, with their types."""
        return self._do('services')

    def topics(self) -> Names:
        """Return all topics that have been discovered, with their types."""
        return self._do('topics')

    def servers(self, service: str) -> int:
        """Return how many servers of this name are discovered."""
        return int(self._do('servers', service))

    def who_reads(self, topic: str) -> list[bytes]:
        """
        Return the gids of a topic's subscribers.

        :param topic: as the middleware has it.
        """
        return self._do('who_reads', topic)

    def asking(self, kind: Any, name: str) -> Asking:
        """Return a client of a service of this full name."""
        return self._do('asking', kind, name)

    def reading(self, kind: Any, topic: str, quality: QoSProfile) -> ReadingEnd:
        """Return a subscription."""
        return self._do('reading', kind, topic, quality)

    def writing(self, kind: Any, topic: str, quality: QoSProfile) -> Writing:
        """Return a publisher."""
        return self._do('writing', kind, topic, quality)

    def close(self) -> None:
        """Remove the node of its own from the graph."""
        if self._private is not None and self._own:
            self._private.close()
        if self._public is not None:
            self._public.close()
