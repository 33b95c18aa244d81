# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The way to a running bridge through ROS, as any node could use it."""

from collections.abc import Sequence

from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters

from drive_can_bridge.client.way import Described, Found
from drive_can_bridge.clock import Clock
from drive_can_bridge.core import sentences
from drive_can_bridge.core.errors import NoBridge
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.ros.client.graph import Graph
from drive_can_bridge.ros.client.search import find_drives
from drive_can_bridge.ros.messages import limits_of, parameter_message, plain


def described(message: ParameterDescriptor) -> Described:
    """Return the description in a message."""
    return Described(message.name, message.description, message.additional_constraints,
                     *limits_of(message))


class RosWay:
    """
    A :class:`.Way`.

    :param namespace: where the bridges run; None: anywhere, if there is only one.
    :raises WhichBridge: there are several, and not together.
    :raises NoBridge: there is none.
    :raises SilentBridge: it does not answer.
    """

    def __init__(self, namespace: str | None, clock: Clock) -> None:
        self._graph = Graph(clock)
        try:
            self.bridge_of = find_drives(self._graph, namespace)
        except NoBridge as error:
            self._graph.close()
            raise NoBridge(sentences.no_bridge_or_file(why=str(error))) from None
        except BaseException:
            self._graph.close()
            raise

    def get(self, node: str, names: Sequence[str]) -> Sequence[Found]:
        """Return values of parameters; fewer where a bridge does not know one of them."""
        answer = self._graph.call(node, 'get_parameters', GetParameters.Request(names=list(names)))
        return [plain(value) for value in answer.values]

    def describe(self, node: str, names: Sequence[str]) -> Sequence[Described]:
        """Return the descriptions of parameters of a drive."""
        answer = self._graph.call(node, 'describe_parameters',
                                  DescribeParameters.Request(names=list(names)))
        return list(map(described, answer.descriptors))

    def listed(self, node: str) -> Sequence[str]:
        """Return the names of the parameters that a drive lists."""
        answer = self._graph.call(node, 'list_parameters', ListParameters.Request())
        return list(answer.result.names)

    def set(self, node: str, name: str, value: Value) -> tuple[bool, str]:
        """Set a parameter of a drive; return whether it was, and why not, or a note."""
        result, = self._graph.call(node, 'set_parameters', SetParameters.Request(
            parameters=[parameter_message(name, value)])).results
        return result.successful, result.reason

    def condition(self, drive: str, *, age: float, patience: float) -> dict[str, str]:
        """Return the facts of the newest diagnostics of a drive; none: there are none."""
        return self._graph.newest_status(f'{self.bridge_of[drive].lstrip("/")}: drive {drive}',
                                         age=age, patience=patience)

    def close(self) -> None:
        """Leave the graph. Idempotent."""
        self._graph.close()
