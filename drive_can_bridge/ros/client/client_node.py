# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A hidden node, with which a command looks at bridges and asks them: it offers nothing itself.

It is no :class:`rclpy.node.Node`: that one has topics and services of its own, and what they need
takes longer to be imported (0.25 s) than all that a command wants to know takes to be asked.
"""

from collections.abc import Sequence
import os
import sys
from typing import Any

from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation

from drive_can_bridge.core.errors import DriveCanError

# What makes messages from their definitions comes with every type support, is used by none, and
# takes 0.15 s to be imported; its package goes without where it cannot be.
sys.modules.setdefault('rosidl_generator_py.generate_py_impl', None)    # type: ignore[arg-type]


class ClientNode:
    """
    This process in the ROS graph.

    :param purpose: part of the node's name.
    :ivar handle: of the node, as rclpy has it.
    :raises DriveCanError: ROS does not start.
    """

    def __init__(self, purpose: str) -> None:
        self.context = Context()
        try:
            self.context.init([])   # takes no signals
            context: Any = self.context.handle
            with context:
                # a leading underscore hides a node from "ros2 node list"; no arguments of the
                # process, no /rosout
                self.handle: Any = rclpy_implementation.Node(
                    f'_drive_can_{purpose}_{os.getpid()}', '', context, None, False, False)
        except Exception as error:  # rcl fails in several types
            reason = str(error).partition(', at ')[0]
            raise DriveCanError(f'ROS does not start: {reason}') from error

    @property
    def open(self) -> bool:
        """It has not gone."""
        return bool(self.context.ok())

    def services(self) -> Sequence[tuple[str, list[str]]]:
        """Return all services that have been discovered, with their types."""
        with self.handle:
            found: Sequence[tuple[str, list[str]]] = (
                rclpy_implementation.rclpy_get_service_names_and_types(self.handle))
        return found

    def topics(self) -> Sequence[tuple[str, list[str]]]:
        """Return all topics that have been discovered, with their types."""
        with self.handle:
            found: Sequence[tuple[str, list[str]]] = (
                rclpy_implementation.rclpy_get_topic_names_and_types(self.handle, False))
        return found

    def servers(self, service: str) -> int:
        """Return how many offer a service of this name."""
        with self.handle:
            return int(self.handle.get_count_services(service))

    def leave(self) -> None:
        """Go. Idempotent."""
        if self.context.ok():
            self.handle.destroy_when_not_in_use()
            self.context.try_shutdown()
