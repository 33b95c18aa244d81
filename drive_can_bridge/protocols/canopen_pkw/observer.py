# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Watching one device with a PKW mailbox: its requests and answers, and what it says as a node.

A request that repeats the function byte of the one before starts nothing (:mod:`.pkw`); it is
shown, and no answer is expected.
"""

from collections.abc import Sequence
from functools import partial

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.parameters import Parameter, ParameterType
from drive_can_bridge.protocols.canopen.addressing import name_of_object
from drive_can_bridge.protocols.canopen.observer import listen_to_node
from drive_can_bridge.protocols.canopen_pkw import addresses, pkw
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement, Span
from drive_can_bridge.protocols.canopen_pkw.pkw import Address, Function, PkwLayout, PkwMessage
from drive_can_bridge.protocols.observer import (
    DriveObserver, Emit, listed_by, raws_of, TelegramKind, Verdict)
from drive_can_bridge.protocols.pairing import PendingRequests, RequestContent
from drive_can_bridge.protocols.telegrams import Direction

_REQUEST, _RESPONSE = Direction.REQUEST, Direction.RESPONSE
_PARAMETER = TelegramKind.PARAMETER


class PkwObserver(DriveObserver):
    """Watches one device."""

    def __init__(self, drive: DriveConfiguration, emit: Emit) -> None:
        super().__init__(drive.name, emit)
        options = drive.options
        self._abort_order: str = options.abort_code_order
        listen_to_node(self, drive.station, self._booted, drive.parameter_timeout)
        decode = partial(pkw.decode, layout=PkwLayout(options.layout))
        for identifier, direction, title, take in (
                (options.request_cob_id, _REQUEST, 'PKW request', self._take_request),
                (options.response_cob_id, _RESPONSE, 'PKW response', self._take_response)):
            self.listen(identifier, direction, _PARAMETER, title, decode, take)
        placement = self._placement = Placement.of(drive)
        self._spans = listed_by(
            drive.profile.parameters.values(), lambda parameter: (
                None if placement.address(parameter) is None else placement.span(parameter)))
        self._wanted = addresses.round_spans(drive)
        self._requests: PendingRequests[PkwMessage] = PendingRequests(
            self, drive.parameter_timeout, self._content, plan=addresses.round_plan(drive),
            setpoints={placement.span(parameter) for parameter in drive.cyclic_request})
        self._last_byte: int | None = None

    # -- the mailbox ------------------------------------------------------------------------------

    def _take_request(self, message: PkwMessage, now: float) -> None:
        repeated = message.function_byte == self._last_byte
        self._last_byte = message.function_byte
        if message.code == Function.NONE:
            self._requests.round.prelude = now
            self.report(now, _REQUEST, _PARAMETER, 'idle request')
            return
        asked = self._meant(message, now, _REQUEST, 'PKW request')
        if asked is None:
            return
        self._requests.ask(
            _key(message), asked.span, now, message.words if asked.writes else None,
            futile=repeated, wrong=frame_sentences.same_function_byte() if repeated else '')

    def _take_response(self, message: PkwMessage, now: float) -> None:
        if message.code == Function.NONE:
            self.report(now, _RESPONSE, _PARAMETER, 'idle response')
            return
        refused = message.code == Function.ERROR
        known = self._requests.about
        key = _key(message) if not refused else next(
            (key for key in reversed(known) if pkw.answers(message, key)), None)
        if key is None:
            self.report(now, _RESPONSE, _PARAMETER, 'PKW response', verdict=Verdict.UNASKED,
                      remark=f'{message}: {self._refusal(message)}')
            return
        asked = known.get(key) or self._meant(message, now, _RESPONSE, 'PKW response')
        if asked is None:
            return
        self._requests.answer(
            key, asked, now, None if asked.writes else message.words,
            refusal=self._refusal(message) if refused else '',
            parts=addresses.instead_of(asked.span, self._wanted))

    def _meant(self, message: PkwMessage, now: float, direction: Direction,
               title: str) -> RequestContent | None:
        """Return what a message is about; None: unknown function (reported)."""
        meaning = message.meaning
        if meaning is None:
            self.report(now, direction, _PARAMETER, title, verdict=Verdict.MALFORMED,
                      remark=frame_sentences.unknown_function_code(message.code))
            return None
        return RequestContent(Span(message.address, meaning.count), meaning.writes)

    def _refusal(self, message: PkwMessage) -> str:
        return pkw.describe(pkw.code_from_words(message.words, self._abort_order))

    def _content(self, span: Span, words: Sequence[int] | None,
                 ) -> tuple[list[Parameter], list[int]]:
        """Return the parameters in a request or answer, and their values where there are any."""
        exact = self._spans.get(span)
        parts = [span] if exact is not None else [Span(each) for each in span.addresses]
        parameters = [self._spans.get(part) or Parameter(
            _raw_name(part.address), ParameterType.UINT16, listed=False) for part in parts]
        if words is None:
            return parameters, []
        if exact is not None:
            return parameters, [self._placement.raw(exact, words)]
        return parameters, raws_of(parameters, words)

    def _booted(self) -> None:
        self._last_byte = None


def _key(message: PkwMessage) -> PkwMessage:
    """Return what a request and its answer have in common."""
    low = message.low if message.address.by_object else 0
    return message._replace(words=pkw.NO_WORDS, low=low)


def _raw_name(address: Address) -> str:
    if address.subindex is None:
        return f'p{address.word}'
    return name_of_object(address.word, address.subindex)
