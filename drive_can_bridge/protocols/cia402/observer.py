# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watching drives of CiA 402: their PDOs, their SDO transfers, what they say as nodes, and SYNC.

A SYNC behind PDOs for a drive asks it for all its transmit PDOs. With ``transmission: event``
nobody asks: an exchange is a complete set of them.
"""

from collections.abc import Sequence
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.canopen import abort_codes, network, sdo
from drive_can_bridge.protocols.canopen.addressing import name_of_object
from drive_can_bridge.protocols.canopen.observer import NmtObserver, node_handlers
from drive_can_bridge.protocols.canopen.sdo import Kind as Said
from drive_can_bridge.protocols.cia402.pdo import Pdo, request_pdos, response_pdos
from drive_can_bridge.protocols.cia402.states import state_of, STATUS_NAME
from drive_can_bridge.protocols.observer import (
    Direction, DriveObserver, Emit, Handler, Kind, listed_by, Observed, Verdict,
)
from drive_can_bridge.protocols.request_watch import Asked, Requests
from drive_can_bridge.protocols.watches import CYCLES_WAITED, CyclicWatch

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_CYCLIC, _PARAMETER, _NETWORK = Kind.CYCLIC, Kind.PARAMETER, Kind.NETWORK
#: periods without a complete set of PDOs that nobody asks for, after which one is missed
_SETS_WAITED = 1.5
_BYTES = {1: ParameterType.UINT8, 2: ParameterType.UINT16, 3: ParameterType.UINT32,
          4: ParameterType.UINT32}

#: index and sub-index
Place = tuple[int, int]


class EventWatch:
    """Counts the sets of PDOs that a drive sends by its own timer."""

    def __init__(self, period: float, observed: Observed) -> None:
        self._patience = _SETS_WAITED * period
        self._observed = observed
        self._last = math.nan

    def complete(self, now: float) -> float:
        """Take a complete set; return when the next one is missed."""
        if self._last == self._last:    # not NaN
            self._observed.period.add(now - self._last)
        self._last = now
        self._observed.exchanges += 1
        return now + self._patience

    def expire(self, now: float) -> float:
        due = self._last + self._patience
        if due <= now:
            self._observed.missed += 1
            self._last = math.nan       # the silence is one
        return due if due > now else math.inf


class Cia402Observer(DriveObserver):
    """Watches one drive."""

    def __init__(self, drive: DriveConfiguration, emit: Emit) -> None:
        super().__init__(drive.name, emit)
        self._listed = listed_by(
            drive.profile.parameters.values(), lambda parameter: None if (
                parameter.index is None) else (parameter.index, parameter.subindex or 0))
        responses = response_pdos(drive)
        self._all = {pdo.number for pdo in responses}
        self._arrived: set[int] = set()
        self._told = False              # something since the last SYNC
        node = drive.station
        self.handlers |= {
            **node_handlers(self, node, self._booted),
            sdo.REQUEST_BASE + node: self._take_sdo_request,
            sdo.RESPONSE_BASE + node: self._take_sdo_response,
            **{pdo.identifier: self._request_handler(pdo) for pdo in request_pdos(drive)},
            **{pdo.identifier: self._response_handler(pdo) for pdo in responses}}
        self._cycle: CyclicWatch | None = None
        self._events: EventWatch | None = None
        if drive.options.transmission == 'sync':
            self._cycle = CyclicWatch(self, CYCLES_WAITED * drive.period)
        else:
            self._events = EventWatch(drive.period, self.observed)
            self.watches.append(self._events)
        self._requests: Requests[Place] = Requests(self, drive.parameter_timeout, self._content)
        self._transfer: Place | None = None     # by segments, under way
        self._text = b''

    # -- process data -----------------------------------------------------------------------------

    def synchronise(self, now: float) -> None:
        """Take a SYNC: it asks a drive that was told something."""
        if self._cycle is not None and self._told:
            self._told = False
            self._arrived.clear()
            self._cycle.ask(now)

    def _request_handler(self, pdo: Pdo) -> Handler:
        def take(data: bytes, now: float) -> None:
            self._told = True
            raws = self.decoded(pdo.unpack, data, now, _REQUEST, _CYCLIC, 'cyclic request')
            if raws is not None:
                self.tell(now, _REQUEST, _CYCLIC, 'cyclic request', pdo.parameters, raws)
        return take

    def _response_handler(self, pdo: Pdo) -> Handler:
        title = 'cyclic response'

        def take(data: bytes, now: float) -> None:
            raws = self.decoded(pdo.unpack, data, now, _RESPONSE, _CYCLIC, title)
            if raws is None:
                return
            verdict, latency = Verdict.NORMAL, math.nan
            self._arrived.add(pdo.number)
            if self._arrived == self._all:
                self._arrived.clear()
                if self._cycle is not None:
                    verdict, latency = self._cycle.answer(now)
                elif self._events is not None:
                    self.due(self._events.complete(now))
            remark = state_of(raws[0]).value if pdo.parameters[0].name == STATUS_NAME else ''
            self.tell(now, _RESPONSE, _CYCLIC, title, pdo.parameters, raws, verdict=verdict,
                      remark=remark, latency=latency)
        return take

    def _booted(self) -> None:
        self._transfer = None
        self._arrived.clear()

    # -- parameters -------------------------------------------------------------------------------

    def _take_sdo_request(self, data: bytes, now: float) -> None:
        title = 'SDO request'
        request = self.decoded(sdo.decode_request, data, now, _REQUEST, _PARAMETER, title)
        if request is None:
            return
        place, written, abort = request
        if place is None:
            return      # the next segment: the transfer was told
        self._transfer = None
        if abort is not None:
            self.tell(now, _REQUEST, _PARAMETER, 'abort', self._content(place, None)[0],
                      remark=abort_codes.describe(abort))
            return
        self._requests.ask(place, place, now, None if written is None else [
            int.from_bytes(written, 'little'), len(written)])

    def _take_sdo_response(self, data: bytes, now: float) -> None:
        title = 'SDO response'
        transfer = self._transfer
        try:
            answer = sdo.decode_answer(data, segments=transfer is not None)
        except RemoteProtocolError as error:
            self.tell(now, _RESPONSE, _PARAMETER, title, verdict=Verdict.MALFORMED,
                      remark=str(error))
            return
        if answer.object is None:
            self._take_segment(answer, now)
            return
        self._transfer = None
        place = answer.object
        asked = self._requests.about.get(place) or Asked(place, answer.kind is Said.WRITTEN)
        if answer.kind is Said.ABORT:
            self._requests.answer(place, asked, now, [],
                                  refusal=abort_codes.describe(answer.number))
            return
        if answer.kind is Said.LONG:
            self._transfer, self._text = place, b''
        self._requests.answer(place, asked, now, [] if not answer.data else [
            int.from_bytes(answer.data, 'little'), len(answer.data)])

    def _take_segment(self, answer: sdo.Answer, now: float) -> None:
        self._text += answer.data
        if answer.last and self._transfer is not None:
            parameters, _ = self._content(self._transfer, None)
            self._transfer = None
            self.tell(now, _RESPONSE, _PARAMETER, 'read', parameters,
                      remark=repr(self._text.rstrip(b'\0').decode('ascii', 'replace')))

    def _content(self, place: Place, words: Sequence[int] | None,
                 ) -> tuple[list[Parameter], list[int]]:
        """Return the parameter that an object is, and its value: words are value and length."""
        length = words[1] if words else 4
        parameter = self._listed.get(place) or Parameter(
            name_of_object(*place), _BYTES.get(length, ParameterType.UINT32), listed=False)
        return [parameter], [parameter.raw_from_word(words[0])] if words else []


class NetworkObserver(DriveObserver):
    """
    Watches what is said to all drives of a bus: NMT, SYNC, the heartbeat of the bridge.

    :param observers: of these drives.
    """

    def __init__(self, drives: Sequence[DriveConfiguration], observers: Sequence[DriveObserver],
                 emit: Emit) -> None:
        super().__init__('', emit)
        self.handlers |= NmtObserver(
            {drive.station: drive.name for drive in drives}, emit).handlers
        self._drives = [each for each in observers if isinstance(each, Cia402Observer)]
        self.handlers[network.SYNC_IDENTIFIER] = self._take_sync
        self.handlers |= {network.HEARTBEAT_BASE + drive.options.bridge_node: self._take_bridge
                          for drive in drives if drive.options.bridge_heartbeat > 0}

    def _take_sync(self, data: bytes, now: float) -> None:
        for each in self._drives:
            each.synchronise(now)
            if each.deadline < self.deadline:
                self.deadline = each.deadline
        self.tell(now, _REQUEST, _CYCLIC, 'SYNC',
                  remark=f'all nodes, counter {data[0]}' if data else 'all nodes')

    def _take_bridge(self, data: bytes, now: float) -> None:
        state = self.decoded(network.decode_heartbeat, data, now, _REQUEST, _NETWORK, 'heartbeat')
        if state is not None:
            self.tell(now, _REQUEST, _NETWORK, 'heartbeat', remark=f'of the bridge: {state.text}')


def make_observers(drives: Sequence[DriveConfiguration], emit: Emit) -> list[DriveObserver]:
    """Make what watches drives, and what is said to all of them."""
    observers: list[DriveObserver] = [Cia402Observer(drive, emit) for drive in drives]
    return [*observers, NetworkObserver(drives, observers, emit)]
