# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
What the registers of a TeSys T LTMR show of a motor starter, and which writes they take.

It is there so that the registers look alive, belong together and react to what is commanded.
Which register means what is partly recollection; docs/protocol_canopen_pkw.md says how far it can
be trusted.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
import math
import struct

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.simulation.canopen_pkw_registers import register_number
from drive_can_bridge.simulation.control import Operation, Report, StatusWord
from drive_can_bridge.simulation.plant import Mechanics, Plant, Refusal
from drive_can_bridge.simulation.registers import Registers
from drive_can_bridge.simulation.scales import clamp, mains_swing, plausible
from drive_can_bridge.simulation.starter import (
    MACHINE, RUN_REVERSE, Starter, TEST_TRIP, THERMAL_OVERLOAD,
)

GENERAL_CONFIGURATION = 601
TRIP_CLASS = 606
FULL_LOAD_RATIO = 652
NODE_ADDRESS = 696
CONTROL_REGISTER_1 = 704
CONTROL_REGISTER_2 = 705
STATUS_1 = 455

#: bit of the general configuration register: settings can be changed
CONFIGURATION_MODE = 1 << 0
#: bits of control register 2
CLEAR_ALL, CLEAR_THERMAL_LEVEL, CLEAR_SETTINGS = 1 << 0, 1 << 2, 1 << 3

#: registers that are written in configuration mode only
SETTINGS = {*range(540, 700)} - {GENERAL_CONFIGURATION}
#: what settings are in a new controller, by register: in configuration mode, as from the factory
DEFAULTS = {GENERAL_CONFIGURATION: CONFIGURATION_MODE, TRIP_CLASS: 5, FULL_LOAD_RATIO: 33, 653: 33,
            682: 0, 695: 0, CONTROL_REGISTER_1: 0, CONTROL_REGISTER_2: 0}
#: what it says of itself: port and controller firmware, serial number, ranges in 0.1 A; its
#: commercial reference, two characters a register
IDENTITY = {62: 10205, 76: 25003, 70: 2612, 71: 301, 72: 1, 74: int.from_bytes(b'SH', 'big'),
            81: 270, 96: 270, **dict(enumerate(struct.unpack('>6H', b'LTMR27CFM   '), 64))}
#: rank in the serial number: the node-ID, so that two controllers differ
SERIAL_RANK = 73
#: settings that take only multiples of something, by register
STEPS = {TRIP_CLASS: 5}

MAINS_VOLTAGE = 400.0
MAINS_FREQUENCY = 50.0
POWER_FACTOR = 0.85
NEVER = 9999

Figure = Callable[[], float]


def is_starter(profile: Profile) -> bool:
    """Tell whether a profile is that of an LTMR: its control word is register 704."""
    control = profile.control
    word = profile.parameters.get(control.parameter) if control else None
    return word is not None and register_number(word) == CONTROL_REGISTER_1


