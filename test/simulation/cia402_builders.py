# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Simulated drives of CiA 402 for tests, and a master that speaks to them in literal frames."""

from collections.abc import Iterable
import struct
from typing import Any

import builders

from drive_can_bridge.configuration.profiles import read_profile
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.canopen.network import NmtState
from drive_can_bridge.resources import profiles_directory
from drive_can_bridge.simulation.cia402 import SimulatedServoDrive
from drive_can_bridge.simulation.cia402_plant import Habits
from drive_can_bridge.simulation.registers import Mechanics

NODE = 5
#: 1.2345 revolutions of 10,000 increments: where a new axis stands
BEGINNING = 12_345
SERVO = read_profile(profiles_directory() / 'cia402_servo.yaml').profile
#: what a mode's target is, and how it travels: index, sub-index, struct's letter
TARGETS = {1: (0x607A, 0, 'i'), 2: (0x6042, 0, 'h'), 3: (0x60FF, 0, 'i'), 4: (0x6071, 0, 'h'),
           6: (0x60FF, 0, 'i'), 7: (0x60C1, 1, 'i'), 8: (0x607A, 0, 'i'), 9: (0x60FF, 0, 'i'),
           10: (0x6071, 0, 'h')}


def names(*wanted: str) -> tuple[Parameter, ...]:
    """Return parameters of the shipped profile."""
    return tuple(SERVO.parameters[name] for name in wanted)


def configuration(*, name: str = 'axis', station: int = NODE,
                  request: Iterable[str] = ('target_velocity',),
                  response: Iterable[str] = ('actual_velocity',), **options: Any,
                  ) -> DriveConfiguration:
    """Make the configuration of a drive; further keywords are its keys."""
    return builders.drive(
        'cia402', name=name, station=station, table=SERVO.parameters.values(),
        request=names(*request), response=names(*response),
        **{'mode': 'csv', 'period': 0.01, **options})


class Servo:
    """
    One simulated drive, switched on at 0.0, spoken to in candump's notation and literal times.

    :ivar now: where the clock of :meth:`run` is.
    """

    def __init__(self, *, habits: Habits | None = None, **options: Any) -> None:
        mechanics = {key: options.pop(key) for key in ('load', 'noise', 'brake')
                     if key in options}
        self.drive = SimulatedServoDrive(
            configuration(**options), mechanics=Mechanics(**mechanics))
        if habits is not None:
            self.drive.habits = habits
        self.now = 0.0
        self.word = 0
        self.target = 0
        self.mode = 0
        assert self.at(0.0) == [f'{0x700 + NODE:03X}#00']

    def sent(self) -> list[str]:
        """Return what it has sent since the last look."""
        return [str(answer) for answer in self.drive.take_frames()]

    def ask(self, text: str, now: float | None = None) -> list[str]:
        """Send it a frame; return what it sends."""
        self.now = self.now if now is None else now
        self.drive.receive_frame(builders.frame(text), self.now)
        return self.sent()

    def at(self, now: float) -> list[str]:
        """Let its timer run once."""
        self.now = now
        self.drive.handle_timer(now)
        return self.sent()

    # -- objects ----------------------------------------------------------------------------------

    def _download(self, index: int, subindex: int, value: int, size: int) -> tuple[str, str]:
        """Write an object by SDO, as manuals print it; return its place, and the answer."""
        data = (value & (1 << 8 * size) - 1).to_bytes(4, 'little').hex().upper()
        head = {1: '2F', 2: '2B', 4: '23'}[size]
        place = f'{index & 0xFF:02X}{index >> 8:02X}{subindex:02X}'
        answer, = self.ask(f'605#{head}{place}{data}')
        return place, answer

    def write(self, index: int, subindex: int, value: int, size: int) -> None:
        """Write an object."""
        place, answer = self._download(index, subindex, value, size)
        assert answer == f'585#60{place}00000000'

    def refused(self, index: int, subindex: int, value: int, size: int) -> int:
        """Write an object, and return the abort code."""
        place, answer = self._download(index, subindex, value, size)
        assert answer.startswith(f'585#80{place}')
        return int.from_bytes(bytes.fromhex(answer[-8:]), 'little')

    def read(self, index: int, subindex: int = 0) -> int:
        """Read an object of at most four bytes, without sign."""
        place = f'{index & 0xFF:02X}{index >> 8:02X}{subindex:02X}'
        answer, = self.ask(f'605#40{place}00000000')
        assert answer.startswith('585#4')
        return int.from_bytes(bytes.fromhex(answer[-8:]), 'little')

    @property
    def node_state(self) -> NmtState:
        return self.drive.node.state

    @property
    def status(self) -> int:
        return self.read(0x6041)

    @property
    def state(self) -> int:
        """The bits of the status word that tell the state."""
        return self.status & 0x6F

    @property
    def revolutions(self) -> float:
        """Where the shaft is."""
        return self.drive.plant.shaft.position

    @property
    def speed(self) -> float:
        """Revolutions per second of the shaft."""
        return self.drive.plant.shaft.speed

    # -- a master ---------------------------------------------------------------------------------

    def set_up(self, mode: int) -> 'Servo':
        """Map control word and target to RPDO1, status word and position to TPDO1, and start."""
        self.mode = mode
        index, subindex, letter = TARGETS[mode]
        self._map(0x1400, 0x80000205, [0x60400010, (
            index << 16 | subindex << 8 | 8 * struct.calcsize(letter))])
        self._map(0x1800, 0x80000185, [0x60410010, 0x60640020])
        self.write(0x6060, 0, mode, 1)
        self.write(0x60C2, 1, 10, 1)
        self.ask('000#0105')
        return self

    def _map(self, index: int, cob_id: int, entries: list[int]) -> None:
        self.write(index, 1, cob_id, 4)
        self.write(index + 0x200, 0, 0, 1)
        for place, entry in enumerate(entries):
            self.write(index + 0x200, place + 1, entry, 4)
        self.write(index + 0x200, 0, len(entries), 1)
        self.write(index, 2, 1, 1)
        self.write(index, 1, cob_id & 0x7FFFFFFF, 4)

    def cycle(self) -> tuple[int, int]:
        """Send RPDO1 and SYNC, 10 ms later; return status word and position."""
        self.now += 0.01
        letter = TARGETS[self.mode][2]
        data = struct.pack(f'<H{letter}', self.word, self.target).hex().upper()
        others = self.ask(f'205#{data}')
        answers = [text for text in (*others, *self.ask('080#')) if text.startswith('185#')]
        assert len(answers) == 1
        status, position = struct.unpack('<Hi', bytes.fromhex(answers[0][4:]))
        return status, position

    def run(self, seconds: float) -> tuple[int, int]:
        """Let cycles run; return what the last one brought."""
        answer = 0, 0
        for _ in range(round(100 * seconds)):
            answer = self.cycle()
        return answer

    def enable(self, more: int = 0) -> None:
        """Walk up to operation enabled, one word a cycle."""
        for word, status in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
            self.word = word
            assert self.cycle()[0] & 0x6F == status
        self.word = 0x0F | more
