# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``~/quick_stop`` of a drive; what its control word, and homing, add to that."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.ros.coroutine_services import CoroutineServices, Question, Serve
from drive_can_bridge.ros.service_thread import ServiceThread

#: hands a request to the session; answered by its outcome
Submit = Callable[[ControlRequest], Question[ControlCompleted]]


def control_services(node: Node, thread: ServiceThread, submit: Submit, *,
                     controlled: bool, homing: bool = False) -> CoroutineServices:
    """
    Return the control services of a drive.

    :param thread: serves them, and those of other drives, but nothing else.
    :param controlled: it has a control word.
    :param homing: it can be asked to look for its reference.
    """
    def serving(wanted: Callable[[Any], ControlAction]) -> Serve:
        async def callback(request: Any, response: Any) -> Any:
            outcome = await submit(ControlRequest(wanted(request)))
            response.success, response.message = outcome.success, outcome.message
            return response
        return callback
    services: dict[str, tuple[type, Serve]] = {
        'quick_stop': (Trigger, serving(lambda _: ControlAction.QUICK_STOP))}
    if controlled:
        services['enable'] = SetBool, serving(
            lambda request: ControlAction.ENABLE if request.data else ControlAction.DISABLE)
        services['reset_fault'] = Trigger, serving(lambda _: ControlAction.RESET_FAULT)
    if homing:
        services['home'] = Trigger, serving(lambda _: ControlAction.HOME)
    return CoroutineServices(node, thread, services)