class StarterPlant(Plant):
    """A :class:`.Starter` behind registers. Its thermal image outlives a loss of power."""

    def __init__(self, registers: Registers, configuration: DriveConfiguration,
                 mechanics: Mechanics) -> None:
        self.registers = registers
        self.control = configuration.profile.control
        self.operation = Operation(MACHINE)
        self.starter = Starter()
        self._node = configuration.station
        # of several names for a register the first counts, as everywhere
        self._by_register = {register_number(p): p.name
                             for p in reversed(list(registers.parameters.values()))}
        self._figures = self._all_figures()

    def initial(self, parameter: Parameter) -> int:
        known: dict[int, int] = {**DEFAULTS, **IDENTITY, SERIAL_RANK: self._node}
        return known.get(register_number(parameter) or 0, plausible(parameter))

    def refusal(self, parameter: Parameter, raw: int) -> Refusal | None:
        """Take settings with the motor off and in configuration mode only; no word otherwise."""
        register = register_number(parameter) or 0
        if raw % STEPS.get(register, 1):
            return Refusal.OUT_OF_RANGE
        configuring = self._content(GENERAL_CONFIGURATION) & CONFIGURATION_MODE
        if register in SETTINGS and (self.operation.enabled or not configuring):
            return Refusal.UNTOLD
        return None

    def written(self, name: str, before: int, raw: int) -> None:
        if name == self._by_register[CONTROL_REGISTER_1]:
            self.operation.word_written(raw)
        elif name == self._by_register.get(CONTROL_REGISTER_2):
            appeared = raw & ~before
            if appeared & (CLEAR_ALL | CLEAR_THERMAL_LEVEL):
                self.starter.thermal = 0.0
                self.operation.end_cause()
            if appeared & (CLEAR_ALL | CLEAR_SETTINGS):
                for register in (TRIP_CLASS, FULL_LOAD_RATIO, 653):
                    if register in self._by_register:
                        self.registers.reset(self._by_register[register])

    def _content(self, register: int) -> int:
        name = self._by_register.get(register)
        return DEFAULTS[register] if name is None else self.registers.plain(name)

    def advance(self, now: float) -> None:
        starter, operation = self.starter, self.operation
        starter.settings(self._content(FULL_LOAD_RATIO), self._content(TRIP_CLASS))
        if starter.advance(operation.advance(now), on=operation.enabled):
            operation.trip(starter.time_to_reset, THERMAL_OVERLOAD)

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        register = register_number(parameter)
        if register == STATUS_1:
            # the profile's own conditions are met in addition, whatever its bits are called
            word = StatusWord(replace(parameter, bits=()), self.control)
            return lambda: word.compose(Report(self.operation), self._status())
        figure = self._figures.get(register)
        if figure is None:
            return None
        ends, content = parameter.type.raw_range, figure
        return lambda: clamp(math.floor(content() + 0.5), ends)

    def _all_figures(self) -> dict[int | None, Figure]:
        """Return what gives the contents of registers."""
        starter, code = self.starter, partial(self.operation.fault_code, TEST_TRIP)
        found: dict[int | None, Figure] = {
            450: lambda: math.ceil(starter.time_to_reset) if self.operation.faulted else 0,
            451: code,
            452: lambda: _bit_of(int(code())),
            460: lambda: THERMAL_OVERLOAD if starter.alarm else 0,
            461: lambda: _bit_of(THERMAL_OVERLOAD) if starter.alarm else 0,
            465: lambda: starter.thermal,
            471: lambda: 1 if starter.current else 0,
            472: lambda: 32.0 + 0.1 * starter.thermal,
            474: lambda: 100.0 * MAINS_FREQUENCY,
            475: lambda: 10.0 * (100.0 + 0.8 * starter.thermal),
            481: lambda: 100.0 * POWER_FACTOR if starter.current else 0,
            511: lambda: min(starter.time_to_trip, NEVER),
            NODE_ADDRESS: lambda: self._node,
            # no trips and alarms of these groups, no inputs, nothing to ground
            **dict.fromkeys((453, 456, 457, 462, 463, 470, 508), lambda: 0),
            # outputs: one for each direction
            **dict.fromkeys((458, 459), lambda: (
                1 << bool(self.operation.word & RUN_REVERSE) if self.operation.enabled else 0)),
        }
        # active and reactive power, in 0.1 kW
        for register, share in ((482, POWER_FACTOR), (483, math.sqrt(1.0 - POWER_FACTOR ** 2))):
            found[register] = _scaled(math.sqrt(3.0) * MAINS_VOLTAGE * share / 100.0,
                                      lambda: starter.current)
        # the average and the three phases, in % of the full load current, in 0.01 A, in V
        for place, share in enumerate((1.0, 1.01, 0.99, 1.0)):
            found[466 + place] = _scaled(100.0 * share, lambda: starter.ratio)
            found[500 + 2 * place] = _scaled(100.0 * share, lambda: starter.current)
        for place, share in enumerate((1.0, 0.998, 1.002, 1.0)):
            found[476 + place] = _scaled(MAINS_VOLTAGE * share,
                                         lambda: 1.0 + mains_swing(self.operation.now))
        return found

    def _status(self) -> int:
        operation, ratio = self.operation, self.starter.ratio
        faulted = operation.faulted
        bits = (not faulted, operation.enabled, faulted, self.starter.alarm, faulted,
                faulted and operation.reset_allowed, True, ratio > 0.1)
        word = sum(1 << number for number, wanted in enumerate(bits) if wanted)
        return word | min(math.floor(32.0 * ratio + 0.5), 63) << 8 | self.starter.starting << 15


def _scaled(factor: float, figure: Figure) -> Figure:
    return lambda: factor * figure()


def _bit_of(code: int) -> int:
    """Return the bit of a trip code in its register; codes from 17 on stand in the next one."""
    return 1 << code - 1 if 1 <= code <= 16 else 0
