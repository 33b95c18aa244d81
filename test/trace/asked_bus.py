# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A bus that is asked, by a scan or for the keys of a drive, and its own time."""

from collections import deque
from collections.abc import Callable, Iterable

from drive_can_bridge.cli import main as front_end
from drive_can_bridge.core.errors import TransportError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport.end_point import EndPoint


class AskedBus(EndPoint):
    """
    A bus with devices that answer at once, and a clock of its own.

    :param device: says what is answered to a frame.
    :ivar sent: what was sent, :ivar times: and when.
    :ivar arriving: what is heard next.
    :ivar late: what has come, and is heard next, when this process has stood still in its next
        look, for ``stall`` s; where that is not 0, answers come so.
    """

    def __init__(self, device: Callable[[Frame], Iterable[Frame]]) -> None:
        super().__init__()
        self._device = device
        self.now = 0.0
        self.sent: list[Frame] = []
        self.times: list[float] = []
        self.arriving: deque[Frame] = deque()
        self.late: list[Frame] = []
        self.stall = 0.0

    def clock(self) -> float:
        return self.now

    def receive(self, timeout: float) -> Frame | None:
        if self.arriving:
            self.now += 0.001
            return self.arriving.popleft()
        if self.late and timeout:
            self.now += self.stall
            self.arriving.extend(self.late)
            self.late.clear()
            return None
        self.now += max(timeout, 1e-4)
        return None

    def send(self, frame: Frame, timeout: float) -> None:
        self.sent.append(frame)
        self.times.append(self.now)
        (self.late if self.stall else self.arriving).extend(self._device(frame))

    def close(self) -> None:
        pass


def takes_nothing(frame: Frame) -> list[Frame]:
    """Fail, as a bus on which nobody acknowledges."""
    raise TransportError('send: transmit queue full')


def drive_can(*arguments: object) -> int:
    """Do what a user types."""
    return front_end.main([str(argument) for argument in arguments])
