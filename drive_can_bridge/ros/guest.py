# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A hidden node, with which a command looks at bridges and asks them: it offers nothing itself."""

import os

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from drive_can_bridge.core.errors import DriveCanError


class Guest:
    """
    This process in the ROS graph.

    :param purpose: part of the node's name.
    :raises DriveCanError: ROS does not start.
    """

    def __init__(self, purpose: str) -> None:
        self.context = Context()
        try:
            rclpy.init(args=[], context=self.context,
                       signal_handler_options=SignalHandlerOptions.NO)
            # a leading underscore hides a node from "ros2 node list"
            self.node = Node(f'_drive_can_{purpose}_{os.getpid()}', context=self.context,
                             use_global_arguments=False, enable_rosout=False,
                             start_parameter_services=False)
        except Exception as error:  # rcl fails in several types
            reason = str(error).partition(', at ')[0]
            raise DriveCanError(f'ROS does not start: {reason}') from error

    def leave(self) -> None:
        """Go. Idempotent."""
        if self.context.ok():
            self.node.destroy_node()
            self.context.try_shutdown()
