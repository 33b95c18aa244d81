# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A drive in virtual time that takes settings in a mode only, and whatever may happen to it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum

from drive_can_bridge.backup.document import Backup
from drive_can_bridge.backup.restore import names_to_read, plan_restore
from drive_can_bridge.backup.restore import Restorer, RestoreResult
from drive_can_bridge.client.drive import Drive, DriveFacts, Enabled, ReadOutcome, WriteOutcome
from drive_can_bridge.core.directory import ParameterDirectory
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import AccessMode, Parameter, Value
from drive_can_bridge.core.profile import RestoreStep, RestoreTable
from drive_can_bridge.core.requests import FailureKind
from drive_can_bridge.core.roles import Role

#: bit of its mode, and what else stands in that parameter
MODE, OTHER = 0x0001, 0x0010
SETTINGS = {'first': 11, 'second': 12, 'third': 13}
FILE = {**SETTINGS, 'mode': OTHER}
#: what stores, if it is told so; it cannot be read
STORE, SAVE = 'store', 0x6173
#: s that an exchange takes, and how long nobody's answer is waited for
EXCHANGE, SILENCE = 0.01, 0.9


class Fate(Enum):
    """What becomes of a write, and of what follows."""

    LOST = 'it is not heard, once'
    UNANSWERED = 'it is obeyed, its answer is lost'
    MUTE = 'it is obeyed, and nothing is answered from then on'
    DEAF = 'neither it nor anything else is heard from then on'
    REFUSED = 'it is refused'
    IGNORED = 'it is acknowledged, and not taken'
    AWAY = 'power is cut before it, for 5 s'
    CUT = 'it is obeyed, then power is cut for 5 s'
    BUS = 'the bus is lost before it'
    BUS_BEHIND = 'it is obeyed, and the bus is lost before its answer'
    SIGNAL = 'it is done, and a signal came meanwhile'
    BROKEN_OFF = 'it is done, and a second signal breaks in'
    ENABLED = 'it is done, and somebody enables the drive'
    KILLED_BEFORE = 'the process dies before it'
    KILLED_AFTER = 'the process dies before its answer'


class Killed(BaseException):
    """Nothing runs any more."""


