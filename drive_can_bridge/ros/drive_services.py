# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Which services a drive has, and the coroutines that serve them."""

from collections.abc import Callable, Coroutine, Mapping
from functools import partial
import threading
from typing import Any

from rclpy.node import Node
from rclpy.qos import qos_profile_parameters
from rclpy.service import Service
from std_srvs.srv import SetBool, Trigger

from drive_can_bridge.core.control import ControlAction, ControlCompleted, ControlRequest
from drive_can_bridge.ros.coroutines import Answer, Awaited, go_on
from drive_can_bridge.ros.rcl.incoming import PolledGroup
from drive_can_bridge.ros.threads import Callback, response_to, ServiceThread

#: takes request and response, and returns the response
Serve = Callable[[Any, Any], Coroutine[Any, Any, Any]]


class CoroutineServices:
    """
    Coroutine services of one node. No two of their coroutines run at the same time.

    :param callbacks: by name, with the type of the service.
    :ivar calls: how many callers wait for their answer.
    """

    def __init__(self, node: Node, thread: ServiceThread,
                 callbacks: Mapping[str, tuple[Any, Serve]]) -> None:
        self._thread = thread
        self.calls = 0
        self._callbacks = callbacks
        self._counting = threading.Lock()
        self._running = threading.Lock()
        self._services: dict[Service, Callback] = {
            node.create_service(kind, f'~/{name}', _never, callback_group=PolledGroup(),
                                qos_profile=qos_profile_parameters):
            partial(self._begin, callback, kind.Response)
            for name, (kind, callback) in callbacks.items()}

    def call(self, name: str, request: Any, answer: Answer) -> None:
        """
        Start a call that came by the local way. From any thread.

        :param answer: called with the response, from any thread.
        """
        kind, callback = self._callbacks[name]

        def answered(message: Any) -> None:
            self._ended()
            answer(response_to(kind, request, message) if isinstance(message, Exception)
                   else message)
        self._thread.begin(partial(self._begin, callback, kind.Response, request, answered))

    def serve(self) -> None:
        """Start to serve."""
        for service, callback in self._services.items():
            self._thread.serve(service, callback, self._ended)

    def destroy(self) -> None:
        """Destroy the services. Before the node is destroyed."""
        self._thread.forget(list(self._services))

    def _begin(self, callback: Serve, response: Callable[[], Any], request: Any,
               answer: Answer) -> None:
        with self._counting:
            self.calls += 1
        go_on(callback(request, response()), self._thread.later, answer, alone=self._running)

    def _ended(self) -> None:
        """Record that one caller fewer waits: it was answered, or is out of reach."""
        with self._counting:
            self.calls -= 1


def _never(_: Any, response: Any) -> Any:
    raise RuntimeError('such services are taken by a thread of their own')


#: submits a request to the session; answered by its outcome
Submit = Callable[[ControlRequest], Awaited[ControlCompleted]]


def control_services(node: Node, thread: ServiceThread, submit: Submit, *,
                     controlled: bool, homing: bool = False) -> CoroutineServices:
    """
    Return the control services of a drive.

    :param thread: serves them, and those of other drives, but nothing else.
    :param controlled: it has a control word.
    :param homing: it can home.
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
