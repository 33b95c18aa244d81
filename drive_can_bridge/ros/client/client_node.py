# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""This process as a node of the ROS graph, without an executor."""

import os
import sys
from typing import Protocol

from rclpy.context import Context

from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.text import printable
from drive_can_bridge.process.environment import domain_problem
from drive_can_bridge.ros.rcl.end import Names, TopicEnd

# What makes messages from their definitions comes with every type support, is used by none, and
# its import takes 0.15 s; the package works without it where it is missing.
sys.modules.setdefault('rosidl_generator_py.generate_py_impl', None)    # type: ignore[arg-type]


class ClientNode:
    """
    This process in the ROS graph.

    It is no :class:`rclpy.node.Node`: that one has topics and services of its own, and what they
    need takes longer to be imported (0.25 s) than all requests of a command take to be
    answered.

    :param purpose: part of the node's name.
    :ivar end: its clients, subscriptions and publishers.
    :ivar full_name: of the node in the graph.
    :raises DriveCanError: ROS does not start.
    """

    def __init__(self, purpose: str) -> None:
        why = domain_problem()
        if why:
            raise DriveCanError(sentences.ros_does_not_start(why=why))
        self.context = Context()
        # a leading underscore hides a node from "ros2 node list"
        name = f'_drive_can_{purpose}_{os.getpid()}'
        self.full_name = f'/{name}'
        try:
            # no signals, and no log file: a stop has to work where nothing can be written
            self.context.init([], initialize_logging=False)
            self.end = TopicEnd(self.context, name, _tell_slow)
        except Exception as error:  # rcl fails in several types
            reason = str(error).partition(', at ')[0]
            raise DriveCanError(sentences.ros_does_not_start(why=reason)) from error

    @property
    def open(self) -> bool:
        """Whether it is still in the graph."""
        return bool(self.context.ok())

    def services(self) -> Names:
        """Return all services that have been discovered, with their types."""
        return self.end.services()

    def topics(self) -> Names:
        """Return all topics that have been discovered, with their types."""
        return self.end.topics()

    def servers(self, service: str) -> int:
        """Return how many servers of this name are discovered."""
        return self.end.servers(service)

    def leave(self) -> None:
        """Leave the graph. Idempotent."""
        if self.context.ok():
            self.end.close()
            self.context.try_shutdown()


class HasEnd(Protocol):
    """A client node, or another node with an end of its own."""

    end: TopicEnd


def _tell_slow(reason: str) -> None:
    print(f'drive_can: {printable(sentences.client_by_rclpy(reason), None)}',
          file=sys.stderr, flush=True)
