# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Watching drives with the DataModel protocol, 29-bit and 11-bit identifiers."""

from collections.abc import Sequence
from dataclasses import replace
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.parameters import Parameter, ParameterType, Storage
from drive_can_bridge.protocols.datamodel import extended, standard
from drive_can_bridge.protocols.datamodel.process_words import CyclicCodec
from drive_can_bridge.protocols.datamodel.standard_round import reads
from drive_can_bridge.protocols.observer import (
    Direction, DriveObserver, Emit, Handler, Kind, Questions, RoundWatch, Telegram, Verdict,
    WriteGap,
)
from drive_can_bridge.protocols.polling import Chunk

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_CYCLIC, _PARAMETER = Kind.CYCLIC, Kind.PARAMETER
_NORMAL = Verdict.NORMAL
#: periods after which a cyclic request counts as unanswered although no other followed
_PATIENCE = 2.0


class _DataModelObserver(DriveObserver):
    """What both protocols share: parameter numbers and the EEPROM."""

    def __init__(self, drive: DriveConfiguration, emit: Emit) -> None:
        super().__init__(drive.name, emit)
        options = drive.options
        self._strict: bool = options.length_policy == 'strict'
        offset: int = options.parameter_offset
        self._listed = {parameter.number + offset: parameter
                        for parameter in reversed(list(drive.profile.parameters.values()))
                        if parameter.number is not None}
        self._offset = offset
        self._gap = WriteGap(options.eeprom_write_gap)
        self._questions: Questions[Chunk] = Questions(drive.parameter_timeout)

    def _named(self, number: int, count: int) -> list[Parameter]:
        """Return the parameters with these numbers on the wire."""
        return [self._listed.get(each) or Parameter(
            f'p{each - self._offset}', number=each - self._offset, listed=False)
            for each in range(number, number + count)]

    def _read(self, chunk: Chunk, now: float, kind: Kind) -> None:
        self._questions.ask(chunk, now)
        self.deadline = min(self.deadline, self._questions.deadline)
        self._tell(now, _REQUEST, kind, 'read', self._named(*chunk))

    def _written(self, number: int, words: Sequence[int], now: float, kind: Kind) -> None:
        parameters = self._named(number, len(words))
        wrong = ''
        if any(parameter.storage is not Storage.RAM for parameter in parameters):
            wrong = self._gap.written(now)
            self.observed.fast_writes += bool(wrong)
        self._tell(now, _REQUEST, kind, 'write', parameters, _raws(parameters, words),
                   verdict=Verdict.SUSPICIOUS if wrong else Verdict.NORMAL, remark=wrong)

    def _malformed(self, now: float, direction: Direction, title: str, error: object) -> None:
        self._tell(now, direction, _PARAMETER, title, verdict=Verdict.MALFORMED,
                   remark=str(error))


class ExtendedObserver(_DataModelObserver):
    """
    Watches one drive with 29-bit identifiers.

    The cyclic telegrams have handlers of their own; the codec decodes the others.
    """

    def __init__(self, drive: DriveConfiguration, emit: Emit) -> None:
        super().__init__(drive, emit)
        self._period = drive.period
        self._request, self._response = drive.cyclic_request, drive.cyclic_response
        control = drive.profile.control
        # a control word is unsigned whatever its type
        self._request_shown = tuple(
            _unsigned(parameter) if control and parameter.name == control.parameter
            else parameter for parameter in self._request)
        self._station = drive.station << extended.STATION_SHIFT
        slots = [slot for slot, parameter in enumerate(self._request)
                 if control and parameter.name == control.parameter]
        self._codec = CyclicCodec(
            drive.station, self._request, self._response,
            control_slot=slots[0] if slots else None, strict=self._strict)
        self._asked = math.nan      # when the cyclic request under way was sent
        self._last = -math.inf      # the one before, answered or not
        self._stale = False      # one answer too many may come

    def handler(self, identifier: int, extended_format: bool) -> Handler | None:
        if not extended_format or identifier & extended.STATION_MASK != self._station:
            return None
        if identifier == self._codec.request_identifier:
            return self._take_request
        if identifier == self._codec.response_identifier:
            return self._take_response
        return lambda data, now: self._take_acyclic(identifier, data, now)

    def _take_request(self, data: bytes, now: float) -> None:
        observed = self.observed
        if self._asked == self._asked:      # not NaN
            self._miss(now)
        if self._last > -math.inf:
            observed.period.add(now - self._last)
        self._asked = self._last = now
        due = now + _PATIENCE * self._period
        if due < self.deadline:
            self.deadline = due
        raws, wrong = self._codec.decode_request(data)
        if wrong:
            self._tell(now, _REQUEST, _CYCLIC, 'cyclic request', verdict=Verdict.MALFORMED,
                       remark=wrong)
            return
        self._emit(Telegram(now, self.name, _REQUEST, _CYCLIC, 'cyclic request',
                            self._request_shown, raws))

    def _take_response(self, data: bytes, now: float) -> None:
        observed = self.observed
        asked = self._asked
        if asked != asked:      # NaN
            late, self._stale = self._stale, False
            verdict = Verdict.LATE if late else Verdict.UNASKED
            if self._last == -math.inf:     # asked before the trace began
                verdict = Verdict.NORMAL
            self._tell(now, _RESPONSE, _CYCLIC, 'cyclic response', self._response,
                       self._codec.decode_response(data)[0], verdict=verdict,
                       latency=now - self._last if late else math.nan)
            return
        raws, wrong = self._codec.decode_response(data)
        if wrong:
            self._tell(now, _RESPONSE, _CYCLIC, 'cyclic response', self._response, raws,
                       verdict=Verdict.MALFORMED, remark=wrong)
            if not raws:
                return
        self._asked = math.nan
        latency = now - asked
        observed.exchanges += 1
        observed.latency.add(latency)
        if not wrong:
            self._emit(Telegram(now, self.name, _RESPONSE, _CYCLIC, 'cyclic response',
                                self._response, raws, _NORMAL, '', latency))

    def _miss(self, now: float) -> None:
        self._tell(now, _RESPONSE, _CYCLIC, 'cyclic response', verdict=Verdict.LOST,
                   remark=f'no answer in {1e3 * (now - self._asked):.0f} ms')
        self._asked = math.nan
        self._stale = True
        self.observed.missed += 1

    def _take_acyclic(self, identifier: int, data: bytes, now: float) -> None:
        try:
            telegram = extended.decode(Frame(identifier, data, True), strict=self._strict)
        except RemoteProtocolError as error:
            direction = _RESPONSE if identifier & extended.DIR else _REQUEST
            self._malformed(now, direction, 'frame', error)
            return
        if isinstance(telegram, extended.ReadRequest):
            self.observed.requests += 1
            self._read(Chunk(telegram.number, telegram.count), now, _PARAMETER)
        elif isinstance(telegram, extended.Write):
            self.observed.requests += 1
            self._written(telegram.number, telegram.words, now, _PARAMETER)
        elif isinstance(telegram, extended.ReadResponse):
            verdict, latency = self._questions.answer(
                Chunk(telegram.number, len(telegram.words)), now)
            parameters = self._named(telegram.number, len(telegram.words))
            self._tell(now, _RESPONSE, _PARAMETER, 'read', parameters,
                       _raws(parameters, telegram.words), verdict=verdict, latency=latency)

    def expire(self, now: float) -> None:
        # a request that no other followed: the master stopped, nobody counts it
        if self._asked + _PATIENCE * self._period <= now:
            due = self._asked + _PATIENCE * self._period
            self._miss(due)
        for chunk, due in self._questions.overdue(now):
            self.observed.unanswered += 1
            self._tell(due, _RESPONSE, _PARAMETER, 'read', self._named(*chunk),
                       verdict=Verdict.LOST, remark='no answer')
        cyclic = self._asked + _PATIENCE * self._period
        self.deadline = min(self._questions.deadline, cyclic if cyclic == cyclic else math.inf)


