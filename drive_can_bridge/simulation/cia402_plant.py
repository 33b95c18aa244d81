# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The inside of a simulated drive of CiA 402: objects, state machine, modes, and the axis it moves.

What the profile lists keeps its name, type and limits; the other objects are there under their raw
names (``x605a.00``). Types are those of EDS files of several makers, see docs/protocol_cia402.md.

The axis is counted in revolutions, and objects show it in the units that the profile has
for them; without one an increment is 1/10,000 of a revolution, and speeds are increments per s.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
import math
import random
from typing import Any, NamedTuple

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import AccessMode, Parameter, ParameterType
from drive_can_bridge.protocols.canopen.addressing import name_of_object
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.simulation import quantities
from drive_can_bridge.simulation.canopen.pdos import Checks, PdoHabits
from drive_can_bridge.simulation.canopen.sdo import Place
from drive_can_bridge.simulation.drive_machine import FAULTS, Machine, MachineState, OperatingState
from drive_can_bridge.simulation.faults import number, read_keys
from drive_can_bridge.simulation.motor import (
    COAST_TIME, FRICTION_TORQUE, INERTIA_TORQUE, LOAD_TORQUE, Motor, Rates, SINKING_SPEED, Travel,
    WARNING_TEMPERATURE)
from drive_can_bridge.simulation.registers import Mechanics, Registers, WriteRefusal

_TYPES = {'u8': ParameterType.UINT8, 'i8': ParameterType.INT8, 'u16': ParameterType.UINT16,
          'i16': ParameterType.INT16, 'u32': ParameterType.UINT32, 'i32': ParameterType.INT32}
INCREMENTS = 10_000.0
#: revolutions per second, and per second each second at full current
RATED_SPEED, FASTEST = 50.0, 1000.0
#: position of a new axis, in revolutions from its home switch
BEGINNING = 1.2345
#: revolutions that homing looks for the switch
SEARCH = 2.0
OVERCURRENT, LOST_MASTER, FOLLOWING_ERROR = 0x2310, 0x8130, 0x8611
PP, VL, PV, TQ, HM, IP, CSP, CSV, CST = 1, 2, 3, 4, 6, 7, 8, 9, 10
_ON_THE_SPOT = (35, 37)
_METHODS = (*range(1, 15), *range(17, 31), 33, 34, *_ON_THE_SPOT)
_HALT, _BIT_4 = states.HALT, 0x10
_MOVING = (PP, PV, TQ, VL, HM)

_STATUS = {MachineState.SWITCH_ON_DISABLED: 0x40, MachineState.READY_TO_SWITCH_ON: 0x21,
           MachineState.SWITCHED_ON: 0x23, MachineState.OPERATION_ENABLED: 0x27,
           MachineState.QUICK_STOP: 0x07,
           MachineState.FAULT: 0x08}
_FAULT_REACTION = 0x0F
_POSITIONS = (0x6062, 0x6064, 0x6065, 0x607A, 0x607C, 0x60C1, 0x60F4)
_SPEEDS = (0x606B, 0x606C, 0x607F, 0x6081, 0x6099, 0x60FF)
_ACCELERATIONS = (0x6083, 0x6084, 0x6085, 0x609A)
_PER_SPEED = {'rpm': 1 / 60, 'rev/s': 1.0, 'rad/s': 0.5 / math.pi, 'deg/s': 1 / 360}
_PER_WAY = {'rev': 1.0, 'rad': 0.5 / math.pi, 'deg': 1 / 360, '°': 1 / 360}


class Standard(NamedTuple):
    """An object of the standard: its type, whether it may be written, and its initial content."""

    type: ParameterType
    access: AccessMode
    initial: int = 0


def _standard(text: str) -> dict[Place, Standard]:
    """Return the objects in a table: index[.sub-index], type, access, initial content."""
    found = {}
    for line in text.split('\n'):
        for row in filter(None, map(str.strip, line.split(';'))):
            where, kind, access, *initial = row.split()
            index, _, subindex = where.partition('.')
            found[int(index, 16), int(subindex or '0', 16)] = Standard(
                _TYPES[kind], AccessMode(access), int(initial[0], 0) if initial else 0)
    return found


