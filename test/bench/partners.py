# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A session and the drive at the other end of its bus, of each family: the table PARTNERS."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from builders import ACTUAL, CURRENT, drive, frame, read, SPEED, STATUS, TABLE, write
from conversation import Conversation
from drives import (
    CannordDrive, ExtendedDrive, Motor, PkwNode, ServoDrive, StandardDrive,
)
from timeline import Pair

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.control import ControlAction
from drive_can_bridge.core.events import DriveState, Noted
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter


class Partner(Pair):
    """
    The drive at the other end of the bus: registers, and the family's telegrams.

    ``registers`` go by the numbers of ``builders``, however the drives of a family address them.

    :cvar sample: the raw integers of every sample.
    :cvar unknown: what is said of a parameter that the drive does not have.
    :cvar idle: state of a drive that has just been found.
    :cvar words: disable and enable, where the control word is built in.
    :cvar parameters: how frames begin by which a user reads and writes 30 to 42.
    """

    sample: tuple[int, ...] = (1000, 250, 1)
    unknown = 'no answer'
    idle = DriveState.NOT_ARMED
    words: Mapping[str, int] = {}
    parameters: str

    device: CannordDrive | ExtendedDrive | StandardDrive | PkwNode | ServoDrive

    def __init__(self, **options: Any) -> None:
        self.configuration = self.configure(**options)
        super().__init__(Conversation(self.configuration))
        self.registers = {parameter.number or 0: 0 for parameter in TABLE}
        self.registers.update({209: 1000, 210: 250, 211: 1})

    @abstractmethod
    def configure(self, **options: Any) -> DriveConfiguration:
        """Make a configuration with ``speed_setpoint`` as its only setpoint."""

    @staticmethod
    def own(parameter: Parameter) -> Parameter:
        """Return a parameter of ``builders`` as drives of the family address it."""
        return parameter

    @staticmethod
    def raw_name(number: int) -> str:
        """Return the raw name of the parameter to which ``builders`` gives a number."""
        return f'p{number}'

    def answers(self, sent: str) -> list[str]:
        """Do what the drive does with a frame; return what it answers."""
        return [str(answer) for answer in self.device.takes(frame(sent))]

    @abstractmethod
    def setpoints(self, sent: str) -> list[int]:
        """Return the raw setpoints that a frame carries; none if it carries none."""

    def enable(self) -> None:
        """Bring a drive that has a control word so far that it takes setpoints."""

    # -- the bus ----------------------------------------------------------------------------------

    def reads(self, *parameters: Parameter) -> None:
        """Have parameters read."""
        self.deliver(self.talk.submits(read(*map(self.own, parameters)), self.now))

    def writes(self, *items: tuple[Parameter, int]) -> None:
        """Have raw integers written."""
        self.deliver(self.talk.submits(
            write(*((self.own(parameter), raw) for parameter, raw in items)), self.now))

    def start(self) -> 'Partner':
        self.activate()
        self.live(0.2)
        return self

    def take(self) -> list[tuple[float, str]]:
        """Return the frames sent since the last call."""
        log, self.log = self.log, []
        return log

    def commanded(self) -> Iterator[int]:
        """Return the raw speed setpoints sent since the last call."""
        for _, text in self.take():
            yield from self.setpoints(text)


class ExtendedPartner(Partner):
    """DataModel with 29-bit identifiers."""

    parameters = '00[23]0(01|02)'

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.registers.update(zip(range(122, 130), (50, 0, 0, 0, 209, 210, 211, 0)))
        self.device = ExtendedDrive(self.registers)

    def configure(self, **options: Any) -> DriveConfiguration:
        options.setdefault('request', (SPEED,))
        return drive('datamodel_extended', response=(ACTUAL, CURRENT, STATUS), **options)

    def setpoints(self, sent: str) -> list[int]:
        return [int(sent[9:13], 16)] if sent.startswith('003FFFF0') else []


class StandardPartner(Partner):
    """DataModel with 11-bit identifiers."""

    parameters = '3F1#0[36](1|2)'

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.device = StandardDrive(self.registers)

    def configure(self, **options: Any) -> DriveConfiguration:
        options.setdefault('request', (SPEED,))
        return drive('datamodel_standard', response=(ACTUAL, CURRENT, STATUS), **options)

    def setpoints(self, sent: str) -> list[int]:
        if not sent.startswith('3F1#063200'):
            return []
        return [int.from_bytes(bytes.fromhex(sent[10:14]), 'little')]


