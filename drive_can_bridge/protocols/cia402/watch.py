# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Who watches the bridge, so that the drive stops by itself when the bridge dies."""

from collections.abc import Callable, Generator

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.messages import Sentence
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.protocols.cia402.channel import Ask, Reply
from drive_can_bridge.protocols.cia402.objects import at_object, differs, Objects, Procedure

CONSUMER = 0x1016
#: the bridge's heartbeat may be late by so many intervals
WATCH_INTERVALS = 3


class Watch:
    """
    What watches the bridge on behalf of one drive.

    :param tell: tells people once what the drive lacks.
    :ivar slot: sub-index of 1016h by which the drive watches the bridge, written by us; None.
    """

    def __init__(self, objects: Objects, drive: DriveConfiguration,
                 tell: Callable[[Sentence], None]) -> None:
        self.slot: int | None = None
        self._objects, self._options, self._tell = objects, drive.options, tell
        self._attempts = drive.parameter_retries + 1

    def set_up(self) -> Procedure:
        """Have the drive stop by itself when the bridge dies."""
        interval, mapping = self._options.bridge_heartbeat, self._options.mapping
        if mapping == 'assume':
            self._tell(sentences.watch_unknown())
            return
        slot = None
        if interval > 0.0:
            slot = yield from (self._write_watch if mapping == 'configure' else
                               self._read_watch)(interval)
        option = (yield from self._objects.read(states.ABORT_CONNECTION_OPTION, 0, 2)) \
            if slot is not None else 0
        if option == 0:
            self._tell(sentences.nothing_stops())

    def _watchers(self) -> Generator[Ask, Reply, list[int]]:
        count = yield from self._objects.read(CONSUMER, 0, 1)
        found = []
        for subindex in range(1, (count or 0) + 1):
            found.append((yield from self._objects.read(CONSUMER, subindex)) or 0)
        return found

    def _write_watch(self, interval: float) -> Generator[Ask, Reply, 'int | None']:
        node = self._options.bridge_node
        entries = yield from self._watchers()
        slots = [place for place, entry in enumerate(entries, 1) if entry >> 16 & 0x7F == node] + [
            place for place, entry in enumerate(entries, 1)
            if not entry >> 16 & 0x7F or not entry & 0xFFFF]
        if not slots:
            return None
        limit = min(round(1000 * WATCH_INTERVALS * interval), 0xFFFF)
        before, self.slot = self.slot, slots[0]   # also where the end comes before the answer
        refusal = yield from self._objects.put(CONSUMER, slots[0], node << 16 | limit, 4)
        if refusal:
            self.slot = before
            self._tell(refusal)
            return None
        return self.slot

    def _read_watch(self, interval: float) -> Generator[Ask, Reply, 'int | None']:
        for place, entry in enumerate((yield from self._watchers()), 1):
            if entry >> 16 & 0x7F == self._options.bridge_node and entry & 0xFFFF:
                if entry & 0xFFFF < 2000 * interval:
                    raise differs(sentences.watch_too_short(
                        at_object(CONSUMER, place), entry & 0xFFFF, interval),
                        sentences.maps_to_correct)
                self._tell(sentences.watch_stays(at_object(CONSUMER, place)))
                return place
        return None

    def release(self, timeout: float) -> Procedure:
        """Have the drive watch the bridge no more, behind an ordered stop."""
        slot, self.slot = self.slot, None
        if slot is not None:
            yield Ask(CONSUMER, slot, bytes(4), attempts=self._attempts, timeout=timeout)
