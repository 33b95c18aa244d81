# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How one device with a PKW mailbox lays out its bytes.

The layout is settled by reads that are no writes in any layout. ``layout``: register 455 is read
in each, then a register that does not exist. A device that understands repeats toggle, function
and register of the one, and puts 4Eh in the place of the function for the other. One that looks
for the function elsewhere may repeat a request that starts nothing there; it never refuses in the
place that was asked. ``abort_code_order``: only one order of the refusal's words is a code.
``word_order``: values of 32 bits of which one half is 0.

Before anything is sent to the mailbox, 1603h is read by SDO: where the receive PDO4 is known to
map something else than 3000h, a read of the mailbox would be process data, and nothing is asked.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route
from drive_can_bridge.core.parameters import Parameter
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.sdo import TEXTS
from drive_can_bridge.protocols.canopen_pkw import pkw
from drive_can_bridge.protocols.canopen_pkw.addresses import Placement
from drive_can_bridge.protocols.canopen_pkw.options import PROBED
from drive_can_bridge.protocols.canopen_pkw.pkw import Address, describe, PkwLayout, PkwMessage
from drive_can_bridge.protocols.canopen_pkw.scanner import MAILBOX, STATUS
from drive_can_bridge.protocols.scanner import (
    Asking, conclude, Conversation, Finding, Prober, Question, spaced)

#: registers that no device should have; their bytes are no function that writes, in any layout
MISSING = (Address(9999), Address(65000))
ORDERS = ('high_first', 'low_first')
_WIDE_MAX = 12
#: values that have to agree where no limits help
_AGREEING = 2
_Asking = Asking[tuple[bytes, PkwMessage] | None]


@dataclass
class _Evidence:
    """What came back in one layout."""

    read: list[bytes] = field(default_factory=list)
    words: pkw.Words = pkw.NO_WORDS
    refusals: list[tuple[Address, bytes, pkw.Words]] = field(default_factory=list)

    @property
    def understood(self) -> bool:
        """Both toggles were answered."""
        return len(self.read) == 2


class PkwProber(Prober):
    """Asks one node."""

    def __init__(self, drive: DriveConfiguration) -> None:
        self._toggle = False
        super().__init__(drive, [Route.of(each) for each in (
            drive.options.request_cob_id, sdo.REQUEST_BASE + drive.station,
            network.NMT_IDENTIFIER)])

    def start_frame(self) -> Frame | None:
        return network.encode_nmt(network.NmtCommand.START, self.drive.station)

    def converse(self) -> Conversation:
        mapped = yield from self._mapped()
        if mapped not in (None, MAILBOX):
            why = frame_sentences.no_mailbox(mapped)
            return [Finding(key, None, why) for key in PROBED]
        seen = {}
        for layout in PkwLayout:
            seen[layout] = yield from self._try(layout)
        layout_found, reason = _conclude(seen)
        findings = [Finding('layout', layout_found and layout_found.value, reason)]
        if layout_found is None:
            why = frame_sentences.layout_first()
            findings += [Finding(key, None, why) for key in PROBED[1:]]
        else:
            findings.append((yield from self._word_order(layout_found)))
            findings.append(_abort_code_order(seen[layout_found]))
        yield self._idle()      # the next one may begin with any function
        if not self.answered:
            return [finding._replace(reason=frame_sentences.node_silent()) for finding in findings]
        return findings

    def _mapped(self) -> Asking[int | None]:
        """Return the object that the receive PDO4 maps; None: not readable."""
        node = self.drive.station
        if self.drive.options.request_cob_id != network.REQUEST_BASE + node:
            return None     # some other PDO
        answer = yield Question(
            sdo.encode_upload(node, sdo.RPDO4_MAPPING, 1), sdo.RESPONSE_BASE + node,
            lambda data: _uploaded(data) is not None, shortest=sdo.SHORTEST)
        uploaded = None if answer is None else _uploaded(answer.data)
        return None if uploaded is None or uploaded.value is None else uploaded.value >> 16

    def _try(self, layout: PkwLayout) -> Asking[_Evidence]:
        evidence = _Evidence()
        yield self._idle()
        self._toggle = False
        for _ in range(2):
            answer = yield from self._ask(STATUS, 1, layout)
            if answer is not None and answer[1].code != pkw.Function.ERROR:
                evidence.read.append(answer[0])
                evidence.words = answer[1].words
        if evidence.read:
            for address in MISSING:
                answer = yield from self._ask(address, 1, layout)
                if answer is not None and answer[1].code == pkw.Function.ERROR:
                    evidence.refusals.append((address, answer[0], answer[1].words))
        return evidence

    def _word_order(self, layout: PkwLayout) -> Asking[Finding]:
        votes: dict[str, list[str]] = {}
        certain = False
        for parameter in self._wide():
            span = Placement.of(self.drive).span(parameter)
            answer = yield from self._ask(span.address, span.count, layout)
            if answer is None or answer[1].code == pkw.Function.ERROR:
                continue
            order, by_limits = _order_of(parameter, answer[1].words)
            if order:
                certain = certain or by_limits
                values = [f'{pkw.value_from_words(answer[1].words, each == ORDERS[0])}'
                          for each in sorted(ORDERS, key=lambda each: each != order)]
                votes.setdefault(order, []).append(
                    frame_sentences.reads_this_not_that(
                        parameter.name, spaced(answer[0][4:]), values))
                if certain or len(votes[order]) > _AGREEING:
                    break
        texts = [text for each in votes.values() for text in each]
        if len(texts) == 1 and not certain:
            return Finding('word_order', None, frame_sentences.one_value_only(texts[0]))
        return conclude(
            'word_order', votes, what='values',
            missing=frame_sentences.no_telling_value())

    # -- asking -----------------------------------------------------------------------------------

    def _idle(self) -> Question:
        """Return what starts nothing in any layout, so that any function may follow."""
        return self._question(bytes(pkw.PAYLOAD))

    def _question(self, data: bytes, fits: Callable[[bytes], bool] = lambda data: True,
                  ) -> Question:
        options = self.drive.options
        return Question(Frame(options.request_cob_id, data, False), options.response_cob_id, fits)

    def _ask(self, address: Address, count: int, layout: PkwLayout) -> _Asking:
        request = pkw.read_request(address, count, self._toggle)
        self._toggle = not self._toggle
        data = pkw.encode(request, layout)
        if not harmless(data):
            return None
        answer = yield from self.ask(self._question(
            data, lambda data: pkw.answers(pkw.decode(data, layout), request)))
        return None if answer is None else (answer, pkw.decode(answer, layout))

    def _wide(self) -> list[Parameter]:
        return [each for each in self.drive.profile.parameters.values()
                if each.type.bits == 32 and each.readable and not each.bits
                and each.word_order is None][:_WIDE_MAX]


