# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A simulated CANopen node: NMT, boot-up, heartbeat, emergencies, SDO server, objects of every node.

CiA 301. A drive composes one of these; its PDOs and all further objects are the family's.
"""

from collections.abc import Callable
import math

from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.network import Emergency, NmtCommand, NmtState
from drive_can_bridge.protocols.canopen.sdo import REQUEST_BASE, RESPONSE_BASE
from drive_can_bridge.simulation.canopen.sdo import (
    Absent, checked_length, SdoServer, ServedObjects)
from drive_can_bridge.simulation.drive import Companion, IgnoredFrame, SimulatedDrive
from drive_can_bridge.simulation.registers import AccessRefused

#: objects by index and sub-index
Contents = dict[tuple[int, int], bytes]

#: ms between heartbeats without a consumer
HEARTBEAT = 1000
#: heartbeats within the time after which the bridge misses them
HEARTBEATS_WATCHED = 3
#: s that a reset by NMT takes
RESET_TIME = 0.05
#: s between two looks at the motor while it runs
TICK = 0.1
TRIP_EMERGENCY = 0xFF00
#: bits of the error register: generic, maker's own
TRIP_ERROR_REGISTER = 0x81

HEARTBEAT_TIME = (0x1017, 0)

_NO_ERROR = Emergency(network.NO_ERROR)
_STATES: dict[int, NmtState] = {
    NmtCommand.START: NmtState.OPERATIONAL, NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL}


def _maker_emergency(code: int) -> Emergency:
    return Emergency(TRIP_EMERGENCY, TRIP_ERROR_REGISTER, code.to_bytes(5, 'little'))


class CanopenNode(Companion):
    """
    The node of a drive.

    :param objects: those that are registers.
    :param constants: returns the content of the family's other, read-only objects, by address.
    :param trip_code: the maker's code of a trip that has none of its own.
    :param heartbeat: ms between heartbeats after power came on; None: as they are watched.
    :param make_emergency: returns the message of a trip from its code.
    :param segmented_writes: accepts them by SDO.
    :ivar state: boot-up: without power, or still starting.
    :ivar start_time: s from NMT start to operational.
    :ivar absent: objects that it does not have, although it could.
    """

    def __init__(self, drive: SimulatedDrive, objects: ServedObjects, *,
                 constants: Callable[[], Contents], trip_code: int, heartbeat: int | None = None,
                 make_emergency: Callable[[int], Emergency] = _maker_emergency,
                 segmented_writes: bool = False) -> None:
        self._drive = drive
        self._objects, self._constants, self._trip_code = objects, constants, trip_code
        self.number = drive.configuration.station
        watched: float = drive.configuration.options.heartbeat_timeout
        self._default_heartbeat = heartbeat if heartbeat is not None else round(
            1000.0 * watched / HEARTBEATS_WATCHED) if watched else HEARTBEAT
        self._make_emergency = make_emergency
        self._server = SdoServer(self, segmented_writes=segmented_writes)
        self.start_time = 0.0
        self.absent = Absent()
        self._now = -math.inf
        self._looks_at = math.inf
        # the boot-up frame leaves with the first call
        self.power_lost(-math.inf)

    @staticmethod
    def routes(number: int, *pdos: int) -> list[Route]:
        """Return the identifiers of a node, and that of NMT commands."""
        own = REQUEST_BASE, RESPONSE_BASE, network.HEARTBEAT_BASE, network.EMERGENCY_BASE
        return [Route.of(identifier) for identifier in (
            network.NMT_IDENTIFIER, *(base + number for base in own), *pdos)]

    def power_lost(self, back_at: float) -> None:
        self.state = NmtState.BOOT_UP
        self._heartbeat = self._default_heartbeat
        self._boots_at, self._beats_at, self._starts_at = back_at, math.inf, math.inf
        self._server.reset()
        self._error = _NO_ERROR

    def receive(self, frame: Frame, now: float) -> bool:
        identifier, data, extended = frame
        if extended:
            return False
        if self.state is NmtState.BOOT_UP:
            # a node that is ready to receive has sent its boot-up frame
            self._report_state(now)
        self._started(now)
        if identifier == network.NMT_IDENTIFIER:
            self._obey(data, now)
        elif identifier == REQUEST_BASE + self.number:
            self._serve(data, now)
        else:
            return False
        return True

    def _obey(self, data: bytes, now: float) -> None:
        try:
            command, number = network.decode_nmt(data)
        except RemoteProtocolError:
            raise IgnoredFrame('NMT command without two data bytes') from None
        if number not in (0, self.number):
            return
        if command == NmtCommand.RESET_NODE:
            self._drive.lose_power(now, now + RESET_TIME)
        elif command == NmtCommand.RESET_COMMUNICATION:
            self._drive.restart(now + RESET_TIME)
        elif self.state is not NmtState.BOOT_UP and command in _STATES:
            state = _STATES[command]
            if state is not NmtState.OPERATIONAL:
                self.state, self._starts_at = state, math.inf
            elif self.state is not state:
                self._starts_at = min(self._starts_at, now + self.start_time)
                self._started(now)

    def _started(self, now: float) -> None:
        """Become operational once the start has taken its time."""
        if self._starts_at <= now:
            self.state, self._starts_at = NmtState.OPERATIONAL, math.inf

    def _serve(self, data: bytes, now: float) -> None:
        if self._communicates:
            self._drive.requests += 1
            self._now = now
            response = self._server.answer(data)
            if response is not None:
                self._drive.answer(Frame(RESPONSE_BASE + self.number, response, False), now)

    def look(self, now: float) -> None:
        """Report a trip that has come or gone, and plan the next check of a running motor."""
        operation = self._drive.plant.operation
        self._looks_at = now + TICK if operation.enabled else math.inf
        code = int(operation.fault_code(self._trip_code))
        error = self._make_emergency(code) if operation.faulted else _NO_ERROR
        if self._communicates and error.code != self._error.code:
            self._error = error
            self._drive.send(network.encode_emergency(self.number, error))

    @property
    def _communicates(self) -> bool:
        """Whether it handles SDOs and emergencies."""
        return self.state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL)

    def next_timer(self) -> float:
        return min(self._boots_at, self._beats_at, self._looks_at, self._starts_at)

    def handle_timer(self, now: float) -> None:
        self._started(now)
        self._report_state(now)
        self.look(now)

    def _report_state(self, now: float) -> None:
        """Send the boot-up frame or the heartbeat that is due."""
        if self._boots_at <= now:
            self._boots_at = math.inf
            self.state = NmtState.PRE_OPERATIONAL
            self._plan_heartbeat(now)
            self._drive.send(network.encode_heartbeat(self.number, NmtState.BOOT_UP))
        elif self._beats_at <= now:
            # late ones are left out, the beat is kept
            period = self._heartbeat / 1000.0
            self._beats_at += period * (math.floor((now - self._beats_at) / period) + 1)
            self._drive.send(network.encode_heartbeat(self.number, self.state))

    def _plan_heartbeat(self, now: float) -> None:
        self._beats_at = now + self._heartbeat / 1000.0 if self._heartbeat else math.inf

    def take_away(self, places: frozenset[tuple[int, int | None]]) -> None:
        """Remove these objects; a sub-index None is all of the index."""
        self.absent.places = places
        if HEARTBEAT_TIME in self.absent:
            self._default_heartbeat = self._heartbeat = 0
            self._beats_at = math.inf

    def send_error(self, error: Emergency) -> None:
        """Send an emergency that stays, independent of the motor."""
        if self._communicates:
            self._drive.send(network.encode_emergency(self.number, error))

    def read_object(self, index: int, subindex: int) -> bytes:
        self.absent.check(index, subindex)
        content = self._content(index, subindex)
        return self._objects.read_object(index, subindex) if content is None else content

    def write_object(self, index: int, subindex: int, data: bytes) -> None:
        self.absent.check(index, subindex)
        if (index, subindex) == HEARTBEAT_TIME:
            self._heartbeat = int.from_bytes(checked_length(data, 2), 'little')
            self._plan_heartbeat(self._now)
        elif self._content(index, subindex) is not None:
            raise AccessRefused(sdo.WRITE_OF_READ_ONLY)
        else:
            self._objects.write_object(index, subindex, data)

    def _content(self, index: int, subindex: int) -> bytes | None:
        """
        Return an object that is no register; None: its index has registers.

        :raises AccessRefused: its index has none, and no such sub-index.
        """
        objects = {
            # what every node has: device type, errors, identifiers, heartbeat, identity
            (0x1000, 0): bytes(4),
            (0x1001, 0): bytes((self._error.register,)),
            (0x1014, 0): (network.EMERGENCY_BASE + self.number).to_bytes(4, 'little'),
            HEARTBEAT_TIME: self._heartbeat.to_bytes(2, 'little'),
            (0x1018, 0): bytes((1,)),
            (0x1018, 1): bytes(4),
            **self._constants(),
        }
        if (index, subindex) not in objects and any(place[0] == index for place in objects):
            raise AccessRefused(sdo.NO_SUCH_SUBINDEX)
        return objects.get((index, subindex))
