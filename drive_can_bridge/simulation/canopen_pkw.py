# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated motor controller with the PKW mailbox (Schneider TeSys T LTMR, CANopen).

It accepts PDOs in operational only. A request begins when the function byte changes, and at
nothing else. What the manual page leaves open is done as in docs/protocol_canopen_pkw.md, which
the configuration of the drive can change: one file describes both ends.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
import math
import struct
from typing import NamedTuple

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Parameter, Storage
from drive_can_bridge.core.profile import Profile
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.network import NmtState
from drive_can_bridge.protocols.canopen_pkw import pkw
from drive_can_bridge.protocols.canopen_pkw.addresses import BLOCKS, object_of, register_of
from drive_can_bridge.protocols.canopen_pkw.pkw import Address, WORD_MAX
from drive_can_bridge.simulation.canopen.node import CanopenNode, Contents
from drive_can_bridge.simulation.canopen.sdo import checked_length, CODES
from drive_can_bridge.simulation.drive import IgnoredFrame, SimulatedDrive
from drive_can_bridge.simulation.drive_machine import (
    FAULTS, Machine, MachineState, MachineStatus, OperatingState, StatusWord, Transition)
from drive_can_bridge.simulation.motor import MotorPlant
from drive_can_bridge.simulation.quantities import clamp, plausible
from drive_can_bridge.simulation.registers import (
    AccessRefused, Mechanics, Plant, PlantFactory, Registers, WriteRefusal)

#: bits of control register 1
RUN_FORWARD, RUN_REVERSE, RESET = 1 << 0, 1 << 1, 1 << 3
RUN = RUN_FORWARD | RUN_REVERSE

#: A; the largest full load current of the controller, and that of the motor
CONTROLLER_CURRENT = 27.0
LOAD_CURRENT = 6.3
INRUSH_CURRENT = 45.0
#: s
INRUSH_TIME = 0.4
START_TIME = 2.0
#: the motor may carry this share of its full load current for ever
SERVICE_FACTOR = 1.1
#: thermal image in s, per s of trip class: six times the full load current trips after the class
CLASS_FACTOR = -1.0 / math.log1p(-(SERVICE_FACTOR / 6.0) ** 2)
#: % of the thermal capacity
TRIP_LEVEL, ALARM_LEVEL, RESET_LEVEL = 100.0, 85.0, 75.0

#: trip codes
THERMAL_OVERLOAD, TEST_TRIP = 4, 10


#: after a trip the run bits have to go before they count again
MACHINE = Machine((
    Transition((MachineState.FAULT,), RUN, 0, MachineState.FAULT_RELEASED),
    Transition(FAULTS, 0, 0, None),
    Transition((MachineState.SWITCH_ON_DISABLED,), RUN, 0, MachineState.READY_TO_SWITCH_ON),
    Transition((MachineState.SWITCH_ON_DISABLED,), 0, 0, None),
    Transition(None, RUN, RUN_FORWARD, MachineState.OPERATION_ENABLED),
    Transition(None, RUN, RUN_REVERSE, MachineState.OPERATION_ENABLED),
    Transition(None, 0, 0, MachineState.READY_TO_SWITCH_ON),
), reset=(RESET, RESET), power_on=(MachineState.READY_TO_SWITCH_ON, 0))
GENERAL_CONFIGURATION = 601
TRIP_CLASS = 606
FULL_LOAD_RATIO = 652
NODE_ADDRESS = 696
CONTROL_REGISTER_1 = 704
STATUS_1 = 455

#: bit of the general configuration register: settings can be changed
CONFIGURATION_MODE = 1 << 0

#: registers that are written in configuration mode only
SETTINGS = {*range(540, 700)} - {GENERAL_CONFIGURATION}
#: what settings are in a new controller, by register: in configuration mode, as from the factory
DEFAULTS = {GENERAL_CONFIGURATION: CONFIGURATION_MODE, TRIP_CLASS: 5, FULL_LOAD_RATIO: 33, 653: 33,
            682: 0, 695: 0, CONTROL_REGISTER_1: 0, 705: 0}
