# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The package ``durand`` on the bench (``clocked/``): its node, on a wire, by the clock of the bench.

Network and scheduler are those two that it asks its users for; its services are its own.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
import math
from typing import Any

from bus import End
from world import World

from drive_can_bridge.core.frame import Frame


@dataclass(order=True)
class Entry:
    """Something that is done later."""

    due: float
    do: Callable[[], object] = field(compare=False)


class Wiring:
    """A network and a scheduler of durand; one thread reads frames, and does what is due."""

    def __init__(self, world: World, channel: str) -> None:
        self._clock = world.clock
        self._end = End(world.wires.of(channel))
        self._heard: dict[int, Callable[[int, bytes], None]] = {}
        self._entries: list[Entry] = []
        self._thread = self._clock.worker(self._run, 'durand')
        self._thread.start()

    # -- network ----------------------------------------------------------------------------------

    def add_subscription(self, cob_id: int, callback: Callable[[int, bytes], None]) -> None:
        self._heard[cob_id] = callback

    def remove_subscription(self, cob_id: int) -> None:
        self._heard.pop(cob_id)

    def send(self, cob_id: int, msg: bytes) -> None:
        self._end.send(Frame(cob_id, bytes(msg), False), 0.0)

    # -- scheduler --------------------------------------------------------------------------------

    def add(self, delay: float, callback: Any, args: Any = (), kwargs: Any = None) -> Entry:
        entry = Entry(self._clock.now() + delay, lambda: callback(*args, **(kwargs or {})))
        self._entries.append(entry)
        self._end.wake_event.ring()
        return entry

    def cancel(self, entry: Entry) -> None:
        if entry in self._entries:
            self._entries.remove(entry)

    # -- both -------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            now = self._clock.now()
            due = min(self._entries, default=Entry(math.inf, int))
            if due.due <= now:
                self._entries.remove(due)
                due.do()
            elif (frame := self._end.receive(due.due - now)) is not None and (
                    frame.identifier in self._heard):
                self._heard[frame.identifier](frame.identifier, frame.data)
