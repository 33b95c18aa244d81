# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated NORD inverter that speaks CANnord.

It does what the manuals say and nothing more: it answers process data sent to itself, and
parameter tasks; never a broadcast, and never anything that the manuals do not define. The answer
to process data shows the inverter as it was before them, as the manuals warn. When a fault occurs
it sends its process data unasked.
"""

from collections.abc import Iterable, Sequence
import math

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
from drive_can_bridge.simulation.cannord_table import CannordTable
from drive_can_bridge.simulation.drive import Ignored, SimulatedDrive
from drive_can_bridge.simulation.registers import PlantFactory, Refused

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
            found += [identifiers.route(each, extended=extended)
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
            raise Ignored('five bytes of process data without extra_setpoints')
        if len(data) not in (SHORT_LENGTH, LONG_LENGTH, EXTRA_LENGTH):
            raise Ignored('process data of a length that the manual does not define')
        self.requests += 1
        self._look_at_clock(now)
        self._silent_since = now
        if self._timed_out:
            self._timed_out = False
            self.plant.operation.end_cause()
        # before the values are taken: it tells how the inverter was when they came
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
        """Return the process data as they are now; the length is that of the request."""
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
            raise Ignored('parameter task without eight data bytes')
        try:
            task = self._layout.decode(data)
        except RemoteProtocolError:
            raise Ignored('parameter task that the manual does not define') from None
        self.requests += 1
        if data[2 if self._layout.index_byte == 'high' else 3]:
            self._violation('byte of the sub-index that holds no information is not 0')
        if task.identifier not in list(Task):
            self._violation('task identifier that does not exist (refused)')
        self._look_at_clock(now)
        try:
            response, value = self.table.answer(task)
        except Refused as refusal:
            response, value = Response.REFUSED, refusal.code
        self.answer(self._parameter_response(response, task.number, task.index, value), now)

    def _parameter_response(self, response: Response, number: int, index: int, value: int,
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
        """Trip when no telegram came for too long. The first one starts the watch."""
        if now >= self._silent_since + self._timeout:
            self._silent_since = math.inf
            self.trip(now, math.inf, TIMEOUT_FAULT)
            self._notices.append(f'{self.name}: telegram time-out')

    @property
    def _timeout(self) -> float:
        """Seconds between telegrams that are allowed."""
        parameter = self.table.numbered(TELEGRAM_TIMEOUT)
        value = 0.0 if parameter is None else float(self.registers.value(parameter.name))
        return value if value > 0.0 else math.inf

    # -- faults -----------------------------------------------------------------------------------

    def trip(self, now: float, duration: float, code: float | None = None) -> None:
        """Fail by itself, and tell at once, unasked."""
        # a telegram ends the cause of this fault alone
        self._timed_out = code == TIMEOUT_FAULT
        super().trip(now, duration, code)
        self.answer(self._status(self._length), now)

    def foreign_frames(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        """Return the answer of an absent address, its twin of the other form, an answer."""
        station, shift = self.configuration.station, identifiers.EXTENDED_SHIFT
        last, junk = identifiers.ADDRESS_MAX + 1, bytes([0x5A]) * len(answer.data)
        others = ((station + step) % last for step in range(1, last))
        twin = answer.identifier >> shift if answer.extended else answer.identifier << shift
        return (
            (Frame(identifiers.identifier(MessageObject.PROCESS_RESPONSE, other,
                                          extended=answer.extended), junk, answer.extended)
             for other in others),
            (Frame(twin, junk, not answer.extended),),
            # nobody asked for P2047 = 5A5Ah
            (self._parameter_response(Response.WORD, 0x7FF, 0, 0x5A5A),))
