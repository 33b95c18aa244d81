# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Nodes that look like bridges in the graph, and answer or not."""

from collections.abc import Callable, Sequence
from typing import Any

from clients import Client
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, GetParameterTypes, ListParameters
from rclpy.qos import qos_profile_parameters
from std_srvs.srv import Trigger


def offer(client: Client, name: str, service: str, kind: Any, answer: Any = None) -> None:
    """Offer a service of somebody who may be a bridge."""
    client.node.create_service(kind, f'{name}/{service}', answer or (lambda _, response: response),
                               qos_profile=qos_profile_parameters)


def hang(client: Client, name: str) -> None:
    """Be a bridge that is in the graph, and answers nothing."""
    offer(client, name, 'change_state', ChangeState)
    offer(client, name, 'save_trace', Trigger)


def answer(client: Client, name: str, others: Sequence[str] = (), drives: str = 'conveyor',
           greet: Any = None) -> Callable[[], None]:
    """Answer as a bridge does; return what begins to tell of its drives."""
    def tell_drives(_: Any, response: Any) -> Any:
        response.result.names = [f'drives.{each}.profile_sha256' for each in drives.split()]
        return response

    def tell_others(request: Any, response: Any) -> Any:
        assert list(request.names) == ['bridges']
        response.values = [ParameterValue(type=ParameterType.PARAMETER_STRING_ARRAY,
                                          string_array_value=sorted([name, *others]))]
        return response
    hang(client, name)
    offer(client, name, 'get_parameter_types', GetParameterTypes, greet)
    offer(client, name, 'get_parameters', GetParameters, tell_others)
    return lambda: offer(client, name, 'list_parameters', ListParameters, tell_drives)
