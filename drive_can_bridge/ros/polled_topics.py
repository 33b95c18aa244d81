# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Command subscriptions that are taken by hand, when the exchange comes to it.

Nor does anybody wait for their events, such as a publisher of other quality: with Fast DDS that
wait ends with every message, which at 3,000 commands/s costs more than everything else. They are
looked at once in a while instead.

Even a look into an empty queue costs 2 µs, with four setpoints a tenth of the whole exchange. So
only the topics that somebody publishes are looked at in each cycle; who does is looked up every
``COUNT_PERIOD``, and whatever came from anybody is taken then. The very first command of a
publisher that was discovered just now may wait for that long.
"""

from collections.abc import Callable
import math
from typing import Any, Protocol

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import QoSSubscriptionEventType, SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import qos_policy_name_from_kind
from rclpy.subscription import Subscription

from drive_can_bridge.clock import Clock
from drive_can_bridge.core.text import printable
from drive_can_bridge.ros.command_topic import CommandTopic
from drive_can_bridge.ros.gone import GONE
from drive_can_bridge.ros.quality import command_quality, overriding

#: s between two looks at who publishes
COUNT_PERIOD = 0.05
#: s between two looks at events of subscriptions
EVENT_PERIOD = 1.0


class PolledGroup(CallbackGroup):
    """Entities of this group are taken by hand; an executor never waits for them."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass


class Warn(Protocol):
    """Takes the topic of a warning, and its text; ``once``: no need to repeat it."""

    def __call__(self, topic: str, text: str, *, once: bool = False) -> None:
        """Log it, or not."""


class PolledEvent:
    """
    An event of a subscription for which nobody waits. To be destroyed before the subscription.

    :param tell: takes the status when there is news.
    """

    def __init__(self, subscription: Subscription, kind: Any,
                 tell: Callable[[Any], None]) -> None:
        self._handle = rclpy_implementation.EventHandle(subscription.handle, kind)
        self._tell = tell

    def look(self) -> None:
        """Tell what happened since the last look, if anything did."""
        with self._handle:
            status = self._handle.take_event()
        if status is not None and status.total_count_change > 0:
            self._tell(status)

    def destroy(self) -> None:
        """Let go of the subscription."""
        self._handle.destroy_when_not_in_use()


class PolledTopics:
    """
    The command subscriptions that one thread takes.

    :param warn: takes (topic of the warning, text); throttling is its business.
    :param refuse: the same of a command that is thrown away.
    """

    def __init__(self, node: Node, clock: Clock, warn: Warn,
                 refuse: Callable[[str, str], None]) -> None:
        self._clock = clock
        self._node = node
        self._warn = warn
        self._refuse = refuse
        self._group = PolledGroup()
        self._topics: list[CommandTopic] = []
        self._published: list[CommandTopic] = []  # by somebody, as far as known
        self._count_at = -math.inf
        self._events: list[PolledEvent] = []
        self._look_at = -math.inf

    def subscribe(self, message_type: type, topic: str,
                  take: Callable[[Any, float], None], old: Callable[[Any], None],
                  read: Callable[[bytes], Any] | None = None) -> None:
        """
        Add a topic.

        :param take: gets each message (or its number) and ``now``.
        :param old: gets each that is thrown away for its age, for what it may stop.
        :param read: makes of the bytes what ``take`` gets; None: the message.
        """
        node = self._node
        name = node.resolve_topic_name(topic)

        def incompatible(status: Any) -> None:
            self._warn(f'quality {name}', f'a publisher of {name} offers incompatible quality of '
                       f'service ({qos_policy_name_from_kind(status.last_policy_kind)}): nothing '
                       f'is received from it')
        subscription = node.create_subscription(
            message_type, topic, _never, command_quality(), callback_group=self._group,
            qos_overriding_options=overriding(node, topic),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False))
        self._events.append(PolledEvent(
            subscription, QoSSubscriptionEventType.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS,
            incompatible))

        def late(seconds: float) -> None:
            self._refuse(f'late {name}', f'command on {name} thrown away: it came {seconds:.2f} s '
                         f'later than others have')

        def unreadable(reason: str) -> None:
            self._refuse(f'unreadable {name}',
                         f'command on {name} cannot be read: {printable(reason)}')
        self._topics.append(CommandTopic(subscription, use=take, old=old, late=late,
                                         unreadable=unreadable, stamp=self._clock.stamp,
                                         read=read))

    def take(self, now: float) -> None:
        """Hand over all that waits, oldest first."""
        try:
            if now < self._count_at:
                for topic in self._published:
                    topic.take(now)
                return
            self._count_at = now + COUNT_PERIOD
            for topic in self._topics:  # some may have come from a publisher that is gone by now
                topic.take(now)
            self._published = [topic for topic in self._topics
                               if topic.handle.get_publisher_count()]
            for topic in self._topics:
                if topic not in self._published:
                    topic.forget()
            if now >= self._look_at:
                self._look_at = now + EVENT_PERIOD
                for event in self._events:
                    event.look()
        except GONE:  # the node is being destroyed
            pass

    def discard(self) -> int:
        """Throw away what is waiting; return how many commands that were."""
        try:
            return sum(topic.discard() for topic in self._topics)
        except GONE:  # the node is being destroyed
            return 0

    def destroy(self) -> None:
        """Let go of the subscriptions. Before the node is destroyed, which has them otherwise."""
        events, self._events = self._events, []
        for event in events:
            event.destroy()

    def unsubscribe(self) -> None:
        """Take the subscriptions out of a node that stays."""
        self.destroy()
        self._published.clear()
        while self._topics:
            self._node.destroy_subscription(self._topics.pop().subscription)


def _never(_: Any) -> None:
    raise RuntimeError('command subscriptions are taken by the exchange, not by an executor')
