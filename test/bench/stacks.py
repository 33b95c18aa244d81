# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
CiA 402 drives as real CANopen stacks and devices behave, on the literal drive of ``drives``.

Each says what showed it. What they have in common stands in :class:`ServoDrive`.
"""

import math
from typing import Any

from drives import ServoDrive

from drive_can_bridge.core.frame import Frame

NO_OBJECT, ACCESS = 0x06020000, 0x06010000


class AcceptsAnything(ServoDrive):
    """
    Acknowledges the mapping of an object that it lacks, and reads it back; no effect.

    Lely core 2.4.0 (620d185) in pre-operational with ros2_canopen's fake slave (6ada196), and
    CanFestival 3 (12a05e4): neither looks at what is mapped.
    """

    def write(self, index: int, subindex: int, content: bytes) -> None:
        if (index, subindex) in self.objects or 0x1400 <= index < 0x1C00:
            super().write(index, subindex, content)


class DropsLimit(AcceptsAnything):
    """
    Has 6072h, maps it, and never takes what comes by PDO; SDO writes it.

    What CanFestival 3 (12a05e4) makes of a PDO entry with another length than its object.
    """

    def _apply(self) -> None:
        kept = self.objects.get((0x6072, 0))
        super()._apply()
        if kept is not None:
            self.objects[0x6072, 0] = kept


class ChecksMapping(ServoDrive):
    """CANopenNode 4 (9b8beed): COB-ID invalid first, then the count 0; objects have to exist."""

    def refusal(self, index: int, subindex: int, content: bytes) -> int:
        first = next((each for each in (0x1600, 0x1A00) if each <= index < each + 4), None)
        if first is not None:
            if not self.number(index - 0x200, 1) & 0x80000000 or subindex and self.number(index):
                return ACCESS
            entry = int.from_bytes(content, 'little')
            if subindex and entry and (entry >> 16, entry >> 8 & 0xFF) not in self.objects:
                return NO_OBJECT
        return super().refusal(index, subindex, content)


class FourBytes(ServoDrive):
    """
    Answers every SDO read with four bytes (43h), whatever the size; users of several makers.

    :ivar signed: what is filled up with its sign, as others do it; the rest with 00.
    """

    signed: frozenset[int] = frozenset()

    def _sdo(self, data: bytes) -> bytes:
        answer = super()._sdo(data)
        if answer[0] & 0xE3 != 0x43:
            return answer
        content = answer[4:8 - (answer[0] >> 2 & 3)]
        sign = content[-1] & 0x80 and int.from_bytes(answer[1:3], 'little') in self.signed
        return b'\x43' + answer[1:4] + content.ljust(4, b'\xFF' if sign else b'\0')


class ShortFrames(ServoDrive):
    """Sends SDO frames that are as short as their content; reported of a stepper's firmware."""

    def _sdo(self, data: bytes) -> bytes:
        answer = super()._sdo(data)
        if answer[0] == 0x60:
            return answer[:4]
        return answer[:8 - (answer[0] >> 2 & 3)] if answer[0] & 0xE3 == 0x43 else answer


class SignedLengths(ServoDrive):
    """Reads mapping lengths back with bit 7 set where the object is signed (users' reports)."""

    SIGNED = (0x60FF, 0x607A, 0x6064, 0x606C, 0x6071, 0x6077)

    def _sdo(self, data: bytes) -> bytes:
        answer = super()._sdo(data)
        index = int.from_bytes(answer[1:3], 'little')
        if data[0] == 0x40 and answer[0] == 0x43 and answer[3] and (
                0x1600 <= index < 0x1604 or 0x1A00 <= index < 0x1A04) and (
                int.from_bytes(answer[6:8], 'little') in self.SIGNED):
            return answer[:4] + bytes((answer[4] | 0x80,)) + answer[5:]
        return answer


