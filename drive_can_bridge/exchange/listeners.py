# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whom an exchange tells what happens on its bus."""

from typing import Protocol

from drive_can_bridge.core.events import Event, ProcessDataReceived


class DriveListener:
    """
    What an exchange tells the owner of a drive, who does nothing about what it leaves out.

    Every call comes with the bus lock held, from the reader or timer thread or from the thread
    that called the exchange: it has to be short and must not call back into the exchange.
    """

    def take_commands(self, now: float) -> None:
        """Hand the newest setpoint commands to the session: a cycle may be due."""

    def discard_commands(self, why: str) -> None:
        """
        Throw away commands that are waiting: they are stale.

        :param why: in words; '' where nobody has to be told.
        """

    def process_data(self, event: ProcessDataReceived) -> None:
        """Publish a sample. The fast path."""

    def request_sent(self, now: float) -> None:
        """Publish what the drive was told last: it changed, or a second has passed."""

    def handle_event(self, event: Event) -> None:
        """Publish or log anything else."""


class BusListener(Protocol):
    """What an exchange tells about its bus; from the reader or timer thread, lock not held."""

    def bus_opened(self, bus: str) -> None:
        """Record that the bus is there (again)."""

    def bus_lost(self, bus: str, reason: str) -> None:
        """Record that the bus is gone, or could not be opened."""

    def fatal(self, bus: str, reason: str, *, misconfigured: bool) -> None:
        """End the bridge: the exchange cannot go on."""
