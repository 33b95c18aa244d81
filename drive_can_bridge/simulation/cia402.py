# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated servo drive of CiA 402 on CANopen.

Its objects, state machine and axis are in :mod:`~.cia402_plant`; what it has as a
node, in :mod:`~.canopen`. It starts as from the factory, with the control word in RPDO1 and
the status word in TPDO1; with ``mapping: verify`` or ``assume`` as configured, since a user must
have set it up. It watches a master's heartbeat (1016h) from the first one on, and where that is
missing does as 6007h defines.
"""

from collections.abc import Iterable, Mapping, Sequence
import math
import re

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import ConfigurationError, ValueRefused
from drive_can_bridge.core.frame import Frame, Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.network import Emergency, NmtState
from drive_can_bridge.protocols.cia402 import pdo as pdo_codec, states
from drive_can_bridge.simulation.canopen.node import CanopenNode, Contents
from drive_can_bridge.simulation.canopen.pdos import Pdos, SimulatedPdo
from drive_can_bridge.simulation.canopen.sdo import bytes_of, checked_length, ObjectDictionary
from drive_can_bridge.simulation.cia402_plant import (
    Habits, LOST_MASTER, own_parameters, ServoPlant)
from drive_can_bridge.simulation.drive import IgnoredFrame, SimulatedDrive
from drive_can_bridge.simulation.registers import AccessRefused, PlantFactory

CONSUMER_HEARTBEATS = 0x1016
DEVICE_NAME = b'simulated CiA 402 servo drive'
#: servo drive (additional information 2) of profile 402
DEVICE_TYPE = 0x00020192
STORE, SAVE = 0x1010, b'save'
CONSUMERS = 2
NOT_STORED = 0x08000020
#: bits of the error register by the first digit of a code: CiA 301
_REGISTER_BITS = {1: 0x01, 2: 0x02, 3: 0x04, 4: 0x08, 8: 0x10}
_OBJECT = re.compile('([0-9A-Fa-f]{4})h?(?:[.]([0-9A-Fa-f]{1,2})h?)?')


def parse_objects(text: str) -> frozenset[tuple[int, int | None]]:
    """
    Read ``6007h,1800h.05h``; a sub-index that is left out is all of the index.

    :raises ValueRefused: it is no list of objects, or one without which no drive can be played.
    """
    found: set[tuple[int, int | None]] = set()
    for part in text.split(','):
        match = _OBJECT.fullmatch(part.strip())
        if match is None:
            raise ValueRefused(command_sentences.no_object_written(part=part.strip()))
        index, subindex = int(match[1], 16), int(match[2], 16) if match[2] else None
        if index in (states.CONTROL_WORD, states.STATUS_WORD):
            raise ValueRefused(command_sentences.no_drive_without(index=index))
        found.add((index, subindex))
    return frozenset(found)


def object_text(index: int, subindex: int | None) -> str:
    return f'{index:04X}h' + ('' if subindex is None else f'.{subindex:02X}h')


class HeartbeatConsumer:
    """Watches other nodes, each at a place of the list: node << 16 | ms."""

    def __init__(self) -> None:
        self.stored = (0,) * CONSUMERS
        self.begin()

    def begin(self) -> None:
        """Restore the stored list; no heartbeat was received yet."""
        self.watched = list(self.stored)
        self._heard = [math.inf] * CONSUMERS

    def read(self, subindex: int) -> bytes:
        if subindex > CONSUMERS:
            raise AccessRefused(sdo.NO_SUCH_SUBINDEX)
        if subindex == 0:
            return bytes((CONSUMERS,))
        return self.watched[subindex - 1].to_bytes(4, 'little')

    def write(self, subindex: int, data: bytes) -> None:
        self.read(subindex)     # it exists
        if subindex == 0:
            raise AccessRefused(sdo.WRITE_OF_READ_ONLY)
        self.watched[subindex - 1] = int.from_bytes(checked_length(data, 4), 'little')
        self._heard[subindex - 1] = math.inf

    def hear(self, node: int, now: float) -> None:
        """Record a heartbeat."""
        for place, watched in enumerate(self.watched):
            if watched >> 16 & network.NODE_MAX == node and watched & 0xFFFF:
                self._heard[place] = now

    def next_timer(self) -> float:
        """Return when the next heartbeat is missed."""
        return min(map(self._due, range(CONSUMERS)))

    def missed(self, now: float) -> list[int]:
        """Return the nodes that are missed now, each once."""
        missed = [place for place in range(CONSUMERS) if self._due(place) <= now]
        for place in missed:
            self._heard[place] = math.inf
        return [self.watched[place] >> 16 & network.NODE_MAX for place in missed]

    def _due(self, place: int) -> float:
        return self._heard[place] + (self.watched[place] & 0xFFFF) / 1000.0


class SimulatedServoDrive(SimulatedDrive):
    """
    One drive. See the base class.

    :ivar habits: what differs between makers; may be replaced before it is set up.
    """

    plant: ServoPlant
    table: ObjectDictionary

    def set_up(self) -> None:
        if not isinstance(self.plant, ServoPlant):
            raise ConfigurationError([f'{self.name}: a drive of CiA 402 needs a ServoPlant'])
        self.table = ObjectDictionary(self.registers)
        self.pdos = Pdos(self.configuration.station, self.table, *self._factory())
        self._consumer = HeartbeatConsumer()
        self._node_state = NmtState.BOOT_UP
        self.power_lost(forget=False)
        self.node = self.companion = CanopenNode(
            self, self, constants=self._constants, trip_code=self.plant.trip_code, heartbeat=0,
            make_emergency=_emergency, segmented_writes=True)
        self.pdos.absent = self.node.absent
        self.habits = Habits()

    @property
    def habits(self) -> Habits:
        return self._habits

    @habits.setter
    def habits(self, habits: Habits) -> None:
        self._habits = self.pdos.habits = habits
        self.plant.habits = self.plant.machine.habits = habits
        self.node.start_time = habits.start

    def take_away(self, places: Iterable[tuple[int, int | None]]) -> None:
        """
        Remove objects: SDO and mappings find none.

        What follows from their content stays as delivered; without 6007h a lost master is reported
        by an emergency (8130h, register 11h), and the axis moves on, as Lely core 2.4 has it.

        :param places: index and sub-index; None: all of the index.
        """
        self.node.take_away(frozenset(places))

    def has(self, index: int, subindex: int | None) -> bool:
        """Return whether there is an object; None: anything of the index."""
        try:
            self.node.read_object(index, subindex or 0)
        except AccessRefused as error:
            return error.code != sdo.NO_SUCH_OBJECT and (
                subindex is None or error.code != sdo.NO_SUCH_SUBINDEX)
        return True

    def allow_torque(self, allowed: bool) -> None:
        self.plant.machine.set_safe(allowed)

    def _factory(self) -> tuple[dict[int, list[int]], dict[int, list[int]], int]:
        """Return the factory mapping."""
        configuration, options = self.configuration, self.configuration.options
        request, response = [states.CONTROL_PARAMETER], [states.STATUS_PARAMETER]
        if options.mapping == 'configure':
            return {1: [_entry(request[0])]}, {1: [_entry(response[0])]}, 255
        request += configuration.cyclic_request
        response += configuration.cyclic_response
        receive, transmit = ({pdo.number: list(pdo.entries) for pdo in pdos} for pdos in (
            pdo_codec.receive_pdos(configuration.station, options.request_pdos, request),
            pdo_codec.transmit_pdos(configuration.station, options.response_pdos, response)))
        return receive, transmit, 1 if options.transmission == 'sync' else 255

    def find_routes(self) -> list[Route]:
        """Return the predefined set of the node, SYNC, and the heartbeats of all others."""
        pdos = [base + 0x100 * number + self.configuration.station
                for base in (0x180, 0x200) for number in range(4)]
        return [*CanopenNode.routes(self.configuration.station, *pdos, network.SYNC_IDENTIFIER),
                Route(network.HEARTBEAT_BASE, STANDARD_IDENTIFIER_MAX & ~network.NODE_MAX, False)]

    def own_parameters(self) -> Mapping[str, Parameter]:
        return own_parameters(self.configuration)

    def choose_plant(self) -> PlantFactory:
        return ServoPlant

    def power_lost(self, *, forget: bool) -> None:
        """Restore the stored set-up; a master is watched again from its first heartbeat on."""
        self.pdos.begin(factory=forget)
        self._consumer.begin()

    # -- frames -----------------------------------------------------------------------------------

    def receive_frame(self, frame: Frame, now: float) -> None:
        super().receive_frame(frame, now)
        self._serve(now)

    def receive(self, frame: Frame, now: float) -> bool:
        identifier, data, extended = frame
        if extended or self.node.state is NmtState.BOOT_UP:
            return False
        if identifier == self.table.raw(0x1005) & STANDARD_IDENTIFIER_MAX:
            self._synchronise(now)
            return True
        node = identifier - network.HEARTBEAT_BASE
        if 0 < node <= network.NODE_MAX and node != self.node.number:
            self._consumer.hear(node, now)
            return True
        for pdo in self.pdos.receive:
            if pdo.identifier == identifier:
                self._take(pdo, data, now)
                return True
        # PDOs that are not valid belong to the node nevertheless
        return identifier - self.node.number in (0x200, 0x300, 0x400, 0x500)

    def _take(self, pdo: SimulatedPdo, data: bytes, now: float) -> None:
        if self.node.state is not NmtState.OPERATIONAL:
            raise IgnoredFrame('PDO while the node is not operational')
        if len(data) < pdo.length:
            raise IgnoredFrame('PDO shorter than its mapping')
        self.requests += 1
        if pdo.type <= 240:
            pdo.pending = data
        else:
            self._apply(pdo, data, now)

    def _apply(self, pdo: SimulatedPdo, data: bytes, now: float) -> None:
        word: int | None = None
        for cell, raw in self.pdos.cells(pdo, data):
            if cell.index == states.CONTROL_WORD:
                self.registers.put(cell.name, raw)
                word = raw
            else:
                self.registers.write(cell.name, self.registers.clamped(cell.name, raw))
        # it is about what came with it
        if word is not None:
            self.plant.control(word)
        self.plant.advance(now)

    def _synchronise(self, now: float) -> None:
        if self.node.state is not NmtState.OPERATIONAL:
            return
        for pdo in self.pdos.receive:
            if pdo.pending is not None:
                data, pdo.pending = pdo.pending, None
                self._apply(pdo, data, now)
        for pdo in self.pdos.transmit:
            if self.pdos.synchronised(pdo):
                self.answer(self.pdos.frame(pdo, now), now)

    def foreign_frames(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        """Return the answer of an absent node, and its 29-bit counterpart."""
        base = answer.identifier - self.node.number
        return ((answer._replace(identifier=base + node) for node in range(
            1, network.NODE_MAX + 1) if node != self.node.number),
            (answer._replace(extended=True),))

    # -- time -------------------------------------------------------------------------------------

    def next_timer(self) -> float:
        return min(super().next_timer(), self._consumer.next_timer(), min(
            map(self.pdos.due, self.pdos.transmit))
            if self.node.state is NmtState.OPERATIONAL else math.inf)

    def handle_timer(self, now: float) -> None:
        super().handle_timer(now)
        self._serve(now)

    def _serve(self, now: float) -> None:
        """Handle what follows from time and from the state of the node."""
        before, self._node_state = self._node_state, self.node.state
        operational = self._node_state is NmtState.OPERATIONAL
        if operational and before is not NmtState.OPERATIONAL:
            for pdo in (*self.pdos.receive, *self.pdos.transmit):
                pdo.pending = pdo.sent = None
        elif self._node_state is NmtState.STOPPED and before is NmtState.OPERATIONAL:
            self._connection_lost()
        for node in self._consumer.missed(now):
            self._notices.append(f'{self.name}: no heartbeat of node {node}')
            if not self._connection_lost():
                self.node.send_error(Emergency(LOST_MASTER, 0x11))
        self.plant.advance(now)
        self.node.look(now)
        for pdo in self.pdos.transmit if operational else ():
            if self.pdos.due(pdo) <= now:
                self.answer(self.pdos.frame(pdo, now), now)

    def _connection_lost(self) -> bool:
        """Do as 6007h defines; return whether it exists."""
        if (states.ABORT_CONNECTION_OPTION, 0) in self.node.absent:
            return False
        self.plant.machine.connection_lost()
        return True

    # -- objects ----------------------------------------------------------------------------------

    def read_object(self, index: int, subindex: int) -> bytes:
        found = self.pdos.find(index)
        if found is not None:
            return self.pdos.read(*found, subindex)
        if index == CONSUMER_HEARTBEATS:
            return self._consumer.read(subindex)
        if index == STORE and subindex <= 1:
            return bytes((1,)).ljust(4 if subindex else 1, b'\0')
        return self.table.read_object(index, subindex)

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        found = self.pdos.find(index)
        if found is not None:
            self.pdos.write(*found, subindex, data,
                            operational=self.node.state is NmtState.OPERATIONAL)
        elif index == CONSUMER_HEARTBEATS:
            self._consumer.write(subindex, data)
        elif index == STORE and subindex == 1:
            if checked_length(data, 4) != SAVE:
                raise AccessRefused(NOT_STORED)
            self.registers.store_all()
            self.pdos.store()
            self._consumer.stored = tuple(self._consumer.watched)
        elif index == STORE:
            raise AccessRefused(sdo.NO_SUCH_SUBINDEX if subindex else
                                sdo.WRITE_OF_READ_ONLY)
        else:
            self.table.write_object(index, subindex, data)

    def _constants(self) -> Contents:
        identity = (0, 0x402, 1, self.node.number)
        return {(0x1000, 0): DEVICE_TYPE.to_bytes(4, 'little'), (0x1008, 0): DEVICE_NAME,
                (0x1018, 0): bytes((4,)),
                **{(0x1018, 1 + place): value.to_bytes(4, 'little')
                   for place, value in enumerate(identity)}}


def _entry(parameter: Parameter) -> int:
    return pdo_codec.mapping_entry(parameter.index or 0, parameter.subindex or 0,
                                   bytes_of(parameter))


def _emergency(code: int) -> Emergency:
    """Return the emergency of an error code: 603Fh has the same."""
    return Emergency(code, 0x01 | _REGISTER_BITS.get(code >> 12, 0x80))
