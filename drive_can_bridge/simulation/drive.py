# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated drive: what all protocol families have in common.

Sans-IO, in the dialect of the bridge's sessions:

.. code-block:: python

    drive.receive_frame(frame, now)
    drive.handle_timer(now)            # when next_timer() says so
    for frame in drive.take_frames(): ...

A family derives a class that knows its telegrams. The values are in its
:class:`~.registers.Registers`, what moves is a :class:`~.registers.Plant`.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
import math
from typing import Protocol

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import DriveCanError, ValueRefused
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Parameter, Value, ValueKind
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.simulation.faults import Fault, FaultKind, FaultyOutbox, parse_fault
from drive_can_bridge.simulation.motor import MotorPlant
from drive_can_bridge.simulation.registers import Mechanics, PlantFactory, Registers

#: s that a drive is deaf after power came back
BOOT_TIME = 0.5
#: s without power, where a fault has no time
_POWER_CUTS = {FaultKind.RESTART: BOOT_TIME, FaultKind.FORGET: BOOT_TIME,
               FaultKind.POWER_CUT: 5.0, FaultKind.OFF: math.inf}


class AddressTable(Protocol):
    """The addresses of a drive."""

    def name_of(self, raw: Parameter) -> str | None:
        """Return the name of the register at an address; None: there is none."""


class IgnoredFrame(DriveCanError):
    """A frame that a drive ignores; the argument is the rule that it breaks."""


class Companion:
    """What a drive has beside the telegrams of a family: nothing, or a CANopen node."""

    def receive(self, frame: Frame, now: float) -> bool:
        """Handle a frame, as :meth:`SimulatedDrive.receive` does, which gets the others."""
        return False

    def next_timer(self) -> float:
        return math.inf

    def handle_timer(self, now: float) -> None:
        """Do what is due."""

    def look(self, now: float) -> None:
        """Update from the state of the drive."""

    def power_lost(self, back_at: float) -> None:
        """Power-cycle the companion, with power back at some time."""


