# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
As many bare nodes as there are drives, with the same publishers, subscriptions and services.

Prints how long it took to make them after rclpy.init; answers ``get_parameters`` of the first at
once, with nothing behind it.
"""

import sys
import threading
import time

from child import serve
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParameters,
    SetParametersAtomically,
)
import rclpy  # isort: skip
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Bool, Float64
from topics import DriveTopics, REQUESTS

SERVICES = {'get_parameters': GetParameters, 'set_parameters': SetParameters,
            'set_parameters_atomically': SetParametersAtomically,
            'list_parameters': ListParameters, 'describe_parameters': DescribeParameters,
            'get_parameter_types': GetParameterTypes}


def answer(_: GetParameters.Request,
           response: GetParameters.Response) -> GetParameters.Response:
    """Answer at once."""
    response.values = [ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=1.0)]
    return response


def make(number: int) -> Node:
    """Make a node that looks like a drive."""
    name = f'bare_drive{number}'
    node = Node(name, start_parameter_services=False, enable_rosout=False, parameter_overrides=[
        Parameter('start_type_description_service', value=False)])
    DriveTopics(node, name)
    node.create_publisher(Bool, '~/online', 1)
    for request in REQUESTS:
        node.create_subscription(Float64, f'~/command/{request}', lambda _: None, 8)
    for service, service_type in SERVICES.items():
        node.create_service(service_type, f'~/{service}', answer)
    return node


def main() -> None:
    """Make them, and spin."""
    rclpy.init(args=[])
    begun = time.monotonic()
    nodes = [make(number) for number in range(int(sys.argv[1]))]
    took = time.monotonic() - begun
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    serve({}, ready=took)


if __name__ == '__main__':
    main()
