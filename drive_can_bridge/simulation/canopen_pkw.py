# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated motor controller with the PKW mailbox (Schneider TeSys T LTMR, CANopen).

It starts in pre-operational with a boot-up frame and waits for the NMT start; it takes PDOs in
operational only. A request begins when the function byte changes, and at nothing else. What the
manual page leaves open is done as docs/protocol_canopen_pkw.md says, which the configuration of
the drive can change: one file describes both ends.
"""

from collections.abc import Sequence
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.protocols.canopen_pkw import abort_codes, network, pkw
from drive_can_bridge.protocols.canopen_pkw.network import Emergency, NmtCommand
from drive_can_bridge.simulation.canopen_pkw_node import NmtNode
from drive_can_bridge.simulation.canopen_pkw_registers import Refused, RegisterTable
from drive_can_bridge.simulation.canopen_pkw_sdo import checked_length, Objects, SdoServer
from drive_can_bridge.simulation.canopen_pkw_starter import StarterPlant
from drive_can_bridge.simulation.drive import EEPROM_TIME, SimulatedDrive
from drive_can_bridge.simulation.faults import Fault

SDO_REQUEST_BASE = 0x600
SDO_RESPONSE_BASE = 0x580
#: ms between heartbeats where nobody watches them
HEARTBEAT = 1000
#: heartbeats within the time after which the bridge misses them
HEARTBEATS_WATCHED = 3
#: s that a reset by NMT takes
RESET_TIME = 0.05
#: s between two looks at the motor while it runs
TICK = 0.1

DEVICE_NAME = b'simulated LTMR'
TRIP_EMERGENCY = 0xFF00
#: bits of the error register: generic, maker's own
TRIP_ERROR_REGISTER = 0x81

JUNK = (0x5A5A, 0x5A5A)

_NMT_ROUTE = Route(network.NMT_IDENTIFIER, STANDARD_IDENTIFIER_MAX, False)


def request_identifier(configuration: DriveConfiguration) -> int:
    """Return the identifier of requests, which the device's receive PDO4 has."""
    identifier: int = configuration.family_options.get(
        'request_cob_id', network.REQUEST_BASE + configuration.station)
    return identifier


def response_identifier(configuration: DriveConfiguration) -> int:
    """Return the identifier of responses, which the device's transmit PDO4 has."""
    identifier: int = configuration.family_options.get(
        'response_cob_id', network.RESPONSE_BASE + configuration.station)
    return identifier


