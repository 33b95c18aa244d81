# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``~/enable``, ``~/reset_fault``, ``~/quick_stop`` of a drive whose profile has ``control``."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.requests import BRIDGE_INACTIVE
from drive_can_bridge.ros.polled_services import PolledServices
from drive_can_bridge.ros.service_thread import Answer, Callback, ServiceThread

#: hands a request to the session; its outcome comes to :meth:`ControlServices.completed`
Ask = Callable[[ControlRequest], None]


class ControlServices:
    """
    The control services of one drive, served by a thread that they share with other drives only.

    :param thread: serves them.
    """

    def __init__(self, node: Node, thread: ServiceThread, ask: Ask) -> None:
        self._ask = ask
        self._waiting: dict[ControlRequest, Callable[[bool, str], None]] = {}
        self._services = PolledServices(node, thread, {
            'enable': (SetBool, self._callback(SetBool, None)),
            'reset_fault': (Trigger, self._callback(Trigger, ControlAction.RESET_FAULT)),
            'quick_stop': (Trigger, self._callback(Trigger, ControlAction.QUICK_STOP))})
        #: from when on the session can be asked, and before the node is destroyed
        self.serve, self.destroy = self._services.serve, self._services.destroy

    def completed(self, outcome: ControlCompleted) -> None:
        """Answer whoever asked for an action. From any thread."""
        answer = self._waiting.pop(outcome.request, None)
        if answer is not None:
            answer(outcome.success, outcome.message)

    def answer_all(self) -> bool:
        """Tell whoever still waits that nothing will come of it; True: all have their answer."""
        while self._waiting:
            self._waiting.popitem()[1](False, BRIDGE_INACTIVE)
        return not self._services.calls

    def _callback(self, kind: Any, action: ControlAction | None) -> Callback:
        def callback(request: Any, answer: Answer) -> None:
            wanted = action or (ControlAction.ENABLE if request.data else ControlAction.DISABLE)

            def say(success: bool, message: str) -> None:
                answer(kind.Response(success=success, message=message))
            asked = ControlRequest(wanted)
            self._waiting[asked] = say      # its outcome may come before the next line
            try:
                self._ask(asked)
            except BaseException:
                del self._waiting[asked]
                self._services.ended()
                raise
        return callback
