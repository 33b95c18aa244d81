# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated CANopen node: NMT, heartbeat, emergencies, SDO server, and the objects of every node.

A drive composes one of these and keeps its PDOs to itself (CiA 301).
"""

from collections.abc import Callable
import math

from drive_can_bridge.core.frame import Frame, Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.protocols.canopen import abort_codes, network
from drive_can_bridge.protocols.canopen.network import Emergency, NmtCommand, NmtState
from drive_can_bridge.protocols.canopen.sdo import REQUEST_BASE, RESPONSE_BASE
from drive_can_bridge.simulation.canopen.sdo import checked_length, Objects, Refused, SdoServer

HEARTBEAT_TIME = (0x1017, 0)

_NO_ERROR = Emergency(network.NO_ERROR)
_STATES = {NmtCommand.START: NmtState.OPERATIONAL, NmtCommand.STOP: NmtState.STOPPED,
           NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL}


class CanopenNode:
    """
    One node.

    :param heartbeat: ms between heartbeats after power came on; 0: none.
    :param constants: returns the content of the device's read-only objects, by address.
    :param objects: all other ones.
    :param send: takes frames.
    :ivar state: boot-up: without power, or still starting.
    """

    def __init__(self, number: int, *, heartbeat: int,
                 constants: Callable[[], dict[tuple[int, int], bytes]], objects: Objects,
                 send: Callable[[Frame], None]) -> None:
        self.number = number
        self.state = NmtState.BOOT_UP
        self.request_identifier = REQUEST_BASE + number
        self._default_heartbeat = self._heartbeat = heartbeat
        self._constants = constants
        self._objects = objects
        self._send = send
        self._server = SdoServer(self)
        self._error = _NO_ERROR
        #: when the boot-up frame is due; -infinity: as soon as somebody looks
        self._boots_at = -math.inf
        self._beats_at = math.inf
        self._now = -math.inf

    @staticmethod
    def routes(number: int) -> list[Route]:
        """Return the identifiers of a node but for its PDOs, and that of NMT commands."""
        own = REQUEST_BASE, RESPONSE_BASE, network.HEARTBEAT_BASE, network.EMERGENCY_BASE
        return [Route(identifier, STANDARD_IDENTIFIER_MAX, False) for identifier in (
            network.NMT_IDENTIFIER, *(base + number for base in own))]

    @property
    def communicates(self) -> bool:
        """Takes and sends SDOs and emergencies."""
        return self.state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL)

    def start(self, ready_at: float) -> None:
        """Begin anew; the boot-up frame leaves when the node is ready, at infinity: never."""
        self.state = NmtState.BOOT_UP
        self._heartbeat = self._default_heartbeat
        self._boots_at, self._beats_at = ready_at, math.inf
        self._server.reset()
        self._error = _NO_ERROR

    def obey(self, data: bytes) -> NmtCommand | None:
        """
        Obey an NMT command, if it is for this node.

        :return: a reset, which is for the drive to carry out; else None.
        :raises RemoteProtocolError: not two bytes.
        """
        command, number = network.decode_nmt(data)
        if number in (0, self.number):
            if command in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION):
                return NmtCommand(command)
            if self.state is not NmtState.BOOT_UP and command in list(NmtCommand):
                self.state = _STATES[NmtCommand(command)]
        return None

    def serve(self, data: bytes, now: float) -> Frame | None:
        """Return the answer to an SDO request; None: there is none."""
        self._now = now
        response = self._server.answer(data)
        return None if response is None else Frame(RESPONSE_BASE + self.number, response, False)

    def tell(self, error: Emergency) -> None:
        """Send an emergency message, unless that is what was told last."""
        if self.communicates and error.code != self._error.code:
            self._error = error
            self._send(network.encode_emergency(self.number, error))

    def next_timer(self) -> float:
        return min(self._boots_at, self._beats_at)

    def handle_timer(self, now: float) -> None:
        """Send the boot-up frame or the heartbeat that is due."""
        if self._boots_at <= now:
            self._boots_at = math.inf
            self.state = NmtState.PRE_OPERATIONAL
            self._plan_heartbeat(now)
            self._send(network.encode_heartbeat(self.number, NmtState.BOOT_UP))
        elif self._beats_at <= now:
            # late ones are left out, the beat is kept
            period = self._heartbeat / 1000.0
            self._beats_at += period * (math.floor((now - self._beats_at) / period) + 1)
            self._send(network.encode_heartbeat(self.number, self.state))

    def _plan_heartbeat(self, now: float) -> None:
        self._beats_at = now + self._heartbeat / 1000.0 if self._heartbeat else math.inf

    def read_object(self, index: int, subindex: int) -> bytes:
        fixed = self._fixed(index)
        if (index, subindex) in fixed:
            return fixed[index, subindex]
        if fixed:
            raise Refused(abort_codes.NO_SUCH_SUBINDEX)
        return self._objects.read_object(index, subindex)

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        fixed = self._fixed(index)
        if (index, subindex) == HEARTBEAT_TIME:
            self._heartbeat = int.from_bytes(checked_length(data, 2), 'little')
            self._plan_heartbeat(self._now)
        elif fixed:
            raise Refused(abort_codes.WRITE_OF_READ_ONLY if (index, subindex) in fixed else
                          abort_codes.NO_SUCH_SUBINDEX)
        else:
            self._objects.write_object(index, subindex, data)

    def _fixed(self, index: int) -> dict[tuple[int, int], bytes]:
        """Return the objects of an index that has no registers."""
        code, register, _ = self._error
        objects = {
            # what every node has: device type, errors, identifiers, heartbeat, identity
            (0x1000, 0): bytes(4),
            (0x1001, 0): bytes((register,)),
            (0x1003, 0): bytes((bool(code),)),
            (0x1003, 1): code.to_bytes(4, 'little'),
            (0x1014, 0): (network.EMERGENCY_BASE + self.number).to_bytes(4, 'little'),
            HEARTBEAT_TIME: self._heartbeat.to_bytes(2, 'little'),
            (0x1018, 0): bytes((1,)),
            (0x1018, 1): bytes(4),
            **self._constants(),
        }
        return {place: content for place, content in objects.items() if place[0] == index}
