# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""``~/enable``, ``~/reset_fault``, ``~/quick_stop`` of a drive whose profile has ``control``."""

from collections.abc import Callable
import threading
from typing import Any

from rclpy.node import Node
from rclpy.qos import qos_profile_parameters
from rclpy.service import Service
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.core.requests import BRIDGE_INACTIVE
from drive_can_bridge.ros.polled_group import PolledGroup
from drive_can_bridge.ros.service_thread import Answer, ServiceThread

#: hands a request to the session; its outcome comes to :meth:`ControlServices.completed`
Ask = Callable[[ControlRequest], None]


class ControlServices:
    """
    The control services of one drive, served by a thread that they share with other drives only.

    :param thread: serves them.
    """

    def __init__(self, node: Node, thread: ServiceThread, ask: Ask) -> None:
        self._thread = thread
        self._ask = ask
        self._waiting: dict[ControlRequest, Callable[[bool, str], None]] = {}
        self._calls = 0     # that wait for their answer
        self._lock = threading.Lock()
        self._services: dict[Service, Callable[[Any, Answer], None]] = {}
        for kind, name, action in (
                (SetBool, 'enable', None), (Trigger, 'reset_fault', ControlAction.RESET_FAULT),
                (Trigger, 'quick_stop', ControlAction.QUICK_STOP)):
            service = node.create_service(kind, f'~/{name}', _never, callback_group=PolledGroup(),
                                          qos_profile=qos_profile_parameters)
            self._services[service] = self._callback(kind, action)

    def serve(self) -> None:
        """Begin to serve: the session can be asked from now on."""
        for service, callback in self._services.items():
            self._thread.serve(service, callback, lambda: self._count(-1))

    def completed(self, outcome: ControlCompleted) -> None:
        """Answer whoever asked for an action. From any thread."""
        answer = self._waiting.pop(outcome.request, None)
        if answer is not None:
            answer(outcome.success, outcome.message)

    def answer_all(self) -> bool:
        """Tell whoever still waits that nothing will come of it; True: all have their answer."""
        while self._waiting:
            self._waiting.popitem()[1](False, BRIDGE_INACTIVE)
        return not self._calls

    def destroy(self) -> None:
        """Let go of the services. Before the node is destroyed."""
        self._thread.forget(list(self._services))

    def _callback(self, kind: Any, action: ControlAction | None) -> Callable[[Any, Answer], None]:
        def callback(request: Any, answer: Answer) -> None:
            wanted = action or (ControlAction.ENABLE if request.data else ControlAction.DISABLE)

            def say(success: bool, message: str) -> None:
                answer(kind.Response(success=success, message=message))
            asked = ControlRequest(wanted)
            self._count(1)
            self._waiting[asked] = say      # its outcome may come before the next line
            try:
                self._ask(asked)
            except BaseException:
                del self._waiting[asked]
                self._count(-1)
                raise
        return callback

    def _count(self, change: int) -> None:
        with self._lock:
            self._calls += change


def _never(_: Any, response: Any) -> Any:
    raise RuntimeError('control services are taken by a thread of their own')
