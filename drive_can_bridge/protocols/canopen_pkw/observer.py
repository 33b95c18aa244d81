# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watching one device with a PKW mailbox: its requests and answers, and what it says as a node.

A request that repeats the function byte of the one before starts nothing (:mod:`.pkw`); it is
shown, and no answer is expected.
"""

from collections.abc import Sequence
import math

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.canopen import network
from drive_can_bridge.protocols.canopen_pkw import addresses, pkw, refusals
from drive_can_bridge.protocols.canopen_pkw.addresses import Span
from drive_can_bridge.protocols.canopen_pkw.identifiers import Identifiers
from drive_can_bridge.protocols.canopen_pkw.pkw import Address, Function, Layout, Message
from drive_can_bridge.protocols.observer import (
    Direction, DriveObserver, Emit, Handler, Kind, Questions, RoundWatch, Telegram, Verdict,
)

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_CYCLIC, _PARAMETER, _NETWORK = Kind.CYCLIC, Kind.PARAMETER, Kind.NETWORK
_TITLES = {True: 'write', False: 'read'}
_COMMANDS = {command.value: command.name.lower().replace('_', ' ')
             for command in network.NmtCommand}


class PkwObserver(DriveObserver):
    """Watches one device."""

    def __init__(self, drive: DriveConfiguration, emit: Emit) -> None:
        super().__init__(drive.name, emit)
        options = drive.options
        self._layout = Layout(options.layout)
        self._word_order: str = options.word_order
        self._abort_order: str = options.abort_code_order
        identifiers = Identifiers.of(drive)
        self._handlers: dict[int, Handler] = {
            identifiers.heartbeat: self._take_heartbeat,
            identifiers.emergency: self._take_emergency,
            identifiers.request: self._take_request,
            identifiers.response: self._take_response,
        }
        addressing: str = options.addressing
        self._spans = {addresses.span_of(parameter, addressing): parameter
                       for parameter in reversed(list(drive.profile.parameters.values()))
                       if addresses.address_of(parameter, addressing) is not None}
        self._wanted = addresses.round_spans(drive)
        self._setpoints = {addresses.span_of(parameter, addressing)
                           for parameter in drive.cyclic_request}
        self._round: RoundWatch[Span] = RoundWatch(addresses.round_plan(drive), self.observed)
        self._questions: Questions[Message] = Questions(drive.parameter_timeout)
        self._kinds: dict[Message, Kind] = {}
        self._last_byte: int | None = None

    def handler(self, identifier: int, extended: bool) -> Handler | None:
        return None if extended else self._handlers.get(identifier)

    # -- the mailbox ------------------------------------------------------------------------------

    def _decoded(self, data: bytes, now: float, direction: Direction) -> Message | None:
        try:
            return pkw.decode(data, self._layout)
        except RemoteProtocolError as error:
            self._tell(now, direction, _PARAMETER, f'PKW {_side(direction)}',
                       verdict=Verdict.MALFORMED, remark=str(error))
            return None

    def _take_request(self, data: bytes, now: float) -> None:
        message = self._decoded(data, now, _REQUEST)
        if message is None:
            return
        repeated = message.function_byte == self._last_byte
        self._last_byte = message.function_byte
        if message.code == Function.NONE:
            self._round.prelude = now
            self._tell(now, _REQUEST, _PARAMETER, 'idle request')
            return
        span = _span(message)
        if span is None:
            self._tell(now, _REQUEST, _PARAMETER, 'PKW request', verdict=Verdict.MALFORMED,
                       remark=f'unknown function {message.code:02X}h')
            return
        writes = _writes(message)
        if writes:
            kind = _CYCLIC if span in self._setpoints else _PARAMETER
        else:
            kind = _CYCLIC if self._round.asked(span, now) else _PARAMETER
        self.observed.requests += kind is _PARAMETER
        key = _key(message)
        self._kinds[key] = kind
        if len(self._kinds) > 1024:
            del self._kinds[next(iter(self._kinds))]
        if not repeated:
            self._questions.ask(key, now)
            self.deadline = min(self.deadline, self._questions.deadline)
        parameters, raws = self._content(span, message.words if writes else None)
        self._tell(now, _REQUEST, kind, _TITLES[writes], parameters, raws,
                   verdict=Verdict.SUSPICIOUS if repeated else Verdict.NORMAL,
                   remark='the function byte is that of the request before: nothing is started'
                   if repeated else '')

    def _take_response(self, data: bytes, now: float) -> None:
        message = self._decoded(data, now, _RESPONSE)
        if message is None:
            return
        if message.code == Function.NONE:
            self._tell(now, _RESPONSE, _PARAMETER, 'idle response')
            return
        refused = message.code == Function.ERROR
        key = self._refused_request(message) if refused else _key(message)
        if key is None:
            self._tell(now, _RESPONSE, _PARAMETER, 'PKW response', verdict=Verdict.UNASKED,
                       remark=f'{message}: {self._refusal(message)}')
            return
        span = _span(key)
        if span is None:
            self._tell(now, _RESPONSE, _PARAMETER, 'PKW response', verdict=Verdict.MALFORMED,
                       remark=f'unknown function {message.code:02X}h')
            return
        verdict, latency = self._questions.answer(key, now)
        writes, kind = _writes(key), self._kinds.get(key, _PARAMETER)
        answered = not refused and not writes
        parameters, raws = self._content(span, message.words if answered else None)
        if verdict is Verdict.NORMAL and not writes:
            if refused:
                self._round.refused(span, self._parts(span), now)
            else:
                self._round.answered(span, now)
        if refused:
            verdict = Verdict.REFUSED
        self._tell(now, _RESPONSE, kind, _TITLES[writes], parameters, raws, verdict=verdict,
                   remark=self._refusal(message) if refused else '', latency=latency)

    def _refused_request(self, message: Message) -> Message | None:
        """Return the request under way, or the last one, that a refusal is about."""
        for key in reversed(self._kinds):
            if pkw.answers(message, key):
                return key
        return None

    def _refusal(self, message: Message) -> str:
        return refusals.describe(refusals.code_from_words(message.words,
                                                                self._abort_order))

    def _parts(self, span: Span) -> Sequence[Span]:
        """Return what is read instead of a shared read that was refused."""
        if span in self._wanted:
            return ()
        return sorted({part for part in self._wanted
                       if set(part.addresses) <= set(span.addresses)})

    def _content(self, span: Span, words: pkw.Words | None,
                 ) -> tuple[list[Parameter], list[int]]:
        """Return the parameters in a request or answer, and their values where there are any."""
        exact = self._spans.get(span)
        parts = [span] if exact is not None else [Span(each) for each in span.addresses]
        parameters = [self._spans.get(part) or Parameter(
            _raw_name(part.address), ParameterType.UINT16, listed=False) for part in parts]
        if words is None:
            return parameters, []
        if exact is not None:
            return parameters, [addresses.raw_from_words(exact, words[:span.count],
                                                         self._word_order)]
        return parameters, [parameter.raw_from_word(word)
                            for parameter, word in zip(parameters, words)]

    # -- the node ---------------------------------------------------------------------------------

    def _take_heartbeat(self, data: bytes, now: float) -> None:
        try:
            state = network.decode_heartbeat(data)
        except RemoteProtocolError as error:
            self._tell(now, _RESPONSE, _NETWORK, 'heartbeat', verdict=Verdict.MALFORMED,
                       remark=str(error))
            return
        if state is network.NmtState.BOOT_UP:
            self._last_byte = None
            self._tell(now, _RESPONSE, _NETWORK, 'boot-up', verdict=Verdict.SUSPICIOUS,
                       remark='the device has started')
        else:
            self._tell(now, _RESPONSE, _NETWORK, 'heartbeat', remark=state.text)

    def _take_emergency(self, data: bytes, now: float) -> None:
        try:
            emergency = network.decode_emergency(data)
        except RemoteProtocolError as error:
            self._tell(now, _RESPONSE, _NETWORK, 'emergency', verdict=Verdict.MALFORMED,
                       remark=str(error))
            return
        over = emergency.code == network.NO_ERROR
        self._tell(now, _RESPONSE, _NETWORK, 'emergency', remark=emergency.text,
                   verdict=Verdict.NORMAL if over else Verdict.SUSPICIOUS)

    def expire(self, now: float) -> None:
        for key, due in self._questions.overdue(now):
            span, writes = _span(key), _writes(key)
            if span is None:
                continue
            kind = self._kinds.get(key, _PARAMETER)
            self.observed.unanswered += kind is _PARAMETER
            if not writes:
                self._round.failed(span)
            self._tell(due, _RESPONSE, kind, _TITLES[writes], self._content(span, None)[0],
                       verdict=Verdict.LOST, remark='no answer')
        self.deadline = self._questions.deadline


class NmtObserver(DriveObserver):
    """
    Watches what is said to all nodes of a bus.

    :param nodes: names of the configured drives by node-ID.
    """

    def __init__(self, nodes: dict[int, str], emit: Emit) -> None:
        super().__init__('', emit)
        self._nodes = nodes

    def handler(self, identifier: int, extended: bool) -> Handler | None:
        return self._take if not extended and identifier == network.NMT_IDENTIFIER else None

    def _take(self, data: bytes, now: float) -> None:
        try:
            command, node = network.decode_nmt(data)
        except RemoteProtocolError as error:
            self._tell(now, _REQUEST, _NETWORK, 'NMT', verdict=Verdict.MALFORMED,
                       remark=str(error))
            return
        what = _COMMANDS.get(command)
        self._emit(Telegram(
            now, self._nodes.get(node, ''), _REQUEST, _NETWORK, 'NMT',
            verdict=Verdict.MALFORMED if what is None else Verdict.NORMAL,
            remark=f'{what or f"unknown command {command:02X}h"}'
                   f'{" all nodes" if node == 0 else f" node {node}"}'))

    def expire(self, now: float) -> None:
        self.deadline = math.inf


def _side(direction: Direction) -> str:
    return 'request' if direction is _REQUEST else 'response'


def _writes(message: Message) -> bool:
    meaning = message.meaning
    return meaning is not None and meaning.writes


def _span(message: Message) -> Span | None:
    """Return the registers that a message is about; None: its function does not exist."""
    meaning = message.meaning
    return None if meaning is None else Span(message.address, meaning.count)


def _key(message: Message) -> Message:
    """Return what a request and its answer have in common."""
    low = message.low if message.address.by_object else 0
    return message._replace(words=pkw.NO_WORDS, low=low)


def _raw_name(address: Address) -> str:
    if address.subindex is None:
        return f'p{address.word}'
    return f'x{address.word:04x}.{address.subindex:02x}'
