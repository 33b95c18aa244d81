# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A process that stops a drive again and again.

``stop N`` enables the first drive and calls ``~/quick_stop``, every other time ``~/enable`` false,
N times in all, and returns when each call was made. ``enable`` enables it.
"""

import random
import threading
import time
from typing import Any

from child import PATIENCE, serve
import rclpy  # isort: skip
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_parameters
from std_srvs.srv import SetBool, Trigger
import topics  # noqa: F401  sets the environment of rclpy


class Stopper:
    """Calls the control services of the first drive."""

    def __init__(self, node: Node) -> None:
        self._enable = node.create_client(SetBool, '/drive0/enable',
                                          qos_profile=qos_profile_parameters)
        self._quick_stop = node.create_client(Trigger, '/drive0/quick_stop',
                                              qos_profile=qos_profile_parameters)

    def stop(self, count: float) -> dict[str, Any]:
        """Return the times of the calls (steady clock, s), and what was not answered well."""
        for client in (self._enable, self._quick_stop):
            if not client.wait_for_service(PATIENCE):
                raise SystemExit('no service')
        called: list[float] = []
        failures: list[str] = []
        for number in range(int(count)):
            failure = self._failure('enable', self._enable, SetBool.Request(data=True))
            if failure:
                failures.append(failure)
                continue
            time.sleep(random.uniform(0.02, 0.06))
            called.append(time.monotonic())
            failure = (self._failure('disable', self._enable, SetBool.Request(data=False))
                       if number % 2 else
                       self._failure('quick stop', self._quick_stop, Trigger.Request()))
            if failure:
                failures.append(failure)
        return {'called': called, 'failures': failures}

    def enable(self) -> bool:
        """Enable the first drive; return whether it is."""
        if not self._enable.wait_for_service(PATIENCE):
            raise SystemExit('no service')
        return not self._failure('enable', self._enable, SetBool.Request(data=True))

    @staticmethod
    def _failure(what: str, client: Any, request: Any) -> str:
        """Call; return what was not answered well, '' if it was."""
        future = client.call_async(request)
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        if not done.wait(PATIENCE):
            return f'{what}: no answer'
        return '' if future.result().success else f'{what}: {future.result().message}'


def main() -> None:
    """Obey."""
    rclpy.init(args=[])
    node = Node('bench_stopper', enable_rosout=False, start_parameter_services=False)
    stopper = Stopper(node)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    serve({'stop': stopper.stop, 'enable': stopper.enable})


if __name__ == '__main__':
    main()
