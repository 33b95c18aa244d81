# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A bar on standard error for what takes its time; only in a terminal."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import sys
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

#: s after which a bar appears
PATIENCE = 1.0


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """Say in a terminal what is waited for, as long as that takes."""
    if not sys.stderr.isatty():
        yield
        return
    with Console(stderr=True).status(f'{what} …'):
        yield


class Bar:
    """
    Counts steps.

    :param what: what they are for, ``reading conveyor``.
    :param total: how many there are.
    :param now: the steady time.
    """

    def __init__(self, what: str, total: int, now: Callable[[], float]) -> None:
        self._now = now
        self._what = what
        self._total = total
        self._done = 0
        self._began = self._now()
        self._progress: Progress | None = None

    def __enter__(self) -> 'Bar':
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        if self._progress is not None:
            self._progress.stop()

    def step(self, _: object = None) -> None:
        """Take note of a step."""
        self._done += 1
        if self._progress is None:
            if self._now() - self._began < PATIENCE or not sys.stderr.isatty():
                return
            self._progress = Progress(
                TextColumn('{task.description}'), BarColumn(), MofNCompleteColumn(),
                TimeRemainingColumn(), console=Console(stderr=True), transient=True)
            self._progress.add_task(self._what, total=self._total)
            self._progress.start()
        task, = self._progress.task_ids
        self._progress.update(task, completed=self._done)
