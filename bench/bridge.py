# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The bridge as the executable runs it, with a way to ask what it cost.

Started with a parameter file, and the word "ordinary" where no thread is to get real-time
priority, or "stuck" where nobody reads standard error. Prints how long it took from rclpy.init to
the first exchange of every drive.
"""

import os
import queue
import sys
import threading
import time
from typing import Any

from child import serve
import rclpy  # isort: skip
import topics  # noqa: F401  sets the environment of rclpy
from unix_bus import register

from drive_can_bridge.process.scheduling import be_punctual
from drive_can_bridge.process.standard_outputs import StandardOutputs
from drive_can_bridge.ros import bridge_node
from drive_can_bridge.ros.bridge_node import BridgeNode
from drive_can_bridge.ros.executor_thread import ExecutorThread
from drive_can_bridge.ros.middleware import begin_with_small_histories
from drive_can_bridge.transport.clock import steady_now

ONLINE_TIMEOUT = 30.0
#: s until something that is not to happen
NEVER = 1e5


class Measured:
    """The bridge and the counts at the beginning of a measurement."""

    def __init__(self) -> None:
        self._spinner = ExecutorThread('services', _complain, rclpy.get_default_context())
        self.bridge = BridgeNode(self._spinner, _complain)
        self._spinner.start()
        if not self.bridge.start():
            raise SystemExit('the bridge did not start')
        self.sessions = [drive.session for drive in self.bridge.drives.values()]
        exchanges = self.bridge.exchanges.values()
        self._threads = {'timer': [exchange._thread for exchange in exchanges],
                         'reader': [exchange.link._thread for exchange in exchanges],
                         'services': [self._spinner._thread,
                                      *self.bridge._parameter_thread._threads]}
        joints = self.bridge._fleet and self.bridge._fleet.joints
        self._joints = joints and joints._errand
        self._before: dict[str, Any] = {}

    def clear(self) -> bool:
        """Begin a measurement."""
        for session in self.sessions:
            for statistic in (session.statistics.period_error, session.statistics.latency):
                statistic.__init__()  # type: ignore[misc]
        self._before = self._counts()
        return True

    def result(self) -> dict[str, Any]:
        """Return what happened since."""
        now, before = self._counts(), self._before
        statistics = [session.statistics for session in self.sessions]
        return {
            'elapsed': now['at'] - before['at'],
            'exchanges': now['exchanges'] - before['exchanges'],
            'missed': now['missed'] - before['missed'],
            'cpu': {name: now['cpu'][name] - before['cpu'][name] for name in self._threads},
            'process_cpu': now['process'] - before['process'],
            'period_errors': [error for each in statistics for error in
                              each.period_error.samples()],
            'latencies': [error for each in statistics for error in each.latency.samples()],
            'online': sum(session.online for session in self.sessions),
        }

    def joints(self, rate: float) -> bool:
        """Have the message of all joints published at so many Hz; 0: not at all."""
        assert self._joints is not None
        self._joints.begin(1.0 / rate if rate else NEVER, steady_now())
        return True

    def trace(self) -> dict[str, float]:
        """Have a trace written; return when it is there."""
        recorder = self.bridge._flight._recorder
        answers: queue.SimpleQueue[tuple[str, str]] = queue.SimpleQueue()
        begun = time.monotonic()
        recorder.save('bus0', 'bench', lambda *answer: answers.put(answer))
        path, reason = answers.get(timeout=60.0)
        if not path:
            raise SystemExit(reason)
        with open(path, encoding='ascii') as file:
            return {'elapsed': time.monotonic() - begun, 'frames': sum(1 for _ in file)}

    def close(self) -> None:
        """End well."""
        self.bridge.stop()
        self._spinner.stop()
        self.bridge.close()
        self.bridge.destroy_node()
        rclpy.try_shutdown()

    def _counts(self) -> dict[str, Any]:
        return {
            'at': time.monotonic(), 'process': time.process_time(),
            'exchanges': sum(each.statistics.exchanges for each in self.sessions),
            'missed': sum(each.statistics.missed for each in self.sessions),
            'cpu': {name: sum(map(_cpu, threads)) for name, threads in self._threads.items()},
        }


def _cpu(thread: threading.Thread) -> float:
    assert thread.ident is not None
    return time.clock_gettime(time.pthread_getcpuclockid(thread.ident))


def _complain(text: str) -> None:
    print(text, file=sys.stderr)


def be_stuck() -> None:
    """Make standard error a pipe that is full, and that nobody reads."""
    _, write = os.pipe()
    os.set_blocking(write, False)
    try:
        while True:
            os.write(write, bytes(1))
    except BlockingIOError:
        os.set_blocking(write, True)
    os.dup2(write, 2)


def main() -> None:
    """Obey."""
    register()
    be_punctual()
    begin_with_small_histories()
    if 'ordinary' in sys.argv[2:]:
        bridge_node.raise_priority = lambda: 'no real-time priority: so asked for'
    level = 'error'
    if 'stuck' in sys.argv[2:]:
        be_stuck()
        StandardOutputs().__enter__()     # to the end, as in the executable
        level = 'info'
    rclpy.init(args=['bench', '--ros-args', '--log-level', level, '--params-file', sys.argv[1]])
    begun = time.monotonic()
    measured = Measured()
    waited_until = begun + ONLINE_TIMEOUT
    while not all(session.online for session in measured.sessions):
        if time.monotonic() > waited_until:
            raise SystemExit('the drives did not come online')
        time.sleep(0.005)
    serve({'clear': measured.clear, 'result': measured.result, 'trace': measured.trace,
           'joints': measured.joints},
          ready=time.monotonic() - begun, close=measured.close)


if __name__ == '__main__':
    main()
