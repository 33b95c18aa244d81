# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Command subscriptions that are polled by the exchange, except for old commands.

Nor does any thread wait for their events, such as a publisher of other quality: with Fast DDS that
wait ends with every message, which at 3,000 commands/s costs more than everything else. They are
looked at once in a while instead.

Even a look into an empty queue costs 2 µs, with four setpoints a tenth of the whole exchange. So
only topics with a publisher are looked at in each cycle; the publishers are counted every
``COUNT_PERIOD``, and all topics are looked at then. The very first command of a
publisher that was discovered just now may wait for that long.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
import math
import struct
from typing import Any, Protocol

from rclpy.node import Node
from rclpy.qos import HistoryPolicy, qos_policy_name_from_kind
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool, Float64, Int64

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.command_age import Age, ALONE, CommandAges
from drive_can_bridge.core.text import printable
from drive_can_bridge.ros.middleware import command_quality, overriding
from drive_can_bridge.ros.rcl.extension import GONE
from drive_can_bridge.ros.rcl.incoming import Incoming, subscribe

#: messages that are taken at once where everything is kept, and that are discarded at once: more
#: than any middleware keeps (Fast DDS: 5000), since what is left would pass for fresh
DEPTH_UNBOUNDED, WAITING_MAX = 1000, 100_000
#: bytes of a message that are looked at: a JointState of a thousand joints with long names
LENGTH_MAX = 1 << 20
#: bytes in front of every message: how the rest is encoded
HEADER = 4
#: struct code of the one number of these messages
_CODES = {Float64: 'd', Int64: 'q', Bool: '?'}
#: what is thrown away
_TOO_OLD = Age.LATE, Age.CLOCKS_DIFFER
#: what malformed bytes raise
_UNREADABLE = RuntimeError, ValueError, struct.error
#: s between two counts of publishers
COUNT_PERIOD = 0.05
#: s between two looks at events of subscriptions
EVENT_PERIOD = 1.0
#: ns by which two clocks that are read one after the other may differ, and none was set
JITTER = 1_000_000

#: the steady time, and by how much the time of the day is ahead of it, in ns
Look = tuple[int, int]


class CommandTopic:
    """
    Takes the waiting messages of one subscription.

    A message is taken as the bytes that came and read with ``struct``, which costs half of what
    rclpy takes to make an object of it; and malformed bytes are one more refused
    command, not an exception in the thread of the exchange.

    A command that is too old (:mod:`drive_can_bridge.core.command_age`) moves nothing, but one
    that equals neutral stops all the same: so a publisher whose clock is behind can.

    :param use: called with each message (of the types with one number: the number) and ``now``.
    :param old: called with each that is discarded for its age, because it may stop.
    :param aged: called with the judged age of each that is not simply fresh, and the figure in s.
    :param unreadable: called with why a message cannot be read.
    :param read: makes of the bytes what ``use`` takes; None: the number, or a message of the type.
    """

    def __init__(self, incoming: Incoming, *, use: Callable[[Any, float], None],
                 old: Callable[[Any], None], aged: Callable[[Age, float], None],
                 unreadable: Callable[[str], None],
                 read: Callable[[bytes], Any] | None = None) -> None:
        self.incoming = incoming
        self.subscription = subscription = incoming.subscription
        self._type: Any = subscription.msg_type
        # more than can wait came meanwhile: that is for the next time
        quality = subscription.qos_profile
        bounded = quality.history is HistoryPolicy.KEEP_LAST
        self._depth = (quality.depth if bounded else DEPTH_UNBOUNDED) or 1
        self._waiting_max = self._depth if bounded else WAITING_MAX
        self._use, self._old = use, old
        self._aged = aged
        self._unreadable = unreadable
        code = _CODES.get(self._type)
        self._read = read or partial(deserialize_message, message_type=self._type)
        self._structs = [struct.Struct(order + code) for order in '><'] if code else []
        self._shortest = HEADER + (self._structs[0].size if self._structs else 0)
        self._ages = CommandAges()
        self.forget = self._ages.forget

    def take(self, now: float, look: Look) -> None:
        """
        Deliver the waiting messages, oldest first.

        :param look: the times of the clocks.
        :raises InvalidHandle: the node is being destroyed.
        """
        take, alone = self.incoming.take, None
        self._ages.look(*look)
        for count in range(self._depth):
            taken = take()
            if taken is None:
                return
            data, info = taken
            publisher = _gid(info)
            if publisher is None:
                if count == 0 and self.incoming.publishers() == 1:
                    alone = ALONE
                publisher = alone
            age, seconds = self._ages.judge(
                info['source_timestamp'], info['received_timestamp'], publisher)
            if age is not Age.FRESH:
                self._aged(age, seconds)
                if age in _TOO_OLD:
                    self._take_old(data)
                    continue
            try:
                message = self._decode(data)
            except _UNREADABLE as error:
                self._unreadable(str(error) or type(error).__name__)
                continue
            self._use(message, now)

    def discard(self, look: Look) -> int:
        """Discard what waits, except for what it may stop; return how many commands that were."""
        self._ages.look(*look)
        for count in range(self._waiting_max):
            taken = self.incoming.take()
            if taken is None:
                return count
            self._take_old(taken[0])
        return self._waiting_max

    def _take_old(self, data: bytes) -> None:
        with suppress(*_UNREADABLE):
            self._old(self._decode(data))

    def _decode(self, data: bytes) -> Any:
        if self._structs and len(data) >= HEADER:
            code = self._structs[data[1] & 1]       # the lowest bit means: low byte first
            if HEADER + code.size <= len(data) < HEADER + code.size + 4:
                return code.unpack_from(data, HEADER)[0]
        if len(data) < self._shortest:  # no middleware need have words for that
            raise ValueError(sentences.ends_too_soon(whole=len(data)))
        if len(data) > LENGTH_MAX:
            raise ValueError(sentences.too_many_bytes(whole=len(data), most=LENGTH_MAX))
        message = self._read(data)
        return message.data if self._structs else message


