# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What values were a moment ago, and how fast counters count."""

from collections import deque
import math

#: s that a history reaches back
SPAN = 60.0
_POINTS_MAX = 1200


class History:
    """The last values of one quantity with their times."""

    def __init__(self) -> None:
        self._points: deque[tuple[float, float]] = deque(maxlen=_POINTS_MAX)

    def add(self, value: float, now: float) -> None:
        """Take a value; what is not finite leaves a gap."""
        points = self._points
        while points and now - points[0][0] > SPAN:
            points.popleft()
        if math.isfinite(value):
            points.append((now, value))

    def points(self, now: float) -> tuple[tuple[float, float], ...]:
        """Return (s ago, value), oldest first."""
        return tuple((now - at, value) for at, value in self._points if now - at <= SPAN)


def columns(points: tuple[tuple[float, float], ...], span: float, count: int,
            ) -> tuple[float | None, ...]:
    """
    Put points into columns of equal time, the newest on the right; None where there is no point.

    A gap of one column between two points is closed: it says no more than that both were looked at
    a little late.
    """
    found: list[float | None] = [None] * count
    for age, value in points:
        # the right end is half a column ahead, so that a point of this moment has a place
        place = count - 1 - int(age / span * count)
        if 0 <= place < count:
            found[place] = value
    for place in range(1, count - 1):
        if found[place] is None and found[place + 1] is not None:
            found[place] = found[place - 1]
    if count > 1 and found[-1] is None:
        found[-1] = found[-2]
    return tuple(found)


class Rate:
    """How fast a counter counts, from its last two looks."""

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        self.value = 0.0

    def went_back(self, count: float) -> bool:
        """Tell whether a count is less than the last: whoever counts has begun anew."""
        return self._last is not None and count < self._last[1]

    def update(self, count: float, at: float) -> None:
        """
        Take a count.

        :param at: s, of whatever clock; a clock or a counter that went back begins anew.
        """
        if self._last is not None:
            since, before = self._last
            if at > since and count >= before:
                self.value = (count - before) / (at - since)
            elif at == since:
                return
            else:
                self.value = 0.0
        self._last = (at, count)
