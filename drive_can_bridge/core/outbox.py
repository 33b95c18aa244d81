# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Frames to be sent, with callbacks for whether they left.

A bus may refuse a frame. What was refused was not sent: it is no stop cycle, no control word, no
write. So nothing counts when a frame is made, but when the driver of the session reports what
happened to it:

.. code-block:: python

    frames = session.take_frames()
    session.frames_left(now, refused={place for place, frame in ... if not sent})
"""

from collections.abc import Callable, Collection

from drive_can_bridge.core.frame import Frame

#: takes (the bus took it, now)
Left = Callable[[bool, float], None]


class Outbox:
    """
    The frames of one session, in order.

    :ivar frames: those that wait. Read after every step, so it is a plain attribute.
    """

    __slots__ = ('_leaving', '_left', 'frames')

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self._left: list[Left | None] = []
        self._leaving: list[Left | None] = []

    def put(self, frame: Frame, left: Left | None = None) -> None:
        """Queue a frame; ``left`` is called with whether it was sent."""
        self.frames.append(frame)
        self._left.append(left)

    def drop(self, unwanted: Callable[[Frame], bool], now: float) -> None:
        """Drop waiting frames that are not to be sent any more: they count as refused."""
        waiting = list(zip(self.frames, self._left))
        self.clear()
        for frame, left in waiting:
            if not unwanted(frame):
                self.put(frame, left)
            elif left is not None:
                left(False, now)

    def take(self) -> list[Frame]:
        """Return the frames to be sent now, in order."""
        frames = self.frames
        if frames:
            self._leaving += self._left
            self.frames, self._left = [], []
        return frames

    def left(self, now: float, refused: Collection[int] = ()) -> None:
        """
        Record which of the frames last taken were sent.

        :param refused: places, in the list last taken, of what the bus did not take.
        """
        leaving, self._leaving = self._leaving, []
        for place, left in enumerate(leaving):
            if left is not None:
                left(place not in refused, now)

    def take_over(self, other: 'Outbox') -> None:
        """Append the frames that wait in another outbox."""
        self.frames += other.frames
        self._left += other._left
        other.clear()

    def clear(self) -> None:
        """Forget frames that were not fetched; their sender is about to forget them, too."""
        self.frames.clear()
        self._left.clear()