def _gid(info: dict[str, Any]) -> bytes | None:
    """Return the publisher of a message; None: this rclpy or middleware does not name it."""
    gid = info.get('publisher_gid')
    if gid is None:
        return None
    data = bytes(gid['data'] if isinstance(gid, dict) else gid)
    return data if any(data) else None


class Warn(Protocol):
    """Logs a warning by topic and text; ``once``: no need to repeat it."""

    def __call__(self, topic: str, text: str, *, once: bool = False) -> None:
        """Log it, or not."""


class PolledTopics:
    """
    The command subscriptions that one thread polls.

    :param warn: logs (topic of the warning, text); limits repetitions itself.
    :param refuse: the same for a command that is refused.
    :param shift: s, less than ``COUNT_PERIOD``, by which its counts come later than others': of
        drives that are served together the last would have to wait for them all.
    """

    def __init__(self, node: Node, clock: Clock, warn: Warn,
                 refuse: Callable[[str, str], None], shift: float = 0.0) -> None:
        self._clock = clock
        self._shift = shift
        self._node = node
        self._warn = warn
        self._refuse = refuse
        self._topics: list[CommandTopic] = []
        self._published: list[CommandTopic] = []  # those with a publisher, as far as known
        self._count_at = -math.inf
        self._look_at = -math.inf
        self._ahead = self._compare_clocks()[1]

    def subscribe(self, message_type: type, topic: str,
                  take: Callable[[Any, float], None], old: Callable[[Any], None],
                  disarm: Callable[[], None],
                  read: Callable[[bytes], Any] | None = None) -> None:
        """
        Add a topic.

        :param take: gets each message (or its number) and ``now``.
        :param old: gets each that is discarded for its age, because it may stop.
        :param disarm: disarms what the topic commands.
        :param read: makes of the bytes what ``take`` gets; None: the message.
        """
        node = self._node
        name = node.resolve_topic_name(topic)

        def incompatible(status: Any) -> None:
            self._warn(f'quality {name}', sentences.publisher_incompatible(
                name, qos_policy_name_from_kind(status.last_policy_kind)))
        incoming = subscribe(node, message_type, topic, command_quality(),
                             overriding(node, topic), incompatible, self._clock.stamp)

        def aged(age: Age, seconds: float) -> None:
            if age is Age.LATE:
                self._refuse(f'late {name}', sentences.command_late(name, seconds))
            elif age is Age.CLOCKS_DIFFER:
                self._refuse(f'clocks {name}', sentences.clocks_differ(name, seconds))
            else:
                disarm()
                said = (sentences.clock_of_publisher_set if age is Age.CLOCK_SET else
                        sentences.steadily_late)
                self._warn(f'begins again {name}', said(name, seconds))

        def unreadable(reason: str) -> None:
            self._refuse(f'unreadable {name}',
                         sentences.command_unreadable(topic=name, reason=printable(reason)))
        self._topics.append(CommandTopic(incoming, use=take, old=old, aged=aged,
                                         unreadable=unreadable, read=read))

    @property
    def names(self) -> list[str]:
        """The full names of the topics."""
        return [topic.subscription.topic_name for topic in self._topics]

    def take(self, now: float) -> None:
        """Deliver all waiting messages, oldest first."""
        counting = now >= self._count_at
        if not counting and not self._published:
            return
        look = self._look()
        try:
            if not counting:
                for topic in self._published:
                    topic.take(now, look)
                return
            self._count_at = max(self._count_at + COUNT_PERIOD, now + self._shift)
            for topic in self._topics:  # some may have come from a publisher that has left by now
                topic.take(now, look)
            self._published = [topic for topic in self._topics
                               if topic.incoming.publishers()]
            for topic in self._topics:
                if topic not in self._published:
                    topic.forget()
            if now >= self._look_at:
                self._look_at = now + EVENT_PERIOD
                for topic in self._topics:
                    topic.incoming.look()
        except GONE:  # the node is being destroyed
            pass

    def discard(self) -> int:
        """Discard what is waiting; return how many commands that were."""
        look = self._look()
        try:
            return sum(topic.discard(look) for topic in self._topics)
        except GONE:  # the node is being destroyed
            return 0

    def _look(self) -> Look:
        """Return the times of the clocks; their difference is as before, unless one was set."""
        look = self._compare_clocks()
        if abs(look[1] - self._ahead) > JITTER:
            look = self._compare_clocks()   # this thread may only have had to wait in between
            if abs(look[1] - self._ahead) > JITTER:
                self._ahead = look[1]
        return look[0], self._ahead

    def _compare_clocks(self) -> Look:
        now = round(1e9 * self._clock.now())
        return now, self._clock.stamp() - now

    def destroy(self) -> None:
        """Destroy the subscriptions. Before the node is destroyed, which has them otherwise."""
        for topic in self._topics:
            topic.incoming.let_go()

    def unsubscribe(self) -> None:
        """Destroy the subscriptions of a node that stays."""
        self.destroy()
        self._published.clear()
        while self._topics:
            self._node.destroy_subscription(self._topics.pop().subscription)
