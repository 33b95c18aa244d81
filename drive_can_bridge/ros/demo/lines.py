# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The demo without a terminal: once a second one line per drive, for people and programs."""

import sys

from drive_can_bridge.ros.demo.frame_log import FrameLog
from drive_can_bridge.ros.demo.hints import Hint
from drive_can_bridge.ros.demo.observer import Observer


class LineWriter:
    """Once a second one line per drive on standard output; the log goes where it always goes."""

    period = 1.0

    def __init__(self, place: str) -> None:
        self._observer: Observer | None = None
        print(f'drive_can demo: {place}', file=sys.stderr, flush=True)

    def open(self, observer: Observer, _: list[Hint]) -> None:
        """Begin."""
        self._observer = observer

    def show(self) -> None:
        """Print the lines of this second, all at once."""
        if self._observer is not None:
            print('\n'.join(self._observer.lines()), flush=True)

    def close(self) -> None:
        """Nothing is in the way of others."""

    def conclude(self, _: int, frame_log: FrameLog | None) -> None:
        """Say what became of the frame log, if it is not what it should be."""
        complain_about(frame_log)


def complain_about(frame_log: FrameLog | None) -> None:
    """Say on standard error that a frame log is not what it should be."""
    if frame_log is not None and frame_log.failure:
        print(f'drive_can demo: {frame_log.path}: incomplete: {frame_log.failure}',
              file=sys.stderr)
