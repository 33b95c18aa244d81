# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The demo in a terminal: a page that is drawn anew five times a second."""

from drive_can_bridge.ros.demo.frame_log import FrameLog
from drive_can_bridge.ros.demo.hints import Hint
from drive_can_bridge.ros.demo.lines import complain_about
from drive_can_bridge.ros.demo.log_lines import LogCapture
from drive_can_bridge.ros.demo.observer import Observer
from drive_can_bridge.ros.demo.screen import Screen
from drive_can_bridge.ros.demo.snapshot import DriveSnapshot, Snapshot, Times
from drive_can_bridge.ros.demo.view import page


class LiveView:
    """
    A page that is drawn anew five times a second.

    It takes standard error from the beginning: what happens during the start belongs to the log.
    """

    period = 0.2

    def __init__(self, place: str) -> None:
        self._place = place
        self._observer: Observer | None = None
        self._hints: list[Hint] = []
        self._last: Snapshot | None = None
        self._screen = Screen()
        self._log = LogCapture()

    def open(self, observer: Observer, told: list[Hint]) -> None:
        """Take the terminal."""
        self._observer = observer
        self._hints = told
        self._screen.open()
        self.show()

    def show(self) -> None:
        """Draw the page."""
        if self._observer is None:
            return
        self._last = self._observer.look()
        width, height = self._screen.size
        self._screen.draw(page(self._last, hints=self._hints, log=self._log.lines,
                               place=self._place, width=width, height=height))

    def close(self) -> None:
        """Give the terminal back, before anything that may take a while."""
        self._screen.close()
        self._log.close()

    def conclude(self, code: int, frame_log: FrameLog | None) -> None:
        """Leave a few lines behind."""
        if code:
            self._log.repeat()
        if self._last is not None:
            width = max([len(drive.name) for drive in self._last.drives] + [0])
            for drive in self._last.drives:
                print(f'{drive.name:{width}}  {_balance(drive)}')
        if frame_log is not None:
            print(f'{frame_log.count} frames in {frame_log.path}')
        complain_about(frame_log)


def _balance(drive: DriveSnapshot) -> str:
    if not drive.exchanges:
        return 'no exchange'
    return (f'{drive.exchanges} exchanges, {drive.missed} missed, '
            f'period error {_in_words(drive.period_error)}, latency {_in_words(drive.latency)}')


def _in_words(times: Times) -> str:
    return f'{1e3 * times.mean:.2f} ms (p99 {1e3 * times.p99:.2f})'