class SimulatedPkwDrive(SimulatedDrive):
    """One controller with a PKW mailbox. See the base class."""

    def __init__(self, configuration: DriveConfiguration, *, neighbours: Sequence[Route] = (),
                 eeprom_time: float = EEPROM_TIME) -> None:
        super().__init__(configuration, neighbours=neighbours, eeprom_time=eeprom_time)
        cyclic = (*configuration.cyclic_request, *configuration.cyclic_response)
        self.plant: StarterPlant = StarterPlant(
            configuration.profile, node=configuration.station, volatile={p.name for p in cyclic},
            preferred=[p.name for p in configuration.cyclic_request])
        self.station = configuration.station
        self.table = RegisterTable(configuration, self.plant)
        options = configuration.family_options
        self._layout = pkw.Layout(options.get('layout', 'word_le'))
        self._abort_code_order: str = options.get('abort_code_order', 'auto')
        self._request_identifier = request_identifier(configuration)
        self._response_identifier = response_identifier(configuration)
        watched: float = options.get('heartbeat_timeout', 0.0)
        heartbeat = round(1000.0 * watched / HEARTBEATS_WATCHED) if watched else HEARTBEAT
        self.nmt = NmtNode(self.station, heartbeat)
        self.request = self.response = bytes(pkw.PAYLOAD)
        self.last_emergency = network.NO_ERROR
        self._function_byte = 0
        self._now = 0.0
        self._sdo = SdoServer(_ObjectDictionary(self))
        self._looks_at = math.inf
        self._foreign_turn = 0

    @classmethod
    def routes(cls, configuration: DriveConfiguration) -> list[Route]:
        """Return all identifiers of the node, and that of NMT commands."""
        node = configuration.station
        identifiers = (
            request_identifier(configuration), response_identifier(configuration),
            SDO_REQUEST_BASE + node, SDO_RESPONSE_BASE + node,
            network.HEARTBEAT_BASE + node, network.EMERGENCY_BASE + node)
        return [_NMT_ROUTE, *(Route(identifier, STANDARD_IDENTIFIER_MAX, False)
                              for identifier in identifiers)]

    @property
    def eeprom_writes(self) -> int:
        """Registers written that are kept in EEPROM."""
        return self.table.eeprom_writes

    # -- time -------------------------------------------------------------------------------------

    def next_timer(self) -> float:
        """Return when :meth:`handle_timer` wants to be called; infinity: never."""
        return min(super().next_timer(), self.nmt.next_timer(), self._looks_at)

    def handle_timer(self, now: float) -> None:
        """Do what is due: held back answers, boot-up frame, heartbeat, a look at the motor."""
        super().handle_timer(now)
        if self.powered:
            self.plant.advance(now)
            self._outbox += self.nmt.handle_timer(now)
        self._look(now)

    def _look(self, now: float) -> None:
        """Report a trip that has come or gone, and plan the next look at a running motor."""
        running = self.powered and self.plant.operation.enabled
        self._looks_at = now + TICK if running else math.inf
        tripped = self.plant.operation.faulted
        if tripped == bool(self.last_emergency) or not self.nmt.communicates:
            return
        emergency = Emergency(network.NO_ERROR)
        if tripped:
            code = self.plant.trip_code
            emergency = Emergency(TRIP_EMERGENCY, TRIP_ERROR_REGISTER,
                                  code.to_bytes(2, 'little') + bytes(3))
        self.last_emergency = emergency.code
        self._outbox.append(network.encode_emergency(self.station, emergency))

    # -- frames -----------------------------------------------------------------------------------

    def _receive(self, frame: Frame, now: float) -> None:
        if frame.extended:
            return
        self._now = now
        if self.nmt.starting:
            # whoever is ready to receive has sent its boot-up frame
            self._outbox += self.nmt.handle_timer(now)
        identifier, data, _ = frame
        if identifier == network.NMT_IDENTIFIER:
            self._obey(data, now)
        elif identifier == self._request_identifier:
            self._take_request(data, now)
        elif identifier == SDO_REQUEST_BASE + self.station:
            self._take_sdo(data, now)
        elif any(route.matches(frame) for route in self.routes(self.configuration)):
            self._violation('frame that only this drive may send')
        self._look(now)

    def _obey(self, data: bytes, now: float) -> None:
        """Obey an NMT command, if it is for this node."""
        try:
            command, node = network.decode_nmt(data)
        except RemoteProtocolError:
            self._violation('NMT command without two data bytes (ignored)')
            return
        if node not in (0, self.station):
            return
        if command == NmtCommand.RESET_NODE:
            self._restart(now, RESET_TIME, forget=False)
        elif command == NmtCommand.RESET_COMMUNICATION:
            self._reset_communication(now + RESET_TIME)
            self._deaf_until = now + RESET_TIME
        else:
            self.nmt.command(command)

    def _take_request(self, data: bytes, now: float) -> None:
        if not self.nmt.operational:
            self._violation('request while the node is not operational (ignored)')
            return
        try:
            request = pkw.decode(data, self._layout)
        except RemoteProtocolError:
            self._violation('request without eight data bytes (ignored)')
            return
        if request.function_byte == self._function_byte:
            if data != self.request:
                self._violation('request with the function byte of the one before (ignored)')
            return
        self.request, self._function_byte = data, request.function_byte
        self.requests += 1
        self.plant.advance(now)
        self.response = pkw.encode(self._response(request), self._layout)
        self._answer(Frame(self._response_identifier, self.response, False), now)

    def _response(self, request: pkw.Message) -> pkw.Message:
        """Carry out a request."""
        meaning = request.meaning
        if request.code == pkw.Function.NONE:
            return pkw.response(request)
        try:
            if meaning is None:
                raise Refused(abort_codes.UNKNOWN_COMMAND)
            if meaning.writes:
                self.table.write(request.address, request.words[:meaning.count])
                return pkw.response(request)
            first, second = (*self.table.read(request.address, meaning.count), 0)[:2]
            return pkw.response(request, (first, second))
        except Refused as error:
            return pkw.error_response(request, abort_codes.words_from_code(
                error.code, self._abort_code_order))

    def _take_sdo(self, data: bytes, now: float) -> None:
        if not self.nmt.communicates:
            return
        self.requests += 1
        self.plant.advance(now)
        response = self._sdo.answer(data)
        if response is not None:
            self._answer(Frame(SDO_RESPONSE_BASE + self.station, response, False), now)

    # -- by hand ----------------------------------------------------------------------------------

    def set_value(self, name: str, value: Value, now: float | None = None) -> None:
        """Set a register, read-only ones included; an actual value is held there."""
        super().set_value(name, value, now)
        if now is not None:
            self._look(now)

    def fault(self, fault: str | Fault, now: float) -> None:
        """Play a fault. See the base class."""
        super().fault(fault, now)
        if not self.powered:
            self.nmt.switch_off()
        self._look(now)

    def _known(self, name: str) -> str:
        if name in self.plant.parameters:
            return name
        known = self.table.name_of(name)
        return super()._known(name) if known is None else known

    # -- inside -----------------------------------------------------------------------------------

    def _restart(self, now: float, boot: float, *, forget: bool) -> None:
        super()._restart(now, boot, forget=forget)
        self._reset_communication(now + boot)

    def _reset_communication(self, ready_at: float) -> None:
        """Begin with boot-up again; the function byte of the last request is forgotten."""
        self.nmt.start(ready_at)
        self._sdo.reset()
        self.request = self.response = bytes(pkw.PAYLOAD)
        self._function_byte = 0
        self.last_emergency = network.NO_ERROR

    def set_heartbeat(self, milliseconds: int) -> None:
        """Change the time between heartbeats (object 1017h)."""
        self.nmt.set_heartbeat(milliseconds, self._now)

    def _foreign_frames(self, answer: Frame) -> list[Frame]:
        """
        Return one of: the answer of an absent node, the 29-bit twin, two unasked answers.

        The unasked ones have another toggle bit, or another register, than the request, and junk
        for data.
        """
        self._foreign_turn += 1
        turn = self._foreign_turn % 4
        if turn == 1:
            for node in range(1, network.NODE_MAX + 1):
                frame = answer._replace(identifier=network.RESPONSE_BASE + node)
                if node != self.station and not any(
                        route.matches(frame) for route in self.neighbours):
                    return [frame]
            return []
        if turn == 2:
            return [answer._replace(extended=True)]
        if answer.identifier != self._response_identifier:
            return []
        message = pkw.decode(answer.data, self._layout)._replace(words=JUNK)
        if turn == 3:
            message = message._replace(toggle=not message.toggle)
        else:
            message = message._replace(word=message.word ^ 1)
        return [answer._replace(data=pkw.encode(message, self._layout))]


