# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""An executor in a thread of its own, which no callback can bring down."""

from collections.abc import Callable
import threading

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import (
    ExternalShutdownException, ShutdownException, SingleThreadedExecutor,
)

#: s between two failures: one that comes at once again must not take the machine
ERROR_PAUSE = 0.05


class ExecutorThread:
    """
    Spins a SingleThreadedExecutor until told to stop.

    :param report: takes one line about an exception that a callback let escape.
    """

    def __init__(self, name: str, report: Callable[[str], None], context: Context) -> None:
        self.executor = SingleThreadedExecutor(context=context)
        self._report = report
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start to serve."""
        self._thread.start()

    def stop(self) -> None:
        """Stop to serve and wait for the callback that is running."""
        self._stopping.set()
        # an executor that is merely woken goes back to waiting for something to do
        self.executor.create_task(_nothing)
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)
        self.executor.shutdown(timeout_sec=1.0)

    def _run(self) -> None:
        while not self._stopping.is_set() and self.executor.context.ok():
            try:
                self.executor.spin_once()
            except (ExternalShutdownException, ShutdownException):
                return
            except InvalidHandle:  # what was to be served is gone: a drive's node, after cleanup
                self._stopping.wait(ERROR_PAUSE)
            except Exception as error:  # noqa: BLE001  outermost loop: no failure is silent
                if self._stopping.is_set():
                    return
                self._report(f'internal error in a callback: {type(error).__name__}: {error}')
                self._stopping.wait(ERROR_PAUSE)


def _nothing() -> None:
    """Be the task that ends the executor's wait."""
