# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Where a model comes from, as a view sees it."""

from typing import Protocol


class Source(Protocol):
    """Fills a model; what takes time happens in :meth:`poll`, and is over soon."""

    def poll(self, now: float) -> None:
        """Take what has arrived, and ask for what is missing."""

    def focus(self, drive: str | None) -> None:
        """Look at one drive closely: all of its samples, and its bits."""

    def read(self, drive: str, names: list[str]) -> None:
        """Read parameters of a drive over its bus. The last wish counts."""

    def close(self) -> None:
        """Leave."""
