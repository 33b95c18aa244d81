# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What ``record`` and ``decode --live`` have in common: the buses of a file, listened to."""

from collections.abc import Iterator
import math

from drive_can_bridge.cli.command import complain
from drive_can_bridge.clock import Clock, Mailbox
from drive_can_bridge.core.configuration import BridgeConfiguration
from drive_can_bridge.core.record import Record
from drive_can_bridge.exchange.one_master import END_FIRST, Ownership
from drive_can_bridge.trace.channels import labels
from drive_can_bridge.transport.tap import QUEUE_MAX, Tap

#: s between two looks at the clock while nothing arrives
_PATIENCE = 0.05


class Taps:
    """
    All buses of a file, listened to until closed; entries come out in the order they arrived.

    :raises DriveCanError: a bus that cannot be opened.
    """

    def __init__(self, configuration: BridgeConfiguration, clock: Clock) -> None:
        self._now = clock.now
        self._queue: Mailbox[Record] = Mailbox(clock, QUEUE_MAX)
        self.taps: list[Tap] = []
        # nothing is sent: only serial ports, which one process can read, are locked
        self._ownership = Ownership([(bus, ()) for bus in configuration.buses.values()],
                                    'drive_can listening', END_FIRST)
        channels = labels(configuration.buses.values())
        try:
            for bus in configuration.buses.values():
                self.taps.append(Tap(bus, channels[bus.name], self._queue, complain,
                                     clock))
        except BaseException:
            self.close()
            raise

    def records(self, seconds: float) -> Iterator[Record | float]:
        """Yield entries for so long; now and then, while there are none, until when there are."""
        end = self._now() + seconds
        while self._now() < end:
            # asked before the queue: what was heard until then is in it, or was taken out of it
            heard_until = min(tap.heard_until for tap in self.taps)
            try:
                yield self._queue.get(self._now() + _PATIENCE)
            except TimeoutError:
                yield heard_until
        while True:     # what arrived in time
            try:
                yield self._queue.get(-math.inf)
            except TimeoutError:
                return

    def close(self) -> None:
        """Stop listening; say what could not be taken."""
        for tap in self.taps:
            tap.close()
            if tap.lost:
                complain(f'bus {tap.bus.name}: {tap.lost} frames lost: this machine is too slow '
                         f'for the traffic')
        self._ownership.release()
