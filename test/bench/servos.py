# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Servo drives as real ones are seen to be, beside what the standard has drives do.

Each is a :class:`.ServoDrive`: bytes and states, no codec of the package. What showed it is in the
docstring.
"""

from collections import deque

from drives import ServoDrive

from drive_can_bridge.core.frame import Frame


class TurningServo(ServoDrive):
    """
    An axis that turns while it is enabled, and for so many SYNCs more in a quick stop.

    :ivar speed: raw steps of 6064h a SYNC while it turns; 606Ch says that, too.
    :ivar brakes: SYNCs for which it brakes.
    :ivar dither: raw steps by which 6064h is off, one after the other, once it stands.
    :ivar noise: likewise of 606Ch.
    :ivar frozen: 606Ch is what it was when the quick stop began, for ever.
    """

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        super().__init__(node, objects)
        self.speed, self.brakes = 100, 20
        self.dither: tuple[int, ...] = (0,)
        self.noise: tuple[int, ...] = (0,)
        self.frozen = False
        self.place = self.number(0x6064) if (0x6064, 0) in self.objects else 0
        self._syncs = 0

    def runs_down(self) -> None:
        self._syncs += 1
        turns = self.state == self.ENABLED or self.state == self.QUICK_STOP and self.braking > 0
        self.place += self.speed * turns
        dither, noise = (each[self._syncs % len(each)] for each in (self.dither, self.noise))
        self._tell(0x6064, self.place + dither * (not turns))
        if not (self.frozen and self.state == self.QUICK_STOP):
            self._tell(0x606C, self.speed if turns else noise)
        super().runs_down()

    def _tell(self, index: int, value: int) -> None:
        if (index, 0) in self.objects:
            self.objects[index, 0] = (value & 0xFFFFFFFF).to_bytes(4, 'little')

    def becomes(self, state: int) -> None:
        if state == self.QUICK_STOP != self.state:
            self.braking = self.brakes
        super().becomes(state)


class LelyServo(TurningServo):
    """
    Lely core 2.4.0 with the fake CiA 402 slave of ros2_canopen.

    It stays in quick stop active although 605Ah is 2, with 606Ch at its last value, and never sets
    bit 10.
    """

    stays = True

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        super().__init__(node, objects)
        self.frozen = True


class CanopenNodeServo(TurningServo):
    """CANopenNode 4 with its example dictionary: no 605Ah, and it stays in quick stop active."""

    stays = True

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        super().__init__(node, objects)
        del self.objects[0x605A, 0]


class LateServo(ServoDrive):
    """
    What its TPDOs say is that of some SYNCs ago.

    So users report of steppers: a state machine of 30 ms at a period of 20 ms is up to two SYNCs
    behind its control word, other drives one to three; positions may be filtered, or interpolated.

    :ivar late_status: SYNCs by which the status is late.
    :ivar late_position: likewise 6064h.
    """

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        super().__init__(node, objects)
        self.late_status = self.late_position = 0
        self._told: deque[dict[tuple[int, int], bytes]] = deque(maxlen=8)

    def responses(self, *kinds: int) -> list[Frame]:
        now = dict(self.objects)
        self._told.append(now)
        for place, late in (((0x6041, 0), self.late_status), ((0x6064, 0), self.late_position)):
            self.objects[place] = self._told[max(0, len(self._told) - 1 - late)][place]
        answers = super().responses(*kinds)
        self.objects.update({place: now[place] for place in ((0x6041, 0), (0x6064, 0))})
        return answers


class HomingServo(LateServo):
    """
    Homes in mode 6 with the rising edge of bit 4; bits of the homing before stand until then.

    :ivar takes_syncs: SYNCs that a homing takes; 0: it is done at once (6098h = 35 or 37).
    :ivar fails: it ends with an error.
    :ivar before: the bits that stand before the first homing.
    :ivar homed_at: 6064h behind a homing.
    :ivar broken_off: homings that were broken off.
    :ivar found: those that came to their end.
    """

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        super().__init__(node, objects)
        self.takes_syncs, self.fails, self.homed_at = 30, False, 7
        self.before = self.bits = 0
        self.broken_off = self.found = 0
        self.left = 0                   # SYNCs until it is done
        self._word = 0

    def write(self, index: int, subindex: int, content: bytes) -> None:
        if index == 0x6060 and content != self.objects[0x6060, 0]:
            self.bits = self.before if content == b'\6' else 0
        super().write(index, subindex, content)

    def becomes(self, state: int) -> None:
        super().becomes(state)
        if state == self.ENABLED:
            status = self.number(0x6041) | getattr(self, 'bits', 0)
            self.objects[0x6041, 0] = status.to_bytes(2, 'little')

    def _control(self, word: int) -> None:
        super()._control(word)
        rises, falls = word & ~self._word & 0x10, self._word & ~word & 0x10
        self._word = word
        if self.state != self.ENABLED or self.number(0x6060) != 6:
            self.left = 0
            return
        if rises:
            self.bits, self.left = 0, self.takes_syncs
            if not self.left:
                self._done()
        elif falls and self.left:
            self.left, self.broken_off = 0, self.broken_off + 1
        self.becomes(self.state)

    def _done(self) -> None:
        self.found += 1
        self.bits = self.before = 0x2000 if self.fails else 0x1400
        self.objects[0x6064, 0] = self.homed_at.to_bytes(4, 'little')

    def runs_down(self) -> None:
        super().runs_down()
        if self.left:
            self.left -= 1
            self.objects[0x6064, 0] = (self.number(0x6064) - 40 & 0xFFFFFFFF).to_bytes(4, 'little')
            if not self.left:
                self._done()
        self.becomes(self.state)


class StepperServo(HomingServo):
    """
    A stepper, as users report it: its state machine runs each 30 ms, at a period of 20 ms.

    It homes to a switch, and has an error of the homing before (bit 13) until the next begins.
    """

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        super().__init__(node, objects)
        self.before = 0x2000
        self.waits = 0                  # units of 10 ms since it ran

    def write(self, index: int, subindex: int, content: bytes) -> None:
        if index == 0x6040:
            self.objects[index, subindex] = content
        else:
            super().write(index, subindex, content)

    def runs_down(self) -> None:
        self.waits += 2
        if self.waits >= 3:
            self.waits -= 3
            super().write(0x6040, 0, self.objects[0x6040, 0])
        super().runs_down()


class LelyHomingServo(HomingServo):
    """
    Lely core 2.4.0 with the fake CiA 402 slave of ros2_canopen.

    Homing starts on bit 2, so with mode 6 of an enabled drive; bits 10, 12 and 14 stay for good.
    """

    def write(self, index: int, subindex: int, content: bytes) -> None:
        begins = index == 0x6060 and content == b'\6' != self.objects[0x6060, 0]
        super().write(index, subindex, content)
        if begins and self.state == self.ENABLED:
            self.left = self.takes_syncs

    def _control(self, word: int) -> None:
        ServoDrive._control(self, word)

    def _done(self) -> None:
        super()._done()
        self.before = self.bits = 0x5400

    def becomes(self, state: int) -> None:
        if getattr(self, 'before', 0):
            self.bits = self.before     # in every mode
        super().becomes(state)


class ProfileServo(LateServo):
    """
    Takes a target of mode pp with the rising edge of bit 4.

    :ivar targets: those that it took.
    :ivar looks_each: SYNCs between two looks of its state machine at the control word.
    """

    def __init__(self, node: int, objects: dict[tuple[int, int], bytes] | None = None) -> None:
        super().__init__(node, objects)
        self.targets: list[int] = []
        self.looks_each = 1
        self._words = 0
        self._high = False

    def _control(self, word: int) -> None:
        self._words += 1
        if self._words % self.looks_each:
            return
        super()._control(word)
        if self.state == self.ENABLED:
            if word & 0x10 and not self._high:
                self.targets.append(self.number(0x607A))
            self._high = bool(word & 0x10)
            status = self.number(0x6041) & ~0x1000 | 0x1000 * self._high
            self.objects[0x6041, 0] = status.to_bytes(2, 'little')
