# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a link needs of an open bus."""

from abc import ABC, abstractmethod
from collections.abc import Callable

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport.error_frames import BusError, ERROR_ACTIVE


#: what is told of an adapter that does not take what it was handed
REFUSED_FRAMES = 'the adapter refuses frames'


class EndPoint(ABC):
    """
    One open bus. Whatever an end point has no means to count stays 0.

    :ivar age: s between the reception of the last received frame and the return of ``receive``.
    :ivar error_frames: error frames seen.
    :ivar last_error: the last of them that asks for something to be done; None: there was none.
    :ivar controller: state of the controller as far as it tells, '' while all is well.
    :ivar rejected_frames: what arrived and is of no use.
    :ivar error_witness: sees the identifier and data of every error frame; None: nobody does.
    """

    def __init__(self) -> None:
        self.age = 0.0
        self.error_frames = 0
        self.rejected_frames = 0
        self.last_error: BusError | None = None
        self.controller = ERROR_ACTIVE
        self.bus_off_count = 0
        self.error_witness: Callable[[int, bytes], None] | None = None

    @abstractmethod
    def receive(self, timeout: float) -> Frame | None:
        """
        Wait for a frame.

        :param timeout: s.
        :return: a data frame, or None after the time-out or when something else came.
        :raises BusUnavailable: the bus is lost, or its controller went bus-off.
        """

    @abstractmethod
    def send(self, frame: Frame, timeout: float) -> None:
        """
        Hand a frame to the adapter.

        :param timeout: s to wait for room in the adapter's queue.
        :raises TransportError: this frame was not sent, but the bus is still there (queue full).
        :raises BusUnavailable: the bus is lost.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the bus. Never raises."""

    @property
    def has_room(self) -> bool | None:
        """A frame could be sent now; None: this adapter does not tell."""
        return None

    @property
    def refused_frames(self) -> int:
        """Frames that the adapter refused after it had been handed them, where it tells."""
        return 0

    @property
    def overflowed_frames(self) -> int:
        """Received frames that were lost because nobody took them in time, where it is known."""
        return 0
