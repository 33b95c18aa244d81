# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a message with commands for all joints costs who takes it, as a real publisher sends them.

``joint_take.py JOINTS`` prints µs of this thread for each: taken by rclpy as bytes (floor), and
taken and read as the bridge does it.
"""

from statistics import median
import sys
import time
from typing import Any

from child import child
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from drive_can_bridge.clock import SteadyClock
from drive_can_bridge.ros.joint_reader import JointReader
from drive_can_bridge.ros.polled_topics import CommandTopic
from drive_can_bridge.ros.rcl.incoming import subscribe

#: rounds, s between two, and messages that a round has at least
ROUNDS, PAUSE, ENOUGH = 60, 0.1, 5
#: s until the publisher is there, and the reader knows its messages
PATIENCE, KNOWN = 60.0, 50


def main() -> None:
    """Measure."""
    joints = int(sys.argv[1])
    rclpy.init(args=[])
    node = Node('bench_joint_take', enable_rosout=False, start_parameter_services=False)
    incoming = subscribe(node, JointState, '/drive_can_bridge/joint_commands',
                         QoSProfile(depth=1000), None, print)
    clock, got = SteadyClock(), list[Any]()
    topic = CommandTopic(incoming, use=lambda message, _: got.append(message),
                         old=got.append, aged=lambda *_: None, unreadable=print,
                         read=JointReader())

    def take() -> int:
        got.clear()
        now = round(1e9 * clock.now())
        topic.take(clock.now(), (now, clock.stamp() - now))
        return len(got)

    def bare() -> int:
        count = 0
        while incoming.take() is not None:
            count += 1
        return count
    with child('publisher.py', 'joints', joints) as publisher:
        publisher.ask('rate 1000')
        known, deadline = 0, time.monotonic() + PATIENCE
        while known < KNOWN and time.monotonic() < deadline:
            time.sleep(PAUSE)
            known += take()
        for name, action in (('taken by rclpy', bare), ('taken and read', take)):
            found = []
            for _ in range(ROUNDS):
                time.sleep(PAUSE)
                begun = time.thread_time()
                count = action()
                if count >= ENOUGH:
                    found.append(1e6 * (time.thread_time() - begun) / count)
            print(f'{name}: {median(found):.1f} µs')


if __name__ == '__main__':
    main()