def harmless(data: bytes) -> bool:
    """Return whether a request writes nothing in any layout."""
    meanings = [pkw.decode(data, layout).meaning for layout in PkwLayout]
    return not any(meaning is not None and meaning.writes for meaning in meanings)


def _uploaded(data: bytes) -> sdo.Uploaded | None:
    """Return the answer to the upload of the mapping; None: it is none."""
    try:
        found = sdo.decode_upload(data)
    except RemoteProtocolError:
        return None
    return found if found.object == (sdo.RPDO4_MAPPING, 1) else None


def _conclude(seen: dict[PkwLayout, _Evidence]) -> tuple[PkwLayout | None, str]:
    """Return the layout, and what that rests on."""
    understood = [layout for layout, each in seen.items() if each.understood]
    proven = [layout for layout in understood if seen[layout].refusals]
    told = '; '.join(f'{layout.value}: ' + (
        f'{STATUS} answered by {spaced(each.read[-1])}' if each.read else 'no answer') + (
        f', {each.refusals[0][0]} refused by {spaced(each.refusals[0][1])}'
        if each.refusals else '') for layout, each in seen.items())
    if len(proven) == 1:
        return proven[0], told
    if len(understood) == 1 and not proven and any(seen[understood[0]].words):
        return understood[0], told
    return None, told


def _abort_code_order(evidence: _Evidence) -> Finding:
    key = 'abort_code_order'
    votes = {}
    for address, data, words in evidence.refusals:
        codes = {order: pkw.value_from_words(words, order == ORDERS[0]) for order in ORDERS}
        known = [order for order in ORDERS if codes[order] in TEXTS]
        if len(known) == 1:
            votes[known[0]] = frame_sentences.refused_by_bytes(
                address, spaced(data), describe(codes[known[0]]))
    if len(votes) == 1:
        return Finding(key, *next(iter(votes.items())))
    if not evidence.refusals:
        return Finding(key, None, frame_sentences.nothing_refused())
    return Finding(key, None, frame_sentences.no_known_code(
        [spaced(data) for _, data, _ in evidence.refusals]))


def _order_of(parameter: Parameter, words: pkw.Words) -> tuple[str, bool]:
    """Return the order that makes a value likely ('': either may), and whether limits say so."""
    if words[0] == words[1]:
        return '', False
    low = -float('inf') if parameter.minimum is None else parameter.minimum
    high = float('inf') if parameter.maximum is None else parameter.maximum
    fits = [order for order in ORDERS
            if low <= parameter.value_from_raw(parameter.raw_from_word(
                pkw.value_from_words(words, order == ORDERS[0]))) <= high]
    if len(fits) == 1:
        return fits[0], True
    if bool(words[0]) == bool(words[1]):
        return '', False
    return (ORDERS[0] if words[1] else ORDERS[1]), False
