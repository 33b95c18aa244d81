# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Threads of the bridge: an executor's, which no callback can bring down, and a periodic one's.

A future of rclpy must be completed in its executor's own thread; completing it elsewhere races
with the executor's wait. Results of other threads are left here.
"""

from collections.abc import Callable
import threading
from typing import Any

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor

from drive_can_bridge.clock import Clock

#: s between two failures: one that comes at once again must not take the machine
ERROR_PAUSE = 0.05


class ExecutorThread:
    """
    Spins a SingleThreadedExecutor until told to stop.

    :param report: takes one line about an exception that a callback let escape.
    """

    def __init__(self, name: str, report: Callable[[str], None], context: Context,
                 clock: Clock) -> None:
        self._clock = clock
        self.executor = SingleThreadedExecutor(context=context)
        self._report = report
        self._stopping = False
        self._ending = threading.Lock()
        self._thread = clock.worker(self._run, name)

    def start(self) -> None:
        """Start to serve."""
        self._thread.start()

    def later(self, job: Callable[..., object], *arguments: Any) -> None:
        """Have something done in this thread soon. From any thread; once it stops, nothing is."""
        with self._ending:
            if not self._stopping:
                self.executor.create_task(job, *arguments)

    def stop(self) -> None:
        """Stop to serve and wait for the callback that is running."""
        # an executor that is merely woken goes back to waiting for something to do
        self.later(self._end)
        with self._ending:
            self._stopping = True
        self._thread.join(5.0)
        self.executor.shutdown(timeout_sec=1.0)

    def _end(self) -> None:
        self._stopping = True

    def _run(self) -> None:
        while not self._stopping and self.executor.context.ok():
            try:
                self.executor.spin_once()
            except (ExternalShutdownException, ShutdownException):
                return
            except InvalidHandle:  # what was to be served is gone: a drive's node, after cleanup
                self._clock.wait(self._clock.now() + ERROR_PAUSE)
            except Exception as error:  # noqa: BLE001  outermost loop: no failure is silent
                if self._stopping:
                    return
                self._report(f'internal error in a callback: {type(error).__name__}: {error}')
                self._clock.wait(self._clock.now() + ERROR_PAUSE)


class PeriodicThread:
    """
    Calls ``action`` every ``period`` s of the steady clock, for the first time after one.

    A timer of rclpy would do as well. But each time it is due the executor looks at every service
    of every drive anew: 12 ms of computing for 15 drives, beside an exchange that wants the
    interpreter every 0.3 ms.

    :param failed: takes one line about an exception that ``action`` let escape.
    """

    def __init__(self, name: str, period: float, action: Callable[[], None],
                 failed: Callable[[str], None], clock: Clock) -> None:
        self._period = period
        self._now = clock.now
        self._action = action
        self._failed = failed
        self._changed = clock.alarm()   # an Event costs more than many an action
        self._ending = False
        self._thread = clock.worker(self._run, name)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def set_period(self, period: float) -> None:
        """Begin anew with another period, in s."""
        self._period = period
        self._changed.ring()

    def stop(self) -> None:
        """End, and wait for a call that is under way."""
        self._ending = True
        self._changed.ring()
        self._thread.join(5.0)

    def _run(self) -> None:
        due = self._now() + self._period
        while not self._ending:
            if self._changed.wait(due):
                due = self._now() + self._period
                continue
            try:
                self._action()
            except Exception as error:  # noqa: BLE001  outermost loop of a thread
                self._failed(f'{type(error).__name__}: {error}')
            due = max(due + self._period, self._now())  # never twice to catch up
