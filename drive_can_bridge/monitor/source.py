# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Where a model comes from, as a view sees it, and what may be asked of drives."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from drive_can_bridge.core.parameters import Value


class Source(Protocol):
    """Fills a model; what takes time happens in :meth:`poll`, and is over soon."""

    def poll(self, now: float) -> None:
        """Take what has arrived, and ask for what is missing."""

    def focus(self, *drives: str) -> None:
        """Look at drives closely: all of their samples, and their bits."""

    def glance(self, now: float) -> None:
        """Take the samples of what is looked at closely, and nothing else."""

    def watch(self, wanted: bool) -> None:
        """Ask for samples, or for none: nobody looks at them."""

    @property
    def busy(self) -> bool:
        """Wait for an answer to something: polling soon is worth it."""

    def close(self) -> None:
        """Leave."""


class Stop(Enum):
    """What ends the movement of a drive."""

    QUICK_STOP = 'quick_stop'
    DISABLE = 'disable'


@dataclass(frozen=True, slots=True)
class Outcome:
    """
    What became of a request to a drive.

    :param text: what the bridge or the drive says, in words; may be '' after a success.
    """

    success: bool
    text: str = ''


class Operations(Protocol):
    """
    Asks drives for what a person wants; none of it ever moves one.

    The answer comes in a later :meth:`poll`, in its thread.
    """

    def poll(self, stops: Mapping[str, Collection[Stop]], now: float) -> bool:
        """
        Take the answers that have arrived.

        :param stops: of each drive: their services are kept at hand, so that a stop waits for no
            discovery.
        :return: somebody still waits for an answer.
        """

    def stop(self, drive: str, stop: Stop, done: Callable[[Outcome], None], now: float) -> None:
        """Stop a drive."""

    def write(self, drive: str, name: str, value: Value, done: Callable[[Outcome], None],
              now: float) -> None:
        """Write a parameter of a drive."""

    def read(self, drive: str, names: Sequence[str],
             done: Callable[[Sequence[Value | None]], None], now: float) -> None:
        """Read parameters of a drive; None: could not be read."""
