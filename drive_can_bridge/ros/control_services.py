# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``~/enable``, ``~/reset_fault``, ``~/quick_stop`` of a drive whose profile has ``control``."""

from collections.abc import Awaitable, Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.qos import qos_profile_parameters
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.core.control import ControlAction

#: asks for an action; awaitable of (success, message)
Ask = Callable[[ControlAction], Awaitable[tuple[bool, str]]]


class ControlServices:
    """The control services of one drive."""

    def __init__(self, node: Node, ask: Ask) -> None:
        self._ask = ask
        group = ReentrantCallbackGroup()
        node.create_service(SetBool, '~/enable', self._enable,
                            qos_profile=qos_profile_parameters, callback_group=group)
        node.create_service(Trigger, '~/reset_fault', self._trigger(ControlAction.RESET_FAULT),
                            qos_profile=qos_profile_parameters, callback_group=group)
        node.create_service(Trigger, '~/quick_stop', self._trigger(ControlAction.QUICK_STOP),
                            qos_profile=qos_profile_parameters, callback_group=group)

    async def _enable(self, request: Any, response: Any) -> Any:
        action = ControlAction.ENABLE if request.data else ControlAction.DISABLE
        response.success, response.message = await self._ask(action)
        return response

    def _trigger(self, action: ControlAction) -> Callable[[Any, Any], Awaitable[Any]]:
        async def callback(_: Any, response: Any) -> Any:
            response.success, response.message = await self._ask(action)
            return response
        return callback
