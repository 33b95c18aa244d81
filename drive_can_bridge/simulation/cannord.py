# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated NORD inverter that speaks CANnord.

It does what the manuals define and nothing more: it answers process data sent to itself, and
parameter tasks; never a broadcast, and never anything that the manuals do not define. The answer
to process data shows the inverter as it was before them, as the manuals warn. When a fault occurs
it sends its process data unasked.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import ConfigurationError, RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.cannord import identifiers, process_data, states
from drive_can_bridge.protocols.cannord.identifiers import MessageObject
from drive_can_bridge.protocols.cannord.parameter_frame import (
    LENGTH, NUMBER_MAX, ParameterFrame, ParameterLayout, ResponseId, Task)
from drive_can_bridge.protocols.cannord.process_data import (
    EXTRA_LENGTH, LONG_LENGTH, MAIN_VALUES, SHORT_LENGTH)
from drive_can_bridge.protocols.cannord.states import (
    ENABLE_OPERATION, FAULT_RESET, NO_DISABLE_VOLTAGE, NO_QUICK_STOP, STATUS_BITS, SWITCH_ON)
from drive_can_bridge.simulation import quantities
from drive_can_bridge.simulation.drive import IgnoredFrame, SimulatedDrive
from drive_can_bridge.simulation.drive_machine import (
    FAULTS, Machine, MachineState, OperatingState, RUNNING, Transition)
from drive_can_bridge.simulation.motor import MotorPlant, WARNING_TEMPERATURE
from drive_can_bridge.simulation.quantities import clamp, nearest_raw, Quantity
from drive_can_bridge.simulation.registers import (
    AccessRefused, Mechanics, PlantFactory, Registers, WriteRefusal)

(INVALID_NUMBER, CANNOT_BE_CHANGED, LIMIT_EXCEEDED, WRONG_SUBINDEX, NOT_AN_ARRAY, INVALID_TYPE,
 ) = range(6)
INVALID_TASK, CANNOT_BE_REPRESENTED = 201, 202

_NEGATIVE = 0xFFFF
WARNING, SETPOINT_REACHED, BUS_CONTROL, ROTATING_RIGHT, ROTATING_LEFT = (
    1 << STATUS_BITS[name] for name in (
        'warning', 'setpoint_reached', 'bus_control', 'rotating_right', 'rotating_left'))
#: the identity of an SK 5xxE, by parameter number: version of the data base
IDENTITY = {742: 1}

#: status bits of a state: those of OFF2 and OFF3 come from the control word in two states
_STATUS = {
    MachineState.SWITCH_ON_DISABLED: 0x40,
    MachineState.READY_TO_SWITCH_ON: 0x31,
    MachineState.SWITCHED_ON: 0x33,
    MachineState.OPERATION_ENABLED: 0x37,
    MachineState.SHUTDOWN: 0x37,
    MachineState.QUICK_STOP: 0x17,
    MachineState.FAULT: 0x08,
}
#: OFF2 and OFF3 in the control word, and how far on they stand in the status word
_OFF = NO_DISABLE_VOLTAGE | NO_QUICK_STOP
_OFF_SHIFT = 3
#: the parameter set, in both
_SET = states.PARAMETER_SETS - 1 << states.PARAMETER_SET_SHIFT

_MACHINE = Machine((
    Transition(FAULTS, 0, 0, None),
    Transition(None, NO_DISABLE_VOLTAGE, 0, MachineState.SWITCH_ON_DISABLED),
    Transition((MachineState.QUICK_STOP,), 0, 0, None),              # ends at standstill only
    Transition(RUNNING, NO_QUICK_STOP, 0, MachineState.QUICK_STOP),
    Transition(None, NO_QUICK_STOP, 0, MachineState.SWITCH_ON_DISABLED),
    Transition(RUNNING, SWITCH_ON, 0, MachineState.SHUTDOWN),
    Transition(None, SWITCH_ON, 0, MachineState.READY_TO_SWITCH_ON),
    Transition((MachineState.SWITCH_ON_DISABLED,), 0, 0, None),      # left with bit 0 = 0 only
    Transition(None, ENABLE_OPERATION, ENABLE_OPERATION, MachineState.OPERATION_ENABLED),
    Transition(None, 0, 0, MachineState.SWITCHED_ON),
), reset=(FAULT_RESET, FAULT_RESET), power_on=(MachineState.SWITCH_ON_DISABLED, _OFF),
    # b4 = 0 uses the quick stop ramp, too, but leaves the inverter enabled
    ramp=states.ENABLE_RAMP)
