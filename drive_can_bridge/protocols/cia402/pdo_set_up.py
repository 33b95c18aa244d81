# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""PDOs of a drive as they are set up: compared, written where they differ, compared again."""

from collections.abc import Callable, Iterable

from drive_can_bridge.core import sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.messages import NOTHING, Sentence
from drive_can_bridge.protocols.canopen import sdo
from drive_can_bridge.protocols.cia402 import pdo
from drive_can_bridge.protocols.cia402.objects import at_object, differs, ObjectAccess
from drive_can_bridge.protocols.cia402.pdo import Pdo, request_pdos, response_pdos, same_mapping
from drive_can_bridge.protocols.cia402.transactor import Procedure


class PdoSetUp:
    """
    The PDOs of one drive.

    :param may_write: ends the set-up where what differs is not to be written.
    :param tell: tells people once what the drive lacks.
    """

    def __init__(self, objects: ObjectAccess, drive: DriveConfiguration,
                 may_write: Callable[[Sentence], None], tell: Callable[[Sentence], None]) -> None:
        self._objects, self._drive, self._options = objects, drive, drive.options
        self._received, self._sent = request_pdos(drive), response_pdos(drive)
        self._synchronous: bool = drive.options.transmission == 'sync'
        self._may_write, self._report = may_write, tell

    def set_up(self) -> Procedure[None]:
        """Compare them with the configuration, and write what differs, if that is wanted."""
        for wanted in self._received:
            yield from self._check(wanted, transmit=False)
        for wanted in self._sent:
            yield from self._check(wanted, transmit=True)
        if self._options.mapping == 'configure':
            yield from self._close(pdo.RPDO_COMMUNICATION, self._received)
            yield from self._close(pdo.TPDO_COMMUNICATION, self._sent)

    def _check(self, wanted: Pdo, *, transmit: bool) -> Procedure[None]:
        """Compare one PDO; write it where it differs, and compare again."""
        difference, identifier = yield from self._compare(wanted, transmit=transmit)
        if difference:
            self._may_write(difference)
            refusal = yield from self._write(wanted, identifier, transmit=transmit)
            difference, _ = yield from self._compare(wanted, transmit=transmit, written=True)
            if refusal and difference:
                raise differs(refusal.also(meant=difference), sentences.maps_fixed)
            if difference:
                raise differs(difference, sentences.maps_not_kept)

    def _types(self, *, transmit: bool) -> tuple[int, ...]:
        event = pdo.EVENT_PROFILE, pdo.EVENT_MAKER
        if not self._synchronous:
            return event
        return (pdo.SYNCHRONOUS,) if transmit else (pdo.SYNCHRONOUS, *event)

    def _compare(self, wanted: Pdo, *, transmit: bool, written: bool = False,
                 ) -> Procedure[tuple[Sentence, int]]:
        """
        Return what differs, and the COB-ID as it is.

        :param written: it was just written, and any of the types that are tried will do.
        """
        at = wanted.communication
        identifier = yield from self._objects.read(at, pdo.COB_ID)
        if identifier is None and not self._objects.absent:
            raise differs(sentences.object_refused(
                at_object(at, pdo.COB_ID), sdo.describe(self._objects.abort or 0)))
        if identifier is None:
            raise differs(sentences.no_such_pdo('TPDO' if transmit else 'RPDO', wanted.number))
        if identifier & ~pdo.NO_REMOTE != wanted.identifier:
            return _difference(at, pdo.COB_ID, identifier, wanted.identifier), identifier
        kind = yield from self._objects.read(at, pdo.TRANSMISSION, 1)
        types = self._types(transmit=transmit)
        judged = transmit or self._options.mapping == 'configure'
        if judged and kind not in (types if written or transmit else types[:1]):
            return _difference(at, pdo.TRANSMISSION, kind or 0, types[0]), identifier
        difference = yield from self._other_content(wanted)
        if difference:
            return difference, identifier
        if transmit and self._options.mapping == 'configure' and not written:
            for subindex, value in self._timers():
                time = yield from self._objects.read(at, subindex, 2)
                if time is not None and time != value:
                    return _difference(at, subindex, time, value), identifier
        return NOTHING, identifier

    def _other_content(self, wanted: Pdo) -> Procedure[Sentence]:
        """Return in what a PDO holds something else, by its meaning."""
        mapping, needed = wanted.communication + pdo.MAPPING_OFFSET, len(wanted.entries)
        count = yield from self._objects.read(mapping, 0, 1)
        if count is None:
            return sentences.object_refused(
                at_object(mapping), sdo.describe(self._objects.abort or 0))
        if count < needed:
            return _difference(mapping, 0, count, needed)
        for place, entry in enumerate(wanted.entries, 1):
            found = (yield from self._objects.read(mapping, place)) or 0
            if not same_mapping([found], [entry]):
                return sentences.object_differs(
                    at_object(mapping, place), pdo.entry_text(found),
                    f'{pdo.entry_text(entry)} ({wanted.parameters[place - 1].name})')
        for place in range(needed + 1, min(count, pdo.ENTRIES_MAX) + 1):
            behind = yield from self._objects.read(mapping, place)
            if behind or behind is None and not self._objects.absent:
                return _difference(mapping, 0, count, needed)
        return NOTHING

    def _timers(self) -> list[tuple[int, int]]:
        """Return inhibit time (0.1 ms) and event timer (ms) that a TPDO shall have."""
        if self._synchronous:
            return [(pdo.INHIBIT_TIME, 0)]
        return [(pdo.INHIBIT_TIME, min(round(5000 * self._drive.period), 0xFFFF)),
                (pdo.EVENT_TIMER, round(1000 * self._drive.period))]

    def _write(self, wanted: Pdo, identifier: int, *, transmit: bool) -> Procedure[Sentence]:
        """
        Write one PDO, in the order that all devices take.

        :return: the refusal of one that is fixed: it may fit as it is, but for type and times.
        """
        at = wanted.communication
        kept = identifier & (pdo.NO_REMOTE | pdo.LONG_IDENTIFIER)
        fixed = yield from self._objects.put(at, pdo.COB_ID, identifier | pdo.INVALID, 4)
        undo: list[tuple[int, int]] = []
        refusal = NOTHING if fixed else (yield from self._map(wanted, undo))
        remedy = sentences.maps_fixed
        if not refusal:
            refusal = yield from self._pace(at, fixed=bool(fixed), transmit=transmit)
            remedy = sentences.drive_to_correct if refusal else remedy
        if not fixed:
            refusal = refusal or (yield from self._objects.put(
                at, pdo.COB_ID, wanted.identifier | kept, 4))
        if refusal and not fixed:       # as it was found
            for place, content in reversed(undo):
                if (yield from self._put_entry(wanted, place, content)):
                    break       # it stays off, rather than with something else in it
            else:
                yield from self._objects.put(at, pdo.COB_ID, identifier, 4)
        if refusal:
            raise differs(refusal, remedy)
        return fixed

    def _map(self, wanted: Pdo, undo: list[tuple[int, int]]) -> Procedure[Sentence]:
        """
        Write what a PDO holds, unless it holds that: it may be fixed.

        :param undo: gets the sub-indices that were written, and what they held.
        :return: the refusal.
        """
        entries, mapping = wanted.entries, wanted.communication + pdo.MAPPING_OFFSET
        count = (yield from self._objects.read(mapping, 0, 1)) or 0
        held = {0: count}
        for place in range(1, min(count, pdo.ENTRIES_MAX) + 1):
            held[place] = (yield from self._objects.read(mapping, place)) or 0
        if same_mapping(list(held.values())[1:], entries):
            return NOTHING
        steps = [(0, 0), *enumerate(entries, 1), (0, len(entries))]
        count_fixed, count_abort = NOTHING, None
        while steps:
            place, content = steps.pop(0)
            refusal = yield from self._put_entry(wanted, place, content)
            if refusal and not place and not content and len(held) > len(entries):
                # what is not needed is to be empty
                count_fixed, count_abort = refusal, self._objects.abort
                steps = list(enumerate([*entries, *[0] * (len(held) - 1 - len(entries))], 1))
                continue
            if refusal:
                return count_fixed if count_fixed and (
                    count_abort == self._objects.abort) else refusal
            if place in held:       # what was beyond the count was nothing
                undo.append((place, held[place]))
                held[place] = content
        return NOTHING

    def _put_entry(self, wanted: Pdo, place: int, content: int) -> Procedure[Sentence]:
        """Write an entry; a refusal names the parameters that were meant."""
        names = [each.name for each in wanted.parameters]
        if 0 < place <= len(names):
            entry = wanted.entries[place - 1]
            names = [names[place - 1], at_object(entry >> 16, entry >> 8 & 0xFF)]
        return (yield from self._objects.put(
            wanted.communication + pdo.MAPPING_OFFSET, place, content, 4 if place else 1,
            ', '.join(names)))

    def _pace(self, at: int, *, fixed: bool, transmit: bool) -> Procedure[Sentence]:
        """Write when a PDO is sent; return the refusal of what it cannot do without."""
        types, refusal = self._types(transmit=transmit), NOTHING
        for kind in types[:1] if fixed else types:
            refusal = yield from self._objects.put(at, pdo.TRANSMISSION, kind, 1)
            if not refusal:
                break
        if refusal and not fixed:
            return refusal
        for subindex, value in self._timers() if transmit else ():
            found = yield from self._objects.read(at, subindex, 2)
            if found == value or found is None and not value:
                continue
            refusal = yield from self._objects.put(at, subindex, value, 2)
            if refusal and subindex == pdo.EVENT_TIMER:
                return refusal
            if refusal:
                self._report(refusal)
        return NOTHING

    def _close(self, first: int, used: Iterable[Pdo]) -> Procedure[None]:
        """Make PDOs invalid that are not needed."""
        needed = {each.number for each in used}
        for number in range(1, pdo.PDO_MAX + 1):
            at = first + number - 1
            if number in needed:
                continue
            identifier = yield from self._objects.read(at, pdo.COB_ID)
            if identifier is not None and not identifier & pdo.INVALID:
                self._may_write(_difference(at, pdo.COB_ID, identifier, identifier | pdo.INVALID))
                refusal = yield from self._objects.put(at, pdo.COB_ID, identifier | pdo.INVALID, 4)
                if refusal:
                    self._report(refusal)


def _difference(index: int, subindex: int, found: int, wanted: int) -> Sentence:
    width = 8 if subindex == pdo.COB_ID and index < 0x1A00 and not 0x1600 <= index < 0x1800 else 2
    return sentences.object_differs(
        at_object(index, subindex), f'{found:0{width}X}h', f'{wanted:0{width}X}h')
