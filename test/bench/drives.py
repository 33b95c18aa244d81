# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Drives that are registers and literal bytes: what the pages say, with no codec of ours.

They do what a drive does with a frame, at once, and return its answers; when these arrive, if at
all, is the test's business. The simulated drives of the package know more, and share its codecs.

``registers`` is number -> raw value; what is not in it the drive does not have.
"""

from collections.abc import Callable
from typing import Any

from drive_can_bridge.core.frame import Frame


class Registers(dict[int, int]):
    """Registers into which every value goes by ``__setitem__``, one after the other."""

    def update(self, entries: Any = (), **_: int) -> None:
        for number, raw in entries:
            self[number] = raw


class Motor(Registers):
    """
    The registers of a drive, and the motor that obeys them.

    Whatever tells it to run starts it, at once and however often that was said before, unless it
    is at fault.

    :param rest: what else the drive has.
    :param word: number of what runs it while it holds 1; None: the setpoint alone moves it.
    :param status: number of its status word, and ``bits`` of that: ready, enabled and fault.
    :param moved: called behind a frame with whether that has started it, and whether it has given
        another setpoint to one that runs, if either.
    :ivar initial: what the drive holds at first.
    """

    def __init__(self, rest: dict[int, int] | None = None, *, setpoint: int = 50,
                 word: int | None = 52, status: int = 211, bits: tuple[int, int, int] = (1, 2, 8),
                 moved: Callable[[bool, bool], object] = lambda begins, moves: None) -> None:
        super().__init__({setpoint: 0, status: 0, **({} if word is None else {word: 0}),
                          **(rest or {})})
        self.setpoint, self.word, self.status, self.bits = setpoint, word, status, bits
        self.moved = moved
        self.initial = dict(self)
        self.runs = self.faulty = False
        self.before = (False, 0)

    def look(self) -> None:
        """See what a frame, taken as a whole, has moved."""
        now = self.runs, self[self.setpoint] if self.runs else 0
        before, self.before = self.before, now
        begins, moves = now[0] and not before[0], now[1] not in (0, before[1])
        if begins or moves:
            self.moved(begins, moves)

    def stops(self, *, faulty: bool = False) -> None:
        """Be stopped by something else than the bridge."""
        self.runs, self.faulty, self.before = False, faulty, (False, 0)

    def restarts(self, preset: int = 0) -> None:
        """Be without power for a moment: nothing but the maps is kept."""
        if self.word is not None:
            self[self.word] = 0
        self[self.setpoint] = preset
        self.stops()

    def __setitem__(self, number: int, raw: int) -> None:
        super().__setitem__(number, raw)
        if number == (self.setpoint if self.word is None else self.word):
            self.runs = not self.faulty and (raw != 0 if self.word is None else raw == 1)

    def __getitem__(self, number: int) -> int:
        if number == self.status:
            ready, enabled, fault = self.bits
            return fault if self.faulty else ready | enabled * self.runs
        return super().__getitem__(number)


class ExtendedDrive:
    """DataModel with 29-bit identifiers, any station: maps in registers 122 to 129."""

    def __init__(self, registers: dict[int, int]) -> None:
        self.registers = registers

    @staticmethod
    def in_cycle(sent: Frame) -> bool:
        """Return whether a frame is of the cyclic exchange."""
        return sent.identifier & 0x1FFFF0 == 0x1FFFF0

    def takes(self, sent: Frame) -> list[Frame]:
        identifier, data, _ = sent
        number, count = identifier >> 4 & 0xFFFF, identifier & 0xF
        words = [int.from_bytes(data[place:place + 2], 'big') for place in range(0, 8, 2)]
        if self.in_cycle(sent):
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
    """DataModel with 11-bit identifiers: 3 reads, 6 writes and is not answered."""

    def __init__(self, registers: dict[int, int]) -> None:
        self.registers = registers

    @staticmethod
    def in_cycle(_: Frame) -> bool:
        """Return True: cycles and requests go by the same frames."""
        return True

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
        return [Frame(sent.identifier + 0x400, answer.ljust(8, b'\xA5'), False)]


class CannordDrive:
    """
    CANnord: 047Fh runs it and bit 7 acknowledges, by its own identifier and by broadcasts.

    Register 52 holds 1 while it shall run, 50 and 51 are its setpoints, 209 and 210 its actual
    values. A broadcast is not answered.

    :ivar obeys: the identifiers of what tells it something.
    """

    def __init__(self, station: int, motor: Motor, *broadcasts: int) -> None:
        self.registers, self.alone = motor, 2 * station
        self.obeys: tuple[int, ...] = (self.alone, *broadcasts)

    def in_cycle(self, sent: Frame) -> bool:
        """Return whether a frame is of the cyclic exchange."""
        return sent.identifier != 0x200 + self.alone

    def takes(self, sent: Frame) -> list[Frame]:
        identifier, data, _ = sent
        if not self.in_cycle(sent):
            return self._parameter(data)
        if identifier not in self.obeys:
            return []
        word, *setpoints = (int.from_bytes(data[place:place + 2], 'little')
                            for place in range(0, len(data), 2))
        motor = self.registers
        motor.faulty = motor.faulty and not word & 0x80
        motor.update([*zip((50, 51), setpoints), (52, int(word == 0x047F))])
        if identifier != self.alone:
            return []
        words = (0x0B38 if motor.faulty else 0x0B37 if motor.runs else 0x0B31,
                 motor.get(209, 0), motor.get(210, 0), 0)
        return [Frame(identifier + 1, b''.join(
            each.to_bytes(2, 'little') for each in words)[:len(data)], False)]

    def _parameter(self, data: bytes) -> list[Frame]:
        key = int.from_bytes(data[:2], 'little')
        task, number = key >> 12, key & 0x7FF
        if number not in self.registers:
            return []
        if task != 1:
            assert task in (2, 14)
            self.registers[number] = int.from_bytes(data[6:], 'little')
        return [Frame(0x201 + self.alone, (1 << 12 | number).to_bytes(2, 'little') + bytes(4)
                      + self.registers[number].to_bytes(2, 'little'), False)]


class PkwNode:
    """NMT, and the mailbox, where only a change of the function byte counts."""

    def __init__(self, node: int, registers: dict[int, int]) -> None:
        self.node = node
        self.registers = registers
        self.operational = False
        self.function = 0
        self.executed: list[tuple[int, tuple[int, ...]]] = []

    @staticmethod
    def in_cycle(_: Frame) -> bool:
        """Return True: cycles and requests go by the same frames."""
        return True

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


class ServoDrive:
    """
    CiA 402, any node: objects that are bytes, and what NMT, SDO, SYNC, PDOs do with them.

    It changes its state by the control word at once, sees RPDOs of type 1 at SYNC, and is
    pre-operational when it is switched on. What it does not let others write is in ``fixed``.
    Stopped by NMT, it hears no SDO and no PDO, and its motor goes on (CiA 301; all stacks).

    :ivar now: s, of the frame that it takes, where the bench tells it.
    :ivar objects: (index, sub-index) -> content, low byte first; ``initial``: in its flash.
    :ivar state: the bits of the status word that tell it.
    :ivar told: the control words that it was sent, in order, without repetitions.
    :ivar cut_short: how often 0000h has ended its braking.
    """

    OFF, READY, ON, ENABLED, QUICK_STOP, FAULT = 0x40, 0x21, 0x23, 0x27, 0x07, 0x08
    #: something happens by itself, so that ``passes`` is to be called
    ticks = False

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        self.node = node
        self.now = 0.0
        self.operational = self.stopped = False
        self.state = self.OFF
        self.powered = True             # no safe torque off
        self.told: list[int] = []
        self.fixed: dict[tuple[int, int], int] = {}     # (index, sub-index) -> abort code
        self.instead: dict[str, str] = {}   # how an SDO begins -> what is answered instead
        self.braking = 0                # SYNCs until a quick stop has ended
        self.cut_short = 0
        self.ramp = 0                   # SYNCs that it takes to disable operation
        self._staged: list[tuple[int, bytes]] = []
        self.objects = {
            (0x1000, 0): bytes.fromhex('92010200'), (0x1005, 0): bytes.fromhex('80000000'),
            (0x1006, 0): bytes(4), (0x1016, 0): b'\1', (0x1016, 1): bytes(4),
            (0x1017, 0): bytes(2), (0x605A, 0): b'\2\0', (0x605C, 0): b'\1\0',
            (0x6007, 0): b'\1\0', (0x6040, 0): bytes(2), (0x6041, 0): b'\x50\2',
            (0x6060, 0): b'\0', (0x6061, 0): b'\0', (0x6502, 0): bytes.fromhex('FF030000'),
            (0x603F, 0): bytes(2), (0x606C, 0): bytes(4)}
        for pdo in range(4):
            for first, at in ((0x200, 0x1400), (0x180, 0x1800)):
                identifier = first + 0x100 * pdo + node | (0x80000000 if pdo else 0)
                self.objects[at + pdo, 1] = identifier.to_bytes(4, 'little')
                self.objects[at + pdo, 2] = b'\xFF'
                self.objects[at + pdo + 0x200, 0] = b'\0'
        self.objects.update(objects or {})
        self.initial = dict(self.objects)

    def in_cycle(self, sent: Frame) -> bool:
        """Return whether a frame is no SDO."""
        return sent.identifier != 0x600 + self.node

    def number(self, index: int, subindex: int = 0) -> int:
        return int.from_bytes(self.objects[index, subindex], 'little')

    def takes(self, sent: Frame) -> list[Frame]:
        identifier, data, _ = sent
        if identifier == 0:
            return self.obeys(data[0]) if data[1] in (0, self.node) else []
        if self.stopped:
            return []
        if identifier == 0x80:
            return self._sync()
        if not self.in_cycle(sent):
            return [] if data[0] == 0x80 else [Frame(0x580 + self.node, self._sdo(data), False)]
        if self.operational:
            for pdo in range(4):
                if self.number(0x1400 + pdo, 1) == identifier:
                    self._staged.append((pdo, data))
                    if self.number(0x1400 + pdo, 2) > 240:
                        self._apply()
        return []

    def obeys(self, command: int) -> list[Frame]:
        """Take an NMT command."""
        if command in (0x81, 0x82):
            return self.restarts()
        self.operational, self.stopped = command == 0x01, command == 0x02
        if not self.operational:
            self._staged.clear()    # as stacks do
        return []

    def beats(self) -> Frame:
        """Return its heartbeat."""
        state = b'\x04' if self.stopped else b'\x05' if self.operational else b'\x7F'
        return Frame(0x700 + self.node, state, False)

    def passes(self, now: float) -> list[Frame]:
        """Return what it says by itself now, but for heartbeats; to be called each millisecond."""
        self.now = now
        return []

    def restarts(self) -> list[Frame]:
        """Be switched off and on: disabled, and what was written of the PDOs is forgotten."""
        self.objects.update({place: content for place, content in self.initial.items()
                             if place[0] < 0x2000 or place[0] in (0x6060, 0x6061)})
        self.operational = self.stopped = False
        self.becomes(self.OFF)
        self._staged.clear()
        return [Frame(0x700 + self.node, b'\0', False)]

    # -- PDOs -------------------------------------------------------------------------------------

    def mapped(self, at: int) -> list[tuple[int, int, int]]:
        """Return (index, sub-index, bytes) of what is mapped."""
        entries = [self.number(at, place) for place in range(1, self.number(at) + 1)]
        return [(entry >> 16, entry >> 8 & 0xFF, (entry & 0xFF) // 8) for entry in entries]

    def _apply(self) -> None:
        for pdo, data in self._staged:
            for index, subindex, length in self.mapped(0x1600 + pdo):
                self.write(index, subindex, data[:length])
                data = data[length:]
        self._staged.clear()

    def _sync(self) -> list[Frame]:
        if not self.operational:
            return []
        self._apply()
        self.runs_down()
        return self.responses(1)

    def responses(self, *kinds: int) -> list[Frame]:
        """Return the TPDOs of these transmission types."""
        found = []
        for pdo in range(4):
            identifier = self.number(0x1800 + pdo, 1)
            if not identifier & 0x80000000 and self.number(0x1800 + pdo, 2) in kinds:
                found.append(Frame(identifier & 0x7FF, b''.join(
                    self.objects.get((index, subindex), bytes(length))
                    for index, subindex, length in self.mapped(0x1A00 + pdo)), False))
        return found

    # -- objects ----------------------------------------------------------------------------------

    def _sdo(self, data: bytes) -> bytes:
        for begins, answer in self.instead.items():
            if data.hex().startswith(begins):
                return bytes.fromhex(answer)
        index, subindex = int.from_bytes(data[1:3], 'little'), data[3]
        code = 0
        if (index, subindex) not in self.objects and not (
                0x1600 <= index < 0x1604 or 0x1A00 <= index < 0x1A04):
            code = 0x06020000
        elif data[0] == 0x40:
            found = self.objects.get((index, subindex), bytes(4))
            return bytes((0x4F - (len(found) - 1 << 2),)) + data[1:4] + found.ljust(4, b'\0')
        else:
            content = data[4:8 - (data[0] >> 2 & 3)]
            code = self.refusal(index, subindex, content)
            if not code:
                self.write(index, subindex, content)
        return bytes((0x80 if code else 0x60,)) + data[1:4] + code.to_bytes(4, 'little')

    def refusal(self, index: int, subindex: int, content: bytes) -> int:
        """Return why it does not let something be written; 0: it does."""
        return self.fixed.get((index, subindex), 0)

    def write(self, index: int, subindex: int, content: bytes) -> None:
        self.objects[index, subindex] = content
        if index == 0x6060 and (0x6061, 0) in self.objects:
            self.objects[0x6061, 0] = content
        if index == 0x6040:
            self._control(int.from_bytes(content, 'little'))

    # -- states -----------------------------------------------------------------------------------

    def becomes(self, state: int) -> None:
        self.state = state
        self.objects[0x6041, 0] = (state | 0x200 | (0x10 if self.powered else 0)).to_bytes(
            2, 'little')

    def runs_down(self) -> None:
        """Let a quick stop, or a ramp, get on."""
        if self.ramp and self.told[-1:] == [0x07] and self.state == self.ENABLED:
            self.ramp -= 1
            if not self.ramp:
                self.becomes(self.ON)
        if self.state == self.QUICK_STOP and self.braking:
            self.braking -= 1
            if not self.braking and not self.stays:
                self.becomes(self.OFF)

    @property
    def stays(self) -> bool:
        """In quick stop active, when it stands."""
        return self.number(0x605A) >= 5

    def _control(self, word: int) -> None:
        before = self.told[-1] if self.told else 0
        if word != before or not self.told:
            self.told.append(word)
        state, command = self.state, word & 0x0F
        if state == self.FAULT:
            if word & 0x80 and not before & 0x80:
                self.becomes(self.OFF)
        elif not command & 0x02:
            self.cut_short += bool(state == self.QUICK_STOP and self.braking)
            self.becomes(self.OFF)
        elif not command & 0x04:
            if state == self.ENABLED:
                self.braking = self.braking or 1
                self.becomes(self.QUICK_STOP)
            elif state != self.QUICK_STOP:
                self.becomes(self.OFF)
        elif state == self.QUICK_STOP:
            pass
        elif command == 0x06:
            self.becomes(self.READY if self.powered or state != self.OFF else self.OFF)
        elif command == 0x07 and state == self.ENABLED and self.ramp:
            pass
        elif command == 0x07 and state in (self.READY, self.ENABLED):
            self.becomes(self.ON)
        elif command == 0x0F and state in (self.READY, self.ON):
            self.becomes(self.ENABLED if state == self.ON else self.ON)
        else:
            self.becomes(state)     # what has changed of the power shows


class MotorServo(ServoDrive):
    """
    CiA 402 with a motor: it runs while operation is enabled, and its setpoint is 60FFh.

    What stops the motor, or makes it trip, is the drive's state with the next frame.
    """

    def __init__(self, node: int, motor: Motor,
                 objects: dict[tuple[int, int], bytes] | None = None) -> None:
        self.registers = motor
        super().__init__(node, {(0x60FF, 0): bytes(4), **{
            (index, subindex): bytes.fromhex(content) for index, subindex, content in (
                (0x1400, 2, '01'), (0x1600, 0, '02'), (0x1600, 1, '10004060'),
                (0x1600, 2, '2000FF60'), (0x1800, 2, '01'), (0x1800, 3, '0000'),
                (0x1800, 5, '0000'), (0x1A00, 0, '01'), (0x1A00, 1, '10004160'))},
            **(objects or {})})

    def takes(self, sent: Frame) -> list[Frame]:
        motor = self.registers
        if motor.faulty is not (self.state == self.FAULT):
            self.becomes(self.FAULT if motor.faulty else self.OFF)
        elif self.state == self.ENABLED and not motor.runs:
            self.becomes(self.OFF)      # by hand
        if not self.stopped and str(sent).startswith(f'{0x600 + self.node:03X}#40416000'):
            self.runs_down()    # while it is asked for its state, as while it is cycled
        answers = super().takes(sent)
        if self.operational and sent.identifier == 0x200 + self.node and (
                by_event := self.responses(255)):   # as its event timer would
            answers += by_event
            self.runs_down()
        motor[50] = self.number(0x60FF)
        motor.faulty = self.state == self.FAULT
        motor[52] = int(self.state == self.ENABLED)
        return answers

    def restarts(self) -> list[Frame]:
        answers = super().restarts()
        self.objects[0x60FF, 0] = self.registers[50].to_bytes(4, 'little')
        return answers
