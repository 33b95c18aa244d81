# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The feed of the panel: one model for all browsers, polled a few times a second.

Everything happens in the thread of the web server, between two of its requests: no locks.
"""

import asyncio
from collections.abc import Callable, Iterable, Sequence
import logging
from typing import TypeVar

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.monitor.model import CONTROL_STATE, Model
from drive_can_bridge.monitor.snapshot import (
    DriveSnapshot, ModelSource, OperationOutcome, Operations, Snapshot, StopAction)

#: s between two polls, and while an answer is awaited
PERIOD = 0.5
_WAITING_PERIOD = 0.02
#: between two samples of what a chart may show
_GLANCE_PERIOD = 0.1

_LOG = logging.getLogger('drive_can_panel')
Result = TypeVar('Result')


class View:
    """
    A page in a browser.

    :param update: shows a snapshot.
    :param focus: drives that it shows closely.
    """

    def __init__(self, update: Callable[[Snapshot], None], focus: Iterable[str] = ()) -> None:
        self.update = update
        self.focus = frozenset(focus)


class Feed:
    """
    Polls the model, and updates the pages.

    :param model: filled by ``source``.
    """

    def __init__(self, source: ModelSource, operations: Operations, model: Model,
                 clock: Clock) -> None:
        self._clock = clock
        self._source = source
        self._operations = operations
        self._model = model
        self._views: set[View] = set()
        self._wake = asyncio.Event()
        self._due = 0.0
        self.snapshot = Snapshot()

    async def run(self) -> None:
        """Poll for ever."""
        while True:
            pause = PERIOD
            try:
                pause = self._turn(self._clock.now())
            except Exception as error:  # noqa: BLE001  whatever it is, others want to see and stop
                _LOG.error('%s: %s', type(error).__name__, error)
            self._wake.clear()
            try:
                await asyncio.wait_for(self._wake.wait(), pause)
            except (asyncio.TimeoutError, TimeoutError):
                continue
            self._due = min(self._due, self._clock.now() + _WAITING_PERIOD)

    def _turn(self, now: float) -> float:
        """Do what is due; return s until the next time."""
        self._source.watch(bool(self._views))
        closely = frozenset().union(*(view.focus for view in self._views))
        self._source.focus(*closely)
        waiting = self._operations.poll(
            {**dict.fromkeys(self.snapshot.unheard, (StopAction.QUICK_STOP,)),
             **{drive.name: stops(drive) for drive in self.snapshot.drives}}, now)
        if now >= self._due:
            self._due = now + PERIOD
            self._look(now)
        elif self._source.busy:
            self._source.poll(now)
        elif closely:
            self._source.glance(now)
        if waiting:
            return _WAITING_PERIOD
        pause = max(0.0, self._due - self._clock.now())
        return min(pause, _GLANCE_PERIOD) if closely or self._source.busy else pause

    def _look(self, now: float) -> None:
        self._source.poll(now)
        self.snapshot = self._model.look(now, 1e-9 * self._clock.stamp())
        for view in list(self._views):
            try:
                view.update(self.snapshot)
            except Exception as error:  # noqa: BLE001  a page that cannot be shown is no other's
                self.hide(view)
                _LOG.error('a page was given up: %s: %s', type(error).__name__, error)

    def show(self, view: View) -> None:
        """Update a page from now on, and at once."""
        self._views.add(view)
        self._wake.set()

    def hide(self, view: View) -> None:
        """Stop updating a page."""
        self._views.discard(view)

    # -- operations -------------------------------------------------------------------------------

    def drive(self, name: str) -> DriveSnapshot | None:
        """Return a drive by its full name."""
        return self.snapshot.drive(name)

    async def stop(self, drive: DriveSnapshot, stop: StopAction) -> OperationOutcome:
        """Stop a drive; return the outcome."""
        if stop not in stops(drive):
            return OperationOutcome(False, command_sentences.no_word_to_disable())
        return await self._stop(drive.name, stop)

    async def stop_all(self) -> list[tuple[str, OperationOutcome]]:
        """Stop all drives at once, whether their bridges report them or not; by full name."""
        names = [*(drive.name for drive in self.snapshot.drives), *self.snapshot.unheard]
        outcomes = await asyncio.gather(*(self._stop(name,
                                                     StopAction.QUICK_STOP) for name in names))
        return list(zip(names, outcomes))

    async def _stop(self, drive: str, stop: StopAction) -> OperationOutcome:
        return await self._told(lambda done: self._operations.stop(
            drive, stop, done, self._clock.now()))

    async def write(self, drive: str, name: str, value: Value) -> OperationOutcome:
        """Write a parameter; return the outcome."""
        return await self._told(lambda done: self._operations.write(
            drive, name, value, done, self._clock.now()))

    async def read(self, drive: str, names: Sequence[str]) -> None:
        """Read parameters of a drive into the model."""
        found: Sequence[Value | None] = await self._told(lambda done: self._operations.read(
            drive, names, done, self._clock.now()))
        now = self._clock.now()
        self._model.read(drive, zip(names, found), now)
        self.snapshot = self._model.look(now, 1e-9 * self._clock.stamp())

    async def _told(self, ask: Callable[[Callable[[Result], None]], None]) -> Result:
        future: asyncio.Future[Result] = asyncio.get_running_loop().create_future()

        def done(result: Result) -> None:
            if not future.done():
                future.set_result(result)
        ask(done)
        self._wake.set()
        return await future


def stops(drive: DriveSnapshot) -> tuple[StopAction, ...]:
    """Return the stop actions of a drive: quick stop each, disable those with a control word."""
    return tuple(StopAction) if CONTROL_STATE in drive.facts else (StopAction.QUICK_STOP,)
