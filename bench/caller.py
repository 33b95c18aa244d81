# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A process that calls parameter services.

``ping N`` calls the bridge's drive and a bare node in turn, one call at a time; ``flood N`` keeps
N calls to each drive under way until ``calm``; ``pester N`` the same to the first drive only, and
eight calls for a thousand names each that nobody knows; ``trace`` has the bridge write its traces.
"""

import re
import sys
import threading
import time
from typing import Any

from child import PATIENCE, serve
from rcl_interfaces.srv import GetParameters
import rclpy  # isort: skip
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_parameters
from std_srvs.srv import Trigger
import topics  # noqa: F401  sets the environment of rclpy


class Caller:
    """Calls ``get_parameters`` of one parameter."""

    def __init__(self, node: Node, drives: int) -> None:
        self._drives = [self._client(node, f'drive{number}') for number in range(drives)]
        self._bare = self._client(node, 'bare_drive0')
        self._request = GetParameters.Request(names=['ramp_time'])
        self._nonsense = GetParameters.Request(names=[f'name_{each}' for each in range(1000)])
        self._save = node.create_client(Trigger, '/drive_can_bridge/save_trace')
        self._flooding = False
        self._answered = 0

    @staticmethod
    def _client(node: Node, name: str) -> Any:
        return node.create_client(GetParameters, f'/{name}/get_parameters',
                                  qos_profile=qos_profile_parameters)

    def ping(self, count: float) -> dict[str, list[float]]:
        """Return the durations of calls in s."""
        found: dict[str, list[float]] = {'drive': [], 'bare': []}
        clients = {'drive': self._drives[0], 'bare': self._bare}
        for client in clients.values():
            if not client.wait_for_service(PATIENCE):
                raise SystemExit('no service')
        for _ in range(int(count)):
            for name, client in clients.items():
                begun = time.monotonic()
                future = client.call_async(self._request)
                done = threading.Event()
                future.add_done_callback(lambda _, done=done: done.set())
                if not done.wait(PATIENCE):
                    raise SystemExit('a call was not answered')
                found[name].append(time.monotonic() - begun)
                time.sleep(0.002)
        return found

    def trace(self) -> dict[str, float]:
        """Have traces written; return how long that took, and how many frames they have."""
        if not self._save.wait_for_service(PATIENCE):
            raise SystemExit('no service')
        begun = time.monotonic()
        future = self._save.call_async(Trigger.Request())
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        if not done.wait(PATIENCE) or not future.result().success:
            raise SystemExit('no trace was written')
        elapsed = time.monotonic() - begun
        frames = 0
        for path in re.findall(r'/\S+\.log', future.result().message):
            with open(path, encoding='ascii') as file:
                frames += sum(1 for _ in file)
        return {'elapsed': elapsed, 'frames': frames}

    def flood(self, under_way: float) -> bool:
        """Keep so many calls to each drive under way."""
        self._flooding, self._answered = True, 0
        for client in self._drives:
            if not client.wait_for_service(PATIENCE):
                raise SystemExit('no service')
            for _ in range(int(under_way)):
                self._call_on(client)
        return True

    def pester(self, under_way: float) -> bool:
        """Keep so many calls to the first drive under way, and eight for unknown names."""
        self._flooding, self._answered = True, 0
        client = self._drives[0]
        if not client.wait_for_service(PATIENCE):
            raise SystemExit('no service')
        for _ in range(int(under_way)):
            self._call_on(client)
        for _ in range(8):
            self._call_on(client, self._nonsense)
        return True

    def calm(self) -> int:
        """End the flood; return how many calls were answered."""
        self._flooding = False
        return self._answered

    def _call_on(self, client: Any, request: Any = None) -> None:
        def answered(_: Any) -> None:
            self._answered += 1
            if self._flooding:
                self._call_on(client, request)
        client.call_async(request or self._request).add_done_callback(answered)


def main() -> None:
    """Obey."""
    rclpy.init(args=[])
    node = Node('bench_caller', enable_rosout=False, start_parameter_services=False)
    caller = Caller(node, int(sys.argv[1]))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    serve({'ping': caller.ping, 'flood': caller.flood, 'calm': caller.calm,
           'pester': caller.pester, 'trace': caller.trace})


if __name__ == '__main__':
    main()
