# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The floors: what the same work costs with nothing around it.

``CanFloor`` is one loop: sleep to the next cycle, python-can send for every drive, python-can
receive, ``struct``, the same publishes. ``sleeping_thread`` is a thread that only sleeps to
absolute deadlines. ``RosFloor`` is a publisher of a stamped message and nothing else.
"""

from dataclasses import dataclass, field
import struct
import threading
import time
from typing import Any

import can
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterValue
from rclpy.node import Node
from std_msgs.msg import Float64, Int64

CYCLIC = 0x001FFFF0
DIR = 0x10000000


@dataclass
class Measured:
    """CPU time of the loop's thread in s, exchanges done, errors of the period in s."""

    cpu: float = 0.0
    exchanges: int = 0
    period_errors: list[float] = field(default_factory=list)


def run_can_floor(node: Node, prefix: str, channel: str, interface: str, drives: int,
                  period: float, duration: float, *, publish: bool) -> Measured:
    """Exchange with ``drives`` drives in one bare loop; return what it cost."""
    bus = can.Bus(interface=interface, channel=channel, ignore_config=True)
    topics = [_Topics(node, f'/{prefix}{number}') for number in range(drives)]
    measured = Measured()

    def loop() -> None:
        request, response = struct.Struct('>hHhH').pack, struct.Struct('>hhhH').unpack
        first = time.monotonic()
        deadline, last = first, 0.0
        started = time.thread_time()
        while deadline < first + duration:
            time.sleep(max(0.0, deadline - time.monotonic()))
            now = time.monotonic()
            if last:
                measured.period_errors.append(abs(now - last - period))
            last = now
            for number in range(drives):
                bus.send(can.Message(arbitration_id=(number + 1) << 21 | CYCLIC,
                                     is_extended_id=True, data=request(0, 0, 0, 0)))
            for _ in range(drives):
                message = bus.recv(1.0)
                if message is None:
                    raise RuntimeError('a drive did not answer')
                speed, current, position, inputs = response(message.data)
                measured.exchanges += 1
                if publish:
                    topics[((message.arbitration_id & ~DIR) >> 21) - 1].publish(
                        speed * 0.1, current * 0.01, position * 0.1, inputs)
            deadline += period
        measured.cpu = time.thread_time() - started

    thread = threading.Thread(target=loop)
    thread.start()
    thread.join()
    bus.shutdown()
    return measured


def sleeping_thread(period: float, duration: float) -> list[float]:
    """Return the period errors of a thread that only sleeps, in s."""
    errors: list[float] = []
    first = time.monotonic()
    deadline, last = first, 0.0
    while deadline < first + duration:
        time.sleep(max(0.0, deadline - time.monotonic()))
        now = time.monotonic()
        if last:
            errors.append(abs(now - last - period))
        last = now
        deadline += period
    return errors


def run_ros_floor(node: Node, prefix: str, period: float, duration: float) -> None:
    """Publish a bare stamped message each period: the subscriber measures the latency."""
    topics = _Topics(node, f'/{prefix}0')
    end = time.monotonic() + duration
    while time.monotonic() < end:
        topics.publish_event(0.1, 0.2, 0.3, 4)
        time.sleep(period)


class _Topics:
    """The same topics as the bridge publishes for a drive, prebuilt messages included."""

    def __init__(self, node: Node, name: str) -> None:
        self._double = [(node.create_publisher(Float64, f'{name}/{topic}', 10), Float64())
                        for topic in ('actual_speed', 'motor_current', 'actual_position')]
        self._integer = (node.create_publisher(Int64, f'{name}/digital_inputs', 10), Int64())
        self._event = node.create_publisher(ParameterEvent, f'{name}/response', 10)
        self._values = [ParameterValue(type=3) for _ in range(3)] + [ParameterValue(type=2)]
        self._message = ParameterEvent(node=name, changed_parameters=[
            Parameter(name=topic, value=value) for topic, value in zip(
                ('actual_speed', 'motor_current', 'actual_position', 'digital_inputs'),
                self._values)])

    def publish(self, speed: float, current: float, position: float, inputs: int) -> None:
        for (publisher, message), value in zip(self._double, (speed, current, position)):
            message.data = value
            publisher.publish(message)
        publisher, message = self._integer
        message.data = inputs
        publisher.publish(message)
        self.publish_event(speed, current, position, inputs)

    def publish_event(self, *values: Any) -> None:
        for entry, value in zip(self._values[:3], values):
            entry.double_value = value
        self._values[3].integer_value = values[3]
        message = self._message
        message.stamp.sec, message.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
        self._event.publish(message)
