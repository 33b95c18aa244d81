# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A drive played in software: what all protocol families have in common.

Sans-IO: frames and the time go in, frames come out. A family derives a class that knows its
telegrams; the registers and the motor are in :class:`~.plant.Plant`.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
import heapq
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.simulation.faults import AnswerFaults, Fault, FaultKind, parse_fault
from drive_can_bridge.simulation.plant import Plant

#: the manual's least time between two EEPROM writes
EEPROM_TIME = 0.020
#: s that a drive is deaf after power came back
BOOT_TIME = 0.5


class SimulatedDrive(ABC):
    """
    One simulated drive.

    :param neighbours: identifiers of the other drives on the bus; scripted faults keep clear of
        them.
    :param eeprom_time: s that an EEPROM write takes.
    :ivar requests: requests understood.
    :ivar answers: answers given, before scripted faults took theirs.
    :ivar violations: how often the other side broke a rule of the protocol, by rule.
    """

    def __init__(self, configuration: DriveConfiguration, *, neighbours: Sequence[Route] = (),
                 eeprom_time: float = EEPROM_TIME) -> None:
        self.configuration = configuration
        self.name = configuration.name
        self.neighbours = tuple(neighbours)
        self.eeprom_time = eeprom_time
        cyclic = (*configuration.cyclic_request, *configuration.cyclic_response)
        self.plant = Plant(configuration.profile, volatile={p.name for p in cyclic},
                           preferred=[p.name for p in configuration.cyclic_request])
        self.requests = 0
        self.answers = 0
        self.violations: Counter[str] = Counter()
        self._notices: list[str] = []
        self._outbox: list[Frame] = []
        self._late: list[tuple[float, int, list[Frame]]] = []
        self._late_count = 0
        self._deaf_until = -math.inf
        self._stuck: dict[str, Fault] = {}
        self._answer_faults = AnswerFaults(self._foreign_frames)

    # -- input and output -------------------------------------------------------------------------

    def receive_frame(self, frame: Frame, now: float) -> None:
        """Take a frame from the bus. Any frame; what is not for this drive is ignored."""
        if now >= self._deaf_until:
            self._receive(frame, now)

    def next_timer(self) -> float:
        """Return when :meth:`handle_timer` wants to be called; infinity: never."""
        return self._late[0][0] if self._late else math.inf

    def handle_timer(self, now: float) -> None:
        """Do what is due: answers that were held back."""
        while self._late and self._late[0][0] <= now:
            self._outbox += heapq.heappop(self._late)[2]

    def take_frames(self) -> list[Frame]:
        """Return the frames that the drive sends now."""
        frames, self._outbox = self._outbox, []
        return frames

    def take_notices(self) -> list[str]:
        """Return readable lines about what is worth knowing, since the last call."""
        notices, self._notices = self._notices, []
        return notices

    # -- by hand, at the drive --------------------------------------------------------------------

    def value(self, name: str, now: float | None = None) -> Value:
        """
        Return a register as a physical value.

        :param name: a name of the profile, or a raw one where the family has some.
        :param now: let the motor move up to this time first.
        :raises ValueRefused: there is no such register.
        """
        if now is not None and self.powered:
            self.plant.advance(now)
        return self.plant.value(self._known(name))

    def set_value(self, name: str, value: Value, now: float | None = None) -> None:
        """
        Set a register, read-only ones included; an actual value is held there.

        :raises ValueRefused: there is no such register, or the value does not fit.
        """
        if now is not None and self.powered:
            self.plant.advance(now)
        self.plant.set_value(self._known(name), value)

    def release(self, name: str) -> None:
        """Let an actual value that was set by hand follow the motor again."""
        self.plant.release(self._known(name))

    def fault(self, fault: str | Fault, now: float) -> None:
        """
        Play a fault, ``late=0.15``.

        :raises ValueRefused: there is no such fault, or it does not suit this drive.
        """
        if isinstance(fault, str):
            fault = parse_fault(fault)
        if self.powered:
            self.plant.advance(now)
        if fault.kind in AnswerFaults.KINDS:
            self._answer_faults.add(fault)
        elif fault.kind is FaultKind.STUCK:
            name = self._known(str(fault.argument))
            self._stuck[name] = fault
            self.plant.stuck.add(name)
        elif fault.kind is FaultKind.TRIP:
            if self.powered:
                self.plant.trip(fault.number or 0.0)
        elif fault.kind is FaultKind.OFF:
            self._deaf_until = math.inf
            self._drop_answers()
        elif fault.kind in (FaultKind.RESTART, FaultKind.FORGET):
            boot = BOOT_TIME if fault.number is None else fault.number
            self._restart(now, boot, forget=fault.kind is FaultKind.FORGET)
        else:
            self._repair(now)
        self._notices.append(f'{self.name}: fault {fault}' if fault.kind is not FaultKind.OK
                             else f'{self.name}: no fault any more')

    @property
    def eeprom_writes(self) -> int:
        """EEPROM cells written so far (they wear)."""
        return 0

    @property
    def powered(self) -> bool:
        """The drive has power (it may still be starting)."""
        return self._deaf_until < math.inf

    @property
    def faults_text(self) -> str:
        """The faults in force, in words."""
        texts = [str(fault) for fault in (*self._answer_faults.active, *self._stuck.values())]
        if self.plant.operation.faulted:
            texts.append('tripped')
        if not self.powered:
            texts.append('off')
        return ', '.join(texts) or 'ok'

    # -- for the families -------------------------------------------------------------------------

    @abstractmethod
    def _receive(self, frame: Frame, now: float) -> None:
        """Take a frame while there is power."""

    @classmethod
    @abstractmethod
    def routes(cls, configuration: DriveConfiguration) -> list[Route]:
        """Return the identifiers that belong to a drive, in both directions."""

    @abstractmethod
    def _foreign_frames(self, answer: Frame) -> list[Frame]:
        """Make frames that look like this answer and are none of anybody."""

    def _known(self, name: str) -> str:
        """
        Return the name under which a register is kept.

        :raises ValueRefused: there is no such register.
        """
        if name not in self.plant.parameters:
            raise ValueRefused(f"{self.name} has no parameter '{name}'")
        return name

    def _power_on(self, *, forget: bool) -> None:
        """Begin anew; a family adds what it keeps outside the plant."""
        self.plant.power_on()

    def _answer(self, frame: Frame, now: float) -> None:
        """Send an answer, as far as scripted faults let it."""
        self.answers += 1
        if not self._answer_faults:
            self._outbox.append(frame)
            return
        delay, frames = self._answer_faults.apply(frame)
        if delay > 0.0:
            self._late_count += 1
            heapq.heappush(self._late, (now + delay, self._late_count, frames))
        else:
            self._outbox += frames

    def _violation(self, rule: str) -> None:
        """Count a broken rule; the first one of its kind is announced."""
        if rule not in self.violations:
            self._notices.append(f'{self.name}: violation: {rule}')
        self.violations[rule] += 1

    # -- inside -----------------------------------------------------------------------------------

    def _restart(self, now: float, boot: float, *, forget: bool) -> None:
        self._drop_answers()
        self._power_on(forget=forget)
        self._deaf_until = now + boot

    def _repair(self, now: float) -> None:
        self._answer_faults.clear()
        self._stuck.clear()
        self.plant.stuck.clear()
        self.plant.operation.repair()
        if not self.powered:
            self._restart(now, BOOT_TIME, forget=False)

    def _drop_answers(self) -> None:
        self._outbox.clear()
        self._late.clear()