class ScriptedDrive(Drive):
    """
    A drive.

    :param fates: by the number of the write (1: the first).
    :param stores: it wants to be told to store, instead of being in a mode.
    :ivar events: what reached it, in order: (what, parameter, word).
    :ivar moving: what was written while it was enabled.
    :ivar now: s.
    """

    def __init__(self, fates: Mapping[int, Fate] = {}, *, stores: bool = False) -> None:
        bits = MODE
        table = RestoreTable((RestoreStep('mode', MODE, bits),), (RestoreStep('mode', 0, bits),))
        if stores:
            table = RestoreTable((), (RestoreStep(STORE, SAVE, 0xFFFF),))
        facts = DriveFacts('lift', 'main', 'virtual', '0', 500000, 'datamodel_extended', 1, 'own',
                           '', table)
        super().__init__(
            'lift', lambda: facts,
            ParameterDirectory({name: Parameter(name, number=number) for number, name in
                                enumerate(FILE, 30)} | {STORE: Parameter(
                                    STORE, number=60, access=AccessMode.WRITE_ONLY)},
                               lambda name: None))
        self.registers = {**dict.fromkeys(SETTINGS, 1), 'mode': OTHER}
        self._stores = stores
        self.events: list[tuple[str, str, int]] = []
        self.moving: list[str] = []
        self.now = 0.0
        self.signalled = False
        self.writes = 0
        self._fates = dict(fates)
        self._mute = self._deaf = self._bus_lost = self.is_enabled = False
        self._away_until = 0.0

    @property
    def in_mode(self) -> bool:
        return bool(self.registers['mode'] & MODE)

    def ended(self) -> None:
        """Nothing is the matter with it any more."""
        self._mute = self._deaf = self._bus_lost = self.is_enabled = False
        self._fates.clear()
        self._away_until, self.signalled = 0.0, False

    def wait(self, seconds: float) -> None:
        self.now += seconds

    # -- what a drive does ------------------------------------------------------------------------

    def role(self, name: str) -> Role | None:
        return None

    def write_refusal(self, name: str, parameter: Parameter) -> str:
        return ''

    def enabled(self) -> Enabled:
        self.events.append(('asked', '', 0))
        return Enabled.YES if self.is_enabled else Enabled.NO

    def identity(self) -> str:
        return ''

    def ask(self, asked: Sequence[tuple[str, Parameter]]) -> Iterator[ReadOutcome]:
        for name, parameter in asked:
            self._check_bus()
            self.events.append(('read', name, 0))
            if self._mute or self._hears_nothing:
                self.now += SILENCE
                yield ReadOutcome(name, parameter, reason='no answer; drive offline',
                                  kind=FailureKind.OFFLINE)
            else:
                self.now += EXCHANGE
                word = self.registers[name]
                yield ReadOutcome(name, parameter, word, word)

    def put(self, name: str, parameter: Parameter, value: Value, *, blind: bool = False,
            ) -> WriteOutcome:
        self.writes += 1
        fate = self._fates.get(self.writes)
        self._bus_lost = self._bus_lost or fate is Fate.BUS
        self._check_bus()
        if fate is Fate.KILLED_BEFORE:
            raise Killed
        self._deaf = self._deaf or fate is Fate.DEAF
        if fate is Fate.AWAY:
            self._away_until = self.now + 5.0
        if self.is_enabled:
            self.moving.append(name)
        if self._hears_nothing or fate is Fate.LOST:
            self.now += SILENCE
            return WriteOutcome(
                name, False, parameter, 'no answer', kind=FailureKind.NO_ANSWER)
        self.events.append(('write', name, int(value)))
        refused = fate is Fate.REFUSED or not (
            self._stores or name == 'mode' or self.in_mode)
        if not refused and fate is not Fate.IGNORED:
            self.registers[name] = int(value)
        if fate is Fate.KILLED_AFTER:
            raise Killed
        if fate is Fate.BUS_BEHIND:
            self._bus_lost = True
            return WriteOutcome.under_way(name, parameter, DriveCanError('gone'))
        if fate is Fate.CUT:
            self._away_until = self.now + 5.0
        self._mute = self._mute or fate is Fate.MUTE
        if self._mute or self._hears_nothing or fate is Fate.UNANSWERED:
            self.now += SILENCE
            return WriteOutcome(
                name, False, parameter, 'no answer', kind=FailureKind.NO_ANSWER)
        self.now += EXCHANGE
        self.signalled = self.signalled or fate in (Fate.SIGNAL, Fate.BROKEN_OFF)
        self.is_enabled = self.is_enabled or fate is Fate.ENABLED
        return WriteOutcome(name, not refused, parameter, 'refused by the drive' * refused,
                            kind=FailureKind.REFUSED if refused else None)

    def write(self, values: Mapping[str, Value], *, blind: bool = False,
              told: Callable[[WriteOutcome], object] | None = None) -> dict[str, WriteOutcome]:
        found = super().write(values, blind=blind, told=told)
        if self._fates.get(self.writes) is Fate.BROKEN_OFF:
            raise KeyboardInterrupt
        return found

    @property
    def _hears_nothing(self) -> bool:
        return self._deaf or self.now < self._away_until

    def _check_bus(self) -> None:
        if self._bus_lost:
            raise DriveCanError('bus main: is gone')


def restored(drive: ScriptedDrive, **tell: Callable[..., object]) -> RestoreResult:
    """
    Restore :data:`FILE`.

    :param tell: whom a :class:`.Restorer` tells something.
    """
    backup = Backup('b.yaml', '/lift', FILE)
    plan = plan_restore(backup, drive, drive.read(*names_to_read(backup, drive)),
                        include_protected=False)
    drive.events.clear()
    return Restorer(drive, plan, stopped=lambda: drive.signalled, clock=lambda: drive.now,
                    wait=drive.wait, **tell).run()
