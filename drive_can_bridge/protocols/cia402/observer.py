# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watching drives of CiA 402: their PDOs, their SDO transfers, what they say as nodes, and SYNC.

A SYNC behind PDOs for a drive asks it for all its transmit PDOs. With ``transmission: event``
nobody asks: an exchange is a complete set of them.
"""

from collections.abc import Sequence
from functools import partial
import math

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.core.status_bits import STATUS_NAME
from drive_can_bridge.core.text import printable, TEXT_MAX
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.addressing import name_of_object
from drive_can_bridge.protocols.canopen.network import NmtState
from drive_can_bridge.protocols.canopen.observer import listen_to_node, NmtObserver
from drive_can_bridge.protocols.canopen.sdo import SdoCommand as Said, SdoMessage
from drive_can_bridge.protocols.cia402.pdo import Pdo, request_pdos, response_pdos
from drive_can_bridge.protocols.cia402.states import state_of
from drive_can_bridge.protocols.observer import (
    DriveObserver, Emit, Handler, listed_by, Observed, TelegramKind, Verdict)
from drive_can_bridge.protocols.pairing import (
    AnswerWatch, CYCLES_WAITED, CyclicWatch, PendingRequests, RequestContent)
from drive_can_bridge.protocols.telegrams import Direction

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_CYCLIC, _PARAMETER, _NETWORK = TelegramKind.CYCLIC, TelegramKind.PARAMETER, TelegramKind.NETWORK
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
        """Count a complete set; return when the next one is missed."""
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
        listen_to_node(self, node, self._booted, drive.parameter_timeout)
        self.listen(sdo.REQUEST_BASE + node, _REQUEST, _PARAMETER, 'SDO request',
                  partial(sdo.decode, _REQUEST), self._take_sdo_request)
        self.listen(sdo.RESPONSE_BASE + node, _RESPONSE, _PARAMETER, 'SDO response',
                  lambda data: sdo.decode(_RESPONSE, data, segments=self._transfer is not None),
                  self._take_sdo_response)
        self.handlers |= {pdo.identifier: self._request_handler(pdo)
                          for pdo in request_pdos(drive)}
        for pdo in responses:
            self.listen(pdo.identifier, _RESPONSE, _CYCLIC, 'cyclic response', pdo.unpack,
                      partial(self._take_response, pdo))
        self._cycle: CyclicWatch | None = None
        self._events: EventWatch | None = None
        if drive.options.transmission == 'sync':
            self._cycle = CyclicWatch(self, CYCLES_WAITED * drive.period)
        else:
            self._events = EventWatch(drive.period, self.observed)
            self.watches.append(self._events)
        self._requests: PendingRequests[Place] = PendingRequests(self, drive.parameter_timeout,
                                                                 self._content)
        self._segments = AnswerWatch(self, drive.parameter_timeout, self._lose_segment)
        self._transfer: Place | None = None     # by segments, under way
        self._begun: Place | None = None        # a write by segments, asked for
        self._writes = False                    # the transfer under way does
        self._last = False                      # its last segment was sent
        self._text = b''

    # -- process data -----------------------------------------------------------------------------

    def synchronise(self, now: float) -> None:
        """Handle SYNC: it asks a drive that was sent RPDOs."""
        if self._cycle is not None and self._told:
            self._told = False
            self._arrived.clear()
            self._cycle.ask(now)

    def _request_handler(self, pdo: Pdo) -> Handler:
        def take(data: bytes, now: float) -> None:
            self._told = True
            raws = self.decoded(pdo.unpack, data, now, _REQUEST, _CYCLIC, 'cyclic request')
            if raws is not None:
                self.report(now, _REQUEST, _CYCLIC, 'cyclic request', pdo.parameters, raws)
        return take

    def _take_response(self, pdo: Pdo, raws: Sequence[int], now: float) -> None:
        verdict, latency = Verdict.NORMAL, math.nan
        self._arrived.add(pdo.number)
        if self._arrived == self._all:
            self._arrived.clear()
            if self._cycle is not None:
                verdict, latency = self._cycle.answer(now)
            elif self._events is not None:
                self.due(self._events.complete(now))
        remark = state_of(raws[0]).value if pdo.parameters[0].name == STATUS_NAME else ''
        self.report(now, _RESPONSE, _CYCLIC, 'cyclic response', pdo.parameters, raws,
                  verdict=verdict, remark=remark, latency=latency)

    def _booted(self) -> None:
        self._end_transfer(math.nan)
        self._arrived.clear()

    # -- parameters -------------------------------------------------------------------------------

    def _take_sdo_request(self, request: SdoMessage, now: float) -> None:
        if request.object is None:
            self._take_segment_request(request, now)
            return
        place, written = request.object, request.data
        self._end_transfer(now)
        self._begun = place if request.kind is Said.DOWNLOAD_BEGUN else None
        if request.kind is Said.ABORT:
            self.report(now, _REQUEST, _PARAMETER, 'abort', self._content(place, None)[0],
                      remark=sdo.describe(request.number))
            return
        self._requests.ask(place, place, now, None if request.kind is Said.UPLOAD else [
            int.from_bytes(written, 'little'), len(written)] if written else [])

    def _take_sdo_response(self, answer: SdoMessage, now: float) -> None:
        place = answer.object
        if place is None:
            self._take_segment(answer, now)
            return
        self._end_transfer(now)
        asked = self._requests.about.get(place) or RequestContent(place,
                                                                  answer.kind is Said.DOWNLOADED)
        self._writes = answer.kind is Said.DOWNLOADED
        if answer.kind is Said.UPLOAD_BEGUN or self._writes and self._begun == place:
            self._transfer, self._text = place, b''
        self._requests.answer(
            place, asked, now, [] if not answer.data else [
                int.from_bytes(answer.data, 'little'), len(answer.data)],
            refusal=sdo.describe(answer.number) if answer.kind is Said.ABORT else '')

    def _take_segment_request(self, request: SdoMessage, now: float) -> None:
        """Handle the next segment, or the request for it; the transfer was reported."""
        if self._transfer is None:
            return
        self._segments.ask(now)
        if request.kind is Said.SEGMENT_SENT and self._add(request):
            self._report_text(_REQUEST, now)

    def _take_segment(self, answer: SdoMessage, now: float) -> None:
        latency = self._segments.answer(now)
        last = self._last if answer.kind is Said.SEGMENT_TAKEN else self._add(answer)
        if last and self._transfer is not None:
            if self._writes:
                self._text = b''
            self._report_text(_RESPONSE, now, latency if self._writes else math.nan)
            self._end_transfer(now)

    def _add(self, segment: SdoMessage) -> bool:
        """Store the content of a segment; return whether it is the last one."""
        # a domain may have megabytes, and no more of it is shown
        self._text = (self._text + segment.data)[:TEXT_MAX]
        self._last = segment.last
        return segment.last

    def _report_text(self, direction: Direction, now: float, latency: float = math.nan) -> None:
        if self._transfer is not None:
            self.report(now, direction, _PARAMETER, 'write' if self._writes else 'read',
                      self._content(self._transfer, None)[0], latency=latency,
                      remark=printable(repr(self._text.rstrip(b'\0').decode(
                          'ascii', 'replace'))) if self._text else '')

    def _lose_segment(self, now: float) -> None:
        if self._transfer is not None:
            self.observed.unanswered += 1
            self.report(now, _RESPONSE, _PARAMETER, 'write' if self._writes else 'read',
                      self._content(self._transfer, None)[0], verdict=Verdict.LOST,
                      remark=frame_sentences.segment_unanswered())

    def _end_transfer(self, now: float) -> None:
        self._segments.answer(now)
        self._transfer, self._last = None, False

    def _content(self, place: Place, words: Sequence[int] | None,
                 ) -> tuple[list[Parameter], list[int]]:
        """Return the parameter that an object is, and its value: words are value and length."""
        length = words[1] if words else 4
        parameter = self._listed.get(place) or Parameter(
            name_of_object(*place), _BYTES.get(length, ParameterType.UINT32), listed=False)
        return [parameter], [parameter.raw_from_word(words[0])] if words else []


class NetworkObserver(DriveObserver):
    """
    Watches what is for all drives of a bus: NMT, SYNC, the heartbeat of the bridge.

    :param observers: of these drives.
    """

    def __init__(self, drives: Sequence[DriveConfiguration], observers: Sequence[DriveObserver],
                 emit: Emit) -> None:
        super().__init__('', emit)
        self.handlers |= NmtObserver(
            {drive.station: drive.name for drive in drives}, emit).handlers
        self._drives = [each for each in observers if isinstance(each, Cia402Observer)]
        self.handlers[network.SYNC_IDENTIFIER] = self._take_sync
        for drive in drives:
            if drive.options.bridge_heartbeat > 0:
                self.listen(network.HEARTBEAT_BASE + drive.options.bridge_node, _REQUEST, _NETWORK,
                          'heartbeat', network.decode_heartbeat, self._take_bridge)

    def _take_sync(self, data: bytes, now: float) -> None:
        for each in self._drives:
            each.synchronise(now)
            if each.deadline < self.deadline:
                self.deadline = each.deadline
        self.report(now, _REQUEST, _CYCLIC, 'SYNC',
                  remark=f'all nodes, counter {data[0]}' if data else 'all nodes')

    def _take_bridge(self, state: NmtState, now: float) -> None:
        self.report(now, _REQUEST, _NETWORK, 'heartbeat', remark=f'of the bridge: {state.text}')


def make_observers(drives: Sequence[DriveConfiguration], emit: Emit) -> list[DriveObserver]:
    """Make the observers of the drives, and of what is for all of them."""
    observers: list[DriveObserver] = [Cia402Observer(drive, emit) for drive in drives]
    return [*observers, NetworkObserver(drives, observers, emit)]
