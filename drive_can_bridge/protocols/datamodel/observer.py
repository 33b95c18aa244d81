# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Watching drives with the DataModel protocol, 29-bit and 11-bit identifiers."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter, ParameterType, Storage
from drive_can_bridge.protocols.datamodel import extended, standard
from drive_can_bridge.protocols.datamodel.process_words import CyclicCodec
from drive_can_bridge.protocols.datamodel.standard_round import reads
from drive_can_bridge.protocols.observer import (
    Direction, DriveObserver, Emit, Handler, Kind, raws_of, Telegram, Verdict,
)
from drive_can_bridge.protocols.polling import Chunk
from drive_can_bridge.protocols.watches import (
    CYCLES_WAITED, CyclicWatch, Questions, RoundWatch, WriteGap,
)

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_CYCLIC, _PARAMETER = Kind.CYCLIC, Kind.PARAMETER
_NORMAL = Verdict.NORMAL


class _Traffic:
    """What reads and writes of parameters look like with both protocols."""

    def __init__(self, observer: DriveObserver, drive: DriveConfiguration,
                 unanswered: Callable[[Chunk, float], None]) -> None:
        self.offset: int = drive.options.parameter_offset
        self.questions: Questions[Chunk] = Questions(
            observer, drive.parameter_timeout, unanswered)
        self._observer = observer
        self._listed = {parameter.number + self.offset: parameter
                        for parameter in reversed(list(drive.profile.parameters.values()))
                        if parameter.number is not None}
        self._gap = WriteGap(drive.options.eeprom_write_gap)

    def named(self, number: int, count: int) -> list[Parameter]:
        """Return the parameters with these numbers on the wire."""
        return [self._listed.get(each) or Parameter(
            f'p{each - self.offset}', number=each - self.offset, listed=False)
            for each in range(number, number + count)]

    def read(self, chunk: Chunk, now: float, kind: Kind) -> None:
        """Take the request to read parameters."""
        self.questions.ask(chunk, now)
        self._observer.tell(now, _REQUEST, kind, 'read', self.named(*chunk))

    def answered(self, chunk: Chunk, words: Sequence[int], now: float, kind: Kind) -> Verdict:
        """Take the answer; return what it is."""
        verdict, latency = self.questions.answer(chunk, now)
        parameters = self.named(*chunk)
        self._observer.tell(now, _RESPONSE, kind, 'read', parameters, raws_of(parameters, words),
                            verdict=verdict, latency=latency)
        return verdict

    def written(self, number: int, words: Sequence[int], now: float, kind: Kind) -> None:
        """Take a write."""
        parameters = self.named(number, len(words))
        wrong = ''
        if any(parameter.storage is not Storage.RAM for parameter in parameters):
            wrong = self._gap.written(now)
            self._observer.observed.fast_writes += bool(wrong)
        self._observer.tell(now, _REQUEST, kind, 'write', parameters, raws_of(parameters, words),
                            verdict=Verdict.SUSPICIOUS if wrong else Verdict.NORMAL, remark=wrong)


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
        self._traffic = _Traffic(self, drive, self._unanswered)

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
            self.tell(now, _REQUEST, _CYCLIC, 'cyclic request', verdict=Verdict.MALFORMED,
                      remark=wrong)
            return
        self.emit(Telegram(now, self.name, _REQUEST, _CYCLIC, 'cyclic request', self._request,
                           raws))

    def _take_response(self, data: bytes, now: float) -> None:
        raws, wrong = self._codec.decode_response(data)
        if wrong and self._cycle.asked:
            self.tell(now, _RESPONSE, _CYCLIC, 'cyclic response', self._response, raws,
                      verdict=Verdict.MALFORMED, remark=wrong)
            if raws:
                self._cycle.answer(now)
            return
        verdict, latency = self._cycle.answer(now)
        if verdict is _NORMAL:
            self.emit(Telegram(now, self.name, _RESPONSE, _CYCLIC, 'cyclic response',
                               self._response, raws, verdict, '', latency))
        else:
            self.tell(now, _RESPONSE, _CYCLIC, 'cyclic response', self._response, raws,
                      verdict=verdict, latency=latency)

    def _take_acyclic(self, identifier: int, data: bytes, now: float) -> None:
        telegram = self.decoded(
            lambda data: extended.decode(Frame(identifier, data, True), strict=self._strict),
            data, now, _RESPONSE if identifier & extended.DIR else _REQUEST, _PARAMETER, 'frame')
        if isinstance(telegram, extended.ReadRequest):
            self._traffic.read(Chunk(telegram.number, telegram.count), now,
                               self.count_request(cyclic=False))
        elif isinstance(telegram, extended.Write):
            self._traffic.written(telegram.number, telegram.words, now,
                                  self.count_request(cyclic=False))
        elif isinstance(telegram, extended.ReadResponse):
            self._traffic.answered(Chunk(telegram.number, len(telegram.words)), telegram.words,
                                   now, _PARAMETER)

    def _unanswered(self, chunk: Chunk, due: float) -> None:
        self.tell_unanswered(due, _PARAMETER, 'read', self._traffic.named(*chunk))


class StandardObserver(DriveObserver):
    """Watches one drive with 11-bit identifiers: an answer belongs to the last read."""

    def __init__(self, drive: DriveConfiguration, emit: Emit) -> None:
        super().__init__(drive.name, emit)
        options = drive.options
        self._strict: bool = options.length_policy == 'strict'
        self._request = standard.identifier(options.request_id_base, drive.station)
        self._response = standard.identifier(options.response_id_base, drive.station)
        self._traffic = _Traffic(self, drive, self._unanswered)
        self._setpoints = {(parameter.number or 0) + self._traffic.offset
                           for parameter in drive.cyclic_request}
        self._round: RoundWatch[Chunk] = RoundWatch(reads(drive), self.observed)
        self._last: Chunk | None = None
        self._kinds: dict[Chunk, Kind] = {}

    def handler(self, identifier: int, extended_format: bool) -> Handler | None:
        if extended_format:
            return None
        return {self._request: self._take_request,
                self._response: self._take_response}.get(identifier)

    def _take_request(self, data: bytes, now: float) -> None:
        request = self.decoded(
            lambda data: standard.decode_request(Frame(self._request, data, False)),
            data, now, _REQUEST, _PARAMETER, 'frame')
        if isinstance(request, standard.Write):
            kind = self.count_request(cyclic=request.number in self._setpoints)
            self._traffic.written(request.number, (request.word,), now, kind)
        elif request is not None:
            chunk = Chunk(request.number, request.count)
            kind = self.count_request(cyclic=self._round.asked(chunk, now))
            self._last = chunk
            self._kinds[chunk] = kind
            self._traffic.read(chunk, now, kind)

    def _take_response(self, data: bytes, now: float) -> None:
        if self._last is None:      # asked before the trace began
            self.tell(now, _RESPONSE, _PARAMETER, 'read', remark=f'data {data.hex(" ").upper()}')
            return
        chunk = self._last
        words = self.decoded(
            lambda data: standard.decode_read_response(
                Frame(self._response, data, False), chunk.size, strict=self._strict),
            data, now, _RESPONSE, _PARAMETER, 'read')
        if words is not None and self._traffic.answered(
                chunk, words, now, self._kinds[chunk]) is _NORMAL:
            self._round.answered(chunk, now)

    def _unanswered(self, chunk: Chunk, due: float) -> None:
        self._round.failed(chunk)
        self.tell_unanswered(due, self._kinds[chunk], 'read', self._traffic.named(*chunk))