class StandardObserver(_DataModelObserver):
    """Watches one drive with 11-bit identifiers: an answer belongs to the last read."""

    def __init__(self, drive: DriveConfiguration, emit: Emit) -> None:
        super().__init__(drive, emit)
        options = drive.options
        self._request_identifier = standard.identifier(options.request_id_base, drive.station)
        self._response_identifier = standard.identifier(options.response_id_base,
                                                        drive.station)
        self._setpoints = {(parameter.number or 0) + self._offset
                           for parameter in drive.cyclic_request}
        self._round: RoundWatch[Chunk] = RoundWatch(reads(drive), self.observed)
        self._last: tuple[Chunk, Kind] | None = None

    def handler(self, identifier: int, extended_format: bool) -> Handler | None:
        if extended_format:
            return None
        return {self._request_identifier: self._take_request,
                self._response_identifier: self._take_response}.get(identifier)

    def _take_request(self, data: bytes, now: float) -> None:
        try:
            request = standard.decode_request(Frame(self._request_identifier, data, False))
        except RemoteProtocolError as error:
            self._malformed(now, _REQUEST, 'frame', error)
            return
        if isinstance(request, standard.Write):
            kind = _CYCLIC if request.number in self._setpoints else _PARAMETER
            self.observed.requests += kind is _PARAMETER
            self._written(request.number, (request.word,), now, kind)
            return
        chunk = Chunk(request.number, request.count)
        kind = _CYCLIC if self._round.asked(chunk, now) else _PARAMETER
        self.observed.requests += kind is _PARAMETER
        self._last = chunk, kind
        self._read(chunk, now, kind)

    def _take_response(self, data: bytes, now: float) -> None:
        if self._last is None:      # asked before the trace began
            self._tell(now, _RESPONSE, _PARAMETER, 'read',
                       remark=f'data {data.hex(" ").upper()}')
            return
        chunk, kind = self._last
        try:
            words = standard.decode_read_response(
                Frame(self._response_identifier, data, False), chunk.size, strict=self._strict)
        except RemoteProtocolError as error:
            self._malformed(now, _RESPONSE, 'read', error)
            return
        verdict, latency = self._questions.answer(chunk, now)
        if verdict is Verdict.NORMAL:
            self._round.answered(chunk, now)
        parameters = self._named(*chunk)
        self._tell(now, _RESPONSE, kind, 'read', parameters, _raws(parameters, words),
                   verdict=verdict, latency=latency)

    def expire(self, now: float) -> None:
        for chunk, due in self._questions.overdue(now):
            kind = self._last[1] if self._last and self._last[0] == chunk else _PARAMETER
            self.observed.unanswered += kind is _PARAMETER
            self._round.failed(chunk)
            self._tell(due, _RESPONSE, kind, 'read', self._named(*chunk), verdict=Verdict.LOST,
                       remark='no answer')
        self.deadline = self._questions.deadline


def _raws(parameters: Sequence[Parameter], words: Sequence[int]) -> list[int]:
    return [parameter.raw_from_word(word) for parameter, word in zip(parameters, words)]


def _unsigned(parameter: Parameter) -> Parameter:
    return replace(parameter, type=ParameterType.UINT16)