#: P513, s that may pass between two telegrams; 0 or less: any
TELEGRAM_TIMEOUT = 513
#: what the fault number shows after that time: E10.2
TIMEOUT_FAULT = 10.2
#: P515
CAN_ADDRESS = 515
_RESERVED_BIT = 0x2000


@dataclass
class ParameterArray:
    """All entries with one number, by sub-index; one without a sub-index counts as 0."""

    members: dict[int, Parameter] = field(default_factory=dict)
    plain: bool = False

    @property
    def array(self) -> bool:
        """Whether array tasks are possible."""
        return not self.plain or len(self.members) > 1

    @property
    def sets(self) -> bool:
        """Whether each parameter set has a value of its own."""
        return self.plain and len(self.members) > 1


def groups_of(parameters: Mapping[str, Parameter]) -> dict[int, ParameterArray]:
    groups: dict[int, ParameterArray] = {}
    for parameter in parameters.values():
        if parameter.number is None or parameter.number > NUMBER_MAX:
            continue
        group = groups.setdefault(parameter.number, ParameterArray())
        group.members[parameter.subindex or 0] = parameter
        group.plain = group.plain or parameter.subindex is None
    return groups


class CannordTable:
    """
    Everything that the parameter channel reaches.

    What kind of parameter a number is follows from the entries of the profile that have it:

    ===================================== =====================================================
    entries                               kind
    ===================================== =====================================================
    one without ``subindex``              simple
    all with ``subindex``                 array; element = sub-index
    one without, others with ``subindex`` one value per parameter set; the one without is
                                          set 1, sub-index 1 to 3 are the sets 2 to 4
    ===================================== =====================================================

    A sub-index counts in array tasks and in plain ones: the rule in the manuals wants array
    tasks, examples in the manuals use plain ones. The motor obeys the values of the *active*
    parameter set.
    """

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        self._groups = groups_of(registers.parameters)
        self._active = 1

    def answer(self, task: ParameterFrame) -> tuple[ResponseId, int]:
        """
        Carry out a task.

        :return: response identifier, and the value, negative where it is.
        :raises AccessRefused: with the error number of the manual.
        """
        if task.identifier not in list(Task):
            raise AccessRefused(INVALID_TASK)
        what = Task(task.identifier)
        if what == Task.NONE:
            return ResponseId.NONE, 0
        group = self._groups.get(task.number)
        if group is None:
            raise AccessRefused(INVALID_NUMBER)
        if (what.array or what is Task.READ_ELEMENTS) and not group.array:
            raise AccessRefused(NOT_AN_ARRAY)
        if what == Task.READ_ELEMENTS:
            return ResponseId.ELEMENTS, max(group.members) + 1
        # The manuals contradict each other on a sub-index in plain tasks: where there is something
        # to choose, it counts here, as in their examples; a simple parameter has no use for it.
        parameter = group.members.get(task.index if group.array else 0)
        if parameter is None:
            raise AccessRefused(WRONG_SUBINDEX)
        if what.writes:
            self._write(parameter, task.value, double=what.double,
                        eeprom=bool(what.persistent))
        elif not parameter.readable:
            raise AccessRefused(CANNOT_BE_REPRESENTED)
        response = next(each for each in what.responses
                        if each.double is (parameter.type.bits == 32))
        return response, self._registers.raw(parameter.name)

    def select_set(self, parameter_set: int) -> None:
        """Select the active parameter set, 1 to 4."""
        if parameter_set == self._active:
            return
        self._active = parameter_set
        for group in self._groups.values():
            active = group.members.get(parameter_set - 1)
            if group.sets and active is not None:
                self._registers.stand_ins[group.members[0].name] = active.name

    def name_of(self, raw: Parameter) -> str | None:
        """Return the name of the parameter with a number and sub-index; None: there is none."""
        parameter = self.numbered(raw.number or 0, raw.subindex or 0)
        return parameter.name if parameter else None

    def numbered(self, number: int, subindex: int = 0) -> Parameter | None:
        """Return the parameter with a number and sub-index; None: there is none."""
        group = self._groups.get(number)
        return group.members.get(subindex) if group else None

    def _write(self, parameter: Parameter, value: int, *, double: bool, eeprom: bool) -> None:
        if (parameter.type.bits == 32) is not double:
            raise AccessRefused(INVALID_TYPE)
        high, low = value >> 16, value & 0xFFFF
        if not double and high not in (0, _NEGATIVE):
            raise AccessRefused(LIMIT_EXCEEDED)
        # the upper half shows a negative word, or is empty
        raw = low - 0x10000 if high and not double else parameter.raw_from_word(value)
        refusal = self._registers.refusal({parameter.name: raw})
        if refusal is not None:
            raise AccessRefused(LIMIT_EXCEEDED if refusal is WriteRefusal.OUT_OF_RANGE else
                                CANNOT_BE_CHANGED)
        self._registers.write(parameter.name, raw, keep=eeprom, wear=int(eeprom))


