# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Private members of rclpy's Python nodes, for what has no public way.

So a bridge reports at its start what is missing (:func:`look`, and :func:`look_at` its node), and
does not begin.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage, SetParametersResult
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

from drive_can_bridge.core.directory import NAME_SHOWN
from drive_can_bridge.core.sentences import no_such_type
from drive_can_bridge.core.text import printable
from drive_can_bridge.ros.rcl.unfit import Unfit

#: by class: what it has, and what only its objects have
_OF_CLASSES: tuple[tuple[type, tuple[str, ...]], ...] = (
    (Node, ('_set_parameters_atomically_common',)),
    (ParameterService, ('_get_node', '_get_parameters_callback', '_set_parameters_callback',
                        '_set_parameters_atomically_callback')))
_OF_NODES = (
    '_parameter_overrides', '_service_change_state', '_state_machine.available_transitions',
    '_state_machine.current_state')


def look() -> None:
    """
    Check that the members used here exist, before there is a node.

    :raises Unfit: they do not; with the missing ones.
    """
    _complain([f'{kind.__name__}.{name}' for kind, names in _OF_CLASSES for name in names
               if not hasattr(kind, name)])


def look_at(node: LifecycleNode) -> None:
    """
    Check that a node has the members used here.

    :raises Unfit: it does not; with the missing ones.
    """
    lacking = [_lacking(node, name) for name in _OF_NODES]
    _complain([f'LifecycleNode.{name}' for name in dict.fromkeys(lacking) if name])


def _lacking(owner: object, name: str) -> str:
    """Return as much of a name with dots as has not been found any more; '': all is there."""
    found: Any = owner
    parts = name.split('.')
    for place, part in enumerate(parts, 1):
        if not hasattr(found, part):
            return '.'.join(parts[:place])
        found = getattr(found, part)
    return ''


def _complain(missing: Sequence[str]) -> None:
    if missing:
        raise Unfit(', '.join(missing))


def overrides(node: Node) -> Mapping[str, Parameter]:
    """Return the overrides of a node from parameter files and command line, declared or not."""
    return node._parameter_overrides


def set_read_only(node: Node, name: str, value: Any) -> None:
    """
    Change a parameter that is read-only from outside.

    The descriptor is passed again because that is how rclpy leaves it read-only.
    """
    node._set_parameters_atomically_common(
        [Parameter(name, value=value)], {name: node.describe_parameter(name)})


class Transitions:
    """The transitions of a managed node, read before rcl is asked for one."""

    def __init__(self, node: LifecycleNode) -> None:
        self._machine = node._state_machine
        self._service = node._service_change_state

    @property
    def possible(self) -> dict[int, str]:
        """Number and label of each transition that is possible now."""
        return {number: label for number, label, *_ in self._machine.available_transitions}

    @property
    def state(self) -> str:
        """The label of the state."""
        return str(self._machine.current_state[1])

    def guard(self, guarded: Callable[[Callable[[Any, Any], Any], Any, Any], Any]) -> None:
        """
        Replace the handler of transition requests.

        :param guarded: called with rclpy's handler, request and response.
        """
        change_state = self._service.callback
        self._service.callback = lambda request, response: guarded(
            change_state, request, response)


class AnsweringParameterServices(ParameterService):
    """
    The parameter services of rclpy, which answer for any type number of a value.

    There, a type that does not exist ends the callback, and the client waits for ever.

    :param prepare: called with the names of requested parameters.
    """

    def __init__(self, node: Node, prepare: Callable[[Sequence[str]], None]) -> None:
        super().__init__(node)
        self._prepare = prepare

    def get(self, request: Any, response: Any) -> Any:
        """Handle ``get_parameters`` for a caller by the local way."""
        return self._get_parameters_callback(request, response)

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
                reason: str = no_such_type(message.value.type)
                if len(messages) > 1:
                    reason = f'{printable(message.name, NAME_SHOWN)}: {reason}'
                return SetParametersResult(successful=False, reason=reason)
        try:
            return self._get_node().set_parameters_atomically(parameters)
        except ParameterNotDeclaredException as error:
            return SetParametersResult(successful=False, reason=printable(str(error)))