#: its identity: port and controller firmware, serial number, ranges in 0.1 A; its
#: commercial reference, two characters a register
IDENTITY = {62: 10205, 76: 25003, 70: 2612, 71: 301, 72: 1, 74: int.from_bytes(b'SH', 'big'),
            81: 270, 96: 270, **dict(enumerate(struct.unpack('>6H', b'LTMR27CFM   '), 64))}
#: rank in the serial number: the node-ID, so that two controllers differ
SERIAL_RANK = 73
#: settings that accept only multiples of something, by register
STEPS = {TRIP_CLASS: 5}

Figure = Callable[[], float]
DEVICE_NAME = b'simulated LTMR'
JUNK = (0x5A5A, 0x5A5A)


class Starter:
    """
    The motor behind the contactor: currents, and a thermal image that trips.

    Not a model of any real controller. Time is an argument.

    :ivar thermal: % of the thermal capacity.
    :ivar full_load_current: A.
    :ivar time_constant: s, of the thermal image.
    :ivar on_for: s since it was switched on; infinity: it is off.
    """

    def __init__(self) -> None:
        self.thermal = 0.0
        self.on_for = math.inf
        self.settings(100.0, 5.0)

    @property
    def current(self) -> float:
        """The mean current of the phases, in A."""
        if self.on_for == math.inf:
            return 0.0
        return INRUSH_CURRENT if self.on_for < INRUSH_TIME else LOAD_CURRENT

    @property
    def ratio(self) -> float:
        return self.current / self.full_load_current

    @property
    def alarm(self) -> bool:
        """Whether the motor is close to a trip."""
        return self.thermal >= ALARM_LEVEL

    @property
    def time_to_reset(self) -> float:
        """The time in s until a motor that is off has cooled down enough."""
        return self.time_constant * math.log(max(self.thermal / RESET_LEVEL, 1.0))

    def settings(self, full_load_percent: float, trip_class: float) -> None:
        """Set the full load current, in % of the largest one, and the trip class."""
        self.full_load_current = max(full_load_percent, 1.0) / 100.0 * CONTROLLER_CURRENT
        self.time_constant = CLASS_FACTOR * max(trip_class, 1.0)

    def advance(self, duration: float, *, on: bool) -> bool:
        """
        Advance by some seconds.

        :param on: the contactor is closed.
        :return: the thermal capacity is used up, which has opened it.
        """
        before = 0.0 if self.on_for == math.inf else self.on_for
        self.on_for = before + duration if on else math.inf
        self.thermal += (self._final_level - self.thermal) * -math.expm1(
            -duration / self.time_constant)
        tripped = on and self.thermal >= TRIP_LEVEL
        if tripped:
            self.on_for = math.inf
        return tripped

    @property
    def _final_level(self) -> float:
        """The thermal level that the present current leads to."""
        return TRIP_LEVEL * (self.ratio / SERVICE_FACTOR) ** 2


class Cell(NamedTuple):
    """One register: the parameter it belongs to, and the lowest bit of what it holds of it."""

    parameter: Parameter
    shift: int