class EightEntries(ServoDrive):
    """The count of a mapping is 8 for ever; entries behind are 00000000h (Curtis, user report)."""

    def _sdo(self, data: bytes) -> bytes:
        index, subindex = int.from_bytes(data[1:3], 'little'), data[3]
        if 0x1600 <= index < 0x1604 or 0x1A00 <= index < 0x1A04:
            if not subindex and data[0] != 0x40:
                return b'\x80' + data[1:4] + (0x06010002).to_bytes(4, 'little')
            if not subindex:
                return b'\x4F' + data[1:4] + b'\x08\0\0\0'
        return super()._sdo(data)

    def mapped(self, at: int) -> list[tuple[int, int, int]]:
        entries = [self.objects.get((at, place), bytes(4)) for place in range(1, 9)]
        return [(int.from_bytes(entry[2:], 'little'), entry[1], entry[0] // 8)
                for entry in entries if any(entry)]


class WatchesSync(ChecksMapping):
    """
    Misses SYNC (1006h) after 1.5 periods: emergency 8100h, and pre-operational, or as 1029h says.

    CANopenNode 4 (9b8beed) with its example dictionary. The error goes with the next SYNC, also
    right behind NMT start; a node with the error that is started is operational for a millisecond.
    Stopped, it hears no SYNC.

    :ivar failed: it has the error.
    """

    ticks = True

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None, *,
                 failed: bool = True) -> None:
        super().__init__(node, {
            (0x1006, 0): (10_000).to_bytes(4, 'little'), (0x1029, 1): b'\0', **(objects or {})})
        self.failed = failed
        self._synced_at = self._drops_at = math.inf

    def _sync(self) -> list[Frame]:
        self._synced_at, over = self.now, self.failed
        self.failed = False
        return [Frame(0x80 + self.node, bytes(8), False)] * over + super()._sync()

    def obeys(self, command: int) -> list[Frame]:
        self._drops_at = self.now + 0.001 if command == 0x01 else math.inf
        return super().obeys(command)

    def passes(self, now: float) -> list[Frame]:
        self.now, period = now, 1e-6 * self.number(0x1006)
        frames = []
        if period and not (self.failed or self.stopped) and now > self._synced_at + 1.5 * period:
            self.failed, self._drops_at = True, now
            frames.append(Frame(0x80 + self.node, bytes.fromhex('0081110000000000'), False))
        if self.failed and self.operational and now >= self._drops_at:
            behaviour = self.number(0x1029, 1)
            self.operational, self.stopped = behaviour == 1, behaviour == 2
        return frames


class StartsSlowly(ServoDrive):
    """
    Needs 0.3 s from NMT start to operational; a test device that is none of the stacks.

    :ivar takes_to_start: s.
    """

    ticks = True
    takes_to_start = 0.3

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        super().__init__(node, objects)
        self._starts_at = math.inf

    def obeys(self, command: int) -> list[Frame]:
        if command == 0x01 and self.operational:
            return []
        self._starts_at = self.now + self.takes_to_start if command == 0x01 else math.inf
        return super().obeys(0x80 if command == 0x01 else command)

    def passes(self, now: float) -> list[Frame]:
        self.operational = self.operational or now >= self._starts_at
        return super().passes(now)


class FewObjects(ServoDrive):
    """No 1006h, 1016h, 1019h, 60C2h, no event timer: durand 0.5.0 (PyPI) as a drive."""

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        super().__init__(node, objects)
        for place in (0x1006, 0), (0x1016, 0), (0x1016, 1):
            self.objects.pop(place, None)


class WatchesOnce(ServoDrive):
    """
    Refuses an entry of 1016h whose node is watched, also by that entry: it is cleared first.

    embedded-office/canopen-stack 4.4 (f4e4db8). No reset of communication clears it either.
    """

    def refusal(self, index: int, subindex: int, content: bytes) -> int:
        if index == 0x1016 and any(
                entry[2:3] == content[2:3] and entry[:2] != bytes(2) != content[:2]
                for (number, place), entry in self.objects.items() if number == index and place):
            return 0x06040043
        return super().refusal(index, subindex, content)


class StartsItself(AcceptsAnything):
    """Operational by itself, at once and without a word: Lely core 2.4.0 (620d185), no 1F80h."""

    def restarts(self) -> list[Frame]:
        frames = super().restarts()
        self.operational = True
        return frames


class BootsTwice(AcceptsAnything):
    """Two boot-up frames within 0.1 ms behind each reset: CanFestival 3 (12a05e4)."""

    def restarts(self) -> list[Frame]:
        return 2 * super().restarts()


def odd_heartbeats(axis: Any, length: int) -> None:
    """Have the heartbeats of an axis be 0 or 8 bytes long (reports of users of ros2_canopen)."""
    says = axis.says

    def otherwise(text: str) -> None:
        state = text[4:]
        says(text[:4] + state.ljust(2 * length, '0')[:2 * length]
             if text.startswith('705#') and state != '00' else text)     # not the boot-up
    axis.says = otherwise