class InverterPlant(MotorPlant):
    """
    The motor of one inverter. See the base class.

    Control words: BU 0050 page 30 (bits) and page 38 (states); where the two differ, on what bit
    3 = 0 leads to, page 38 counts. A word with bit 10 = 0 is ignored as a whole.

    In process data 4000h is 100 % of the maximum frequency, whatever the profile calls it: so
    every frequency or speed among the actual values shows the same share of 100 % as the motor
    has, in hertz as in percent.
    """

    def __init__(self, registers: Registers, configuration: DriveConfiguration,
                 mechanics: Mechanics) -> None:
        # the motor knows set 1 and its stand-ins
        plain = {name: each for name, each in registers.parameters.items() if not each.subindex}
        super().__init__(registers, configuration, mechanics, operation=OperatingState(_MACHINE),
                         movable=plain)
        self._first = {each.number: each for each in plain.values() if each.number is not None}

    def command(self, value: float) -> float:
        """Return the frequency setpoint under the last control word."""
        operation, word = self.operation, self.operation.word
        if operation.state is MachineState.SHUTDOWN:
            return 0.0
        if operation.state is MachineState.OPERATION_ENABLED and not word & states.RELEASE_RAMP:
            return self.motor.shaft.speed
        if not word & states.ENABLE_SETPOINT:
            return 0.0
        # rotation right has priority
        moved = self.speed_setpoint
        if moved and word & states.ROTATE_LEFT and not word & states.ROTATE_RIGHT:
            raw = self.registers.clamped(moved.name, -self.registers.plain(moved.name))
            return float(moved.value_from_raw(raw))
        return value

    @property
    def status_word(self) -> int:
        motor, operation = self.motor, self.operation
        target = self.target if operation.enabled and not operation.stopping else 0.0
        word = _STATUS[operation.state] | operation.word & _SET | BUS_CONTROL
        if operation.state in (MachineState.SWITCH_ON_DISABLED, MachineState.FAULT):
            word |= (operation.word & _OFF) << _OFF_SHIFT
        if motor.temperature > WARNING_TEMPERATURE:
            word |= WARNING
        if motor.shaft.speed == target:
            word |= SETPOINT_REACHED
        # at standstill the manuals' examples show "right"
        return word | (ROTATING_LEFT if motor.shaft.speed < 0.0 else ROTATING_RIGHT)

    def initial(self, parameter: Parameter) -> int:
        """Return the initial content of a register: the same in all parameter sets."""
        first = self._first.get(parameter.number or 0, parameter)
        return IDENTITY.get(parameter.number or 0) or super().initial(first)

    def source(self, parameter: Parameter) -> Callable[[], int] | None:
        if parameter.number is not None or quantities.measured(parameter) is not Quantity.SPEED:
            return super().source(parameter)
        moved, motor = self.speed_setpoint, self.motor
        if moved is None:
            return lambda: 0
        own, its = parameter.type.raw_range, moved.type.raw_range
        return lambda: clamp(nearest_raw(moved, motor.shaft.speed, its), own)


