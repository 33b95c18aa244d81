# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A CAN bus in memory: one frame at a time, in the order in which they were handed to it."""

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
import math

import can
from jumping import EPOCH, JumpingClock

from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import BusUnavailable, TransportError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.transport.end_point import EndPoint

#: bits of a frame beside its data, with some that are stuffed
OVERHEAD = 80
#: bit/s of the buses of a story
BITRATE = 1_000_000


class Wire:
    """
    What connects the ends of a bus.

    :param bitrate: bit/s; 0: frames take no time.
    :ivar frames: all there were: when, and which.
    :ivar down: why nobody has the bus at the moment; '' while all is well.
    :ivar full: nobody acknowledges, and nothing leaves.
    """

    def __init__(self, clock: JumpingClock, bitrate: int = 0) -> None:
        self.clock = clock
        self.ends: list[End] = []
        self.frames: list[tuple[float, Frame]] = []
        self.watchers: list[Callable[[Frame], None]] = []
        self.down = ''
        self.full = False
        self._bit = 1.0 / bitrate if bitrate else 0.0
        self._free_at = 0.0

    def carry(self, frame: Frame, sender: 'End | None' = None) -> None:
        """Carry a frame to everybody else."""
        now = self.clock.now()
        self._free_at = max(self._free_at, now) + self._bit * (OVERHEAD + 8 * len(frame.data))
        self.frames.append((self._free_at, frame))
        for watch in self.watchers:
            watch(frame)
        for end in self.ends:
            if end is not sender:
                end.arrive(self._free_at, frame)

    def lose(self, reason: str = 'unplugged') -> None:
        """Take the bus away."""
        self.down = reason
        for end in self.ends:
            end.wake_event.ring()

    def restore(self) -> None:
        """Give it back."""
        self.down = ''


class End(EndPoint):
    """
    One that is connected to it.

    :ivar witness: sees every message that arrives, as that of a port does.
    """

    def __init__(self, wire: Wire, routes: Sequence[Route] = ()) -> None:
        super().__init__()
        self.punctual = self.host_stamps = True
        self.witness: Callable[[can.Message], None] | None = None
        if wire.down:
            raise BusUnavailable(wire.down)
        self.wake_event = wire.clock.wake_event()
        self._wire = wire
        self._routes = routes
        self._coming: deque[tuple[float, Frame]] = deque()
        wire.ends.append(self)

    def arrive(self, at: float, frame: Frame) -> None:
        """Let a frame come in."""
        if not self._routes or any(route.matches(frame) for route in self._routes):
            self._coming.append((at, frame))
            self.wake_event.ring()

    def receive(self, timeout: float) -> Frame | None:
        """Wait for a frame."""
        clock = self._wire.clock
        until = clock.now() + timeout
        while True:
            if self._wire.down:
                raise BusUnavailable(self._wire.down)
            due = self._coming[0][0] if self._coming else math.inf
            if due <= clock.now():
                at, frame = self._coming.popleft()
                self.age = clock.now() - at
                if self.witness is not None:
                    self.witness(can.Message(
                        timestamp=1e-9 * EPOCH + at, arbitration_id=frame.identifier,
                        is_extended_id=frame.extended, data=frame.data))
                return frame
            if clock.now() >= until:
                return None
            self.wake_event.wait(min(due, until))

    def send(self, frame: Frame, timeout: float) -> None:
        """Hand a frame over."""
        if self._wire.down:
            raise BusUnavailable(self._wire.down)
        if self._wire.full:
            raise TransportError('the transmit queue is full')
        self._wire.carry(frame, self)

    def close(self) -> None:
        """Leave."""
        if self in self._wire.ends:
            self._wire.ends.remove(self)

    @property
    def has_room(self) -> bool | None:
        """A frame could be sent now."""
        return not self._wire.full


class Wires:
    """
    The buses of a story, by channel; opens them in place of python-can.

    :param see: takes channel and frame of all that is sent.
    """

    def __init__(self, clock: JumpingClock, see: Callable[[str, Frame], None]) -> None:
        self._clock = clock
        self._see = see
        self._wires: dict[str, Wire] = {}

    def of(self, channel: str) -> Wire:
        """Return the wire of a channel."""
        if channel not in self._wires:
            self._wires[channel] = wire = Wire(self._clock, BITRATE)
            wire.watchers.append(partial(self._see, channel))
        return self._wires[channel]

    def open(self, bus: BusConfiguration, clock: object = None, routes: Sequence[Route] = (),
             *, stations: int = 0) -> End:
        """Open a bus; as :func:`drive_can_bridge.transport.port.open_port`."""
        return End(self.of(str(bus.channel)), routes)