class SimulatedDrive(ABC):
    """
    One simulated drive.

    :param mechanics: the load of the motor; None: none.
    :param plant: makes the plant; None: the family's choice.
    :ivar routes: the identifiers that belong to the drive, in both directions.
    :ivar neighbours: those of the other drives on the bus; scripted faults keep clear of them.
    :ivar companion: its node, if it has one.
    :ivar requests: requests understood.
    :ivar answers: answers given, before scripted faults.
    :ivar wear: EEPROM cells written, by parameter.
    :ivar violations: how often the master broke a rule of the protocol, by rule.
    :ivar table: the registers by the protocol's addresses.
    """

    table: AddressTable

    def __init__(self, configuration: DriveConfiguration, *,
                 mechanics: Mechanics | None = None, plant: PlantFactory | None = None) -> None:
        self.configuration = configuration
        self.name = configuration.name
        self.routes = self.find_routes()
        self.neighbours: list[Route] = []
        self.registers = Registers(
            {**configuration.profile.parameters, **self.own_parameters()},
            {p.name for p in (*configuration.cyclic_request, *configuration.cyclic_response)})
        self.plant = (plant or self.choose_plant())(
            self.registers, configuration, mechanics or Mechanics())
        self.registers.connect(self.plant)
        self.wear = self.registers.wear
        self.companion = Companion()
        self.requests = self.answers = 0
        self.violations: Counter[str] = Counter()
        self._notices: list[str] = []
        self._outbox = FaultyOutbox(self._foreign_frames)
        self._deaf_until = -math.inf
        self._foreign_turn = -1
        self._cut_at = math.inf
        self._set_by_fault: set[str] = set()
        self.set_up()

    # -- input and output -------------------------------------------------------------------------

    def receive_frame(self, frame: Frame, now: float) -> None:
        """Handle a frame from the bus. Any frame; what is not for this drive is ignored."""
        if now < self._deaf_until:
            return
        self._advance(now)
        try:
            if not (self.companion.receive(frame, now) or self.receive(frame, now)) and any(
                    route.matches(frame) for route in self.routes):
                self._violation('frame that only this drive may send')
        except IgnoredFrame as broken:
            self._violation(f'{broken} (ignored)')
        self.companion.look(now)
        if self.registers.settings_written >= self._cut_at:
            self._cut_at = math.inf
            self.lose_power(now, math.inf)

    def next_timer(self) -> float:
        """Return when :meth:`handle_timer` wants to be called; infinity: never."""
        return min(self._outbox.next_timer(), self.companion.next_timer())

    def handle_timer(self, now: float) -> None:
        """Do what is due: delayed answers, and the companion's timer."""
        self._advance(now)
        self._outbox.handle_timer(now)
        self.companion.handle_timer(now)

    def take_frames(self) -> list[Frame]:
        """Return the frames that the drive sends now."""
        frames, self._outbox.frames = self._outbox.frames, []
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
        :param now: advance the motor up to this time first.
        :raises ValueRefused: there is no such register.
        """
        self._advance(now)
        return self.registers.value(self._known(name))

    def set_value(self, name: str, value: Value, now: float | None = None) -> None:
        """
        Set a register, read-only ones included; an actual value is held there.

        :raises ValueRefused: there is no such register, or the value does not fit.
        """
        self._advance(now)
        self.registers.set_value(self._known(name), value)
        if now is not None:
            self.companion.look(now)

    def release(self, name: str) -> None:
        """Release an actual value that was set by hand: it follows the motor again."""
        self.registers.release(self._known(name))

    def fault(self, fault: str | Fault, now: float) -> None:
        """
        Apply a fault, ``late=0.15``.

        :raises ValueRefused: there is no such fault, or it does not suit this drive.
        """
        if isinstance(fault, str):
            fault = parse_fault(fault)
        self._advance(now)
        kind = fault.kind
        if kind in FaultyOutbox.FAULTS:
            self._outbox.add(fault)
        elif kind in (FaultKind.STUCK, FaultKind.REFUSE):
            self.registers.faults[kind, self._known(fault.argument), ''] = fault
        elif kind is FaultKind.NEEDS:
            name, other = map(self._known, fault.argument.split(':', 1))
            self.registers.faults[kind, name, other] = fault
        elif kind is FaultKind.SET:
            word, text = fault.argument.split(':', 1)
            name = self._known(word)
            self.set_value(name, _value(self.registers.parameters[name], text), now)
            self._set_by_fault.add(name)
        elif kind is FaultKind.STO:
            self.allow_torque(False)
            self._outbox.add(fault)
        elif kind is FaultKind.CUT_AT:
            self._cut_at = self.registers.settings_written + fault.argument
        elif kind in _POWER_CUTS:
            seconds = _POWER_CUTS[kind] if fault.argument is None else fault.argument
            self.lose_power(now, now + seconds, forget=kind is FaultKind.FORGET)
        elif kind is FaultKind.OK:
            self._repair(now)
        elif self.plant.operation.powered:
            self.trip(now, fault.argument or 0.0)
        self._notices.append(f'{self.name}: fault {fault}' if kind is not FaultKind.OK
                             else f'{self.name}: no fault any more')
        self.companion.look(now)

    @property
    def eeprom_writes(self) -> int:
        """The number of EEPROM cells written."""
        return sum(self.wear.values())

    @property
    def faults_text(self) -> str:
        """The faults in force, in words; 'ok' without any."""
        texts = [str(fault) for fault in (
            *self._outbox.faults.values(), *self.registers.faults.values())]
        if self.plant.operation.faulted:
            texts.append('tripped')
        if self._deaf_until == math.inf:
            texts.append('off')
        return ', '.join(texts) or 'ok'

    # -- hooks of a family ------------------------------------------------------------------------

    @abstractmethod
    def set_up(self) -> None:
        """Create the table, and other state of the family: registers and plant exist."""

    @abstractmethod
    def receive(self, frame: Frame, now: float) -> bool:
        """
        Handle a frame while there is power; return False: it is none for this drive.

        :raises IgnoredFrame: it is one, but breaks a rule.
        """

    @abstractmethod
    def foreign_frames(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        """
        Return frames that look like this answer and belong to no drive.

        :return: kinds of them, which take turns; of each the first that is no neighbour's is sent.
        """

    def find_routes(self) -> list[Route]:
        """Return the identifiers that belong to the drive: those that its family claims."""
        claims = FAMILIES[self.configuration.protocol].claims(self.configuration)
        return [claim.route for claim in claims]

    def own_parameters(self) -> Mapping[str, Parameter]:
        """Return the parameters that every drive of the family has, listed or not, by name."""
        return {}

    def choose_plant(self) -> PlantFactory:
        """Return what makes the plant, unless another one is passed."""
        return MotorPlant

    def trip(self, now: float, duration: float, code: float | None = None) -> None:
        """Trip by itself; the cause lasts for some seconds. See :meth:`.Operation.trip`."""
        self.plant.operation.trip(duration, code)
        self.plant.advance(now)

    def allow_torque(self, allowed: bool) -> None:
        """
        Set the input for safe torque off high (allowed) or low.

        :raises ValueRefused: this drive has none.
        """
        if not allowed:
            raise ValueRefused(command_sentences.no_sto_input(drive=self.name))

    def power_lost(self, *, forget: bool) -> None:  # noqa: B027  optional hook
        """Forget the family's state outside the registers."""

    # -- what a family uses -----------------------------------------------------------------------

    def answer(self, frame: Frame, now: float) -> None:
        """Send an answer, subject to scripted faults."""
        self.answers += 1
        self._outbox.answer(frame, now)

    def _violation(self, rule: str) -> None:
        """Count a broken rule; the first one of its kind is announced."""
        if rule not in self.violations:
            self._notices.append(f'{self.name}: violation: {rule}')
        self.violations[rule] += 1

    def send(self, frame: Frame) -> None:
        """Send a frame that is no answer; no fault touches it."""
        self._outbox.frames.append(frame)

    def lose_power(self, now: float, back_at: float, *, forget: bool = False) -> None:
        """Cut the power until some time; RAM is lost with it."""
        self._outbox.clear()
        self.plant.operation.power_off()
        self.plant.power_off()
        self.registers.lose_power()
        self.restart(back_at, forget=forget)
        self._advance(now)

    def restart(self, back_at: float, *, forget: bool = False) -> None:
        """Reset all conversations, and be deaf until some time."""
        self._deaf_until = back_at
        self.companion.power_lost(back_at)
        self.power_lost(forget=forget)

    # -- inside -----------------------------------------------------------------------------------

    def _known(self, name: str) -> str:
        """
        Return the name under which a register is kept.

        :raises ValueRefused: there is no such register.
        """
        if name in self.registers.parameters:
            return name
        family = FAMILIES[self.configuration.protocol]
        raw = family.raw_parameter(self.configuration, name)
        known = self.table.name_of(raw) if raw else None
        if known is None:
            raise ValueRefused(command_sentences.simulated_no_parameter(
                drive=self.name, name=name))
        return known

    def _foreign_frames(self, answer: Frame) -> list[Frame]:
        self._foreign_turn += 1
        kinds = self.foreign_frames(answer)
        return [frame for frame in kinds[self._foreign_turn % len(kinds)] if not any(
            route.matches(frame) for route in self.neighbours)][:1]

    def _advance(self, now: float | None) -> None:
        """Advance the motor up to now, if that is known; power may have come back on the way."""
        if now is None:
            return
        operation = self.plant.operation
        if not operation.powered and now >= self._deaf_until:
            self.plant.advance(self._deaf_until)
            self.plant.power_on()
            operation.powered = True
        self.plant.advance(now)

    def _repair(self, now: float) -> None:
        self._outbox.faults.clear()
        self.registers.faults.clear()
        self._cut_at = math.inf
        for name in self._set_by_fault:
            self.registers.release(name)
        self._set_by_fault.clear()
        self.allow_torque(True)
        self.plant.operation.repair()
        if self._deaf_until == math.inf:
            self.lose_power(now, now + BOOT_TIME)


def _value(parameter: Parameter, text: str) -> Value:
    """
    Return the value in a text of the command line.

    :raises ValueRefused: it is none of this parameter's kind.
    """
    try:
        if parameter.kind is ValueKind.BOOL:
            return {'true': True, 'false': False}[text]
        return int(text, 0) if parameter.kind is ValueKind.INTEGER else float(text)
    except (KeyError, ValueError):
        raise ValueRefused(command_sentences.simulated_no_value(
            text=text, name=parameter.name, kind=parameter.kind.words)) from None
