# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Captures of Wireshark, ``dumpcap`` and ``tcpdump``, ``.pcap`` and ``.pcapng``, read by scapy.

A packet holds a frame as SocketCAN has it: identifier and flags (4 bytes), length, flags of CAN
FD, two bytes of no interest, data. Where it stands:

==== ===================================================================================
type
==== ===================================================================================
227  alone, identifier big-endian: one interface was captured
113  behind the head of a "cooked" capture (16 bytes), identifier in the byte order of the
     file: "any" was, and an old libpcap gives sent frames twice, once going out
276  likewise (20 bytes), with the number of the interface
252  behind the name of what it is, as Wireshark writes what it has read of other makers
==== ===================================================================================
"""

from collections import Counter, deque
from collections.abc import Callable, Iterator
from pathlib import Path
import struct
from struct import unpack_from
from typing import Any, BinaryIO, cast, NamedTuple

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.frame import DATA, EXTENDED_IDENTIFIER_MAX, Record, RecordKind

#: how such files begin: the classical format in both byte orders and with both units, and the new
BEGINNINGS = (rb'\xa1\xb2\xc3\xd4|\xd4\xc3\xb2\xa1|\xa1\xb2\x3c\x4d|\x4d\x3c\xb2\xa1'
              rb'|\x0a\x0d\x0d\x0a')

_SOCKETCAN, _COOKED, _COOKED_2, _NAMED = 227, 113, 276, 252
_CAN, _CAN_FD, _CAN_XL = 0x0C, 0x0D, 0x0E
_OUTGOING = 4
_EXTENDED, _REMOTE, _ERROR = 0x80000000, 0x40000000, 0x20000000
_FD, _XL = 0x04, 0x80
_CLASSICAL_MAX = 8
_HEAD = 8
#: of link type 252: the tag of the name
_DISSECTOR = 12
#: blocks of .pcapng, and options of interfaces
_INTERFACE, _OLD_PACKET, _SIMPLE_PACKET, _PACKET = 1, 2, 3, 6
_NAME, _OFFSET = 2, 14
_SECTION = b'\x0a\x0d\x0d\x0a'
#: s within which a sent frame comes back
_ECHO_MAX = 1.0
#: sent frames that may wait
_WAITING_MAX = 10_000

Complain = Callable[[str], None]


class _PacketContent(NamedTuple):
    """
    The content of a packet.

    :param order: of its identifier, ``>`` or ``<``.
    :param interface: where the packet itself has it; '' where it does not.
    """

    data: bytes
    order: str
    outgoing: bool = False
    interface: str = ''


def read_capture(path: Path, complain: Complain, passed: Counter[str]) -> Iterator[Record]:
    """
    Read a capture.

    :param passed: counts packets that are no frames.
    :raises DriveCanError: scapy is missing.
    """
    try:
        from scapy.utils import RawPcapReader       # takes half a second
    except ImportError:
        raise DriveCanError(
            command_sentences.scapy_missing(path=path, suffix=path.suffix)) from None
    echoes = _Echoes()
    with path.open('rb') as file:
        size = path.stat().st_size
        watched = _Watched(file)
        try:
            # a file is taken, too, whatever scapy's types say
            reader = RawPcapReader(cast('Any', watched))
        except Exception:  # noqa: BLE001  whatever a damaged head makes it raise
            complain(command_sentences.trace_cut())
            return
        interfaces = _Interfaces(reader, watched)
        whole = True
        try:
            for number, (data, about) in enumerate(reader, 1):
                whole = len(data) == getattr(about, 'caplen', len(data))
                if not whole:
                    break
                try:
                    record = _record(data, reader, about, interfaces, passed)
                except (ValueError, struct.error):
                    complain(command_sentences.packet_in_part(number=number))
                    continue
                if record is not None and not echoes.has(record):
                    yield record
        except Exception:  # noqa: BLE001  readers raise whatever a file makes them
            whole = False
        whole = whole and watched.place == size and not watched.short
        if not (whole and interfaces.ends_well(file)):
            complain(command_sentences.trace_cut())
    if echoes.dropped:
        complain(command_sentences.trace_doubled(count=echoes.dropped))


class _Watched:
    """
    A file for scapy, which ends silently where one is cut.

    :ivar place: bytes that were read.
    :ivar short: some were missing.
    :ivar on_section: called where a part of a .pcapng begins, with interfaces of its own.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.name = ''
        self.place = 0
        self.short = False
        self.on_section: Callable[[], None] = lambda: None

    def read(self, size: int = -1) -> bytes:
        data = self._file.read(size)
        self.place += len(data)
        self.short |= 0 < len(data) < size
        if data == _SECTION:
            self.on_section()
        return data

    def close(self) -> None:
        """Leave the file open: its opener closes it."""


