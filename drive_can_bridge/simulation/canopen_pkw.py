# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated motor controller with the PKW mailbox (Schneider TeSys T LTMR, CANopen).

It takes PDOs in operational only. A request begins when the function byte changes, and at nothing
else. What the manual page leaves open is done as docs/protocol_canopen_pkw.md says, which the
configuration of the drive can change: one file describes both ends.
"""

from collections.abc import Iterable, Sequence

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.protocols.canopen import abort_codes, network
from drive_can_bridge.protocols.canopen.network import NmtState
from drive_can_bridge.protocols.canopen_pkw import pkw, refusals
from drive_can_bridge.simulation.canopen.node import CanopenNode, Contents
from drive_can_bridge.simulation.canopen_pkw_registers import RegisterTable
from drive_can_bridge.simulation.drive import Ignored, SimulatedDrive
from drive_can_bridge.simulation.motor_plant import MotorPlant
from drive_can_bridge.simulation.registers import PlantFactory, Refused
from drive_can_bridge.simulation.starter import TEST_TRIP
from drive_can_bridge.simulation.starter_plant import is_starter, StarterPlant

DEVICE_NAME = b'simulated LTMR'
JUNK = (0x5A5A, 0x5A5A)


class SimulatedPkwDrive(SimulatedDrive):
    """One controller with a PKW mailbox. See the base class."""

    table: RegisterTable

    def set_up(self) -> None:
        options = self._options = self.configuration.options
        self._layout = pkw.Layout(options.layout)
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
        """Forget the function byte of the last request, and what the mailbox holds."""
        self._request = self._response = pkw.idle_request()

    def receive(self, frame: Frame, now: float) -> bool:
        identifier, data, extended = frame
        if identifier != self._options.request_cob_id or extended:
            return False
        if self.node.state is not NmtState.OPERATIONAL:
            raise Ignored('request while the node is not operational')
        try:
            request = pkw.decode(data, self._layout)
        except RemoteProtocolError:
            raise Ignored('request without eight data bytes') from None
        if request.function_byte == self._request.function_byte:
            if request != self._request:
                raise Ignored('request with the function byte of the one before')
            return True
        self._request = request
        self.requests += 1
        self._response = self._response_to(request)
        self.answer(Frame(self._options.response_cob_id,
                          pkw.encode(self._response, self._layout), False), now)
        return True

    def _response_to(self, request: pkw.Message) -> pkw.Message:
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
