# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Watching drives with the DataModel protocol, 29-bit and 11-bit identifiers."""

from collections.abc import Sequence
from dataclasses import replace

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter, ParameterType, Storage
from drive_can_bridge.protocols.datamodel import extended, standard
from drive_can_bridge.protocols.datamodel.extended import ReadTelegram, WriteTelegram
from drive_can_bridge.protocols.datamodel.process_words import CyclicCodec
from drive_can_bridge.protocols.datamodel.standard_round import reads
from drive_can_bridge.protocols.observer import (
    DriveObserver, Emit, Handler, listed_by, raws_of, Telegram, TelegramKind, Verdict)
from drive_can_bridge.protocols.pairing import (
    CYCLES_WAITED, CyclicWatch, PendingRequests, RequestContent, WriteGap)
from drive_can_bridge.protocols.polled_exchange import Chunk
from drive_can_bridge.protocols.telegrams import Direction

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_CYCLIC, _PARAMETER = TelegramKind.CYCLIC, TelegramKind.PARAMETER
_NORMAL = Verdict.NORMAL


class _Traffic:
    """
    What reads and writes of parameters look like with both protocols.

    :param plan: the reads of a round, where the exchange is made of reads and writes.
    :param setpoints: what is written in it.
    """

    def __init__(self, observer: DriveObserver, drive: DriveConfiguration, *,
                 plan: Sequence[Chunk] = (), setpoints: Sequence[Parameter] = ()) -> None:
        self._offset: int = drive.options.parameter_offset
        self._observed = observer.observed
        self._listed = listed_by(
            drive.profile.parameters.values(), lambda parameter: (
                None if parameter.number is None else parameter.number + self._offset))
        self._requests: PendingRequests[Chunk] = PendingRequests(
            observer, drive.parameter_timeout, self._content, plan=plan,
            setpoints={Chunk((parameter.number or 0) + self._offset) for parameter in setpoints})
        self._gap = WriteGap(drive.options.eeprom_write_gap)
        # what is sent cyclically is taken to be volatile, as the bridge takes it
        self._volatile = {(parameter.number or 0) + self._offset
                          for parameter in drive.cyclic_request}

    def take(self, request: ReadTelegram | WriteTelegram, now: float) -> None:
        """Record a request; nobody answers a write."""
        if isinstance(request, ReadTelegram):
            chunk = Chunk(request.number, request.count)
            self._requests.ask(chunk, chunk, now)
            return
        chunk = Chunk(request.number, len(request.words))
        wrong = ''
        if any(parameter.storage is not Storage.RAM and number not in self._volatile
               for number, parameter in zip(chunk.addresses, self._named(chunk))):
            wrong = self._gap.written(now)
            self._observed.fast_writes += bool(wrong)
        self._requests.ask(None, chunk, now, request.words, wrong=wrong)

    def answered(self, chunk: Chunk, words: Sequence[int], now: float) -> None:
        """Record the answer to a read."""
        self._requests.answer(chunk, self._requests.about.get(chunk) or RequestContent(chunk),
                              now, words)

    def _content(self, chunk: Chunk, words: Sequence[int] | None,
                 ) -> tuple[list[Parameter], list[int]]:
        parameters = self._named(chunk)
        return parameters, [] if words is None else raws_of(parameters, words)

    def _named(self, chunk: Chunk) -> list[Parameter]:
        """Return the parameters with these numbers on the wire."""
        return [self._listed.get(each) or Parameter(
            f'p{each - self._offset}', number=each - self._offset, listed=False)
            for each in chunk.addresses]