class _Interfaces:
    """
    Which interface a packet is of: scapy 2.5 reads it, and does not return it.

    :ivar current: number of that of the last packet.
    """

    def __init__(self, reader: Any, watched: _Watched) -> None:
        self._reader = reader
        self._names: list[str] = []
        self._offsets: list[int] = []
        self.current = 0
        self.is_new = hasattr(reader, 'blocktypes')
        if not self.is_new:
            return
        watched.on_section = self._begin_section
        blocks = reader.blocktypes
        for kind, note in ((_INTERFACE, self._note_interface), (_SIMPLE_PACKET, self._note_first),
                           (_PACKET, self._note_packet), (_OLD_PACKET, self._note_old_packet)):
            blocks[kind] = _noting(note, blocks[kind])

    @property
    def name(self) -> str:
        """Return the name of the interface of the last packet."""
        if not self.is_new:
            return ''
        return self._names[self.current] or (
            f'#{self.current}' if len(self._names) > 1 else '')

    @property
    def offset(self) -> int:
        """Return the s that belong to its times."""
        return self._offsets[self.current] if self.is_new else 0

    def ends_well(self, file: BinaryIO) -> bool:
        """Return whether the last block is complete: its length stands at both of its ends."""
        if not self.is_new:
            return True
        try:
            file.seek(-4, 2)
            last = file.read(4)
            length = unpack_from(f'{self._reader.endian}L', last)[0]
            file.seek(-length, 2)
            return file.read(8)[4:] == last
        except (OSError, struct.error):
            return False

    def _begin_section(self) -> None:
        self._reader.interfaces.clear()
        self._names.clear()
        self._offsets.clear()

    def _note_interface(self, block: bytes) -> None:
        order, place = self._reader.endian, 8
        found: dict[int, bytes] = {}
        while place + 4 <= len(block):
            code, length = unpack_from(f'{order}HH', block, place)
            found.setdefault(code, block[place + 4:place + 4 + length])
            if not code:
                break
            place += 4 + length + -length % 4
        self._names.append(found.get(_NAME, b'').rstrip(b'\0').decode(errors='replace'))
        offset = found.get(_OFFSET, b'')
        self._offsets.append(unpack_from(f'{order}q', offset)[0] if len(offset) == 8 else 0)

    def _note_first(self, _: bytes) -> None:
        self.current = 0

    def _note_packet(self, block: bytes) -> None:
        self.current, = unpack_from(f'{self._reader.endian}L', block)

    def _note_old_packet(self, block: bytes) -> None:
        self.current, = unpack_from(f'{self._reader.endian}H', block)


def _noting(note: Callable[[bytes], None], read: Callable[[bytes, int], Any],
            ) -> Callable[[bytes, int], Any]:
    def read_and_note(block: bytes, size: int) -> Any:
        note(block)
        return read(block, size)
    return read_and_note


class _Echoes:
    """
    Finds frames that a capture has twice: outgoing, and received back when they were sent.

    :ivar dropped: their number.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._waiting: dict[Record, deque[float]] = {}

    def has(self, record: Record) -> bool:
        """Return whether an entry is the second of such two."""
        frame = record._replace(time=0.0, sent=None)
        waiting = self._waiting.get(frame)
        if record.sent:
            if len(self._waiting) >= _WAITING_MAX:
                self._waiting = {each: times for each, times in self._waiting.items()
                                 if times and times[-1] > record.time - _ECHO_MAX}
            self._waiting.setdefault(frame, deque()).append(record.time)
            return False
        while waiting:
            if waiting.popleft() >= record.time - _ECHO_MAX:
                self.dropped += 1
                return True
        return False


def _record(data: bytes, reader: Any, about: Any, interfaces: _Interfaces,
            passed: Counter[str]) -> Record | None:
    """
    Return the frame of a packet; None: there is none, which is counted.

    :raises struct.error: not all of it is there.
    :raises ValueError: likewise.
    """
    link = about.linktype if interfaces.is_new else reader.linktype
    content = _content(link, data, '<' if reader.endian == '<' else '>')
    if content is None:
        passed['packets that are no frames' if link in (_COOKED, _COOKED_2, _NAMED)
               else f'packets of link type {link}'] += 1
        return None
    order = content.order
    identifier, size, flags = unpack_from(f'{order}LBB', content.data)
    if size & _XL:
        passed['frames of CAN XL'] += 1
        return None
    kind = (RecordKind.ERROR if identifier & _ERROR else
            RecordKind.REMOTE if identifier & _REMOTE else
            RecordKind.FD if flags & _FD or size > _CLASSICAL_MAX else DATA)
    frame = b'' if kind is RecordKind.REMOTE else content.data[_HEAD:_HEAD + size]
    if len(frame) < size and kind is not RecordKind.REMOTE:
        raise ValueError
    extended = bool(identifier & _EXTENDED) or kind is RecordKind.ERROR
    return Record(_time(reader, about, interfaces), content.interface or interfaces.name,
                  identifier & EXTENDED_IDENTIFIER_MAX, frame, extended, kind,
                  True if content.outgoing else None)


def _content(link: int, data: bytes, order: str) -> _PacketContent | None:
    """Return where in a packet a frame is; None: there is none."""
    if link == _SOCKETCAN:
        return _PacketContent(data, '>')
    if link == _COOKED:
        direction, protocol = unpack_from('>H12xH', data)
        return _PacketContent(data[16:], order,
                              direction == _OUTGOING) if _is_can(protocol) else None
    if link == _COOKED_2:
        protocol, index, direction = unpack_from('>HxxLxxB', data)
        return (_PacketContent(data[20:], order, direction == _OUTGOING, f'#{index}')
                if _is_can(protocol) else None)
    if link == _NAMED:
        name, place = b'', 0
        while True:
            tag, length = unpack_from('>HH', data, place)
            place += 4 + length
            if not tag:
                break
            if tag == _DISSECTOR:
                name = data[place - length:place].rstrip(b'\0')
        if name in (b'can-hostendian', b'can-bigendian'):
            return _PacketContent(data[place:], order if name == b'can-hostendian' else '>')
    return None


def _is_can(protocol: int) -> bool:
    return protocol in (_CAN, _CAN_FD, _CAN_XL)


def _time(reader: Any, about: Any, interfaces: _Interfaces) -> float:
    if not interfaces.is_new:
        return float(about.sec + about.usec * (1e-9 if reader.nano else 1e-6))
    if about.tshigh is None:    # a simple packet has none
        return 0.0
    return float(interfaces.offset + ((about.tshigh << 32) + about.tslow) / about.tsresol)