class RegisterTable:
    """
    Everything that can be addressed.

    A value of 32 bits has two registers, the order of its words is that of the configuration. A
    refused access changes nothing and carries an SDO abort code.
    """

    def __init__(self, configuration: DriveConfiguration, registers: Registers) -> None:
        self._registers = registers
        self._word_order = configuration.options.word_order
        self._cells: dict[Address, Cell] = {}
        parameters = list(registers.parameters.values())
        # the profile overrides the table of the vendor
        for parameter in parameters:
            if parameter.number is not None:
                self._enter(parameter, Address(parameter.number))
            if parameter.index is not None:
                self._enter(parameter, Address(parameter.index, parameter.subindex or 0))
        for parameter in parameters:
            register = register_number(parameter)
            place = None if register is None else object_of(register)
            if register is not None:
                self._enter(parameter, Address(register))
            if place is not None and parameter.index is None:
                self._enter(parameter, Address(*place))

    def _enter(self, parameter: Parameter, address: Address) -> None:
        shifts = range(0, parameter.type.bits, 16)
        if (parameter.word_order or self._word_order) == 'high_first':
            shifts = shifts[::-1]
        for shift in shifts:
            self._cells.setdefault(address, Cell(parameter, shift))
            address = address.next

    def read(self, address: Address, count: int) -> tuple[int, ...]:
        """
        Read one register or two adjacent ones.

        :raises AccessRefused: there is none, or it cannot be read.
        """
        cells = self._find(address, count)
        for cell in cells:
            if not cell.parameter.readable:
                raise AccessRefused(sdo.READ_OF_WRITE_ONLY)
        return tuple([self._value(cell.parameter) >> cell.shift & WORD_MAX for cell in cells])

    def write(self, address: Address, words: tuple[int, ...]) -> None:
        """
        Write one register or two adjacent ones, or none of them.

        :raises AccessRefused: there is none, it is read-only, or the value is refused.
        """
        values: dict[str, int] = {}
        wear: Counter[str] = Counter()
        for cell, word in zip(self._find(address, len(words)), words, strict=True):
            parameter = cell.parameter
            value = values.get(parameter.name, self._value(parameter))
            values[parameter.name] = value & ~(WORD_MAX << cell.shift) | word << cell.shift
            wear[parameter.name] += parameter.storage is Storage.EEPROM
        raws = {name: self._registers.parameters[name].raw_from_word(value)
                for name, value in values.items()}
        refusal = self._registers.refusal(raws)
        if refusal is not None:
            raise AccessRefused(CODES[refusal])
        for name, raw in raws.items():
            self._registers.write(name, raw, wear=wear[name])

    def highest_subindex(self, index: int) -> int | None:
        return max((address.subindex for address in self._cells
                    if address.subindex is not None and address.word == index), default=None)

    def read_object(self, index: int, subindex: int) -> bytes:
        """Read a register, or how many of them an index has."""
        highest = self.highest_subindex(index)
        if subindex == 0 and highest is not None:
            return bytes((highest,))
        return self.read(Address(index, subindex), 1)[0].to_bytes(2, 'little')

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        address = Address(index, subindex)
        if address in self._cells:
            checked_length(data, 2)
        self.write(address, (int.from_bytes(data[:2], 'little'),))

    def name_of(self, raw: Parameter) -> str | None:
        """Return the name of the parameter at a register or object; None: there is none."""
        address = Address(raw.index or 0, raw.subindex) if raw.number is None else (
            Address(raw.number))
        cell = self._cells.get(address)
        return None if cell is None else cell.parameter.name

    def _find(self, address: Address, count: int) -> list[Cell]:
        addresses = (address,) if count == 1 else (address, address.next)
        for each in addresses:
            if each not in self._cells:
                # no such number or index, or no such sub-index
                known = (any(block.index == each.word for block in BLOCKS)
                         or self.highest_subindex(each.word) is not None)
                raise AccessRefused(sdo.NO_SUCH_SUBINDEX if each.by_object and known
                                    else sdo.NO_SUCH_OBJECT)
        return [self._cells[each] for each in addresses]

    def _value(self, parameter: Parameter) -> int:
        return parameter.word_from_raw(self._registers.raw(parameter.name))


def register_number(parameter: Parameter) -> int | None:
    """Return the register of a parameter, by its number or by its CANopen address."""
    if parameter.number is not None or parameter.index is None:
        return parameter.number
    return register_of(parameter.index, parameter.subindex or 0)


def is_starter(profile: Profile) -> bool:
    """Return whether a profile is that of an LTMR: its control word is register 704."""
    control = profile.control
    word = profile.parameters.get(control.parameter) if control else None
    return word is not None and register_number(word) == CONTROL_REGISTER_1


