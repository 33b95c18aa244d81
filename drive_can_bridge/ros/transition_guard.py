# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Answer an illegal lifecycle transition instead of ending on it.

rclpy lets the error of an illegal transition escape from the service's callback, and so from the
executor: any client could end the process. Here it becomes a failure and a warning, before rcl is
asked, which would have a warning of its own.
"""

from collections.abc import Callable
from typing import Any

from rclpy.lifecycle import LifecycleNode

from drive_can_bridge.clock import Lock
from drive_can_bridge.core.text import printable


def guard_transitions(node: LifecycleNode, warn: Callable[[str], None], lock: Lock,
                      refusal: Callable[[], str]) -> None:
    """
    Guard the transition service of a node.

    :param warn: takes what is wrong with a transition.
    :param lock: is held during a transition.
    :param refusal: why none is possible any more; '' otherwise.
    """
    service = node._service_change_state
    change_state = service.callback
    machine = node._state_machine

    def guarded(request: Any, response: Any) -> Any:
        number, label = request.transition.id, request.transition.label
        with lock:
            # of a request with both, rclpy takes the label
            possible = {known: name for known, name, *_ in machine.available_transitions}
            why = refusal()
            if not why and (label not in possible.values() if label else number not in possible):
                why = f'possible are {", ".join(possible.values()) or "none"}'
            if not why:
                try:
                    return change_state(request, response)
                except RuntimeError as error:
                    why = printable(' '.join(str(error).split()))
            warn(f'transition {printable(label) or f"number {number}"} is not possible in state '
                 f'{machine.current_state[1]} ({why})')
            response.success = False
            return response

    service.callback = guarded
