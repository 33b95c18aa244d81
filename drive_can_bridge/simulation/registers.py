# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The registers of a simulated drive: raw integers by the parameter names of its profile.

A :class:`Plant` computes some of them (actual values, status words). Every other one is
plain memory with the type, the limits and the access of the profile: it keeps what is written,
without power only what is in EEPROM.
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.parameters import Parameter, Storage, Value
from drive_can_bridge.simulation.drive_machine import OperatingState
from drive_can_bridge.simulation.faults import Fault, FaultKind, number, read_keys
from drive_can_bridge.simulation.quantities import clamp, nearest_raw


class WriteRefusal(Enum):
    """Why a write is refused, where a protocol can report it; one kind is acknowledged instead."""

    READ_ONLY = 'read-only'
    OUT_OF_RANGE = 'out of range'
    FORBIDDEN = 'a scripted fault'
    UNTOLD = 'nobody is told, the value stays'


class Plant(Protocol):
    """
    A motor, or another load of a drive. Time is an argument and never runs backwards.

    A family chooses a plant when a drive is made; a caller may pass another one:
    ``Simulation(configuration, plants={'lift': MyPlant})``, for instance derived from
    :class:`~.motor.MotorPlant`.

    :ivar operation: the operating state.
    :ivar volatile: names of further parameters that a loss of power resets.
    """

    operation: OperatingState
    volatile: Collection[str] = ()

    def initial(self, parameter: Parameter) -> int:
        """Return the initial content of a register, where its limits allow it."""

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        """Return the function that computes a read-only register; None: it is plain memory."""

    def refusal(self, parameter: Parameter, raw: int) -> WriteRefusal | None:
        """Return why a register refuses a value within its limits now; None: it does not."""

    def written(self, name: str, before: int, raw: int) -> None:
        """Handle a write to a register."""

    def advance(self, now: float) -> None:
        """Advance up to now, together with the operating state."""

    def power_off(self) -> None:
        """Record that power is lost."""

    def power_on(self) -> None:
        """Start again; the registers have the contents of EEPROM."""


@dataclass(frozen=True, slots=True)
class Mechanics:
    """
    The load of a simulated drive's motor, and how exactly its position is measured.

    :param load: share of the rated torque with which a weight pulls it backwards. Without torque,
        and without a brake, it sinks, at full load with a tenth of its rated speed.
    :param noise: raw steps by which a measured position is off at most, either way.
    :param brake: 1: closed whenever there is no torque.
    """

    load: float = 0.0
    noise: int = 0
    brake: int = 0

    @classmethod
    def parse(cls, text: str) -> 'Mechanics':
        """
        Return the mechanics in ``load=0.3,noise=1,brake=1``; what is left out is 0.

        :raises ValueRefused: with what is allowed.
        """
        return cls(**read_keys(text, {
            'load': ('0…1', number(float, 0.0, 1.0)), 'noise': ('0…100', number(int, 0, 100)),
            'brake': ('0…1', number(int, 0, 1))}))