class StarterPlant(Plant):
    """
    A :class:`.Starter` behind registers. Its thermal image survives a loss of power.

    It makes the registers look alive, belong together and react to commands.
    The meaning of some registers is unverified; docs/protocol_canopen_pkw.md has how far it
    can be trusted.
    """

    def __init__(self, registers: Registers, configuration: DriveConfiguration,
                 mechanics: Mechanics) -> None:
        self.registers = registers
        self.control = configuration.profile.control
        self.operation = OperatingState(MACHINE)
        self.starter = Starter()
        self._node = configuration.station
        # of several names for a register the first counts, as everywhere
        self._by_register = {register_number(p): p.name
                             for p in reversed(list(registers.parameters.values()))}
        self._figures = self._all_figures()

    def initial(self, parameter: Parameter) -> int:
        known: dict[int, int] = {**DEFAULTS, **IDENTITY, SERIAL_RANK: self._node}
        return known.get(register_number(parameter) or 0, plausible(parameter))

    def refusal(self, parameter: Parameter, raw: int) -> WriteRefusal | None:
        """Refuse settings unless the motor is off and in configuration mode, without an answer."""
        register = register_number(parameter) or 0
        if raw % STEPS.get(register, 1):
            return WriteRefusal.OUT_OF_RANGE
        configuring = self._content(GENERAL_CONFIGURATION) & CONFIGURATION_MODE
        if register in SETTINGS and (self.operation.enabled or not configuring):
            return WriteRefusal.UNTOLD
        return None

    def written(self, name: str, before: int, raw: int) -> None:
        if name == self._by_register[CONTROL_REGISTER_1]:
            self.operation.word_written(raw)

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
            return lambda: word.compose(MachineStatus(self.operation), self._status())
        figure = self._figures.get(register)
        if figure is None:
            return None
        ends, content = parameter.type.raw_range, figure
        return lambda: clamp(math.floor(content() + 0.5), ends)

    def _all_figures(self) -> dict[int | None, Figure]:
        """Return the functions for the contents of registers."""
        starter, code = self.starter, partial(self.operation.fault_code, TEST_TRIP)
        return {
            450: lambda: math.ceil(starter.time_to_reset) if self.operation.faulted else 0,
            451: code,
            452: lambda: _bit_of(int(code())),
            460: lambda: THERMAL_OVERLOAD if starter.alarm else 0,
            461: lambda: _bit_of(THERMAL_OVERLOAD) if starter.alarm else 0,
            465: lambda: starter.thermal,
            NODE_ADDRESS: lambda: self._node,
            # no trips and alarms of these groups, no inputs, nothing to ground
            **dict.fromkeys((453, 456, 457, 462, 463, 470, 508), lambda: 0),
            # outputs: one for each direction
            **dict.fromkeys((458, 459), lambda: (
                1 << bool(self.operation.word & RUN_REVERSE) if self.operation.enabled else 0)),
            # the average and the three phases, in % of the full load current, in 0.01 A
            **dict.fromkeys(range(466, 470), lambda: 100.0 * starter.ratio),
            **dict.fromkeys((500, 502, 504, 506), lambda: 100.0 * starter.current),
        }

    def _status(self) -> int:
        operation, ratio = self.operation, self.starter.ratio
        faulted = operation.faulted
        bits = (not faulted, operation.enabled, faulted, self.starter.alarm, faulted,
                faulted and operation.reset_allowed, True, ratio > 0.1)
        word = sum(1 << number for number, wanted in enumerate(bits) if wanted)
        return word | min(math.floor(32.0 * ratio + 0.5), 63) << 8 | (
            self.starter.on_for < START_TIME) << 15


def _bit_of(code: int) -> int:
    """Return the bit of a trip code in its register; codes from 17 on stand in the next one."""
    return 1 << code - 1 if 1 <= code <= 16 else 0


