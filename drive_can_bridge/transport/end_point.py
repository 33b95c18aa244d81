# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The interface of an open bus, as a link uses it."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from operator import add, sub
from typing import NamedTuple

from drive_can_bridge.compiled import mypyc_attr
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.transport.error_frames import BusError, ERROR_ACTIVE

# s for what has arrived already, and looks in a row in which nothing is found: an adapter's own
# answers stand between the frames.
_CATCH_UP, _EMPTY_LOOKS = 0.1, 8


def arrived(receive: Callable[[float], Frame | None], now: Callable[[], float]) -> Iterator[Frame]:
    """
    Yield the frames that have arrived already.

    Who concludes something from silence asks for them first: a process that did not run meanwhile
    has not looked.

    :param receive: of an end point.
    :param now: the steady time.
    """
    end, empty = now() + _CATCH_UP, 0
    while empty < _EMPTY_LOOKS and now() < end:
        frame = receive(0.0)
        if frame is None:
            empty += 1
        else:
            empty = 0
            yield frame


class Counts(NamedTuple):
    """
    The counts of a bus's errors, as far as its adapter reports them. Can be added and subtracted.

    :param error_frames: seen.
    :param bus_off: how often the controller went bus-off.
    :param overflowed: received frames that were lost because they were not fetched in time.
    :param refused: frames that the adapter refused after it had accepted them.
    """

    error_frames: int = 0
    bus_off: int = 0
    overflowed: int = 0
    refused: int = 0

    def plus(self, other: 'Counts') -> 'Counts':
        """Return the sums."""
        return Counts(*map(add, self, other))

    def minus(self, other: 'Counts') -> 'Counts':
        """Return the differences."""
        return Counts(*map(sub, self, other))


@mypyc_attr(allow_interpreted_subclasses=True)
class EndPoint(ABC):
    """
    One open bus. Whatever an end point has no means to count stays 0.

    :ivar age: s between the reception of the last received frame and the return of ``receive``.
    :ivar punctual: ``receive`` ends when its time-out does, to well below a millisecond.
    :ivar host_stamps: what a witness gets is stamped by this machine, when it arrived.
    :ivar error_frames: error frames seen.
    :ivar last_error: the last of them that asks for something to be done; None: there was none.
    :ivar controller: state of the controller as far as it is reported, '' while all is well.
    :ivar rejected_frames: what arrived and is of no use.
    :ivar tell: logs what people should know of it, once each; None: not logged.
    :ivar error_witness: called with the identifier and data of every error frame; None: not
        called.
    """

    def __init__(self) -> None:
        self.age = 0.0
        self.punctual = False
        self.host_stamps = False
        self.error_frames = 0
        self.rejected_frames = 0
        self.last_error: BusError | None = None
        self.controller = ERROR_ACTIVE
        self.bus_off_count = 0
        self.error_witness: Callable[[int, bytes], None] | None = None
        self.tell: Callable[[str], None] | None = None

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
        Pass a frame to the adapter.

        :param timeout: s to wait for room in the adapter's queue.
        :raises TransportError: this frame was not sent, but the bus is still there (queue full).
        :raises BusUnavailable: the bus is lost.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the bus. Never raises."""

    @property
    def has_room(self) -> bool | None:
        """Whether a frame could be sent now; None: this adapter does not report it."""
        return None

    @property
    def counts(self) -> Counts:
        """The counts since it was opened."""
        return Counts(self.error_frames, self.bus_off_count)
