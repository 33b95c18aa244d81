# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Last words: waited for until they are written, unless nobody takes them."""

from collections.abc import Callable
import time

#: s after which nobody takes what is being written
PATIENCE = 2.0
#: s between two looks
MOMENT = 0.05


class Taking:
    """
    Whether somebody takes what a thread writes; a context manager around each single write.

    That a thread has not begun to write says nothing: on a busy machine it has to wait for its
    turn. A write that does not end does.

    :param now: the steady time.
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._since: float | None = None

    def __enter__(self) -> None:
        self._since = self._now()

    def __exit__(self, *_: object) -> None:
        self._since = None

    @property
    def nobody(self) -> bool:
        """What is being written has not been taken for so long that it never will be."""
        since = self._since
        return since is not None and self._now() - since > PATIENCE