class AccessRefused(DriveCanError):
    """
    An access that a drive does not carry out.

    :param code: the reason, as a number of its protocol.
    """

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class Registers:
    """
    All registers of one drive.

    :param volatile: names of parameters that a power cycle resets although the profile does not
        have where they are stored (those exchanged cyclically live in RAM).
    :ivar faults: the scripted faults in force, by kind, name and, where there is one, the name of
        another register that has to be written first.
    :ivar settings_written: writes that had an effect, of what is not exchanged cyclically.
    :ivar wear: EEPROM writes by name.
    :ivar stand_ins: name of the register that the motor uses instead of another one.
    """

    def __init__(self, parameters: Mapping[str, Parameter], volatile: Collection[str]) -> None:
        self.parameters = parameters
        self.faults: dict[tuple[FaultKind, str, str], Fault] = {}
        self.settings_written = 0
        self.wear: Counter[str] = Counter()
        self.stand_ins: dict[str, str] = {}
        self._volatile = volatile
        self._raw: dict[str, int] = {}
        self._initial: dict[str, int] = {}
        self._kept: dict[str, int] = {}
        self._held: dict[str, int] = {}
        self._written: set[str] = set()
        self._sources: dict[str, Callable[[], int]] = {}

    def connect(self, plant: Plant) -> None:
        """Fill the registers with initial contents; the plant computes the others."""
        self._plant = plant
        for name, parameter in self.parameters.items():
            self._initial[name] = self.clamped(name, plant.initial(parameter))
            source = None if parameter.writable else plant.source(parameter)
            if source is not None:
                self._sources[name] = source
        self._raw.update(self._initial)

    def raw(self, name: str) -> int:
        """Return a register, as of the last time that the plant moved."""
        source = self._sources.get(name)
        if source is None:
            return self._raw[name]
        held = self._held.get(name)
        return source() if held is None else held

    def plain(self, name: str) -> int:
        """Return the stored content of a register that is computed from it."""
        return self._raw[name]

    def clamped(self, name: str, raw: int) -> int:
        """Return the allowed raw integer nearest to another one."""
        return clamp(raw, self.parameters[name].raw_limits)

    def refusal(self, raws: Mapping[str, int]) -> WriteRefusal | None:
        """Return why registers that are written together refuse it; None: they do not."""
        for name, raw in raws.items():
            parameter = self.parameters[name]
            if not parameter.writable:
                return WriteRefusal.READ_ONLY
            for kind, one, other in self.faults:
                if one == name and (kind is FaultKind.REFUSE or (
                        kind is FaultKind.NEEDS and other not in self._written)):
                    return WriteRefusal.FORBIDDEN
            if raw != self.clamped(name, raw):
                return WriteRefusal.OUT_OF_RANGE
            refusal = self._plant.refusal(parameter, raw)
            if refusal not in (None, WriteRefusal.UNTOLD):
                return refusal
        return None

    def write(self, name: str, raw: int, *, keep: bool | None = None, wear: int = 0) -> None:
        """
        Write a register as an accepted request does. Some are acknowledged and change nothing.

        :param keep: survives a loss of power; None: as in the profile.
        :param wear: EEPROM cells that it writes.
        """
        parameter = self.parameters[name]
        blocked = self.faults and any(
            one == name and kind is not FaultKind.NEEDS for kind, one, _ in self.faults)
        if blocked or self._plant.refusal(parameter, raw) is not None:
            return
        if wear:
            self.wear[name] += wear
        self._written.add(name)
        self.settings_written += name not in self._volatile
        self._store(name, raw, not self.is_volatile(parameter) if keep is None else keep)

    def is_volatile(self, parameter: Parameter) -> bool:
        """Return whether a power cycle resets a register (of unknown storage: EEPROM)."""
        if parameter.storage is not None:
            return parameter.storage is Storage.RAM
        return parameter.name in self._volatile or parameter.name in self._plant.volatile

    def lose_power(self) -> None:
        """Forget everything but what is in EEPROM."""
        self._raw.update(self._initial)
        self._raw.update(self._kept)
        self._held.clear()
        self._written.clear()

    def value(self, name: str) -> Value:
        return self.parameters[name].value_from_raw(self.raw(name))

    def set_value(self, name: str, value: Value) -> None:
        """
        Set any register, read-only ones included. A computed one is held at the value.

        :raises ValueRefused: the value does not fit the parameter.
        """
        parameter = self.parameters[name]
        raw = parameter.raw_from_value(value)
        if name in self._sources:
            self._held[name] = raw
        else:
            self._store(name, raw, not self.is_volatile(parameter))

    def release(self, name: str) -> None:
        self._held.pop(name, None)

    def commanded(self, name: str) -> float:
        """Return the value for the motor: that of a register or of its stand-in."""
        name = self.stand_ins.get(name, name)
        return float(self.parameters[name].value_from_raw(self._raw[name]))

    def put(self, name: str, value: float) -> None:
        """Change a register from inside, without notice."""
        parameter = self.parameters[name]
        self._raw[name] = nearest_raw(parameter, value, parameter.raw_limits)

    def store_all(self) -> None:
        """Store all writable registers in EEPROM, as they are now."""
        for name, parameter in self.parameters.items():
            if parameter.writable:
                self._kept[name] = self._raw[name]

    def _store(self, name: str, raw: int, keep: bool) -> None:
        before, self._raw[name] = self._raw[name], raw
        if keep:
            self._kept[name] = raw
        self._plant.written(name, before, raw)


#: makes what is behind the registers of a drive
PlantFactory = Callable[[Registers, DriveConfiguration, Mechanics], Plant]
