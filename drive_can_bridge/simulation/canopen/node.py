# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated CANopen node: NMT, heartbeat, emergencies, SDO server, and what every node has.

A drive composes one of these and keeps its PDOs to itself.
"""

import math

from drive_can_bridge.core.frame import Frame, Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.protocols.canopen_pkw import abort_codes, network
from drive_can_bridge.protocols.canopen_pkw.network import Emergency, NmtCommand
from drive_can_bridge.simulation.canopen.nmt import NmtNode
from drive_can_bridge.simulation.canopen.sdo import checked_length, Objects, Refused, SdoServer

SDO_REQUEST_BASE = 0x600
SDO_RESPONSE_BASE = 0x580
HEARTBEAT_TIME = (0x1017, 0)

_RESETS = (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)


class CanopenNode(Objects):
    """
    One node.

    :param heartbeat: ms between heartbeats after power came on; 0: none.
    :param name: object 1008h.
    :param objects: all objects that are not in here.
    :ivar nmt: its state.
    :ivar error: the emergency last told; that of code 0: none.
    """

    def __init__(self, number: int, *, heartbeat: int, name: bytes, objects: Objects) -> None:
        self.number = number
        self.nmt = NmtNode(number, heartbeat)
        self.error = Emergency(network.NO_ERROR)
        self.request_identifier = SDO_REQUEST_BASE + number
        self._name = name
        self._objects = objects
        self._server = SdoServer(self)
        self._now = -math.inf

    @staticmethod
    def routes(number: int) -> list[Route]:
        """Return the identifiers of a node but for its PDOs, and that of NMT commands."""
        own = (SDO_REQUEST_BASE, SDO_RESPONSE_BASE, network.HEARTBEAT_BASE,
               network.EMERGENCY_BASE)
        return [Route(identifier, STANDARD_IDENTIFIER_MAX, False) for identifier in (
            network.NMT_IDENTIFIER, *(base + number for base in own))]

    def obey(self, data: bytes) -> NmtCommand | None:
        """
        Obey an NMT command, if it is for this node.

        :return: a reset, which is for the drive to carry out; else None.
        :raises RemoteProtocolError: not two bytes.
        """
        command, number = network.decode_nmt(data)
        if number not in (0, self.number):
            return None
        if command in _RESETS:
            return NmtCommand(command)
        self.nmt.command(command)
        return None

    def serve(self, data: bytes, now: float) -> list[Frame]:
        """Answer an SDO request."""
        self._now = now
        response = self._server.answer(data)
        if response is None:
            return []
        return [Frame(SDO_RESPONSE_BASE + self.number, response, False)]

    def tell(self, error: Emergency) -> list[Frame]:
        """Return the emergency message, unless that is what was told last."""
        if not self.nmt.communicates or error.code == self.error.code:
            return []
        self.error = error
        return [network.encode_emergency(self.number, error)]

    def start(self, ready_at: float) -> None:
        """Begin anew: power came on, or communication was reset."""
        self.nmt.start(ready_at)
        self._server.reset()
        self.error = Emergency(network.NO_ERROR)

    # -- the object dictionary --------------------------------------------------------------------

    def read(self, index: int, subindex: int) -> bytes:
        """Return the content of an object. See the base class."""
        found = self._own().get((index, subindex))
        if found is not None:
            return found
        self._check_subindex(index)
        return self._objects.read(index, subindex)

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object. See the base class."""
        if (index, subindex) == HEARTBEAT_TIME:
            self.nmt.set_heartbeat(int.from_bytes(checked_length(data, 2), 'little'), self._now)
            return
        if (index, subindex) in self._own():
            raise Refused(abort_codes.WRITE_OF_READ_ONLY)
        self._check_subindex(index)
        self._objects.write(index, subindex, data)

    def _check_subindex(self, index: int) -> None:
        if any(place == index for place, _ in self._own()):
            raise Refused(abort_codes.NO_SUCH_SUBINDEX)

    def _own(self) -> dict[tuple[int, int], bytes]:
        """Return the objects that every node has: device type, errors, name, identity …."""
        code, register, _ = self.error
        return {
            (0x1000, 0): bytes(4),
            (0x1001, 0): bytes((register,)),
            (0x1003, 0): bytes((bool(code),)),
            (0x1003, 1): code.to_bytes(4, 'little'),
            (0x1008, 0): self._name,
            (0x1014, 0): (network.EMERGENCY_BASE + self.number).to_bytes(4, 'little'),
            HEARTBEAT_TIME: self.nmt.heartbeat.to_bytes(2, 'little'),
            (0x1018, 0): bytes((1,)),
            (0x1018, 1): bytes(4),
        }
