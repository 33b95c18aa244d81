# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""What a session has to know of the parts that act at times of their own."""

from typing import Protocol


class Part(Protocol):
    """What goes on in a conversation beside other things."""

    def next_timer(self) -> float:
        """Return when ``handle_timer`` has something to do; infinity: not planned."""

    def handle_timer(self, now: float) -> None:
        """Do what is due, which may be nothing."""

    def stop(self) -> None:
        """Plan nothing any more. The channel was cleared."""


class AcyclicPart(Protocol):
    """The acyclic channel."""

    def next_timer(self) -> float:
        """Return when ``advance`` wants to be called."""

    def advance(self, now: float) -> None:
        """Do all that is possible now."""

    def time_lost(self, now: float) -> None:
        """Record that nobody listened until now."""

    def clear(self) -> None:
        """Forget everything under way."""
