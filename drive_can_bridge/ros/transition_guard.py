# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Answer an illegal lifecycle transition instead of ending on it.

rclpy lets the error of an illegal transition escape from the service's callback, and so from the
executor: any client could end the process. Here it becomes a failure and a warning.
"""

from collections.abc import Callable
from threading import RLock
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode

from drive_can_bridge.core.text import printable

RCLError = rclpy_implementation.RCLError


def guard_transitions(node: LifecycleNode, warn: Callable[[str], None], lock: RLock,
                      refusal: Callable[[], str]) -> None:
    """
    Guard the transition service of a node.

    :param warn: takes what is wrong with a transition.
    :param lock: is held during a transition.
    :param refusal: why none is possible any more; '' otherwise.
    """
    service = node._service_change_state
    change_state = service.callback

    def guarded(request: Any, response: Any) -> Any:
        with lock:
            try:
                if refusal():
                    raise RuntimeError(refusal())
                if request.transition.label:  # an unknown one is answered without a word
                    node._state_machine.get_transition_by_label(request.transition.label)
                return change_state(request, response)
            except (RCLError, RuntimeError) as error:
                label = printable(request.transition.label or f'number {request.transition.id}')
                state = node._state_machine.current_state[1]
                warn(f'transition {label} is not possible in state {state}'
                     f' ({printable(" ".join(str(error).split()))})')
                response.success = False
                return response

    service.callback = guarded
