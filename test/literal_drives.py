# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Drives that are registers and literal bytes: what the pages say, with no codec of ours.

They do what a drive does with a frame, at once, and return its answers; when these arrive, if at
all, is the test's business. The simulated drives of the package know more, and share its codecs.

``registers`` is number -> raw value; what is not in it the drive does not have.
"""

from typing import Any

from drive_can_bridge.core.frame import Frame


class Registers(dict[int, int]):
    """Registers into which every value goes by ``__setitem__``, one after the other."""

    def update(self, entries: Any = (), **_: int) -> None:
        for number, raw in entries:
            self[number] = raw


class ExtendedDrive:
    """DataModel with 29-bit identifiers, any station: maps in registers 122 to 129."""

    def __init__(self, registers: dict[int, int]) -> None:
        self.registers = registers

    def takes(self, sent: Frame) -> list[Frame]:
        identifier, data, _ = sent
        number, count = identifier >> 4 & 0xFFFF, identifier & 0xF
        words = [int.from_bytes(data[place:place + 2], 'big') for place in range(0, 8, 2)]
        if identifier & 0x1FFFF0 == 0x1FFFF0:
            self.registers.update(zip(self._mapped(122), words))
            numbers = self._mapped(126)
        elif identifier & 0x100000:
            self.registers.update(zip(range(number, number + count), words))
            return []
        else:
            numbers = list(range(number, number + count))
        if any(entry not in self.registers for entry in numbers):
            return []
        answer = b''.join(self.registers[entry].to_bytes(2, 'big') for entry in numbers)
        return [Frame(identifier | 0x10000000, answer.ljust(8, b'\xA5'), True)]

    def _mapped(self, first: int) -> list[int]:
        entries = [self.registers[first + place] for place in range(4)]
        return entries[:entries.index(0)] if 0 in entries else entries


class StandardDrive:
    """DataModel with 11-bit identifiers, station 1: 3 reads, 6 writes and is not answered."""

    def __init__(self, registers: dict[int, int]) -> None:
        self.registers = registers

    def takes(self, sent: Frame) -> list[Frame]:
        data = sent.data
        number = int.from_bytes(data[1:3], 'little')
        if data[0] == 6:
            self.registers[number] = int.from_bytes(data[3:5], 'little')
            return []
        numbers = range(number, number + data[3])
        if any(entry not in self.registers for entry in numbers):
            return []
        answer = b''.join(self.registers[entry].to_bytes(2, 'little') for entry in numbers)
        return [Frame(0x7F1, answer.ljust(8, b'\xA5'), False)]


class PkwNode:
    """NMT, and the mailbox, where only a change of the function byte counts."""

    def __init__(self, node: int, registers: dict[int, int]) -> None:
        self.node = node
        self.registers = registers
        self.operational = False
        self.function = 0
        self.executed: list[tuple[int, tuple[int, ...]]] = []

    def takes(self, sent: Frame) -> list[Frame]:
        data = sent.data
        if sent.identifier == 0:
            self.operational = data == bytes((1, self.node))
            return []
        if not self.operational or data[3] == self.function:
            return []
        self.function = data[3]
        code, number = data[3] & 0x7F, int.from_bytes(data[:2], 'little')
        numbers = range(number, number + (2 if code in (0x26, 0x2B) else 1))
        if code == 0:
            return [self._answer(data)]
        if any(entry not in self.registers for entry in numbers):
            return [self._answer(data[:3] + bytes((data[3] & 0x80 | 0x4E, 0, 0, 2, 6)))]
        if code in (0x2A, 0x2B):
            words = tuple(int.from_bytes(data[place:place + 2], 'little')
                          for place in range(4, 4 + 2 * len(numbers), 2))
            self.written(number, words)
            return [self._answer(data[:4] + bytes(4))]
        words = tuple(self.registers[entry] for entry in numbers)
        return [self._answer((data[:4] + b''.join(
            word.to_bytes(2, 'little') for word in words)).ljust(8, b'\xA5'))]

    def written(self, number: int, words: tuple[int, ...]) -> None:
        self.registers.update(enumerate(words, number))
        self.executed.append((number, words))

    def restarts(self) -> None:
        self.operational = False
        self.function = 0

    def _answer(self, data: bytes) -> Frame:
        return Frame(0x480 + self.node, data, False)
