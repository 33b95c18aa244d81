# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
How one drive of CiA 402 wants to be configured, settled by reads of objects.

``mode``: 6502h says which there are. ``mapping``: PDOs that are as the file wants them already
need no writing. ``disable_word``: 605Ch and 605Bh say what brakes. ``bridge_heartbeat``: without
1016h nobody watches the bridge.
"""

from collections.abc import Sequence
from typing import NamedTuple

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Route
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.sdo import SdoCommand, SdoMessage
from drive_can_bridge.protocols.cia402 import states
from drive_can_bridge.protocols.cia402.options import PROBED
from drive_can_bridge.protocols.cia402.pdo import (
    ENTRIES_MAX, entry_text, MAPPING_OFFSET, Pdo, request_pdos, response_pdos, same_mapping)
from drive_can_bridge.protocols.cia402.scanner import PROFILE
from drive_can_bridge.protocols.cia402.states import (
    ABORT_CONNECTION_OPTION, DISABLE_OPTION, MODES, MODES_OFFERED, SHUTDOWN_OPTION)
from drive_can_bridge.protocols.scanner import (
    Asking, Conversation, Finding, Prober, Question, undecided)
from drive_can_bridge.protocols.telegrams import Direction

_CONSUMER_HEARTBEAT = 0x1016
#: what 605Bh and 605Ch say
_COASTS, _RAMP = 0, 1
#: index of the status word of the first axis; that of the next ones, so much above
_STATUS_WORD, _NEXT_AXIS, _AXES_MAX = states.STATUS_WORD, 0x800, 8


class _Read(NamedTuple):
    """
    What became of the read of an object.

    :param value: None: it is not known.
    :param absent: the drive says that it has no such object.
    :param why: why it is not known, in words.
    """

    value: int | None = None
    absent: bool = False
    why: str = ''

    @property
    def unknown(self) -> bool:
        """Neither a value nor that there is none: nothing follows from that."""
        return self.value is None and not self.absent

    @property
    def signed(self) -> int | None:
        """The value, of 16 bits with a sign."""
        return None if self.value is None else (self.value & 0xFFFF ^ 0x8000) - 0x8000


_Reading = Asking[_Read]


class Cia402Prober(Prober):
    """
    Asks one node. SDO is answered in every state but stopped.

    That it lacks an object is concluded from its own word only (06020000h, 06090011h): an answer
    may have been lost, and another refusal says nothing of what there is.
    """

    def __init__(self, drive: DriveConfiguration) -> None:
        super().__init__(drive, [Route.of(each) for each in (
            *(request.identifier for request in request_pdos(drive)),
            sdo.REQUEST_BASE + drive.station, network.NMT_IDENTIFIER)])

    def converse(self) -> Conversation:
        device = (yield from self._value(sdo.DEVICE_TYPE, 0)).value
        if device is None and not self.answered:
            return [Finding(key, None, frame_sentences.no_answer_to_scan()) for key in PROBED]
        if device is not None and device & 0xFFFF != PROFILE:
            self.notes.append(frame_sentences.no_cia402(device))
        axes = yield from self._axes()
        if axes:
            self.notes.append(frame_sentences.several_axes(
                len(axes) + 1, [f'{index:04X}h is {word:04X}h' for index, word in axes]))
        return [(yield from self._mode()), (yield from self._mapping()),
                (yield from self._disable_word()), (yield from self._bridge_heartbeat())]

    def _axes(self) -> Asking[list[tuple[int, int]]]:
        """Return the status words of further axes, with their indices."""
        found: list[tuple[int, int]] = []
        for axis in range(1, _AXES_MAX):
            index = _STATUS_WORD + _NEXT_AXIS * axis
            word = (yield from self._value(index, 0)).value
            if word is None:
                break
            found.append((index, word & 0xFFFF))
        return found

    def _mode(self) -> Asking[Finding]:
        offered = yield from self._value(MODES_OFFERED, 0)
        if offered.value is None:
            return undecided('mode', offered.why)
        names = [name for name, mode in MODES.items() if offered.value >> mode.number - 1 & 1]
        told = frame_sentences.modes_offered(offered.value, names)
        wanted = self.drive.options.mode
        return Finding('mode', wanted if wanted in names else None, told)

    def _mapping(self) -> Asking[Finding]:
        for wanted in (*request_pdos(self.drive), *response_pdos(self.drive)):
            found, why = yield from self._entries(wanted)
            place = f'{wanted.communication + MAPPING_OFFSET:04X}h'
            if why:
                return undecided('mapping', why)
            if not same_mapping(found, wanted.entries):
                return Finding('mapping', 'configure', frame_sentences.mapping_holds(
                    place, _entries_text(found), _entries_text(wanted.entries)))
        return Finding('mapping', 'verify', frame_sentences.mapping_fits())

    def _entries(self, pdo: Pdo) -> Asking[tuple[list[int], str]]:
        """Return what a PDO holds, or why that is not known."""
        place = pdo.communication + MAPPING_OFFSET
        count = yield from self._value(place, 0)
        if count.value is None:
            return [], count.why
        found = []
        for subindex in range(1, min(count.value, ENTRIES_MAX) + 1):
            entry = yield from self._value(place, subindex)
            if entry.unknown:
                return [], entry.why
            found.append(entry.value or 0)
        return found, ''

    def _disable_word(self) -> Asking[Finding]:
        options = {}
        for index in (DISABLE_OPTION, SHUTDOWN_OPTION):
            options[index] = yield from self._value(index, 0)
        disable, shutdown = (each.signed for each in options.values())
        told = ', '.join(
            each.why if each.unknown else
            f'{index:04X}h is {"missing" if each.absent else each.signed}'
            for index, each in options.items())
        if disable == _RAMP:
            return Finding('disable_word', 'disable_operation',
                           frame_sentences.brakes_by_ramp(told, '0007h'))
        if any(each.unknown for each in options.values()):
            return undecided('disable_word', told)
        if shutdown == _RAMP:
            return Finding('disable_word', 'shutdown',
                           frame_sentences.brakes_by_ramp(told, '0006h'))
        if disable != _COASTS:      # others are the maker's own
            return Finding('disable_word', None, frame_sentences.manual_says(told, '0007h'))
        if shutdown not in (_COASTS, None):
            return Finding('disable_word', None, frame_sentences.manual_says(told, '0006h'))
        return Finding('disable_word', 'disable_operation', frame_sentences.always_coasts(told))

    def _bridge_heartbeat(self) -> Asking[Finding]:
        places = yield from self._value(_CONSUMER_HEARTBEAT, 0)
        if places.unknown:
            return undecided('bridge_heartbeat', places.why)
        if not places.value:
            told = 'no 1016h' if places.absent else frame_sentences.no_heartbeat_places()
            return Finding('bridge_heartbeat', 0.0, frame_sentences.nothing_watches(told))
        option = yield from self._value(ABORT_CONNECTION_OPTION, 0)
        told = f'1016h has {places.value} places, ' + (
            option.why if option.unknown else
            f'6007h is {"missing" if option.absent else option.value}')
        if option.value == 0:
            told = frame_sentences.misses_without_effect(told)
        elif option.value is None:
            told = frame_sentences.misses_unknown(told)
        return Finding('bridge_heartbeat', self.drive.options.bridge_heartbeat, told)

    # -- asking -----------------------------------------------------------------------------------

    def _value(self, index: int, subindex: int) -> _Reading:
        """Read an object."""
        node, place = self.drive.station, (index, subindex)
        data = yield from self.ask(Question(
            sdo.encode_upload(node, index, subindex), sdo.RESPONSE_BASE + node,
            lambda data: _answer(data, place) is not None, shortest=sdo.SHORTEST))
        answer = None if data is None else _answer(data, place)
        text = f'{index:04X}h' + (f'.{subindex:02X}h' if subindex else '')
        if answer is None:
            return _Read(why=frame_sentences.probed_object_unanswered(text))
        if answer.kind is not SdoCommand.ABORT:
            return _Read(int.from_bytes(answer.data, 'little'))
        if answer.number in sdo.ABSENT:
            return _Read(absent=True, why=frame_sentences.probed_object_absent(text))
        return _Read(why=frame_sentences.probed_object_refused(text, sdo.describe(answer.number)))


def _answer(data: bytes, place: tuple[int, int]) -> SdoMessage | None:
    """Return the answer to the read of an object; None: it is none."""
    try:
        found = sdo.decode(Direction.RESPONSE, data, segments=False)
    except RemoteProtocolError:
        return None
    return found if found.object == place and found.kind in (SdoCommand.UPLOADED,
                                                             SdoCommand.ABORT) else None


def _entries_text(entries: Sequence[int]) -> str:
    return ', '.join(map(entry_text, entries)) or 'nothing'
