# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Messages that are polled as the bytes that came, and events of their topics.

Where rclpy has no such members, its executor takes them (``raw=True``), and they wait here.
The stamp of the middleware does not show how long one has waited for the executor: so what counts
is when that has taken it.
"""

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup, ReentrantCallbackGroup
from rclpy.event_handler import QoSSubscriptionEventType, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from drive_can_bridge.ros.rcl.extension import extension, lacking

MEMBERS = ('Subscription.take_message', 'Subscription.get_publisher_count', 'EventHandle',
           'EventHandle.take_event', 'EventHandle.destroy_when_not_in_use')

#: messages that wait here where everything is kept: as many as Fast DDS keeps
KEPT_MAX = 5000
#: the bytes of a message, and what is known of it
Taken = tuple[bytes, dict[str, Any]]


class PolledGroup(CallbackGroup):
    """A group whose entities are polled; an executor never waits for them."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass


class Incoming(NamedTuple):
    """
    A subscription.

    :ivar take: returns the oldest message that waits; None: there is none.
    :ivar publishers: returns how many publish to it.
    :ivar look: handles its events.
    :ivar let_go: must have been called before the subscription is destroyed.
    """

    subscription: Subscription
    take: Callable[[], Taken | None]
    publishers: Callable[[], int]
    look: Callable[[], None]
    let_go: Callable[[], None]


def by_hand(subscription: Any, look: Callable[[], None] = lambda: None,
            let_go: Callable[[], None] = lambda: None) -> Incoming:
    """Return the functions to poll a subscription that no executor takes from."""
    handle = subscription.handle
    return Incoming(subscription, partial(handle.take_message, subscription.msg_type, True),
                    handle.get_publisher_count, look, let_go)


def why_not_by_hand() -> str:
    """Return why messages cannot be polled; '': they can."""
    return lacking(MEMBERS)


def subscribe(node: Node, kind: type, topic: str, quality: QoSProfile,
              overriding: QoSOverridingOptions | None, incompatible: Callable[[Any], None],
              stamp: Callable[[], int]) -> Incoming:
    """
    Subscribe to a topic.

    :param incompatible: called with the status of a publisher of incompatible quality.
    :param stamp: returns the time of the day, in ns.
    """
    if why_not_by_hand():
        return _by_executor(node, kind, topic, quality, overriding, incompatible, stamp)
    subscription = node.create_subscription(
        kind, topic, _never, quality, callback_group=PolledGroup(),
        qos_overriding_options=overriding,
        event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False))
    # waiting for it would end with every message
    event = extension.EventHandle(
        subscription.handle,
        QoSSubscriptionEventType.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS)

    def look() -> None:
        with event:
            status = event.take_event()
        if status is not None and status.total_count_change > 0:
            incompatible(status)
    return by_hand(subscription, look, event.destroy_when_not_in_use)


def _by_executor(node: Node, kind: type, topic: str, quality: QoSProfile,
                 overriding: QoSOverridingOptions | None, incompatible: Callable[[Any], None],
                 stamp: Callable[[], int]) -> Incoming:
    came: deque[Taken] = deque(maxlen=KEPT_MAX)

    def take(data: Any, info: Any) -> None:
        came.append((data, {**info, 'received_timestamp': stamp()}))
    taking: Any = take
    subscription = node.create_subscription(
        kind, topic, taking, quality, callback_group=ReentrantCallbackGroup(), raw=True,
        qos_overriding_options=overriding, event_callbacks=SubscriptionEventCallbacks(
            incompatible_qos=incompatible, use_default_callbacks=False))
    used = subscription.qos_profile
    if used.history is HistoryPolicy.KEEP_LAST:     # the newest, as the middleware does
        came = deque(maxlen=used.depth or 1)
    return Incoming(subscription, lambda: came.popleft() if came else None,
                    lambda: node.count_publishers(subscription.topic_name), lambda: None,
                    lambda: None)


def _never(_: Any) -> None:
    raise RuntimeError('command subscriptions are taken by the exchange, not by an executor')
