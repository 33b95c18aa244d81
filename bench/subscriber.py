# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Other processes that subscribe.

``subscriber.py all PREFIX,… COUNT`` is matched with every topic of all drives and takes nothing:
its middleware receives and acknowledges everything, as any subscriber's does, but no Python runs,
which would not keep up with 15,000 messages a second and starve the bench on a small machine.

``subscriber.py joints`` counts messages with all joints.

``subscriber.py diagnostics`` adds up what the drives of all bridges say about their exchanges.

``subscriber.py listen NAME …`` measures from the stamp of ``/NAME/response`` to the callback.
"""

import sys
import threading
import time

from child import PATIENCE, serve
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
import rclpy  # isort: skip
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from topics import TYPES


class Listener:
    """Latencies by name, in s."""

    def __init__(self, node: Node, names: list[str]) -> None:
        self._latencies: dict[str, list[float]] = {name: [] for name in names}
        for name in names:
            node.create_subscription(
                ParameterEvent, f'/{name}/response',
                lambda message, name=name: self._received(name, message), 10)

    def _received(self, name: str, message: ParameterEvent) -> None:
        sent = message.stamp.sec * 1_000_000_000 + message.stamp.nanosec
        self._latencies[name].append((time.time_ns() - sent) * 1e-9)

    def clear(self) -> bool:
        """Begin anew."""
        for latencies in self._latencies.values():
            latencies.clear()
        return True

    def latencies(self) -> dict[str, list[float]]:
        """Return what was found."""
        return {name: list(found) for name, found in self._latencies.items()}


class Counter:
    """Counts messages with all joints."""

    def __init__(self, node: Node) -> None:
        self.number = 0
        # as the hardware interface of ros2_control and robot_state_publisher subscribe to it
        node.create_subscription(JointState, '/drive_can_bridge/joint_states', self._received,
                                 qos_profile_sensor_data)

    def _received(self, _: JointState) -> None:
        self.number += 1

    def clear(self) -> bool:
        """Begin anew."""
        self.number = 0
        return True


class Diagnostics:
    """What all drives said last."""

    def __init__(self, node: Node) -> None:
        self._said: dict[str, dict[str, str]] = {}
        self._fresh = threading.Condition()
        node.create_subscription(DiagnosticArray, '/diagnostics', self._received, 10)

    def _received(self, message: DiagnosticArray) -> None:
        with self._fresh:
            for status in message.status:
                values = {each.key: each.value for each in status.values}
                if 'missed_exchanges' in values:
                    self._said[status.name] = values
            self._fresh.notify_all()

    def totals(self, drives: float) -> dict[str, float]:
        """Wait until so many drives have said something new; return missed, and latency in s."""
        with self._fresh:
            self._said.clear()
            if not self._fresh.wait_for(lambda: len(self._said) >= drives, PATIENCE):
                raise SystemExit(f'{len(self._said)} of {drives:.0f} drives in /diagnostics')
            said = list(self._said.values())
        return {'missed': sum(int(each['missed_exchanges']) for each in said),
                'latency': sum(1e-3 * float(each['latency_mean_ms']) for each in said) / len(said)}


def spun(node: Node) -> None:
    """Have somebody take what arrives."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()


def main() -> None:
    """Subscribe."""
    rclpy.init(args=[])
    node = Node(f'bench_subscriber_{sys.argv[1]}', enable_rosout=False,
                start_parameter_services=False)
    if sys.argv[1] == 'all':
        for prefix in sys.argv[2].split(','):
            for number in range(int(sys.argv[3])):
                for topic, message_type in TYPES.items():
                    node.create_subscription(message_type, f'/{prefix}{number}/{topic}',
                                             lambda _: None, 10)
        serve({})
    elif sys.argv[1] == 'joints':
        counter = Counter(node)
        spun(node)
        serve({'clear': counter.clear, 'count': lambda: counter.number})
    elif sys.argv[1] == 'diagnostics':
        diagnostics = Diagnostics(node)
        spun(node)
        serve({'totals': diagnostics.totals})
    listener = Listener(node, sys.argv[2:])
    spun(node)
    serve({'clear': listener.clear, 'latencies': listener.latencies})


if __name__ == '__main__':
    main()