class SimulatedPkwDrive(SimulatedDrive):
    """One controller with a PKW mailbox. See the base class."""

    table: RegisterTable

    def set_up(self) -> None:
        options = self._options = self.configuration.options
        self._layout = pkw.PkwLayout(options.layout)
        self.table = RegisterTable(self.configuration, self.registers)
        self._abort_code_order: str = options.abort_code_order
        self.node = self.companion = CanopenNode(
            self, self.table, constants=self._constants, trip_code=TEST_TRIP)
        self.power_lost(forget=False)

    def find_routes(self) -> list[Route]:
        options = self.configuration.options
        return CanopenNode.routes(
            self.configuration.station, options.request_cob_id, options.response_cob_id)

    def choose_plant(self) -> PlantFactory:
        """Return a starter for the profile of an LTMR, a motor for any other one."""
        return StarterPlant if is_starter(self.configuration.profile) else MotorPlant

    def power_lost(self, *, forget: bool) -> None:
        """Forget the function byte of the last request, and the content of the mailbox."""
        self._request = self._response = pkw.idle_request()

    def receive(self, frame: Frame, now: float) -> bool:
        identifier, data, extended = frame
        if identifier != self._options.request_cob_id or extended:
            return False
        if self.node.state is not NmtState.OPERATIONAL:
            raise IgnoredFrame('request while the node is not operational')
        try:
            request = pkw.decode(data, self._layout)
        except RemoteProtocolError:
            raise IgnoredFrame('request without eight data bytes') from None
        if request.function_byte == self._request.function_byte:
            if request != self._request:
                raise IgnoredFrame('request with the function byte of the one before')
            return True
        self._request = request
        self.requests += 1
        self._response = self._response_to(request)
        self.answer(Frame(self._options.response_cob_id,
                          pkw.encode(self._response, self._layout), False), now)
        return True

    def _response_to(self, request: pkw.PkwMessage) -> pkw.PkwMessage:
        meaning = request.meaning
        if request.code == pkw.Function.NONE:
            return pkw.response(request)
        try:
            if meaning is None:
                raise AccessRefused(sdo.UNKNOWN_COMMAND)
            if meaning.writes:
                self.table.write(request.address, request.words[:meaning.count])
                return pkw.response(request)
            first, second = (*self.table.read(request.address, meaning.count), 0)[:2]
            return pkw.response(request, (first, second))
        except AccessRefused as error:
            return pkw.error_response(request, pkw.words_from_code(
                error.code, self._abort_code_order))

    def foreign_frames(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        """
        Return the answer of an absent node, the 29-bit twin, two unasked answers.

        The unasked ones have another toggle bit, or another register, than the request, and junk
        for data.
        """
        unasked: list[list[Frame]] = [[], []]
        if answer.identifier == self._options.response_cob_id:
            message = pkw.decode(answer.data, self._layout)._replace(words=JUNK)
            unasked = [[answer._replace(data=pkw.encode(changed, self._layout))] for changed in (
                message._replace(toggle=not message.toggle),
                message._replace(word=message.word ^ 1))]
        return (
            (answer._replace(identifier=network.RESPONSE_BASE + node)
             for node in range(1, network.NODE_MAX + 1) if node != self.node.number),
            (answer._replace(extended=True),), *unasked)

    def _constants(self) -> Contents:
        """Return the name, the mailbox, PDO4."""
        mailbox = b''.join(pkw.encode(message, self._layout) for message in (
            self._request, self._response))
        objects: Contents = {(0x1008, 0): DEVICE_NAME, (0x3000, 0): bytes((4,))}
        for number in range(1, 5):
            objects[0x3000, number] = mailbox[4 * number - 4:4 * number]
        for base, identifier, first in ((0x1400, self._options.request_cob_id, 1),
                                        (0x1800, self._options.response_cob_id, 3)):
            # identifier, sent on change; then the two halves of the mailbox
            for place, contents in ((base + 3, (identifier.to_bytes(4, 'little'), b'\xFF')), (
                    base + 0x203, [(0x30000020 | half << 8).to_bytes(4, 'little')
                                   for half in (first, first + 1)])):
                objects[place, 0] = bytes((2,))
                objects[place, 1], objects[place, 2] = contents
        return objects