#: 605Ah 2: quick-stop ramp; 605Ch 1 and 605Dh 1: slow-down ramp; 605Bh 0: power off; 605Eh 2:
#: quick-stop ramp; 6007h 1: a lost bus is a fault. 6065h: an increment is 1/10,000 revolution
STANDARD = _standard("""
    1002 u32 ro; 1005 u32 rw 0x80; 1006 u32 rw; 1019 u8 rw; 1029.1 u8 rw
    6007 i16 rw 1; 603F u16 ro; 6040 u16 rw; 6041 u16 ro
    6042 i16 rw; 6043 i16 ro; 6044 i16 ro; 6046.1 u32 rw; 6046.2 u32 rw 3000
    6048.1 u32 rw 3000; 6048.2 u16 rw 1; 6049.1 u32 rw 3000; 6049.2 u16 rw 1
    605A i16 rw 2; 605B i16 rw; 605C i16 rw 1; 605D i16 rw 1; 605E i16 rw 2
    6060 i8 rw; 6061 i8 ro; 6062 i32 ro; 6064 i32 ro; 6065 u32 rw 20000
    606B i32 ro; 606C i32 ro; 6071 i16 rw; 6072 u16 rw 2000; 6074 i16 ro; 6075 u32 rw 4000
    6076 u32 rw 1270; 6077 i16 ro; 6078 i16 ro; 6079 u32 ro
    607A i32 rw; 607C i32 rw; 607D.1 i32 rw -0x80000000; 607D.2 i32 rw 0x7FFFFFFF
    607F u32 rw 500000; 6081 u32 rw 100000; 6083 u32 rw 500000; 6084 u32 rw 500000
    6085 u32 rw 2500000; 6086 i16 rw; 6087 u32 rw 1000
    6098 i8 rw 35; 6099.1 u32 rw 20000; 6099.2 u32 rw 5000; 609A u32 rw 500000
    60C0 i16 rw; 60C1.1 i32 rw; 60C2.1 u8 rw 1; 60C2.2 i8 rw -3
    60F4 i32 ro; 60FD u32 ro; 60FF i32 rw; 6502 u32 ro 0x3EF
""")


def own_parameters(configuration: DriveConfiguration) -> Mapping[str, Parameter]:
    """Return the objects of the standard that a profile does not list, by their raw names."""
    listed = {(each.index, each.subindex or 0)
              for each in configuration.profile.parameters.values()}
    return {name: Parameter(name=name, index=place[0], subindex=place[1], type=object_.type,
                            access=object_.access, listed=False)
            for place, object_ in STANDARD.items() if place not in listed
            for name in (name_of_object(*place),)}


@dataclass(frozen=True)
class Habits(PdoHabits):
    """
    Further differences between makers.

    :param start: s from NMT start to operational.
    :param mode_shown_early: 6061h shows a new mode at once; else in operation enabled only.
    :param leaves_quick_stop: 000Fh leads from quick stop active (605Ah 5 to 8) back to operation.
    :param stand_bit: bit 10 shows in quick stop active that the axis stands.
    :param ramp_bits: vl turns only with bits 4 to 6 of the control word.
    :param home_switch: where the switch is, in revolutions from the initial position; None: it
        is not found within two.
    """

    start: float = 0.0
    mode_shown_early: bool = True
    leaves_quick_stop: bool = True
    stand_bit: bool = True
    ramp_bits: bool = True
    home_switch: float | None = 0.0

    @classmethod
    def parse(cls, text: str) -> 'Habits':
        """
        Return the habits in ``mapping=operational,start=0.3,types=254+255,stand_bit=0``.

        :raises ValueRefused: with what is allowed.
        """
        return cls(**read_keys(text, _HABITS))


def _types(text: str) -> frozenset[int]:
    types = frozenset(map(int, text.split('+')))
    if not types <= frozenset(range(256)):
        raise ValueError
    return types