class SimulatedCannordInverter(SimulatedDrive):
    """One inverter. See the base class."""

    plant: InverterPlant
    table: CannordTable

    def set_up(self) -> None:
        if not isinstance(self.plant, InverterPlant):
            raise ConfigurationError([f'{self.name}: an inverter needs an InverterPlant'])
        self._options = options = self.configuration.options
        self.table = CannordTable(self.registers)
        # parameters of known meaning, as they leave the factory, if the profile lists them
        for number, raw in ((TELEGRAM_TIMEOUT, 0), (CAN_ADDRESS, self.configuration.station)):
            parameter = self.table.numbered(number)
            if parameter is not None and parameter.writable:
                self.registers.set_value(parameter.name, parameter.value_from_raw(raw))
        self._layout = ParameterLayout(options.value_order, options.index_byte)
        self._main, self._main_response, self._task, self._response, *self._broadcasts = (
            route.identifier for route in self.routes)
        self.power_lost(forget=False)

    def power_lost(self, *, forget: bool) -> None:
        self.table.select_set(1)
        self._length = SHORT_LENGTH
        self._silent_since = math.inf       # inf: the next telegram is not waited for
        self._timed_out = False

    def find_routes(self) -> list[Route]:
        """Return the four identifiers of the address, and both broadcasts where one is claimed."""
        found, options = super().find_routes()[:len(MessageObject)], self.configuration.options
        extended, station = options.extended_identifiers, self.configuration.station
        if options.broadcast != 'none':
            found += [Route.of(each, extended=extended)
                      for each in identifiers.broadcasts(station, extended=extended)]
        return found

    def choose_plant(self) -> PlantFactory:
        return InverterPlant

    # -- telegrams --------------------------------------------------------------------------------

    def receive(self, frame: Frame, now: float) -> bool:
        identifier, data, extended = frame
        if extended is not self._options.extended_identifiers:
            return False
        if identifier == self._main or identifier in self._broadcasts:
            self._process_data(data, now, answered=identifier == self._main)
        elif identifier == self._task:
            self._parameter_task(data, now)
        else:
            return False
        return True

    def _process_data(self, data: bytes, now: float, *, answered: bool) -> None:
        if len(data) == EXTRA_LENGTH and not self._options.extra_setpoints:
            raise IgnoredFrame('five bytes of process data without extra_setpoints')
        if len(data) not in (SHORT_LENGTH, LONG_LENGTH, EXTRA_LENGTH):
            raise IgnoredFrame('process data of a length that the manual does not define')
        self.requests += 1
        self._look_at_clock(now)
        self._silent_since = now
        if self._timed_out:
            self._timed_out = False
            self.plant.operation.end_cause()
        # before the values are taken: it shows the inverter as it was when they came
        answer = self._status(len(data))
        requested = self.configuration.cyclic_request
        if len(data) == EXTRA_LENGTH:
            self._take(requested[MAIN_VALUES:], process_data.decode_extra(data))
        else:
            self._length = len(data)
            word, values = process_data.decode_main(data, swap=self._options.swap_setpoints_2_3)
            if word & _RESERVED_BIT:
                self._violation('reserved bit 13 of the control word')
            if word & states.DATA_VALID:
                self._take(requested, values)
                self.plant.operation.word_written(word)
            self.table.select_set(states.parameter_set_of(self.plant.operation.word))
        self.plant.advance(now)
        if answered:
            self.answer(answer, now)

    def _take(self, parameters: Sequence[Parameter], words: Sequence[int]) -> None:
        for parameter, word in zip(parameters, words, strict=False):
            if parameter.writable:
                self.registers.write(parameter.name, self.registers.clamped(
                    parameter.name, parameter.raw_from_word(word)))

    def _status(self, length: int) -> Frame:
        """Return the process data as they are now, as long as the request."""
        words = [self.registers.raw(p.name) & 0xFFFF for p in self.configuration.cyclic_response]
        if length == EXTRA_LENGTH:
            data = process_data.encode_extra(words[MAIN_VALUES:])
        else:
            places = 1 if length == SHORT_LENGTH else MAIN_VALUES
            data = process_data.encode_main(self.plant.status_word, words[:places], length=length,
                                            swap=self._options.swap_setpoints_2_3)
        return Frame(self._main_response, data, self._options.extended_identifiers)

    def _parameter_task(self, data: bytes, now: float) -> None:
        if len(data) != LENGTH:
            raise IgnoredFrame('parameter task without eight data bytes')
        try:
            task = self._layout.decode(data)
        except RemoteProtocolError:
            raise IgnoredFrame('parameter task that the manual does not define') from None
        self.requests += 1
        if data[2 if self._layout.index_byte == 'high' else 3]:
            self._violation('byte of the sub-index that holds no information is not 0')
        if task.identifier not in list(Task):
            self._violation('task identifier that does not exist (refused)')
        self._look_at_clock(now)
        try:
            response, value = self.table.answer(task)
        except AccessRefused as refusal:
            response, value = ResponseId.REFUSED, refusal.code
        self.answer(self._parameter_response(response, task.number, task.index, value), now)

    def _parameter_response(self, response: ResponseId, number: int, index: int, value: int,
                            ) -> Frame:
        return Frame(self._response, self._layout.encode(response, number, index, value),
                     self._options.extended_identifiers)

    # -- time -------------------------------------------------------------------------------------

    def next_timer(self) -> float:
        return min(super().next_timer(), self._silent_since + self._timeout)

    def handle_timer(self, now: float) -> None:
        super().handle_timer(now)
        self._look_at_clock(now)

    def _look_at_clock(self, now: float) -> None:
        """Trip after the time-out for telegrams. The first one starts the watch."""
        if now >= self._silent_since + self._timeout:
            self._silent_since = math.inf
            self.trip(now, math.inf, TIMEOUT_FAULT)
            self._notices.append(f'{self.name}: telegram time-out')

    @property
    def _timeout(self) -> float:
        """The time-out for telegrams, in s; infinity: none."""
        parameter = self.table.numbered(TELEGRAM_TIMEOUT)
        value = 0.0 if parameter is None else float(self.registers.value(parameter.name))
        return value if value > 0.0 else math.inf

    # -- faults -----------------------------------------------------------------------------------

    def trip(self, now: float, duration: float, code: float | None = None) -> None:
        """Trip by itself, and report it at once, unasked."""
        # a telegram ends the cause of this fault alone
        self._timed_out = code == TIMEOUT_FAULT
        super().trip(now, duration, code)
        self.answer(self._status(self._length), now)

    def foreign_frames(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        """Return the answer of an absent address, its other frame format, an answer."""
        station, shift = self.configuration.station, identifiers.EXTENDED_SHIFT
        last, junk = identifiers.ADDRESS_MAX + 1, bytes([0x5A]) * len(answer.data)
        others = ((station + step) % last for step in range(1, last))
        twin = answer.identifier >> shift if answer.extended else answer.identifier << shift
        return (
            (Frame(identifiers.identifier(MessageObject.PROCESS_RESPONSE, other,
                                          extended=answer.extended), junk, answer.extended)
             for other in others),
            (Frame(twin, junk, not answer.extended),),
            # P2047 = 5A5Ah was never requested
            (self._parameter_response(ResponseId.WORD, 0x7FF, 0, 0x5A5A),))
