# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What stops the drive when the bridge dies.

The drive watches the heartbeat of the bridge (1016h), and acts as its 6007h says. What it watches
by itself is named: life guarding (100Ch, 100Dh), or how long a receive PDO may be missing (1400h
sub-index 5). Without 6007h nobody knows what it does: there are stacks that report 8130h, and go
on moving (Lely core 2.4.0).
"""

from collections.abc import Callable

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.protocols.cia402 import pdo, states
from drive_can_bridge.protocols.cia402.objects import at_object, differs, ObjectAccess
from drive_can_bridge.protocols.cia402.pdo import request_pdos
from drive_can_bridge.protocols.cia402.stop_options import in_words, unknown
from drive_can_bridge.protocols.cia402.transactor import Procedure, Transfer

CONSUMER, GUARD_TIME, LIFE_FACTOR = 0x1016, 0x100C, 0x100D
#: the bridge's heartbeat may be late by so many intervals
WATCH_INTERVALS = 3


class BridgeWatch:
    """
    What watches the bridge on behalf of one drive.

    :param tell: tells people once what the drive lacks (``warning``), or has.
    :ivar slot: sub-index of 1016h by which the drive watches the bridge, written by us; None.
    :ivar text: what stops the drive when the bridge dies, for diagnostics; '': not looked yet.
    """

    def __init__(self, objects: ObjectAccess, drive: DriveConfiguration,
                 tell: Callable[..., None]) -> None:
        self.slot: int | None = None
        self.text = ''
        self._objects, self._options, self._report = objects, drive.options, tell
        self._attempts = drive.parameter_retries + 1
        self._received = request_pdos(drive)
        self._unsure = NOTHING      # why nobody knows whether the drive watches
        self._watching: int | None = None   # sub-index by which it does

    def set_up(self) -> Procedure[None]:
        """Set up what stops the drive when the bridge dies, and learn what does."""
        interval, mapping = self._options.bridge_heartbeat, self._options.mapping
        self._unsure = NOTHING
        if mapping == 'assume':
            self._unknown('mapping: assume')
            return
        slot = None
        if interval > 0.0:
            slot = yield from (self._write_watch if mapping == 'configure' else
                               self._read_watch)(interval)
        self._watching = slot
        yield from self._learn(slot)

    def learn_again(self) -> Procedure[None]:
        """Read what the drive does then once more: users have written it."""
        if self.text and self._options.mapping != 'assume':
            yield from self._learn(self._watching)

    def _learn(self, slot: int | None) -> Procedure[None]:
        guarding, time_out = (yield from self._guarding()), (yield from self._time_out())
        option = yield from self._objects.read(
            states.ABORT_CONNECTION_OPTION, 0, 2, signed=True)
        refused = self._refused(states.ABORT_CONNECTION_OPTION) if option is None else NOTHING
        alone = [each for each in (guarding, time_out) if each]
        for each in alone:
            self._report(each, warning=False)
        if time_out or alone and option != 0:
            self.text = '; '.join(alone)
        elif slot is None and self._unsure:
            self._unknown(self._unsure)
        elif slot is None or option == 0:
            self.text = 'nothing'
            self._report(sentences.nothing_stops())
        elif option is None:
            self._unknown(refused or 'no 6007h')
        else:
            self.text = (f'{in_words(states.ABORT_CONNECTION_OPTION, option)}, by '
                         f'{at_object(CONSUMER, slot)}')
            self._report(unknown(states.ABORT_CONNECTION_OPTION, option))

    def _unknown(self, why: str) -> None:
        self.text = f'not known ({why})'
        self._report(sentences.watch_unknown(why))

    def _refused(self, index: int, subindex: int = 0) -> Sentence:
        """Return why the object that was read last is not known; '' if the drive has none."""
        return NOTHING if self._objects.absent else sentences.object_refused(
            at_object(index, subindex), sdo.describe(self._objects.abort or 0))

    def _guarding(self) -> Procedure[Sentence]:
        """Name life guarding, if that is set."""
        time = (yield from self._objects.read(GUARD_TIME, 0, 2)) or 0
        factor = (yield from self._objects.read(LIFE_FACTOR, 0, 1)) or 0
        return sentences.life_guarding(time * factor) if time * factor else NOTHING

    def _time_out(self) -> Procedure[Sentence]:
        """Name the receive PDO that may be missing for a time only."""
        for each in self._received:
            time = yield from self._objects.read(each.communication, pdo.EVENT_TIMER, 2)
            if time:
                return sentences.pdo_time_out(
                    at_object(each.communication, pdo.EVENT_TIMER), time)
        return NOTHING

    def _watchers(self) -> Procedure[list[int]]:
        count = yield from self._objects.read(CONSUMER, 0, 1)
        if count is None:
            self._unsure = self._refused(CONSUMER)
        found = []
        for subindex in range(1, (count or 0) + 1):
            entry = yield from self._objects.read(CONSUMER, subindex)
            if entry is None:
                self._unsure = self._unsure or self._refused(CONSUMER, subindex)
            found.append(entry or 0)
        return found

    def _write_watch(self, interval: float) -> Procedure[int | None]:
        node = self._options.bridge_node
        entries = yield from self._watchers()
        slots = [place for place, entry in enumerate(entries, 1) if entry >> 16 & 0x7F == node] + [
            place for place, entry in enumerate(entries, 1)
            if not entry >> 16 & 0x7F or not entry & 0xFFFF]
        if not slots:
            return None
        limit = min(round(1000 * WATCH_INTERVALS * interval), 0xFFFF)
        before, self.slot = self.slot, slots[0]   # also where the end comes before the answer
        entry, wanted = entries[slots[0] - 1], node << 16 | limit
        if entry == wanted:     # of a bridge that died: some stacks refuse what is watched already
            return self.slot
        ours = entry >> 16 & 0x7F == node and entry & 0xFFFF > 0
        refusal = yield from self._objects.put(CONSUMER, slots[0], wanted, 4)
        if refusal and ours and not (yield from self._objects.put(CONSUMER, slots[0], 0, 4)):
            ours = False
            refusal = yield from self._objects.put(CONSUMER, slots[0], wanted, 4)
        if refusal:
            self.slot = before
            self._report(refusal)
            return slots[0] if ours else None
        found = yield from self._objects.read(CONSUMER, slots[0])
        if found not in (None, wanted):     # acknowledged, and not taken
            self._report(sentences.object_differs(
                at_object(CONSUMER, slots[0]), f'{found:08X}h', f'{wanted:08X}h'))
            return None
        return self.slot

    def _read_watch(self, interval: float) -> Procedure[int | None]:
        for place, entry in enumerate((yield from self._watchers()), 1):
            if entry >> 16 & 0x7F == self._options.bridge_node and entry & 0xFFFF:
                if entry & 0xFFFF < 2000 * interval:
                    raise differs(sentences.watch_too_short(
                        at_object(CONSUMER, place), entry & 0xFFFF, interval),
                        sentences.maps_to_correct)
                self._report(sentences.watch_stays(at_object(CONSUMER, place)))
                return place
        return None

    def release(self, timeout: float) -> Procedure[None]:
        """End the watch of the drive for the bridge, behind an ordered stop."""
        slot, self.slot = self.slot, None
        if slot is not None:
            yield Transfer(CONSUMER, slot, bytes(4), attempts=self._attempts, timeout=timeout)
