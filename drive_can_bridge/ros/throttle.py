# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Warnings that repeat: the first one at once, the rest counted."""

from collections.abc import Callable
import math
import threading
import time

#: s in which a topic is logged once
QUIET_PERIOD = 5.0
#: distinct topics remembered; more are forgotten, oldest first
TOPICS_MAX = 256


class Throttle:
    """
    Pass on the first warning of each topic, then at most one every five seconds.

    What was held back is counted and said with the next one: nothing is lost silently. Called from
    any thread.
    """

    def __init__(self, emit: Callable[[str], None],
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._emit = emit
        self._clock = clock
        self._topics: dict[str, tuple[float, int]] = {}
        self._lock = threading.Lock()

    def __call__(self, topic: str, text: str, *, once: bool = False) -> None:
        """
        Log or count one warning.

        :param once: never again, until :meth:`reset`.
        """
        with self._lock:
            now = self._clock()
            quiet_until, held_back = self._topics.get(topic, (0.0, 0))
            if now < quiet_until:
                self._topics[topic] = (quiet_until, held_back + 1)
                return
            self._topics.pop(topic, None)
            self._topics[topic] = (math.inf if once else now + QUIET_PERIOD, 0)
            if len(self._topics) > TOPICS_MAX:
                self._topics.pop(next(iter(self._topics)))
        self._emit(f'{text} (and {held_back} more like it)' if held_back else text)

    def reset(self) -> None:
        """Forget everything: the next warning of each topic is logged at once."""
        with self._lock:
            self._topics.clear()
