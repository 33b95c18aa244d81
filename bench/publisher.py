# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Other processes that publish.

``publisher.py bare PERIOD`` publishes ``/bare/response`` and nothing else: the bare pair's half.
``publisher.py commands DRIVES RATE`` publishes setpoints for each of so many drives at a rate.
"""

import sys
import threading
import time

from child import serve, sleep_until
import rclpy  # isort: skip
from rclpy.node import Node
from rclpy.serialization import serialize_message
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


def publish_commands(node: Node, drives: int, rate: float) -> None:
    """Publish setpoints for ever, serialised beforehand: this process is only the load."""
    publishers = [node.create_publisher(Float64, f'/drive{number}/command/speed_setpoint', 10)
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


def main() -> None:
    """Publish in a thread until the standard input ends."""
    rclpy.init(args=[])
    node = Node(f'bench_publisher_{sys.argv[1]}', enable_rosout=False,
                start_parameter_services=False)
    if sys.argv[1] == 'bare':
        target, arguments = publish_bare, (node, float(sys.argv[2]))
    else:
        target, arguments = publish_commands, (node, int(sys.argv[2]), float(sys.argv[3]))
    threading.Thread(target=target, args=arguments, daemon=True).start()
    serve({})


if __name__ == '__main__':
    main()
