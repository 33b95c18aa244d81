# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated NORD inverter that speaks CANnord.

It does what the manuals say and nothing more: it answers process data sent to itself, and
parameter tasks; never a broadcast, and never anything that the manuals do not define. The answer
to process data shows the inverter as it was before them, as the manuals warn. When a fault occurs
it sends its process data unasked.
"""

from collections.abc import Sequence
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import ConfigurationError, RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.cannord import identifiers, process_data, states
from drive_can_bridge.protocols.cannord.identifiers import MessageObject
from drive_can_bridge.protocols.cannord.parameter_frame import (
    LENGTH, ParameterLayout, Response, Task,
)
from drive_can_bridge.protocols.cannord.process_data import (
    EXTRA_LENGTH, LONG_LENGTH, MAIN_VALUES, SHORT_LENGTH,
)
from drive_can_bridge.simulation.cannord_plant import InverterPlant
from drive_can_bridge.simulation.cannord_table import CannordTable, Refused
from drive_can_bridge.simulation.drive import ALONE, SimulatedDrive, Surroundings
from drive_can_bridge.simulation.faults import Fault, FaultKind, parse_fault
from drive_can_bridge.simulation.motor_plant import FAULT_CODE
from drive_can_bridge.simulation.plant import PlantFactory

#: P513, s that may pass between two telegrams; 0 or less: any
TELEGRAM_TIMEOUT = 513
#: what the fault number shows after that time: E10.2
TIMEOUT_FAULT = 10.2
#: P515
CAN_ADDRESS = 515
_RESERVED_BIT = 0x2000


class SimulatedCannordInverter(SimulatedDrive):
    """One inverter. See the base class."""

    plant: InverterPlant
    table: CannordTable

    def __init__(self, configuration: DriveConfiguration,
                 surroundings: Surroundings = ALONE) -> None:
        super().__init__(configuration, surroundings)
        if not isinstance(self.plant, InverterPlant):
            raise ConfigurationError([f'{self.name}: an inverter needs an InverterPlant'])
        options = configuration.family_options
        self._requested = configuration.cyclic_request
        self._reported = configuration.cyclic_response
        self.table = CannordTable(configuration.profile.parameters, self.registers)
        self._timeout_parameter = self.table.numbered(TELEGRAM_TIMEOUT)
        self._leaves_factory(TELEGRAM_TIMEOUT, 0)
        self._leaves_factory(CAN_ADDRESS, configuration.station)
        self._extended: bool = options['extended_identifiers']
        self._swap: bool = options['swap_setpoints_2_3']
        self._extra: bool = options['extra_setpoints']
        self._layout = ParameterLayout(options['value_order'], options['index_byte'])
        self._identifiers = {kind: self._identifier(kind) for kind in MessageObject}
        self._broadcasts = _broadcast_identifiers(configuration)
        self._length = SHORT_LENGTH
        self._silent_since = math.inf       # inf: the next telegram is not waited for
        self._timed_out = False
        self._foreign_turn = 0

    @classmethod
    def routes(cls, configuration: DriveConfiguration) -> list[Route]:
        """Return the four identifiers of the address, and the broadcasts that are listened to."""
        extended = configuration.family_options['extended_identifiers']
        own = [identifiers.identifier(kind, configuration.station, extended=extended)
               for kind in MessageObject]
        return [identifiers.route(value, extended=extended)
                for value in (*own, *_broadcast_identifiers(configuration))]

    def choose_plant(self) -> PlantFactory:
        """Return what makes the motor."""
        return InverterPlant

    # -- telegrams --------------------------------------------------------------------------------

    def receive(self, frame: Frame, now: float) -> None:
        if frame.extended is not self._extended:
            return
        if frame.identifier in self._broadcasts:
            self._process_data(frame.data, now, answered=False)
        elif frame.identifier == self._identifiers[MessageObject.PROCESS_REQUEST]:
            self._process_data(frame.data, now, answered=True)
        elif frame.identifier == self._identifiers[MessageObject.PARAMETER_TASK]:
            self._parameter_task(frame.data, now)
        elif frame.identifier in self._identifiers.values():
            self._violation('frame that only this drive may send')

    def _process_data(self, data: bytes, now: float, *, answered: bool) -> None:
        if len(data) == EXTRA_LENGTH and not self._extra:
            self._violation('five bytes of process data without extra_setpoints (ignored)')
            return
        if len(data) not in (SHORT_LENGTH, LONG_LENGTH, EXTRA_LENGTH):
            self._violation('process data of a length that the manual does not define (ignored)')
            return
        self.requests += 1
        self._look_at_clock(now)
        self._telegram_came(now)
        # before the values are taken: it tells how the inverter was when they came
        answer = self._status(len(data))
        if len(data) == EXTRA_LENGTH:
            self._take(self._requested[MAIN_VALUES:], process_data.decode_extra(data))
        else:
            self._length = len(data)
            self._main_data(data, now)
        self.plant.advance(now)
        if answered:
            self._answer(answer, now)

    def _main_data(self, data: bytes, now: float) -> None:
        word, values = process_data.decode_main(data, swap=self._swap)
        if word & _RESERVED_BIT:
            self._violation('reserved bit 13 of the control word')
        if word & states.DATA_VALID:
            self._take(self._requested, values)
        self.plant.state.word_written(word, now)
        self.table.select_set(self.plant.state.parameter_set)

    def _take(self, parameters: Sequence[Parameter], words: Sequence[int]) -> None:
        for parameter, word in zip(parameters, words, strict=False):
            if parameter.writable:
                self.registers.write(parameter.name, self.registers.clamped(
                    parameter.name, parameter.raw_from_word(word)))

    def _status(self, length: int) -> Frame:
        """Return the process data as they are now; the length is that of the request."""
        words = [self.registers.raw(p.name) & 0xFFFF for p in self._reported]
        if length == EXTRA_LENGTH:
            data = process_data.encode_extra(words[MAIN_VALUES:])
        else:
            places = 1 if length == SHORT_LENGTH else MAIN_VALUES
            data = process_data.encode_main(self.plant.status_word, words[:places], length=length,
                                            swap=self._swap)
        return Frame(self._identifiers[MessageObject.PROCESS_RESPONSE], data, self._extended)

    def _parameter_task(self, data: bytes, now: float) -> None:
        if len(data) != LENGTH:
            self._violation('parameter task without eight data bytes (ignored)')
            return
        try:
            task = self._layout.decode(data)
        except RemoteProtocolError:
            self._violation('parameter task that the manual does not define (ignored)')
            return
        self.requests += 1
        if data[2 if self._layout.index_byte == 'high' else 3]:
            self._violation('byte of the sub-index that holds no information is not 0')
        if task.identifier not in list(Task):
            self._violation('task identifier that does not exist (refused)')
        self._look_at_clock(now)
        try:
            response, value = self.table.answer(task)
        except Refused as refusal:
            response, value = Response.REFUSED, refusal.args[0]
        answer = self._layout.encode(response, task.number, task.index, value)
        self._answer(Frame(self._identifiers[MessageObject.PARAMETER_RESPONSE], answer,
                           self._extended), now)

    # -- time -------------------------------------------------------------------------------------

    def next_timer(self) -> float:
        """Return when :meth:`handle_timer` wants to be called; infinity: never."""
        return min(super().next_timer(), self._silent_since + self._timeout)

    def handle_timer(self, now: float) -> None:
        """Do what is due: answers that were held back, and the end of patience."""
        super().handle_timer(now)
        self._look_at_clock(now)

    def _look_at_clock(self, now: float) -> None:
        """Trip when no telegram came for too long. The first one starts the watch."""
        if now >= self._silent_since + self._timeout:
            self._silent_since = math.inf
            self._timed_out = True
            self._trip(now, TIMEOUT_FAULT, math.inf)
            self._notices.append(f'{self.name}: telegram time-out')

    def _telegram_came(self, now: float) -> None:
        self._silent_since = now
        if self._timed_out:
            self._timed_out = False
            self.plant.state.end_cause(now)

    @property
    def _timeout(self) -> float:
        """Seconds between telegrams that are allowed."""
        if self._timeout_parameter is None:
            return math.inf
        value = float(self.registers.value(self._timeout_parameter.name))
        return value if value > 0.0 else math.inf

    # -- faults -----------------------------------------------------------------------------------

    def fault(self, fault: str | Fault, now: float) -> None:
        """Play a fault; one of the inverter itself is told at once, unasked."""
        if isinstance(fault, str):
            fault = parse_fault(fault)
        super().fault(fault, now)
        if fault.kind is FaultKind.TRIP and now >= self._deaf_until:
            self._trip(now, FAULT_CODE, fault.number or 0.0)

    def _trip(self, now: float, code: float, duration: float) -> None:
        self.plant.fault_code = code
        self.plant.trip(duration)
        self._answer(self._status(self._length), now)

    def power_lost(self, back_at: float, *, forget: bool) -> None:
        """Begin with parameter set 1, and wait for a first telegram."""
        self.table.select_set(1)
        self._length = SHORT_LENGTH
        self._silent_since = math.inf
        self._timed_out = False

    def _leaves_factory(self, number: int, raw: int) -> None:
        """Give a parameter of known meaning its value, if the profile lists it."""
        parameter = self.table.numbered(number)
        if parameter is not None and parameter.writable:
            self.registers.set_value(parameter.name, parameter.value_from_raw(raw))

    # -- frames of others -------------------------------------------------------------------------

    def _identifier(self, kind: MessageObject) -> int:
        return identifiers.identifier(kind, self.configuration.station, extended=self._extended)

    def foreign_frames(self, answer: Frame) -> list[Frame]:
        """Return one of: the answer of an absent address, its twin of the other form, a task."""
        self._foreign_turn += 1
        turn = self._foreign_turn % 3
        if turn == 1:
            last = identifiers.ADDRESS_MAX + 1
            others = [(self.configuration.station + step) % last for step in range(1, last)]
            junk = bytes([0x5A]) * len(answer.data)
            return self._nobodys([
                Frame(identifiers.identifier(MessageObject.PROCESS_RESPONSE, address,
                                             extended=answer.extended), junk, answer.extended)
                for address in others])
        if turn == 2:
            shift = identifiers.EXTENDED_SHIFT
            twin = answer.identifier >> shift if answer.extended else answer.identifier << shift
            return [Frame(twin, bytes([0x5A]) * len(answer.data), not answer.extended)]
        # an answer that nobody asked for: P2047 = 5A5Ah
        data = self._layout.encode(Response.WORD, 0x7FF, 0, 0x5A5A)
        return [Frame(self._identifiers[MessageObject.PARAMETER_RESPONSE], data, self._extended)]


def _broadcast_identifiers(configuration: DriveConfiguration) -> tuple[int, ...]:
    """Return the identifiers of the broadcasts that an inverter obeys: both, or none."""
    options = configuration.family_options
    if options['broadcast'] == 'none':
        return ()
    extended = options['extended_identifiers']
    return (identifiers.group_identifier(configuration.station, extended=extended),
            identifiers.all_identifier(extended=extended))