def _switch(text: str) -> bool:
    return {'0': False, '1': True}[text]


#: keys of habits in a text, with their parsers
_HABITS: Mapping[str, tuple[str, Callable[[str], Any]]] = {
    'mapping': ('|'.join(each.value for each in Checks), Checks),
    'start': ('0…60', number(float, 0.0, 60.0)),
    'types': ('1+254+255', _types),
    **dict.fromkeys(('fixed_mapping', 'no_remote', 'mode_shown_early', 'leaves_quick_stop',
                     'stand_bit', 'ramp_bits'), ('0|1', _switch)),
}


class DriveOperation(OperatingState):
    """
    The state machine of CiA 402, one state at a time; with the option codes 605Ah to 605Eh.

    :ivar safe: the input for safe torque off is high: there may be torque.
    :ivar leads_to: where standstill leads from a ramp down.
    """

    def __init__(self, option: Callable[[int], int]) -> None:
        self._option = option
        self.habits = Habits()
        self.safe = True
        super().__init__(Machine())

    def _enter(self, state: MachineState, leads_to: MachineState | None = None) -> None:
        self.state, self.leads_to = state, leads_to
        self.faulted = state in FAULTS
        self.stopping = state is MachineState.QUICK_STOP or leads_to is not None
        self.enabled = self.stopping or state is MachineState.OPERATION_ENABLED

    def _brake(self, option: int, to: MachineState) -> None:
        """Leave operation enabled: by ramp, or with power off at once."""
        if self._option(option) == 0:
            self._enter(to)
        elif self.leads_to is not to:
            self._enter(MachineState.OPERATION_ENABLED, to)

    def word_written(self, word: int) -> None:
        before, self.word = self.word, word
        state, running = self.state, self.state is MachineState.OPERATION_ENABLED
        if self.faulted:
            if word & ~before & states.FAULT_RESET and not self.leads_to and self.reset_allowed:
                self._enter(MachineState.SWITCH_ON_DISABLED)
        elif not self.safe:
            self._enter(MachineState.SWITCH_ON_DISABLED)
        elif not word & 0x02:
            self._enter(MachineState.SWITCH_ON_DISABLED)
        elif not word & 0x04:
            if running and self._option(states.QUICK_STOP_OPTION):
                self._enter(MachineState.QUICK_STOP)
            elif state is not MachineState.QUICK_STOP:
                self._enter(MachineState.SWITCH_ON_DISABLED)
        elif state is MachineState.QUICK_STOP:
            if word & 0x0F == 0x0F and self.stays and self.habits.leaves_quick_stop:
                self._enter(MachineState.OPERATION_ENABLED)
        elif not word & 0x01:
            if running:
                self._brake(states.SHUTDOWN_OPTION, MachineState.READY_TO_SWITCH_ON)
            else:
                self._enter(MachineState.READY_TO_SWITCH_ON)
        elif state is MachineState.SWITCH_ON_DISABLED:
            pass
        elif state is MachineState.READY_TO_SWITCH_ON:
            self._enter(MachineState.SWITCHED_ON)
        elif word & 0x08:
            self._enter(MachineState.OPERATION_ENABLED)
        elif running:
            self._brake(states.DISABLE_OPTION, MachineState.SWITCHED_ON)

    @property
    def stays(self) -> bool:
        """Whether the quick stop ends in quick stop active."""
        return self._option(states.QUICK_STOP_OPTION) >= 5

    def standstill(self) -> None:
        """Handle standstill: the end of a ramp."""
        if self.leads_to is not None:
            self._enter(self.leads_to)
        elif self.state is MachineState.QUICK_STOP and not self.stays:
            self._enter(MachineState.SWITCH_ON_DISABLED)

    def trip(self, duration: float = 0.0, code: float | None = None) -> None:
        ramp = self.enabled and self._option(0x605E) != 0
        super().trip(duration, code)
        if ramp:
            self._enter(MachineState.FAULT, MachineState.FAULT)

    def repair(self) -> None:
        if self.faulted:
            self._enter(MachineState.SWITCH_ON_DISABLED)

    def connection_lost(self) -> None:
        """Do as 6007h defines."""
        option = self._option(states.ABORT_CONNECTION_OPTION)
        if option == 1:
            self.trip(code=LOST_MASTER)
        elif option == 2 and not self.faulted:
            self._enter(MachineState.SWITCH_ON_DISABLED)
        elif option == 3 and not self.faulted:
            self.word_written(states.QUICK_STOP)

    def set_safe(self, safe: bool) -> None:
        """Set the input for safe torque off high or low. Low: power is off at once."""
        self.safe = safe
        if not safe:
            self._enter(MachineState.FAULT if self.faulted else MachineState.SWITCH_ON_DISABLED)


