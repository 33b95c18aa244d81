# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Other processes that publish.

``publisher.py bare PERIOD`` publishes ``/bare/response`` and nothing else: the bare pair's half.
``publisher.py commands DRIVES RATE [PREFIX]`` publishes setpoints for each of so many drives at a
rate.
``publisher.py joints DRIVES`` publishes commands for all joints, at the rate that it is told.
"""

from collections.abc import Callable
import sys
import threading
import time
from typing import Any

from child import serve, sleep_until
import rclpy  # isort: skip
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from topics import DriveTopics


def publish_bare(node: Node, period: float) -> None:
    """Publish stamped messages for ever."""
    topics = DriveTopics(node, 'bare')
    deadline = time.monotonic()
    while True:
        deadline += period
        sleep_until(deadline)
        topics.publish_response(time.time_ns(), 0.1, 0.2, 0.3, 4)


def publish_commands(node: Node, drives: int, rate: float, prefix: str = 'drive') -> None:
    """Publish setpoints for ever, serialised beforehand: this process is only the load."""
    publishers = [node.create_publisher(Float64, f'/{prefix}{number}/command/speed_setpoint', 10)
                  for number in range(drives)]
    values = [serialize_message(Float64(data=value)) for value in (0.0, 0.1)]
    period = max(1.0 / rate, 0.002)
    burst = max(1, round(rate * period))
    deadline, count = time.monotonic(), 0
    while True:
        deadline += period
        sleep_until(deadline)
        for publisher in publishers:
            for _ in range(burst):
                count += 1
                publisher.publish(values[count % 2])
        deadline = max(deadline, time.monotonic() - period)


class JointCommands:
    """Commands for all joints, as ros2_control sends them."""

    def __init__(self, node: Node, drives: int) -> None:
        names = [f'joint{number}' for number in range(drives)]
        self._publisher = node.create_publisher(
            JointState, '/drive_can_bridge/joint_commands', 1)
        # as messages: a publisher makes other bytes than a serialisation
        self._messages = [JointState(name=names, position=[0.0] * drives,
                                     velocity=[speed] * drives) for speed in (0.0, 0.1)]
        self._rate = 0.0

    def set_rate(self, rate: float) -> bool:
        """Publish so often from now on; 0: not at all."""
        self._rate = rate
        return True

    def run(self) -> None:
        """Publish for ever."""
        deadline, count = time.monotonic(), 0
        while True:
            deadline = max(deadline + 1.0 / (self._rate or 100.0), time.monotonic() - 0.1)
            sleep_until(deadline)
            if self._rate:
                count += 1
                self._publisher.publish(self._messages[count % 2])


def main() -> None:
    """Publish in a thread until the standard input ends."""
    rclpy.init(args=[])
    node = Node(f'bench_publisher_{sys.argv[1]}', enable_rosout=False,
                start_parameter_services=False)
    commands: dict[str, Any] = {}
    arguments: tuple[Any, ...] = ()
    target: Callable[..., object]
    if sys.argv[1] == 'joints':
        joints = JointCommands(node, int(sys.argv[2]))
        target, commands = joints.run, {'rate': joints.set_rate}
    elif sys.argv[1] == 'bare':
        target, arguments = publish_bare, (node, float(sys.argv[2]))
    else:
        target = publish_commands
        arguments = (node, int(sys.argv[2]), float(sys.argv[3]), *sys.argv[4:])
    threading.Thread(target=target, args=arguments, daemon=True).start()
    serve(commands)


if __name__ == '__main__':
    main()
