# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Something done again and again, without waking an executor."""

from collections.abc import Callable

from drive_can_bridge.clock import Clock


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
