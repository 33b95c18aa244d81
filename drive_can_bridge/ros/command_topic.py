# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
One subscription for commands: taken by hand, by its bytes, and never older than it looks.

A message is taken as the bytes that came and read with ``struct``, which costs half of what rclpy
takes to make an object of it; and bytes that nobody can read are one more refused command, not an
exception in the thread of the exchange.

How old a command is, its two time stamps say: what the publisher's clock showed when it was
published, and this machine's when it arrived. The clocks may differ; so what counts is by how much
the difference exceeds the smallest that was seen on the topic. A command that waited somewhere (a
process that stood still, a network that was away) is told from a fresh one by that. It moves
nothing, but one that equals neutral stops all the same: so a publisher whose clock lags can.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
import math
import struct
from typing import Any

from rclpy.qos import HistoryPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from std_msgs.msg import Bool, Float64, Int64

#: ns by which a command may take longer than the quickest of its topic
LATENESS_MAX = 250_000_000
#: messages that are taken at once where everything is kept
DEPTH_UNBOUNDED = 1000
#: bytes of a message that are looked at: a JointState of some hundred joints
LENGTH_MAX = 65536
#: bytes in front of every message: how the rest is encoded
HEADER = 4
#: struct code of the one number of these messages
_CODES = {Float64: 'd', Int64: 'q', Bool: '?'}
#: what bytes that nobody can read raise
_UNREADABLE = RuntimeError, ValueError, struct.error


class CommandTopic:
    """
    Takes what waits on one subscription.

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
        self._depth = (quality.depth if quality.history is HistoryPolicy.KEEP_LAST
                       else DEPTH_UNBOUNDED) or 1
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
        for count in range(self._depth):
            taken = self.handle.take_message(self._type, True)
            if taken is None:
                return count
            self._take_old(taken[0])
        return self._depth

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
