# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Something done again and again, without waking an executor."""

from collections.abc import Callable
import threading

from drive_can_bridge.exchange.alarm import Alarm
from drive_can_bridge.transport.clock import steady_now


class PeriodicThread:
    """
    Calls ``action`` every ``period`` s of the steady clock, for the first time after one.

    A timer of rclpy would do as well. But each time it is due the executor looks at every service
    of every drive anew: 12 ms of computing for 15 drives, beside an exchange that wants the
    interpreter every 0.3 ms.

    :param failed: takes one line about an exception that ``action`` let escape.
    """

    def __init__(self, name: str, period: float, action: Callable[[], None],
                 failed: Callable[[str], None]) -> None:
        self._period = period
        self._action = action
        self._failed = failed
        self._changed = Alarm()     # an Event costs more than many an action
        self._ending = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

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
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        due = steady_now() + self._period
        while not self._ending:
            if self._changed.sleep(due - steady_now()):
                due = steady_now() + self._period
                continue
            try:
                self._action()
            except Exception as error:  # noqa: BLE001  outermost loop of a thread
                self._failed(f'{type(error).__name__}: {error}')
            due = max(due + self._period, steady_now())  # never twice to catch up