class CannordPartner(Partner):
    """CANnord, station 1; actual values are in parameters 209 and 210."""

    sample = (0x0B31, 1000, 250)
    idle = DriveState.DISABLED
    words = {'disable': 0x047E, 'enable': 0x047F}
    parameters = '202#'

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.registers = Motor(self.registers)
        self.device = CannordDrive(1, self.registers)

    def enable(self) -> None:
        self.deliver(self.talk.asks(ControlAction.ENABLE, self.now))
        self.live(max(0.1, 2 * self.configuration.period))
        assert self.talk.control_outcomes() == [('enable', True, 'operation enabled')]

    def configure(self, **options: Any) -> DriveConfiguration:
        options.setdefault('request', (SPEED,))
        return drive('cannord', response=(ACTUAL, CURRENT), **options)

    def setpoints(self, sent: str) -> list[int]:
        if not sent.startswith('002#'):
            return []
        return [int.from_bytes(bytes.fromhex(sent[8:12]), 'little')]


class PkwPartner(Partner):
    """PKW, node 1; obeys the rule that only a change of the function byte counts."""

    unknown = 'refused by the drive: 06020000h (no such register or object)'
    parameters = '501#(1|2)'

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.device = PkwNode(1, self.registers)

    def configure(self, **options: Any) -> DriveConfiguration:
        options.setdefault('request', (SPEED,))
        return drive('canopen_pkw', response=(ACTUAL, CURRENT, STATUS), **options)

    def setpoints(self, sent: str) -> list[int]:
        if not sent.startswith(('501#3200002A', '501#320000AA')):
            return []
        return [int.from_bytes(bytes.fromhex(sent[12:16]), 'little')]


class Cia402Partner(Partner):
    """CiA 402 in mode vl, node 1; other parameters are manufacturer's objects of 16 bits."""

    sample = (0x0231, 1000, 250)
    unknown = 'refused by the drive: 06020000h (no such register or object)'
    idle = DriveState.DISABLED
    words = {'disable': 0x0006, 'enable': 0x007F}
    parameters = '601#..(1|2).20'

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.device: ServoDrive = RegisterServo(self.registers)

    @staticmethod
    def own(parameter: Parameter) -> Parameter:
        return replace(parameter, number=None, subindex=0, index=0x6042 if (
            parameter.number == 50) else 0x2000 + (parameter.number or 0))

    @staticmethod
    def raw_name(number: int) -> str:
        return f'x{0x6042 if number == 50 else 0x2000 + number:04x}.00'

    def enable(self) -> None:
        self.deliver(self.talk.asks(ControlAction.ENABLE, self.now))
        self.live(max(0.1, 6 * self.configuration.period))
        assert self.talk.control_outcomes() == [('enable', True, 'operation enabled')]

    def configure(self, **options: Any) -> DriveConfiguration:
        options = {
            'request': (SPEED,), 'response': (ACTUAL, CURRENT), 'table': TABLE, 'mode': 'vl',
            'request_pdos': (1, 2, 3), 'response_pdos': (1, 2), **options}
        for key in ('request', 'response', 'table'):
            options[key] = tuple(map(self.own, options[key]))
        return drive('cia402', **options)

    def setpoints(self, sent: str) -> list[int]:
        if not sent.startswith('201#'):
            return []
        return [int.from_bytes(bytes.fromhex(sent[8:12]), 'little')]


class RegisterServo(ServoDrive):
    """A servo drive whose objects of 16 bits are the registers of a partner."""

    def __init__(self, registers: dict[int, int]) -> None:
        self.registers = registers
        super().__init__(1, {self._place(number): raw.to_bytes(2, 'little')
                             for number, raw in registers.items()})

    @staticmethod
    def _place(number: int) -> tuple[int, int]:
        return (0x6042 if number == 50 else 0x2000 + number), 0

    def takes(self, sent: Frame) -> list[Frame]:
        for place in [place for place in self.objects if 0x2000 <= place[0] < 0x3000]:
            del self.objects[place]
        for number, raw in self.registers.items():
            self.objects[self._place(number)] = raw.to_bytes(2, 'little')
        return super().takes(sent)

    def write(self, index: int, subindex: int, content: bytes) -> None:
        super().write(index, subindex, content)
        for number in self.registers:
            if (index, subindex) == self._place(number):
                self.registers[number] = int.from_bytes(content, 'little')


PARTNERS: dict[str, type[Partner]] = {
    'cia402': Cia402Partner,
    'cannord': CannordPartner,
    'canopen_pkw': PkwPartner,
    'datamodel_extended': ExtendedPartner,
    'datamodel_standard': StandardPartner,
}


def run(partner: Partner) -> None:
    """Have the drive run."""
    partner.commands(0.0, 100.0)
    partner.live(0.1)
    assert partner.registers[50] == 1000
    partner.talk.events()


def warnings(partner: Partner) -> list[str]:
    return [note.text for note in partner.talk.events(Noted) if note.warning]


def worries(partner: Partner) -> list[str]:
    return [text for text in warnings(partner) if 'may still be running' in text]
