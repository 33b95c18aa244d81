# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What a user writes who knows the name of a service, and calls it.

``stop``, ``read``, ``write``.
"""

import sys

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger

DRIVE = '/drive0'
CALLS = {
    'stop': ('quick_stop', Trigger, Trigger.Request),
    'read': ('get_parameters', GetParameters,
             lambda: GetParameters.Request(names=['ramp_time'])),
    'write': ('set_parameters', SetParameters, lambda: SetParameters.Request(parameters=[
        Parameter(name='ramp_time', value=ParameterValue(
            type=ParameterType.PARAMETER_DOUBLE, double_value=float(sys.argv[2])))])),
}


def main() -> None:
    """Call it."""
    service, kind, request = CALLS[sys.argv[1]]
    rclpy.init()
    node = Node('bare_client')
    client = node.create_client(kind, f'{DRIVE}/{service}')
    client.wait_for_service()
    future = client.call_async(request())
    rclpy.spin_until_future_complete(node, future)
    print(future.result())
    node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
