# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Whether the reader of an output takes what is written."""

from collections.abc import Callable

#: s after which the reader of a write counts as hung
PATIENCE = 2.0
#: s between two looks
MOMENT = 0.05


class WriteWatch:
    """
    Whether the reader takes what a thread writes; a context manager around each single write.

    That a thread has not begun to write is no sign: on a busy machine it has to wait for its
    turn. A write that does not end is one, unless the whole process was stalled meanwhile. So the
    time is that which a watcher has seen pass.

    :param now: the steady time.
    :param patience: s after which the reader counts as hung.
    """

    def __init__(self, now: Callable[[], float], patience: float = PATIENCE) -> None:
        self._now = now
        self._patience = patience
        self._write: object | None = None

    def __enter__(self) -> None:
        self._write = object()

    def __exit__(self, *_: object) -> None:
        self._write = None

    def watch(self) -> Callable[[], bool]:
        """
        Return a function that, called every :data:`MOMENT`, returns whether the reader hangs.

        What was not taken for so long never will be.
        """
        watched, seen, looked = self._write, 0.0, self._now()

        def hangs() -> bool:
            nonlocal watched, seen, looked
            now, write = self._now(), self._write
            passed, looked = min(now - looked, 2.0 * MOMENT), now
            seen = seen + passed if write is watched else 0.0
            watched = write
            return write is not None and seen > self._patience
        return hangs