class _ObjectDictionary(Objects):
    """The objects of a simulated controller, as SDOs see them."""

    def __init__(self, drive: SimulatedPkwDrive) -> None:
        self._drive = drive

    def read(self, index: int, subindex: int) -> bytes:
        fixed = self._fixed()
        if (index, subindex) in fixed:
            return fixed[index, subindex]
        highest = self._drive.table.highest_subindex(index)
        if subindex == 0 and highest is not None:
            return bytes((highest,))
        word, = self._drive.table.read(self._register(index, subindex), 1)
        return word.to_bytes(2, 'little')

    def write(self, index: int, subindex: int, data: bytes) -> None:
        if (index, subindex) == (0x1017, 0):
            self._drive.set_heartbeat(int.from_bytes(checked_length(data, 2), 'little'))
            return
        if (index, subindex) in self._fixed():
            raise Refused(abort_codes.WRITE_OF_READ_ONLY)
        table, address = self._drive.table, self._register(index, subindex)
        if table.name_at(address) is not None:
            checked_length(data, 2)
        table.write(address, (int.from_bytes(data[:2], 'little'),))

    def _register(self, index: int, subindex: int) -> pkw.Address:
        if any(place == index for place, _ in self._fixed()):
            raise Refused(abort_codes.NO_SUCH_SUBINDEX)
        return pkw.Address(index, subindex)

    def _fixed(self) -> dict[tuple[int, int], bytes]:
        """Return every object that is no register."""
        drive = self._drive
        error = drive.last_emergency
        objects: dict[tuple[int, int], bytes] = {
            (0x1000, 0): bytes(4),
            (0x1001, 0): bytes((TRIP_ERROR_REGISTER if error else 0,)),
            (0x1003, 0): bytes((bool(error),)),
            (0x1003, 1): error.to_bytes(4, 'little'),
            (0x1008, 0): DEVICE_NAME,
            (0x1014, 0): _u32(network.EMERGENCY_BASE + drive.station),
            (0x1017, 0): drive.nmt.heartbeat.to_bytes(2, 'little'),
            (0x1018, 0): bytes((1,)),
            (0x1018, 1): bytes(4),
            (0x3000, 0): bytes((4,)),
        }
        for number, half in enumerate((drive.request[:4], drive.request[4:],
                                       drive.response[:4], drive.response[4:]), 1):
            objects[0x3000, number] = half
        for base, identifier, first in (
                (0x1400, request_identifier(drive.configuration), 1),
                (0x1800, response_identifier(drive.configuration), 3)):
            # PDO4: identifier, sent on change, and the two halves of the mailbox
            objects[base + 3, 0] = bytes((2,))
            objects[base + 3, 1] = _u32(identifier)
            objects[base + 3, 2] = b'\xFF'
            objects[base + 0x203, 0] = bytes((2,))
            objects[base + 0x203, 1] = _u32(0x30000020 | first << 8)
            objects[base + 0x203, 2] = _u32(0x30000020 | first + 1 << 8)
        return objects


def _u32(value: int) -> bytes:
    return value.to_bytes(4, 'little')
