# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Command subscriptions that are taken by hand, when the exchange comes to it, but for old commands.

Nor does anybody wait for their events, such as a publisher of other quality: with Fast DDS that
wait ends with every message, which at 3,000 commands/s costs more than everything else. They are
looked at once in a while instead.

Even a look into an empty queue costs 2 µs, with four setpoints a tenth of the whole exchange. So
only the topics that somebody publishes are looked at in each cycle; who does is looked up every
``COUNT_PERIOD``, and whatever came from anybody is taken then. The very first command of a
publisher that was discovered just now may wait for that long.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
import math
import struct
from typing import Any, Protocol

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import QoSSubscriptionEventType, SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, qos_policy_name_from_kind
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from std_msgs.msg import Bool, Float64, Int64

from drive_can_bridge.clock import Clock
from drive_can_bridge.core.text import printable
from drive_can_bridge.ros.middleware import command_quality, GONE, overriding

#: ns by which a command may take longer than the quickest of its topic
LATENESS_MAX = 250_000_000
#: messages that are taken at once where everything is kept, and that are thrown away at once: more
#: than any middleware keeps (Fast DDS: 5000), since what is left would pass for fresh
DEPTH_UNBOUNDED, KEPT_MAX = 1000, 100_000
#: bytes of a message that are looked at: a JointState of a thousand joints with long names
LENGTH_MAX = 1 << 20
#: bytes in front of every message: how the rest is encoded
HEADER = 4
#: struct code of the one number of these messages
_CODES = {Float64: 'd', Int64: 'q', Bool: '?'}
#: what bytes that nobody can read raise
_UNREADABLE = RuntimeError, ValueError, struct.error
#: s between two looks at who publishes
COUNT_PERIOD = 0.05
#: s between two looks at events of subscriptions
EVENT_PERIOD = 1.0


class CommandTopic:
    """
    Takes what waits on one subscription.

    A message is taken as the bytes that came and read with ``struct``, which costs half of what
    rclpy takes to make an object of it; and bytes that nobody can read are one more refused
    command, not an exception in the thread of the exchange.

    How old a command is, its two time stamps say: what the publisher's clock showed when it was
    published, and this machine's when it arrived. The clocks may differ; so what counts is by how
    much the difference exceeds the smallest that was seen on the topic. A command that waited
    somewhere (a process that stood still, a network that was away) is told from a fresh one by
    that. It moves nothing, but one that equals neutral stops all the same: so a publisher whose
    clock lags can.

    :param use: takes each message (of the types with one number: the number) and ``now``.
    :param old: takes each that is thrown away for its age, for what it may stop.
    :param late: takes by how many s a command that is thrown away came too late.
    :param unreadable: takes why a message cannot be read.
    :param stamp: this machine's time of the day, in ns.
    :param read: makes of the bytes what ``use`` takes; None: the number, or a message of the type.
    """

    def __init__(self, subscription: Subscription, *, use: Callable[[Any, float], None],
                 old: Callable[[Any], None], late: Callable[[float], None],
                 unreadable: Callable[[str], None], stamp: Callable[[], int],
                 read: Callable[[bytes], Any] | None = None) -> None:
        self.subscription = subscription
        self.handle: Any = subscription.handle
        self._type: Any = subscription.msg_type
        # more than can wait came meanwhile: that is for the next time
        quality = subscription.qos_profile
        bounded = quality.history is HistoryPolicy.KEEP_LAST
        self._depth = (quality.depth if bounded else DEPTH_UNBOUNDED) or 1
        self._waiting_max = self._depth if bounded else KEPT_MAX
        self._use, self._old = use, old
        self._stamp = stamp
        self._late = late
        self._unreadable = unreadable
        code = _CODES.get(self._type)
        self._read = read or partial(deserialize_message, message_type=self._type)
        self._structs = [struct.Struct(order + code) for order in '><'] if code else []
        self._quickest = math.inf

    def take(self, now: float) -> None:
        """
        Hand over what waits, oldest first.

        :raises InvalidHandle: the node is being destroyed.
        """
        take = self.handle.take_message
        for _ in range(self._depth):
            taken = take(self._type, True)
            if taken is None:
                return
            data, info = taken
            lateness = self._lateness(info)
            if lateness > LATENESS_MAX:
                self._late(1e-9 * lateness)
                self._take_old(data)
                continue
            try:
                message = self._decode(data)
            except _UNREADABLE as error:
                self._unreadable(str(error) or type(error).__name__)
                continue
            self._use(message, now)

    def discard(self) -> int:
        """Throw away what waits, but for what it may stop; return how many commands that were."""
        for count in range(self._waiting_max):
            taken = self.handle.take_message(self._type, True)
            if taken is None:
                return count
            self._take_old(taken[0])
        return self._waiting_max

    def _take_old(self, data: bytes) -> None:
        with suppress(*_UNREADABLE):
            self._old(self._decode(data))

    def forget(self) -> None:
        """Record that nobody publishes here any more: the next one has a clock of its own."""
        self._quickest = math.inf

    def _lateness(self, info: dict[str, Any]) -> float:
        """Return how much longer than the quickest a message took, in ns."""
        source = info['source_timestamp']
        if not source:  # this middleware does not tell
            return 0.0
        age = (info['received_timestamp'] or self._stamp()) - source
        if age < self._quickest:
            self._quickest = age
        return float(age - self._quickest)

    def _decode(self, data: bytes) -> Any:
        if self._structs and len(data) >= HEADER:
            code = self._structs[data[1] & 1]       # the lowest bit says: low byte first
            if HEADER + code.size <= len(data) < HEADER + code.size + 4:
                return code.unpack_from(data, HEADER)[0]
        if len(data) > LENGTH_MAX:
            raise ValueError(f'{len(data)} bytes, at most {LENGTH_MAX} are looked at')
        message = self._read(data)
        return message.data if self._structs else message


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
