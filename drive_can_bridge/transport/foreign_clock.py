# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""How old a frame is by the stamp of a clock that is not the host's."""

from collections import deque
import math

#: s for which a figure counts: in so long, clocks of the field drift by a millisecond at most
_WINDOW = 10.0


class ForeignClock:
    """
    The clock of an adapter, or of the computer behind a gateway.

    Its start is not known, and it drifts. The frame that took least from stamp to arrival in
    the last 10 s counts as one that took no time: of the others it is known how much longer they
    took, which is how old they are.
    """

    def __init__(self) -> None:
        self._last = -math.inf
        # arrival, and what the clock was behind then: from the smallest of them on, rising
        self._behind: deque[tuple[float, float]] = deque()

    def age(self, stamp: float, arrival: float, *, waited: bool) -> float:
        """
        Return how old a frame is, in s.

        :param stamp: by that clock; 0 or less: it has none.
        :param arrival: steady, in s.
        :param waited: it was not there when the one before it had been taken.
        """
        if not 0.0 < stamp < math.inf:
            return 0.0
        if stamp < self._last or waited and stamp == self._last:    # set, or it stands still
            self._behind.clear()
        self._last = stamp
        known, behind = self._behind, arrival - stamp
        while known and known[-1][1] >= behind:
            known.pop()
        known.append((arrival, behind))
        while known[0][0] < arrival - _WINDOW:
            known.popleft()
        return behind - known[0][1]
