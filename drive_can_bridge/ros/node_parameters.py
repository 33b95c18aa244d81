# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The parameters of the bridge's own node.

Parameter files say what they are (``overrides``); once that has been checked, every key is
declared with its value in effect, so that ``ros2 param get`` tells it. Four of them may be changed
while the bridge runs; all others are read-only and say so.
"""

from collections.abc import Callable, Sequence
from typing import Any

from rcl_interfaces.msg import (
    Parameter as ParameterMessage, ParameterDescriptor, SetParametersResult,
)
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

from drive_can_bridge.configuration.load import check_dynamic, declared_parameters
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.directory import NAME_SHOWN
from drive_can_bridge.core.text import printable
from drive_can_bridge.ros.recognition import BRIDGES, bridges_among

_OURS = ('drives.', 'buses.')
_OURS_ALONE = ('diagnostics_period', 'autostart')


class NodeParameters:
    """
    Declares, checks and passes on. The node must have no parameter services of its own.

    :param changed: takes (name, value) of each parameter that was changed.
    :param refusal: says why a value that is allowed in itself cannot be set now; '' if it can.
    """

    def __init__(self, node: Node, changed: Callable[[str, Any], None],
                 refusal: Callable[[str, Any], str]) -> None:
        self._node = node
        self._changed = changed
        self._refusal = refusal
        self._dynamic: list[str] = []
        self._announcing = False
        node.declare_parameter(
            BRIDGES, [node.get_fully_qualified_name()], ParameterDescriptor(
                description='full names of all bridges that this one sees, its own among them',
                read_only=True), ignore_override=True)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)
        self._services = _Services(node, self._prepare)

    @property
    def overrides(self) -> dict[str, Any]:
        """What parameter files and command line say, by dotted name."""
        return {name: parameter.value
                for name, parameter in self._node._parameter_overrides.items()}

    @property
    def current(self) -> dict[str, Any]:
        """The same with what has been changed since."""
        current = self.overrides
        for name in self._dynamic:
            current[name] = self._node.get_parameter(name).value
        return current

    def declare(self, configuration: BridgeConfiguration) -> None:
        """Declare every key of a configuration that is not declared yet."""
        for name, value, description, dynamic in declared_parameters(configuration):
            if self._node.has_parameter(name):
                continue
            if dynamic:
                self._dynamic.append(name)
            self._node.declare_parameter(
                name, value, ParameterDescriptor(
                    description=description, read_only=not dynamic, dynamic_typing=True),
                ignore_override=True)

    def _prepare(self, names: Sequence[str]) -> None:
        """Have a value that is being asked for: looking at the graph is not cheap."""
        if BRIDGES in names:
            own = self._node.get_fully_qualified_name()
            seen = {own, *bridges_among(self._node.get_service_names_and_types())}
            self.announce(BRIDGES, sorted(name for name in seen for _ in range(
                max(1, self._node.count_services(f'{name}/change_state')))))

    def announce(self, name: str, value: Any) -> None:
        """Change a read-only parameter: what the bridge itself has found out."""
        if self._node.get_parameter(name).value == value:
            return
        self._announcing = True
        try:
            # the descriptor is handed in again because that is how rclpy leaves it read-only for
            # everybody else
            self._node._set_parameters_atomically_common(
                [Parameter(name, value=value)], {name: self._node.describe_parameter(name)})
        finally:
            self._announcing = False

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        if self._announcing:
            return SetParametersResult(successful=True)
        for parameter in parameters:
            if not parameter.name:  # rclpy would add one
                return SetParametersResult(successful=False, reason='a parameter has a name')
            if parameter.name.startswith(_OURS) or parameter.name in _OURS_ALONE:
                problem = (check_dynamic(parameter.name, parameter.value)
                           or self._refusal(parameter.name, parameter.value))
                if problem and self._node.has_parameter(parameter.name):
                    return SetParametersResult(successful=False, reason=problem)
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            self._changed(parameter.name, parameter.value)


class _Services(ParameterService):
    """
    The parameter services of rclpy, which answer whatever the type of a value is said to be.

    There, a type that does not exist ends the callback, and the client waits for ever.

    :param prepare: is told the names of parameters that are asked for.
    """

    def __init__(self, node: Node, prepare: Callable[[Sequence[str]], None]) -> None:
        super().__init__(node)
        self._prepare = prepare

    def _get_parameters_callback(self, request: Any, response: Any) -> Any:
        self._prepare(request.names)
        return super()._get_parameters_callback(request, response)

    def _set_parameters_callback(self, request: Any, response: Any) -> Any:
        response.results = [self._set([message]) for message in request.parameters]
        return response

    def _set_parameters_atomically_callback(self, request: Any, response: Any) -> Any:
        response.result = self._set(request.parameters)
        return response

    def _set(self, messages: list[ParameterMessage]) -> SetParametersResult:
        parameters = []
        for message in messages:
            try:
                parameters.append(Parameter.from_parameter_msg(message))
            except ValueError:
                reason = f'type {message.value.type} does not exist'
                if len(messages) > 1:
                    reason = f'{printable(message.name, NAME_SHOWN)}: {reason}'
                return SetParametersResult(successful=False, reason=reason)
        try:
            return self._get_node().set_parameters_atomically(parameters)
        except ParameterNotDeclaredException as error:
            return SetParametersResult(successful=False, reason=printable(str(error)))
