# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The floor: what the same exchange costs with nothing around it.

One loop: sleep to the next cycle, python-can send for every drive, python-can receive, ``struct``,
the same publishes. Started with channel, number of drives and period.
"""

import struct
import sys
import threading
import time
from typing import Any

import can
from child import serve, sleep_until
import rclpy  # isort: skip
from rclpy.node import Node
from topics import DriveTopics
from unix_bus import INTERFACE, register

CYCLIC = 0x001FFFF0
DIR = 0x10000000


class Floor:
    """The loop, in a thread of its own so that its CPU time is known."""

    def __init__(self, node: Node, channel: str, drives: int, period: float) -> None:
        self._bus = can.Bus(interface=INTERFACE, channel=channel, ignore_config=True)
        self._topics = [DriveTopics(node, f'floor{number}') for number in range(drives)]
        self._period = period

    def run(self, duration: float) -> dict[str, Any]:
        """Exchange for so long; return CPU time, exchanges, errors of the period."""
        found: dict[str, Any] = {'cpu': 0.0, 'exchanges': 0, 'period_errors': []}
        thread = threading.Thread(target=self._loop, args=(duration, found))
        thread.start()
        thread.join()
        return found

    def _loop(self, duration: float, found: dict[str, Any]) -> None:
        request, response = struct.Struct('>hHhH').pack, struct.Struct('>hhhH').unpack
        drives, period, bus = len(self._topics), self._period, self._bus
        errors: list[float] = found['period_errors']
        deadline, last = time.monotonic(), 0.0
        end = deadline + duration
        cpu = time.thread_time()
        while deadline < end:
            sleep_until(deadline)
            now = time.monotonic()
            if last:
                errors.append(abs(now - last - period))
            last = now
            for number in range(drives):
                bus.send(can.Message(arbitration_id=(number + 1) << 21 | CYCLIC,
                                     is_extended_id=True, data=request(0, 0, 0, 0)))
            for _ in range(drives):
                message = bus.recv(1.0)
                if message is None:
                    raise RuntimeError('a drive did not answer')
                speed, current, position, inputs = response(message.data)
                station = (message.arbitration_id & ~DIR) >> 21
                self._topics[station - 1].publish(
                    time.time_ns(), speed * 0.1, current * 0.01, position * 0.1, inputs)
                found['exchanges'] += 1
            deadline += period
        found['cpu'] = time.thread_time() - cpu

    def close(self) -> None:
        """End well."""
        self._bus.shutdown()


def main() -> None:
    """Obey."""
    register()
    rclpy.init(args=[])
    floor = Floor(Node('bench_floor', enable_rosout=False), sys.argv[1], int(sys.argv[2]),
                  float(sys.argv[3]))
    serve({'run': floor.run}, close=floor.close)


if __name__ == '__main__':
    main()