class ServoPlant:
    """
    One axis behind the objects of CiA 402.

    :ivar machine: its ``operation``.
    :ivar shaft: in revolutions and revolutions per second, from where the home switch is.
    """

    def __init__(self, registers: Registers, configuration: DriveConfiguration,
                 mechanics: Mechanics) -> None:
        self.registers = registers
        self._mechanics = mechanics
        self._noise, self._jitter = random.Random(configuration.name), 0
        self._cells: dict[Place, str] = {(each.index or 0, each.subindex or 0): each.name
                       for each in (*own_parameters(configuration).values(),
                                    *configuration.profile.parameters.values())}
        self._places: dict[str, Place] = {name: place for place, name in self._cells.items()}
        self._units = {name: _revolutions(registers.parameters[name])
                       for name in self._places}
        # only what was stored survives a loss of power
        self.volatile: Collection[str] = set(registers.parameters)
        fault = configuration.profile.fault
        self.trip_code = (quantities.likely_fault(fault.codes) if fault and fault.codes
                          else OVERCURRENT)
        self.machine = DriveOperation(self.raw)
        self.operation: OperatingState = self.machine
        self.habits = Habits()
        self.shaft = Travel(BEGINNING)
        self.motor = Motor(RATED_SPEED, mechanics.load, self.shaft)
        self._zero = 0.0
        self._begin()

    def _begin(self) -> None:
        """Reset the demand: nothing is commanded."""
        self._demand = self.shaft.position
        self._goal, self._goal_in = self._demand, 0.0
        self._target = self._demand
        self._acknowledged = self._reached = self._attained = self._homing_failed = False
        self._homing: float | None = None       # where it ends
        self._shown_mode = 0

    # -- registers --------------------------------------------------------------------------------

    def raw(self, index: int, subindex: int = 0) -> int:
        return self.registers.raw(self._cells[index, subindex])

    def value(self, index: int, subindex: int = 0) -> float:
        """Return an object in revolutions, or revolutions per s."""
        return self.raw(index, subindex) * self._units[self._cells[index, subindex]]

    def _position(self, index: int, subindex: int = 0) -> float:
        """Return where on the shaft an object has the axis."""
        return self.value(index, subindex) + self._zero

    def initial(self, parameter: Parameter) -> int:
        standard = STANDARD.get(self._places.get(parameter.name, (0, 0)))
        if standard is None:
            return quantities.plausible(parameter)
        factor = _revolutions(parameter) * INCREMENTS
        raw = standard.initial
        if abs(raw) < 0x7FFFFFFF and factor != 1.0 and self._places[parameter.name][0] in (
                *_POSITIONS, *_SPEEDS, *_ACCELERATIONS):
            raw = round(raw / factor)
        return quantities.clamp(raw, parameter.raw_limits)

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        place = self._places.get(parameter.name, (0, 0))
        motor = self.motor
        sources: dict[Place, Callable[[], float]] = {
            (0x603F, 0): lambda: self.operation.fault_code(self.trip_code),
            (0x6041, 0): lambda: self.status_word,
            (0x6061, 0): lambda: self._shown_mode,
            (0x6062, 0): lambda: self._demand - self._zero,
            (0x6064, 0): lambda: self.shaft.position - self._zero,
            (0x606B, 0): lambda: self.shaft.speed,
            (0x606C, 0): lambda: self.shaft.speed,
            (0x6043, 0): lambda: self.raw(0x6042),
            (0x6044, 0): lambda: self.shaft.speed,
            (0x6074, 0): self._torque,
            (0x6077, 0): self._torque,
            (0x6078, 0): lambda: 1000.0 * math.copysign(motor.current, motor.torque),
            (0x6079, 0): lambda: 48_000 * (1.0 + quantities.mains_swing(self.operation.now)),
            (0x60F4, 0): lambda: self._demand - self.shaft.position,
            (0x60FD, 0): self._inputs,
        }
        measure, unit = sources.get(place), self._units.get(parameter.name, 1.0)
        if measure is None:
            return None
        span, low = 1 << parameter.type.bits, parameter.type.raw_range[0]
        # counters wrap, as those of drives do
        if place == (0x6064, 0):
            return lambda: (math.floor(measure() / unit + 0.5) + self._jitter - low) % span + low
        return lambda: (math.floor(measure() / unit + 0.5) - low) % span + low

    def _torque(self) -> float:
        """Return thousandths of the rated torque: those that are wanted, in the modes for it."""
        pulls = self._mode in (CST, TQ) and self.operation.enabled and not self.operation.stopping
        return self.raw(0x6071) if pulls else 1000.0 * self.motor.torque

    def _inputs(self) -> int:
        """Return the inputs: home switch (bit 2), safe torque off inactive (bit 3)."""
        switch = self.habits.home_switch
        return (switch is not None and self.shaft.position <= switch) << 2 | (
            self.machine.safe << 3)

    def refusal(self, parameter: Parameter, raw: int) -> WriteRefusal | None:
        if self._places.get(parameter.name) == (states.MODE, 0) and not (
                raw == 0 or 1 <= raw <= 32 and self.raw(states.MODES_OFFERED) >> raw - 1 & 1):
            return WriteRefusal.OUT_OF_RANGE
        return None

    def written(self, name: str, before: int, raw: int) -> None:
        index = self._places.get(name, (0, 0))[0]
        mode, enabled = self._mode, self.operation.enabled
        if index == states.CONTROL_WORD:
            self.control(raw)
        elif index == states.MODE and raw != before:
            self._begin_mode()
        elif enabled and (index, mode) in ((0x607A, CSP), (0x60C1, IP)):
            self._interpolate(self._position(index, int(index == 0x60C1)))

    @property
    def _mode(self) -> int:
        return self.raw(states.MODE)

    # -- what the control word does ---------------------------------------------------------------

    def control(self, word: int) -> None:
        """Handle a control word."""
        operation, before = self.machine, self.machine.word
        was_enabled = operation.state is MachineState.OPERATION_ENABLED
        operation.word_written(word)
        if operation.state is not MachineState.OPERATION_ENABLED:
            self._show_mode()
            return
        if not was_enabled:
            before &= ~_BIT_4
            self._begin_mode()
        edge = word & ~before & _BIT_4
        if self._mode == PP:
            if edge:
                self._target, self._reached = self._position(0x607A), False
            self._acknowledged = bool(word & _BIT_4)
        elif self._mode == HM:
            if edge:
                self._home()
            elif not word & _BIT_4:
                self._homing = None

    def _begin_mode(self) -> None:
        """Start a mode at the present position; a cyclic target is followed from here on."""
        shown = self._shown_mode
        self._begin()
        self._shown_mode = shown
        self._show_mode()
        if self.operation.enabled and self._mode == CSP:
            self._interpolate(self._position(0x607A))

    def _show_mode(self) -> None:
        if self.habits.mode_shown_early or self.operation.state is MachineState.OPERATION_ENABLED:
            self._shown_mode = self._mode

    def _interpolate(self, goal: float) -> None:
        self._goal = goal
        self._goal_in = max(self.raw(0x60C2, 1) * 10.0 ** self.raw(0x60C2, 2), 1e-6)

    def _home(self) -> None:
        method, here = self.raw(0x6098), self.shaft.position
        self._attained, self._homing_failed = False, method not in _METHODS
        if self._homing_failed:
            return
        if method in _ON_THE_SPOT:
            self._homing = here
        elif method in (33, 34):
            self._homing = math.floor(here) if method == 33 else math.ceil(here)
        elif self.habits.home_switch is not None:
            self._homing = self.habits.home_switch
        else:
            self._homing = here - SEARCH

    # -- the axis ---------------------------------------------------------------------------------

    def advance(self, now: float) -> None:
        duration = self.operation.advance(now)
        if duration > 0.0 and self._mechanics.noise:
            self._jitter = self._noise.randint(-self._mechanics.noise, self._mechanics.noise)
        self._move(duration)
        self.motor.advance(duration, energised=self.operation.powered and self.operation.enabled)

    def _move(self, duration: float) -> None:
        operation, shaft, mode = self.operation, self.shaft, self._mode
        word, load = operation.word, self._mechanics.load
        if not (operation.powered and operation.enabled):
            coasting = RATED_SPEED / COAST_TIME
            if self._mechanics.brake:
                shaft.speed = shaft.slope = 0.0
            else:
                shaft.run(duration, -SINKING_SPEED * load * RATED_SPEED,
                          Rates(coasting, coasting))
            self._demand = self._goal = self._target = shaft.position
            return
        rate = self._rate(0x6084)
        if operation.stopping:
            option = self.raw(0x605A) if operation.state is MachineState.QUICK_STOP else 2 if (
                operation.faulted) else 1
            rate = {1: rate, 5: rate, 2: self._rate(0x6085), 6: self._rate(0x6085)}.get(
                option, FASTEST)
            self._run_out(duration, rate)
            return
        if word & _HALT and mode in _MOVING:
            self._halt(duration, rate)
        elif mode == CSP or mode == IP and word & _BIT_4:
            self._follow(duration)
        elif mode in (CSV, PV, VL):
            self._turn(duration, mode)
        elif mode in (CST, TQ):
            self._pull(duration)
        elif mode == PP:
            self._travel(duration)
        elif mode == HM and self._homing is not None:
            self._seek(duration)
        else:
            self._halt(duration, rate)
        if mode not in (CSP, IP):
            self._demand = self._goal = shaft.position

    def _run_out(self, duration: float, rate: float) -> None:
        """Brake, and handle standstill: without torque a load sinks."""
        needed = abs(self.shaft.speed) / rate
        self._halt(min(needed, duration), rate)
        self._demand = self._goal = self._target = self.shaft.position
        if needed <= duration:
            self.shaft.speed = self.shaft.slope = 0.0
            stopping = self.machine.state, self.machine.leads_to
            self.machine.standstill()
            if (self.machine.state, self.machine.leads_to) != stopping:
                self._move(duration - needed)

    def _halt(self, duration: float, rate: float) -> None:
        self.shaft.run(duration, 0.0, Rates(rate, rate))

    def _rate(self, index: int) -> float:
        return min(max(self.value(index), 0.01), FASTEST)

    def _follow(self, duration: float) -> None:
        """Follow the interpolated target; a step that no motor can follow trips."""
        while duration > 1e-9:      # less is what sums of times are off
            step = min(duration, self._goal_in or duration)
            if self._goal_in:
                self._demand += (self._goal - self._demand) * step / self._goal_in
                self._goal_in = max(self._goal_in - step, 0.0) if step < self._goal_in else 0.0
            if not self._goal_in:
                self._demand = self._goal
            way = self._demand - self.shaft.position
            most = RATED_SPEED * step
            moved = min(max(way, -most), most)
            self.shaft.position += moved
            before, self.shaft.speed = self.shaft.speed, moved / step
            self.shaft.slope = (self.shaft.speed - before) / step
            duration -= step
        if abs(self._demand - self.shaft.position) > self.value(0x6065):
            self.operation.trip(code=FOLLOWING_ERROR)

    def _turn(self, duration: float, mode: int) -> None:
        rates = Rates(FASTEST, FASTEST) if mode == CSV else Rates(
            self._rate(0x6083), self._rate(0x6084))
        target = self.value(0x6042 if mode == VL else 0x60FF)
        if mode == VL and self.habits.ramp_bits and self.operation.word & 0x70 != 0x70:
            target = 0.0
        self.shaft.run(duration, min(max(target, -RATED_SPEED), RATED_SPEED), rates)
        self._reached = self.shaft.speed == target

    def _pull(self, duration: float) -> None:
        """Turn by torque: friction that grows with the speed ends the acceleration."""
        torque = self.raw(0x6071) / 1000.0 - self._mechanics.load
        target = RATED_SPEED * math.copysign(
            max(abs(torque) - FRICTION_TORQUE, 0.0) / LOAD_TORQUE, torque)
        rate = RATED_SPEED * max(abs(torque), FRICTION_TORQUE) / INERTIA_TORQUE
        self.shaft.run(duration, min(max(target, -RATED_SPEED), RATED_SPEED), Rates(rate, rate))
        self._reached = True

    def _travel(self, duration: float) -> None:
        self.shaft.go(duration, self._target, max(self.value(0x6081), 1e-6), self._rate(0x6083))
        self._reached = self.shaft.position == self._target and not self.shaft.speed

    def _seek(self, duration: float) -> None:
        goal = self._homing
        assert goal is not None
        self.shaft.go(duration, goal, max(self.value(0x6099, 1), 1e-6), self._rate(0x609A))
        if self.shaft.position == goal and not self.shaft.speed:
            self._homing = None
            self._homing_failed = self.habits.home_switch is None and (
                self.raw(0x6098) not in (*_ON_THE_SPOT, 33, 34))
            self._attained = not self._homing_failed
            if self._attained:
                self._zero = self.shaft.position - self.value(0x607C)
        self._reached = self._homing is None

    @property
    def status_word(self) -> int:
        """The status word (6041h)."""
        operation, mode = self.machine, self._mode
        state, stands = operation.state, self.shaft.speed == 0.0
        word = states.REMOTE | operation.safe * states.VOLTAGE_ENABLED
        word |= _FAULT_REACTION if operation.faulted and operation.leads_to else _STATUS[state]
        if self.motor.temperature > WARNING_TEMPERATURE:
            word |= 0x80
        if state is MachineState.QUICK_STOP:
            return word | states.TARGET_REACHED * (stands and self.habits.stand_bit)
        if state is not MachineState.OPERATION_ENABLED:
            return word
        reached = stands if operation.stopping or operation.word & _HALT else self._reached
        bit_12 = {PP: self._acknowledged, HM: self._attained, PV: stands,
                  IP: bool(operation.word & _BIT_4)}.get(mode, mode in (CSP, CSV, CST))
        return (word | states.TARGET_REACHED * (reached and mode not in (CSP, CSV, CST))
                | states.BIT_12 * bit_12 | states.BIT_13 * self._homing_failed)

    def power_off(self) -> None:
        """Stop the shaft; the position is kept, as by an absolute encoder."""
        self.shaft.speed = self.shaft.slope = 0.0

    def power_on(self) -> None:
        self._begin()
        self._show_mode()


def _revolutions(parameter: Parameter) -> float:
    """Return the revolutions, or revolutions per s, of an object's raw step."""
    index, unit = parameter.index or 0, parameter.unit
    if index in _POSITIONS:
        known = _PER_WAY.get(unit)
    elif index in _SPEEDS:
        known = _PER_SPEED.get(unit)
    elif index in _ACCELERATIONS:
        known = _PER_SPEED.get(unit.removesuffix('^2' if unit.endswith('^2') else '/s'))
    elif index in (0x6042, 0x6043, 0x6044):
        return (parameter.scale if parameter.unit == 'rpm' else 1.0) / 60.0
    else:
        return 1.0
    return 1.0 / INCREMENTS if known is None else known * abs(parameter.scale)
