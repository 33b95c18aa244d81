# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A drive that runs on although it shall not: for how long, and whether people were told."""

import math

from drive_can_bridge.core.sentences import NOTHING

#: s that a drive may go on running under ``disable`` at least until that is told
RUNNING_ON_MAX = 1.0


class Disregard:
    """
    Notice that something lasts.

    :param timeout: s that a caller of a stop waits, ramps included: it may last so long.
    :ivar text: what people were told of it; '': nothing.
    """

    def __init__(self, timeout: float) -> None:
        self.text = NOTHING
        self._longest = max(RUNNING_ON_MAX, timeout)
        self._since = math.inf

    def lasts(self, now: float, *, so: bool) -> bool:
        """Record whether it is so now; tell whether it is to be told."""
        if not so:
            self.forget()
            return False
        self._since = min(self._since, now)
        return not self.text and now - self._since > self._longest

    def forget(self) -> None:
        """Record that it is over."""
        self._since, self.text = math.inf, NOTHING
