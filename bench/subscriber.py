# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The other process: subscribes to every topic and measures from stamp to callback.

Prints one JSON line with the latencies of the stamped topics in s when told to by a line on
standard input, and ends with the standard input.
"""

import json
import sys
import threading
import time

from rcl_interfaces.msg import ParameterEvent
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64, Int64

SAMPLES_MAX = 20000


def main() -> None:
    """Subscribe to ``prefix`` + number + topics for all prefixes given."""
    prefixes, count = sys.argv[1].split(','), int(sys.argv[2])
    topics = {topic: {'double': Float64, 'integer': Int64}[kind]
              for topic, kind in (entry.split(':') for entry in sys.argv[3].split(','))}
    rclpy.init()
    node = Node('bench_subscriber')
    latencies: dict[str, list[float]] = {prefix: [] for prefix in prefixes}
    received: dict[str, int] = dict.fromkeys(prefixes, 0)

    def stamped(prefix: str, message: ParameterEvent) -> None:
        now = time.time_ns()
        received[prefix] += 1
        if len(latencies[prefix]) < SAMPLES_MAX:
            sent = message.stamp.sec * 1_000_000_000 + message.stamp.nanosec
            latencies[prefix].append((now - sent) * 1e-9)

    def plain(prefix: str) -> None:
        received[prefix] += 1

    for prefix in prefixes:
        for number in range(count):
            name = f'/{prefix}{number}'
            node.create_subscription(ParameterEvent, f'{name}/response',
                                     lambda message, prefix=prefix: stamped(prefix, message), 10)
            for topic, message_type in topics.items():
                node.create_subscription(message_type, f'{name}/{topic}',
                                         lambda _, prefix=prefix: plain(prefix), 10)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    print('ready', flush=True)
    for line in sys.stdin:
        if line.strip() == 'clear':
            for prefix in prefixes:
                latencies[prefix].clear()
                received[prefix] = 0
            continue
        print(json.dumps({'latencies': latencies, 'received': received}), flush=True)


if __name__ == '__main__':
    main()