class ExtendedObserver(DriveObserver):
    """
    Watches one drive with 29-bit identifiers.

    The cyclic telegrams have handlers of their own; the codec decodes the others.
    """

    def __init__(self, drive: DriveConfiguration, emit: Emit) -> None:
        super().__init__(drive.name, emit)
        self._strict: bool = drive.options.length_policy == 'strict'
        control = drive.profile.control
        slots = [slot for slot, parameter in enumerate(drive.cyclic_request)
                 if control and parameter.name == control.parameter]
        # a control word is unsigned whatever its type
        self._request = tuple(
            replace(parameter, type=ParameterType.UINT16) if slot in slots else parameter
            for slot, parameter in enumerate(drive.cyclic_request))
        self._response = drive.cyclic_response
        self._station = drive.station << extended.STATION_SHIFT
        self._codec = CyclicCodec(
            drive.station, drive.cyclic_request, self._response,
            control_slot=slots[0] if slots else None, strict=self._strict)
        self._cycle = CyclicWatch(self, CYCLES_WAITED * drive.period)
        self._traffic = _Traffic(self, drive)

    def handler(self, identifier: int, extended_format: bool) -> Handler | None:
        if not extended_format or identifier & extended.STATION_MASK != self._station:
            return None
        if identifier == self._codec.request_identifier:
            return self._take_request
        if identifier == self._codec.response_identifier:
            return self._take_response
        return lambda data, now: self._take_acyclic(identifier, data, now)

    def _take_request(self, data: bytes, now: float) -> None:
        self._cycle.ask(now)
        raws, wrong = self._codec.decode_request(data)
        if wrong:
            self.report(now, _REQUEST, _CYCLIC, 'cyclic request', verdict=Verdict.MALFORMED,
                      remark=wrong)
            return
        self.emit(Telegram(now, self.name, _REQUEST, _CYCLIC, 'cyclic request', self._request,
                           raws))

    def _take_response(self, data: bytes, now: float) -> None:
        raws, wrong = self._codec.decode_response(data)
        if wrong and self._cycle.asked:
            self.report(now, _RESPONSE, _CYCLIC, 'cyclic response', self._response, raws,
                      verdict=Verdict.MALFORMED, remark=wrong)
            if raws:
                self._cycle.answer(now)
            return
        verdict, latency = self._cycle.answer(now)
        if wrong:   # nobody was heard to ask for it
            self.report(now, _RESPONSE, _CYCLIC, 'cyclic response', self._response, raws,
                      verdict=Verdict.MALFORMED if verdict is _NORMAL else verdict,
                      remark=wrong, latency=latency)
        elif verdict is _NORMAL:
            self.emit(Telegram(now, self.name, _RESPONSE, _CYCLIC, 'cyclic response',
                               self._response, raws, verdict, '', latency))
        else:
            self.report(now, _RESPONSE, _CYCLIC, 'cyclic response', self._response, raws,
                      verdict=verdict, latency=latency)

    def _take_acyclic(self, identifier: int, data: bytes, now: float) -> None:
        telegram = self.decoded(
            lambda data: extended.decode(Frame(identifier, data, True), strict=self._strict),
            data, now, _RESPONSE if identifier & extended.DIR else _REQUEST, _PARAMETER, 'frame')
        if isinstance(telegram, (ReadTelegram, WriteTelegram)):
            self._traffic.take(telegram, now)
        elif isinstance(telegram, extended.ReadResponse):
            self._traffic.answered(Chunk(telegram.number, len(telegram.words)), telegram.words,
                                   now)


class StandardObserver(DriveObserver):
    """Watches one drive with 11-bit identifiers: an answer belongs to the last read."""

    def __init__(self, drive: DriveConfiguration, emit: Emit) -> None:
        super().__init__(drive.name, emit)
        options = drive.options
        self._strict: bool = options.length_policy == 'strict'
        request, self._response = (
            standard.identifier(base, drive.station)
            for base in (options.request_id_base, options.response_id_base))
        self.listen(request, _REQUEST, _PARAMETER, 'frame', lambda data: standard.decode_request(
            Frame(request, data, False)), self._take_request)
        self.handlers[self._response] = self._take_response
        self._traffic = _Traffic(self, drive, plan=reads(drive), setpoints=drive.cyclic_request)
        self._last: Chunk | None = None

    def _take_request(self, request: ReadTelegram | WriteTelegram, now: float) -> None:
        if isinstance(request, ReadTelegram):
            self._last = Chunk(request.number, request.count)
        self._traffic.take(request, now)

    def _take_response(self, data: bytes, now: float) -> None:
        chunk = self._last
        if chunk is None:       # asked before the trace began
            self.report(now, _RESPONSE, _PARAMETER, 'read', remark=f'data {data.hex(" ").upper()}')
            return
        words = self.decoded(
            lambda data: standard.decode_read_response(
                Frame(self._response, data, False), chunk.size, strict=self._strict),
            data, now, _RESPONSE, _PARAMETER, 'read')
        if words is not None:
            self._traffic.answered(chunk, words, now)
