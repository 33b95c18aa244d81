# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Finding drives of CiA 402 among CANopen nodes: the lower half of 1000h says it.

Where a master is talking to them already, nobody may ask: then control word and status word at the
head of PDO1, cycle after cycle beside a SYNC, are a likely one.

How a drive wants to be configured is settled by reads of objects. ``mode``: 6502h says which there
are. ``mapping``: PDOs that are as the file wants them already need no writing. ``disable_word``:
605Ch and 605Bh say what brakes. ``bridge_heartbeat``: without 1016h nobody watches the bridge.
"""

from collections import Counter
from collections.abc import Generator, Sequence
from typing import Any, NamedTuple

from drive_can_bridge.core import frame_sentences
from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.protocols.canopen import network, sdo
from drive_can_bridge.protocols.canopen.sdo import SdoCommand, SdoMessage
from drive_can_bridge.protocols.cia402 import pdo, states
from drive_can_bridge.protocols.cia402.pdo import (
    ENTRIES_MAX, entry_text, MAPPING_OFFSET, Pdo, request_pdos, response_pdos, same_mapping)
from drive_can_bridge.protocols.cia402.states import (
    ABORT_CONNECTION_OPTION, DISABLE_OPTION, MODES, MODES_OFFERED, SHUTDOWN_OPTION)
from drive_can_bridge.protocols.scanner import (
    Certainty, Conversation, Finding, Prober, Question, Scanner, undecided)
from drive_can_bridge.protocols.telegrams import Direction

#: device profile, in the lower half of 1000h
PROFILE = 0x0192
#: kinds of drives, in bits 16 to 23 of it
_KINDS = {1: 'frequency converter', 2: 'servo drive', 4: 'stepper'}
#: the other half of it where a node has several device modules (CiA 301)
_MODULES = 0xFFFF
#: index of the status word of the first axis; that of the next ones, so much above
_STATUS_WORD, _NEXT_AXIS, _AXES_MAX = states.STATUS_WORD, 0x800, 8
#: cycles that make process data likely to be what they look like
_CYCLES = 3
#: bits of a control word that no mode has
_RESERVED = 0xFE00
_IDENTITY = {1: 'vendor', 2: 'product', 3: 'revision', 4: 'serial number'}
KEYS = ('mode', 'mapping', 'disable_word', 'bridge_heartbeat')
_DEVICE_PROFILE = 402
_CONSUMER_HEARTBEAT = 0x1016
#: what 605Bh and 605Ch say
_COASTS, _RAMP = 0, 1


class Cia402Scanner(Scanner):
    """
    Recognises what nodes answer to anybody's reads of 1000h.

    Reads objects that every node has or refuses. 600h to 67Fh mean nothing to other families.
    """

    protocol = 'cia402'
    unmistakable = True

    def __init__(self) -> None:
        super().__init__()
        self._types: dict[int, str] = {}
        self._identities: dict[int, dict[str, str]] = {}
        self._cycles: Counter[int] = Counter()      # by identifier; SYNC among them

    def begin(self) -> None:
        # what another scanner's question brought is known already
        self._questions += [sdo.encode_upload(node, sdo.DEVICE_TYPE, 0) for node in range(
            1, network.NODE_MAX + 1) if node not in self._types]
        for node in self.sightings:
            self._ask_identity(node)

    def _ask_identity(self, node: int) -> None:
        self._questions += [sdo.encode_upload(node, sdo.IDENTITY, subindex)
                            for subindex in _IDENTITY
                            if _IDENTITY[subindex] not in self._identities.get(node, ())]

    def settings(self, station: int) -> dict[str, Any]:
        """Return the mode that moves nothing by itself and needs no short period."""
        return {'mode': 'pv'}

    def hear(self, frame: Frame, now: float) -> None:
        base, node = frame.identifier & ~network.NODE_MAX, frame.identifier & network.NODE_MAX
        if frame.extended:
            return
        if frame.identifier == network.SYNC_IDENTIFIER or base in (pdo.RPDO_BASE, pdo.TPDO_BASE):
            self._hear_cycle(frame, node)
        elif base == sdo.RESPONSE_BASE and node:
            self._hear_answer(frame, node)

    def _hear_cycle(self, frame: Frame, node: int) -> None:
        identifier, data, _ = frame
        word = int.from_bytes(data[:2], 'little')
        sync = identifier == network.SYNC_IDENTIFIER
        told = states.state_of(word)
        fits = len(data) <= 1 if sync else len(data) >= 2 and node and (
            told is not states.ServoState.UNKNOWN if identifier < pdo.RPDO_BASE
            else not word & _RESERVED)
        self._cycles[identifier] = self._cycles[identifier] + 1 if fits else 0
        request = pdo.RPDO_BASE + node
        if identifier == pdo.TPDO_BASE + node and min(self._cycles[each] for each in (
                identifier, request, network.SYNC_IDENTIFIER)) >= _CYCLES:
            self.master = frame_sentences.process_data_for(node)
            self.nodes.setdefault(node, f'status word {word:04X}h')
            self._see(node, f'status word {word:04X}h ({told.value}), answered with SYNC',
                      Certainty.LIKELY)

    def _hear_answer(self, frame: Frame, node: int) -> None:
        try:
            (index, subindex), value, _ = sdo.decode_upload(frame.data)
        except RemoteProtocolError:
            return
        if (index, subindex) == (sdo.DEVICE_TYPE, 0):
            self._types[node] = 'refused' if value is None else f'{value:08X}h'
            if value is not None and value & 0xFFFF == PROFILE:
                kind = _KINDS.get(value >> 16 & 0xFF, 'drive')
                if value >> 16 == _MODULES:
                    kind = 'drive, perhaps several axes, of which the first is driven,'
                self._types[node] = f'device type {value:08X}h ({kind} of CiA 402)'
                self._tell(node)
                self._ask_identity(node)
        elif index == sdo.IDENTITY and subindex in _IDENTITY and value is not None:
            self._identities.setdefault(node, {})[_IDENTITY[subindex]] = f'{value:X}h'
            # one that only looks like a drive of CiA 402 has not said so in 1000h
            if node in self.sightings and (
                    self.sightings[node].certainty is Certainty.CERTAIN):
                self._tell(node)

    def _tell(self, node: int) -> None:
        text = ', '.join((self._types[node], *(
            f'{name} {value}' for name, value in self._identities.get(node, {}).items())))
        self.nodes[node] = text
        self._see(node, text, Certainty.CERTAIN)


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


_Reading = Generator[Question, Frame | None, _Read]


class Cia402Prober(Prober):
    """
    Asks one node. SDO is answered in every state but stopped.

    That it lacks an object is concluded from its own word only (06020000h, 06090011h): an answer
    may have been lost, and another refusal says nothing of what there is.
    """

    def __init__(self, drive: DriveConfiguration) -> None:
        super().__init__(drive, [Route(each, STANDARD_IDENTIFIER_MAX, False) for each in (
            *(request.identifier for request in request_pdos(drive)),
            sdo.REQUEST_BASE + drive.station, network.NMT_IDENTIFIER)])

    def converse(self) -> Conversation:
        device = (yield from self._value(sdo.DEVICE_TYPE, 0)).value
        if device is None and not self.answered:
            return [Finding(key, None, frame_sentences.no_answer_to_scan()) for key in KEYS]
        if device is not None and device & 0xFFFF != _DEVICE_PROFILE:
            self.notes.append(frame_sentences.no_cia402(device))
        axes = yield from self._axes()
        if axes:
            self.notes.append(frame_sentences.several_axes(
                len(axes) + 1, [f'{index:04X}h is {word:04X}h' for index, word in axes]))
        return [(yield from self._mode()), (yield from self._mapping()),
                (yield from self._disable_word()), (yield from self._bridge_heartbeat())]

    def _axes(self) -> Generator[Question, Frame | None, list[tuple[int, int]]]:
        """Return the status words of further axes, with their indices."""
        found: list[tuple[int, int]] = []
        for axis in range(1, _AXES_MAX):
            index = _STATUS_WORD + _NEXT_AXIS * axis
            word = (yield from self._value(index, 0)).value
            if word is None:
                break
            found.append((index, word & 0xFFFF))
        return found

    def _mode(self) -> Generator[Question, Frame | None, Finding]:
        offered = yield from self._value(MODES_OFFERED, 0)
        if offered.value is None:
            return undecided('mode', offered.why)
        names = [name for name, mode in MODES.items() if offered.value >> mode.number - 1 & 1]
        told = frame_sentences.modes_offered(offered.value, names)
        wanted = self.drive.options.mode
        return Finding('mode', wanted if wanted in names else None, told)

    def _mapping(self) -> Generator[Question, Frame | None, Finding]:
        for wanted in (*request_pdos(self.drive), *response_pdos(self.drive)):
            found, why = yield from self._entries(wanted)
            place = f'{wanted.communication + MAPPING_OFFSET:04X}h'
            if why:
                return undecided('mapping', why)
            if not same_mapping(found, wanted.entries):
                return Finding('mapping', 'configure', frame_sentences.mapping_holds(
                    place, _entries_text(found), _entries_text(wanted.entries)))
        return Finding('mapping', 'verify', frame_sentences.mapping_fits())

    def _entries(self, pdo: Pdo) -> Generator[Question, Frame | None, tuple[list[int], str]]:
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

    def _disable_word(self) -> Generator[Question, Frame | None, Finding]:
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

    def _bridge_heartbeat(self) -> Generator[Question, Frame | None, Finding]:
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
