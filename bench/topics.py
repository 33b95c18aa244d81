# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The topics of a drive of the benches, as the bridge has them."""

from typing import Any

import child  # noqa: F401  sets the environment of rclpy
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterValue
from rclpy.node import Node
from std_msgs.msg import Float64, Int64

DOUBLES = ('actual_speed', 'motor_current', 'actual_position')
INTEGERS = ('digital_inputs',)
REQUESTS = ('speed_setpoint', 'torque_limit', 'position_setpoint', 'digital_outputs')
TYPES: dict[str, Any] = {**dict.fromkeys(DOUBLES, Float64), **dict.fromkeys(INTEGERS, Int64),
                         'response': ParameterEvent}


class DriveTopics:
    """
    Publishes what the bridge publishes, as one does who knows rclpy: with messages made once.

    :param names: of the topics; all of them by default.
    """

    def __init__(self, node: Node, drive: str, depth: int = 10) -> None:
        self._plain = [(node.create_publisher(TYPES[topic], f'/{drive}/{topic}', depth),
                        TYPES[topic]()) for topic in (*DOUBLES, *INTEGERS)]
        self._response = node.create_publisher(ParameterEvent, f'/{drive}/response', depth)
        self._values = [ParameterValue(type=3) for _ in DOUBLES] + [
            ParameterValue(type=2) for _ in INTEGERS]
        self._message = ParameterEvent(node=f'/{drive}', changed_parameters=[
            Parameter(name=topic, value=value)
            for topic, value in zip((*DOUBLES, *INTEGERS), self._values)])

    def publish(self, now_ns: int, *values: Any) -> None:
        """Publish a sample."""
        self.publish_response(now_ns, *values)
        for (publisher, message), value in zip(self._plain, values):
            message.data = value
            publisher.publish(message)

    def publish_response(self, now_ns: int, *values: Any) -> None:
        """Publish the stamped message of a sample."""
        for entry, value in zip(self._values[:3], values):
            entry.double_value = value
        self._values[3].integer_value = values[3]
        message = self._message
        message.stamp.sec, message.stamp.nanosec = divmod(now_ns, 1_000_000_000)
        self._response.publish(message)
