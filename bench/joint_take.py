# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What takes commands for all joints out of a topic, as a bridge does it every 5 ms.

``joint_take.py`` is told ``take SECONDS``: by the bridge's own code, as nothing but bytes by
rclpy, and these bytes are read. It answers what each of them took of the processor, and of how
many messages. It runs in an older build, too, which is compared with this one
(``run.py --beside``).
"""

import inspect
import time
from typing import Any

from child import serve
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from drive_can_bridge.clock import SteadyClock
from drive_can_bridge.ros.joint_reader import JointReader
from drive_can_bridge.ros.polled_topics import PolledTopics

TOPIC = '/drive_can_bridge/joint_commands'
#: s between two looks
PERIOD = 0.005


def nothing(*_: object, **__: object) -> None:
    """Do nothing with it."""


class Taker:
    """The bridge's own code, from the middleware to what joints are told."""

    def __init__(self, node: Node) -> None:
        self._clock = SteadyClock()
        self._topics = PolledTopics(node, self._clock, nothing, nothing)
        self._count = 0
        wanted = {'take': self._take, 'old': self._take, 'read': JointReader()}
        if 'disarm' in inspect.signature(self._topics.subscribe).parameters:
            wanted['disarm'] = nothing
        subscribe: Any = self._topics.subscribe
        subscribe(JointState, TOPIC, **wanted)

    def _take(self, *_: object) -> None:
        self._count += 1

    def __call__(self) -> int:
        self._count = 0
        self._topics.take(self._clock.now())
        return self._count


class Floor:
    """What rclpy takes to hand over the bytes of messages, and to say that there are no more."""

    def __init__(self, node: Node) -> None:
        subscription = node.create_subscription(
            JointState, TOPIC, nothing,
            QoSProfile(depth=8, reliability=ReliabilityPolicy.BEST_EFFORT))
        self._handle: Any = subscription.handle
        #: what it has handed over
        self.taken: list[bytes] = []

    def __call__(self) -> int:
        self.taken.clear()
        while (found := self._handle.take_message(JointState, True)) is not None:
            self.taken.append(found[0])
        return len(self.taken)


class Reading:
    """What the bridge makes of those bytes."""

    def __init__(self, floor: Floor) -> None:
        self._floor = floor
        self._read = JointReader()

    def __call__(self) -> int:
        for data in self._floor.taken:
            self._read(data)
        return len(self._floor.taken)


def main() -> None:
    """Take when asked."""
    rclpy.init(args=[])
    node = Node(f'bench_joint_take_{time.monotonic_ns()}', enable_rosout=False,
                start_parameter_services=False)
    floor = Floor(node)
    actions = {'bridge': Taker(node), 'rclpy': floor, 'read': Reading(floor)}
    orders = [('bridge', 'rclpy', 'read'), ('rclpy', 'read', 'bridge')]

    def take(seconds: float) -> dict[str, tuple[float, int]]:
        spent, count = dict.fromkeys(actions, 0.0), dict.fromkeys(actions, 0)
        for each in actions.values():   # what waits from before
            each()
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            time.sleep(PERIOD)
            orders.reverse()    # who comes second finds the caches warm
            for name in orders[0]:
                begun = time.thread_time()
                count[name] += actions[name]()
                spent[name] += time.thread_time() - begun
        return {name: (spent[name], count[name]) for name in actions}
    serve({'take': take})


if __name__ == '__main__':
    main()
