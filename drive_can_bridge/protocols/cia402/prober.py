# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Finding out by reads of objects how a drive of CiA 402 wants to be configured.

``mode``: 6502h says which there are. ``mapping``: PDOs that are as the file wants them already
need no writing. ``disable_word``: 605Ch and 605Bh say what brakes. ``bridge_heartbeat``: without
1016h nobody watches the bridge.
"""

from collections.abc import Generator, Sequence

from drive_can_bridge.core.configuration import DriveConfiguration
from drive_can_bridge.core.errors import RemoteProtocolError
from drive_can_bridge.core.frame import Frame, Route, STANDARD_IDENTIFIER_MAX
from drive_can_bridge.protocols.canopen import abort_codes, sdo
from drive_can_bridge.protocols.canopen.sdo import Kind
from drive_can_bridge.protocols.cia402.pdo import (
    entry_text, MAPPING_OFFSET, Pdo, request_pdos, response_pdos,
)
from drive_can_bridge.protocols.cia402.states import (
    ABORT_CONNECTION_OPTION, DISABLE_OPTION, MODES, MODES_OFFERED, SHUTDOWN_OPTION,
)
from drive_can_bridge.protocols.prober import Conversation, Finding, Prober, Question

KEYS = ('mode', 'mapping', 'disable_word', 'bridge_heartbeat')
_DEVICE_PROFILE = 402
_CONSUMER_HEARTBEAT = 0x1016
_SILENT = 'no answer: check station, bit rate and power'


class Cia402Prober(Prober):
    """Asks one node. SDO is answered in every state but stopped."""

    def __init__(self, drive: DriveConfiguration) -> None:
        super().__init__(drive, [Route(
            sdo.REQUEST_BASE + drive.station, STANDARD_IDENTIFIER_MAX, False)])

    def converse(self) -> Conversation:
        device = yield from self._value(sdo.DEVICE_TYPE, 0)
        if device is None and not self.answered:
            return [Finding(key, None, _SILENT) for key in KEYS]
        if device is not None and device & 0xFFFF != _DEVICE_PROFILE:
            self.notes.append(f'1000h says {device:08X}h: no drive of CiA 402 (0192h in the lower '
                              'half)')
        return [(yield from self._mode()), (yield from self._mapping()),
                (yield from self._disable_word()), (yield from self._bridge_heartbeat())]

    def _mode(self) -> Generator[Question, Frame | None, Finding]:
        offered = yield from self._value(MODES_OFFERED, 0)
        if offered is None:
            return Finding('mode', None, 'no 6502h: the drive does not say which it has')
        names = [name for name, mode in MODES.items() if offered >> mode.number - 1 & 1]
        told = f'6502h is {offered:08X}h: {", ".join(names) or "none of those known here"}'
        wanted = self.drive.options.mode
        return Finding('mode', wanted if wanted in names else None, told)

    def _mapping(self) -> Generator[Question, Frame | None, Finding]:
        for pdo in (*request_pdos(self.drive), *response_pdos(self.drive)):
            found = yield from self._entries(pdo)
            place = f'{pdo.communication + MAPPING_OFFSET:04X}h'
            if found is None:
                return Finding('mapping', None, f'{place} was not answered')
            if found != list(pdo.entries):
                return Finding('mapping', 'configure', (
                    f'{place} holds {_entries_text(found)} and not {_entries_text(pdo.entries)}'))
        return Finding('mapping', 'verify', 'all PDOs are mapped as the file wants them; '
                                            'configure does no harm')

    def _entries(self, pdo: Pdo) -> Generator[Question, Frame | None, list[int] | None]:
        place = pdo.communication + MAPPING_OFFSET
        count = yield from self._value(place, 0)
        if count is None:
            return None
        found = []
        for subindex in range(1, min(count, 8) + 1):
            entry = yield from self._value(place, subindex)
            if entry is None:
                return None
            found.append(entry)
        return found

    def _disable_word(self) -> Generator[Question, Frame | None, Finding]:
        disable = yield from self._value(DISABLE_OPTION, 0)
        shutdown = yield from self._value(SHUTDOWN_OPTION, 0)
        told = ', '.join(f'{index:04X}h is {"missing" if value is None else value}'
                         for index, value in ((DISABLE_OPTION, disable),
                                              (SHUTDOWN_OPTION, shutdown)))
        if disable:
            return Finding('disable_word', 'disable_operation', f'{told}: 0007h brakes by ramp')
        if shutdown:
            return Finding('disable_word', 'shutdown', f'{told}: 0006h brakes by ramp')
        if disable is None:
            return Finding('disable_word', None, f'{told}: the manual says what 0007h does')
        return Finding('disable_word', 'disable_operation', (
            f'{told}: the axis coasts with every word; write 605Ch := 1 if it may be'))

    def _bridge_heartbeat(self) -> Generator[Question, Frame | None, Finding]:
        places = yield from self._value(_CONSUMER_HEARTBEAT, 0)
        if not places:
            return Finding('bridge_heartbeat', 0.0, 'no 1016h: the drive cannot watch the bridge, '
                                                    'nothing stops it when the bridge dies')
        option = yield from self._value(ABORT_CONNECTION_OPTION, 0)
        told = f'1016h has {places} places, 6007h is {"missing" if option is None else option}'
        if option == 0:
            told += ': it does nothing when it misses the bridge; write 6007h'
        return Finding('bridge_heartbeat', self.drive.options.bridge_heartbeat, told)

    # -- asking -----------------------------------------------------------------------------------

    def _value(self, index: int, subindex: int) -> Generator[Question, Frame | None, int | None]:
        """Read an object; None: no answer, or refused."""
        node, place = self.drive.station, (index, subindex)
        data = yield from self.ask(Question(
            sdo.encode_upload(node, index, subindex), sdo.RESPONSE_BASE + node,
            lambda data: _answer(data, place) is not None))
        answer = None if data is None else _answer(data, place)
        if answer is None:
            return None
        if answer.kind is Kind.ABORT:
            if answer.number not in (abort_codes.NO_SUCH_OBJECT, abort_codes.NO_SUCH_SUBINDEX):
                self.notes.append(f'{index:04X}h: {abort_codes.describe(answer.number)}')
            return None
        return int.from_bytes(answer.data, 'little')


def _answer(data: bytes, place: tuple[int, int]) -> sdo.Answer | None:
    """Return the answer to the read of an object; None: it is none."""
    try:
        found = sdo.decode_answer(data)
    except RemoteProtocolError:
        return None
    return found if found.object == place and found.kind in (Kind.DATA, Kind.ABORT) else None


def _entries_text(entries: Sequence[int]) -> str:
    return ', '.join(map(entry_text, entries)) or 'nothing'
