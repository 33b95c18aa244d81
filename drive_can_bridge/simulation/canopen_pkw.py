# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated motor controller with the PKW mailbox (Schneider TeSys T LTMR, CANopen).

It starts in pre-operational with a boot-up frame and waits for the NMT start; it takes PDOs in
operational only. A request begins when the function byte changes, and at nothing else. What the
manual page leaves open is done as docs/protocol_canopen_pkw.md says, which the configuration of
the drive can change: one file describes both ends.
"""

from collections.abc import Iterable, Sequence
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.core.parameters import Value
from drive_can_bridge.protocols.canopen import abort_codes, network
from drive_can_bridge.protocols.canopen.network import Emergency, NmtCommand, NmtState
from drive_can_bridge.protocols.canopen_pkw import pkw, refusals
from drive_can_bridge.protocols.canopen_pkw.identifiers import Identifiers
from drive_can_bridge.simulation.canopen.node import CanopenNode
from drive_can_bridge.simulation.canopen.sdo import Refused
from drive_can_bridge.simulation.canopen_pkw_registers import RegisterTable
from drive_can_bridge.simulation.drive import ALONE, Ignored, SimulatedDrive, Surroundings
from drive_can_bridge.simulation.faults import Fault
from drive_can_bridge.simulation.motor_plant import MotorPlant
from drive_can_bridge.simulation.plant import PlantFactory
from drive_can_bridge.simulation.starter import TEST_TRIP
from drive_can_bridge.simulation.starter_plant import is_starter, StarterPlant

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


class SimulatedPkwDrive(SimulatedDrive):
    """One controller with a PKW mailbox. See the base class."""

    table: RegisterTable

    def __init__(self, configuration: DriveConfiguration,
                 surroundings: Surroundings = ALONE) -> None:
        super().__init__(configuration, surroundings)
        options = configuration.options
        self.table = RegisterTable(configuration, self.registers)
        self._layout = pkw.Layout(options.layout)
        self._abort_code_order: str = options.abort_code_order
        self._identifiers = Identifiers.of(configuration)
        watched: float = options.heartbeat_timeout
        self.node = CanopenNode(
            configuration.station, constants=self._objects, objects=self.table,
            send=lambda frame: self._outbox.frames.append(frame),
            heartbeat=round(1000.0 * watched / HEARTBEATS_WATCHED) if watched else HEARTBEAT)
        self._telegrams = {network.NMT_IDENTIFIER: self._obey,
                           self._identifiers.request: self._take_request,
                           self.node.request_identifier: self._serve}
        self.request = self.response = bytes(pkw.PAYLOAD)
        self._function_byte = 0
        self._looks_at = math.inf

    @classmethod
    def routes(cls, configuration: DriveConfiguration) -> list[Route]:
        identifiers = Identifiers.of(configuration)
        return [*CanopenNode.routes(configuration.station),
                *(Route(identifier, STANDARD_IDENTIFIER_MAX, False)
                  for identifier in (identifiers.request, identifiers.response))]

    def choose_plant(self) -> PlantFactory:
        """Return a starter for the profile of an LTMR, a motor for any other one."""
        return StarterPlant if is_starter(self.configuration.profile) else MotorPlant

    # -- time -------------------------------------------------------------------------------------

    def next_timer(self) -> float:
        return min(super().next_timer(), self.node.next_timer(), self._looks_at)

    def handle_timer(self, now: float) -> None:
        super().handle_timer(now)
        self.node.handle_timer(now)
        self._look(now)

    def _look(self, now: float) -> None:
        """Report a trip that has come or gone, and plan the next look at a running motor."""
        operation = self.plant.operation
        self._looks_at = now + TICK if operation.enabled else math.inf
        error = Emergency(network.NO_ERROR)
        if operation.faulted:
            code = self.plant.trip_code if isinstance(self.plant, StarterPlant) else TEST_TRIP
            error = Emergency(TRIP_EMERGENCY, TRIP_ERROR_REGISTER,
                              code.to_bytes(2, 'little') + bytes(3))
        self.node.tell(error)

    # -- frames -----------------------------------------------------------------------------------

    def receive(self, frame: Frame, now: float) -> bool:
        identifier, data, extended = frame
        if extended:
            return False
        if self.node.state is NmtState.BOOT_UP:
            # whoever is ready to receive has sent its boot-up frame
            self.node.handle_timer(now)
        found = self._telegrams.get(identifier)
        try:
            if found is not None:
                found(data, now)
        finally:
            self._look(now)
        return found is not None

    def _obey(self, data: bytes, now: float) -> None:
        try:
            reset = self.node.obey(data)
        except RemoteProtocolError:
            raise Ignored('NMT command without two data bytes') from None
        if reset is NmtCommand.RESET_NODE:
            self._lose_power(now, now + RESET_TIME)
        elif reset is NmtCommand.RESET_COMMUNICATION:
            self._deaf_until = now + RESET_TIME
            self._reset_communication(self._deaf_until)

    def _serve(self, data: bytes, now: float) -> None:
        if self.node.communicates:
            self.requests += 1
            answer = self.node.serve(data, now)
            if answer is not None:
                self._answer(answer, now)

    def _take_request(self, data: bytes, now: float) -> None:
        if self.node.state is not NmtState.OPERATIONAL:
            raise Ignored('request while the node is not operational')
        try:
            request = pkw.decode(data, self._layout)
        except RemoteProtocolError:
            raise Ignored('request without eight data bytes') from None
        if request.function_byte == self._function_byte:
            if data != self.request:
                raise Ignored('request with the function byte of the one before')
            return
        self.request, self._function_byte = data, request.function_byte
        self.requests += 1
        self.response = pkw.encode(self._response(request), self._layout)
        self._answer(Frame(self._identifiers.response, self.response, False), now)

    def _response(self, request: pkw.Message) -> pkw.Message:
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
            return pkw.error_response(request, refusals.words_from_code(
                error.code, self._abort_code_order))

    # -- by hand ----------------------------------------------------------------------------------

    def set_value(self, name: str, value: Value, now: float | None = None) -> None:
        super().set_value(name, value, now)
        if now is not None:
            self._look(now)

    def fault(self, fault: str | Fault, now: float) -> None:
        super().fault(fault, now)
        self._look(now)

    def power_lost(self, back_at: float, *, forget: bool) -> None:
        self._reset_communication(back_at)

    def _reset_communication(self, ready_at: float) -> None:
        """Begin with boot-up again; the function byte of the last request is forgotten."""
        self.node.start(ready_at)
        self.request = self.response = bytes(pkw.PAYLOAD)
        self._function_byte = 0

    def foreign_frames(self, answer: Frame) -> Sequence[Iterable[Frame]]:
        """
        Return the answer of an absent node, the 29-bit twin, two unasked answers.

        The unasked ones have another toggle bit, or another register, than the request, and junk
        for data.
        """
        unasked: list[list[Frame]] = [[], []]
        if answer.identifier == self._identifiers.response:
            message = pkw.decode(answer.data, self._layout)._replace(words=JUNK)
            unasked = [[answer._replace(data=pkw.encode(changed, self._layout))] for changed in (
                message._replace(toggle=not message.toggle),
                message._replace(word=message.word ^ 1))]
        return (
            (answer._replace(identifier=network.RESPONSE_BASE + node)
             for node in range(1, network.NODE_MAX + 1) if node != self.node.number),
            (answer._replace(extended=True),), *unasked)

    def _objects(self) -> dict[tuple[int, int], bytes]:
        """Return the objects beside the registers: name, mailbox, PDO4."""
        mailbox = self.request + self.response
        objects = {(0x1008, 0): DEVICE_NAME, (0x3000, 0): bytes((4,))}
        for number in range(1, 5):
            objects[0x3000, number] = mailbox[4 * number - 4:4 * number]
        for base, identifier, first in ((0x1400, self._identifiers.request, 1),
                                        (0x1800, self._identifiers.response, 3)):
            # identifier, sent on change; then the two halves of the mailbox
            for place, contents in ((base + 3, (identifier.to_bytes(4, 'little'), b'\xFF')), (
                    base + 0x203, [(0x30000020 | half << 8).to_bytes(4, 'little')
                                   for half in (first, first + 1)])):
                objects[place, 0] = bytes((2,))
                objects[place, 1], objects[place, 2] = contents
        return objects
