# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Vector's binary logging format, ``.blf``.

python-can's reader returns frames only, and reads every entry of type 73 as SocketCAN's error
classes, which only its own writer puts there. A file is a header and objects; most of them stand
packed in containers, and may span several of them:

====== ======== ======================================================
offset size     of an object (little-endian)
====== ======== ======================================================
0      4        ``LOBJ``
4      2, 2     size and version of the header
8      4        size of all; a multiple of four is filled up to
12     4        type
16     4        flags: 1, time in 10 µs; 2, in ns
24     8        time since the beginning of the file
====== ======== ======================================================
"""

from collections import Counter
from collections.abc import Callable, Generator, Iterator
from datetime import datetime, timezone
from pathlib import Path
import struct
from struct import Struct
from typing import BinaryIO, NamedTuple
import zlib

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.frame import (
    DATA, EXTENDED_IDENTIFIER_MAX, Record, RecordKind, state_record)

_FILE_HEADER = Struct('<4sL32x8H')
_OBJECT = Struct('<4sHHLL')
_STAMP = Struct('<LHHQ')
_CONTAINER = Struct('<H14x')     # how it is packed; its size when unpacked, which may be wrong
_PADDING_MAX = 8
_SIGNATURE = b'LOBJ'

#: types of objects
_MESSAGE, _ERROR, _CONTAINED, _DRIVER_ERROR, _ERROR_EXT = 1, 2, 10, 31, 73
_MESSAGE_2, _FD_MESSAGE, _FD_MESSAGE_64, _DRIVER_ERROR_EXT = 86, 100, 101, 104
_NAMES = {3: 'overload frames', 4: 'statistics', 65: 'texts', 92: 'comments', 96: 'markers'}

_MESSAGE_STRUCT = Struct('<HBBL8s')
_FD_STRUCT = Struct('<HBBLLBBB5x64s')
_FD_64_STRUCT = Struct('<BBBxL4xL18xBB4x')
_ERROR_EXT_STRUCT = Struct('<HHLBBBxLLH2x8s')
_CHANNEL = Struct('<H')
_DRIVER_STRUCT = Struct('<HBBL')
_EXTENDED = 0x80000000
_REMOTE, _SENT = 0x80, 0x01
_FD_EDL = 0x01
_FD_64_EDL, _FD_64_REMOTE, _FD_64_SENT, _FD_64_REQUEST = 0x1000, 0x10, 0x40, 0x80
#: of a destroyed frame; the other half of its byte is reserved
_LENGTH = 0x0F
_TENS_OF_MICROSECONDS = 1
_CLASSICAL_MAX = 8


Complain = Callable[[str], None]


class _Object(NamedTuple):
    kind: int
    time: float     # s since the beginning
    header_size: int
    content: bytes


def read_blf(path: Path, complain: Complain, passed: Counter[str]) -> Iterator[Record]:
    """
    Read the entries of a file.

    :param passed: counts what has no entry.
    """
    with path.open('rb') as file:
        header = file.read(_FILE_HEADER.size)
        if len(header) < _FILE_HEADER.size:
            complain(command_sentences.trace_cut())
            return
        begin, size = _begin(header)
        file.seek(max(size, _FILE_HEADER.size))
        for number, found in enumerate(_objects(file, complain, passed), 1):
            try:
                record = _entry(found, begin + found.time, passed)
            except struct.error:
                complain(command_sentences.trace_object_short(number=number, kind=found.kind))
                continue
            if record is not None:
                yield record


def _begin(header: bytes) -> tuple[float, int]:
    """Return when a file begins, s since 1970, and where the first object is."""
    _, size, year, month, _, day, hour, minute, second, milliseconds = (
        _FILE_HEADER.unpack(header))
    try:
        return datetime(year, month, day, hour, minute, second, 1000 * milliseconds,
                        timezone.utc).timestamp(), size
    except ValueError:      # not set
        return 0.0, size


def _objects(file: BinaryIO, complain: Complain, passed: Counter[str]) -> Iterator[_Object]:
    """Yield all objects, those of containers in their places."""
    waiting = b''
    while head := file.read(_OBJECT.size):
        padding = len(head) - len(head.lstrip(b'\0'))
        head = head[padding:] + file.read(padding)
        signature, header_size, version, size, kind = (
            _OBJECT.unpack(head) if len(head) == _OBJECT.size else (b'', 0, 0, 0, 0))
        if signature != _SIGNATURE or size < _OBJECT.size:
            waiting = head
            break
        content = file.read(size - _OBJECT.size)
        whole = len(head) + len(content) == size
        if kind == _CONTAINED:
            unpacked, ended = _unpack(content)
            whole &= ended
            waiting = yield from _contained(waiting + unpacked, complain, passed)
        elif whole:
            yield from _parse(head + content, header_size, version, kind, passed)
        if not whole:
            waiting = head
            break
    if waiting.strip(b'\0'):
        complain(command_sentences.trace_cut())


def _unpack(container: bytes) -> tuple[bytes, bool]:
    """Return the content of a container, and whether its end was reached."""
    if len(container) < _CONTAINER.size:
        return b'', False
    method, = _CONTAINER.unpack_from(container)
    packed = container[_CONTAINER.size:]
    if not method:
        return packed, True
    unpacking = zlib.decompressobj()
    try:
        return unpacking.decompress(packed), unpacking.eof
    except zlib.error:
        return b'', False


def _contained(data: bytes, complain: Complain, passed: Counter[str],
               ) -> Generator[_Object, None, bytes]:
    """Yield the complete objects; return what continues in the next container."""
    place, end = 0, len(data)
    while True:
        found = data.find(_SIGNATURE, place)
        if found < 0:
            return data[max(place, end - len(_SIGNATURE) + 1):]
        if found > place + _PADDING_MAX:
            complain(command_sentences.trace_bytes_damaged(count=found - place))
        if found + _OBJECT.size > end:
            return data[found:]
        _, header_size, version, size, kind = _OBJECT.unpack_from(data, found)
        place = found + max(size, _OBJECT.size)
        if place > end:
            return data[found:]
        yield from _parse(data[found:place], header_size, version, kind, passed)


def _parse(data: bytes, header_size: int, version: int, kind: int, passed: Counter[str],
           ) -> Iterator[_Object]:
    """Yield an object, unless its header is of an unknown version."""
    if version not in (1, 2) or len(data) < max(_OBJECT.size + _STAMP.size, header_size):
        passed[f'objects with a header of version {version}'] += 1
        return
    flags, _, _, ticks = _STAMP.unpack_from(data, _OBJECT.size)
    yield _Object(kind, ticks / (1e5 if flags == _TENS_OF_MICROSECONDS else 1e9), header_size,
                  data[header_size:])


def _entry(found: _Object, time: float, passed: Counter[str]) -> Record | None:
    """
    Return the entry of an object; None: it has none, and is counted.

    :raises struct.error: it is too short.
    """
    kind, _, header_size, content = found
    if kind in (_MESSAGE, _MESSAGE_2):
        channel, flags, size, number, data = _MESSAGE_STRUCT.unpack_from(content)
        return _frame(time, channel, number, data[:min(size, _CLASSICAL_MAX)],
                      _remote_or_data(flags & _REMOTE), flags & _SENT)
    if kind == _FD_MESSAGE:
        channel, flags, _, number, _, _, fd_flags, size, data = _FD_STRUCT.unpack_from(content)
        return _frame(time, channel, number, data[:size], RecordKind.FD if fd_flags & _FD_EDL
                      else _remote_or_data(flags & _REMOTE), flags & _SENT)
    if kind == _FD_MESSAGE_64:
        channel, _, size, number, fd_flags, direction, extension = _FD_64_STRUCT.unpack_from(
            content)
        if fd_flags & _FD_64_REQUEST and not fd_flags & _FD_64_SENT:
            passed['requests to send'] += 1
            return None
        end = _FD_64_STRUCT.size + size
        if extension:
            end = min(end, extension - header_size)
        # what is not there is zero, as in CANoe
        return _frame(time, channel, number,
                      content[_FD_64_STRUCT.size:end].ljust(size, b'\0'),
                      RecordKind.FD if fd_flags & _FD_64_EDL
                      else _remote_or_data(fd_flags & _FD_64_REMOTE), direction)
    if kind == _ERROR_EXT:
        return _error(time, content)
    if kind == _ERROR:
        channel, = _CHANNEL.unpack_from(content)
        return Record(time, channel, 0, b'', False, RecordKind.ERROR)
    if kind in (_DRIVER_ERROR, _DRIVER_ERROR_EXT):
        channel, sending, receiving, code = _DRIVER_STRUCT.unpack_from(content)
        return state_record(time, channel, f'error {code:08X}h of the driver, error counters '
                            f'transmit {sending}, receive {receiving}')
    passed[_NAMES.get(kind, f'objects of type {kind}')] += 1
    return None


def _remote_or_data(remote: int) -> RecordKind:
    return RecordKind.REMOTE if remote else DATA


def _frame(time: float, channel: int, number: int, data: bytes, kind: RecordKind,
           sent: int) -> Record:
    return Record(time, channel, number & EXTENDED_IDENTIFIER_MAX,
                  b'' if kind is RecordKind.REMOTE else data, bool(number & _EXTENDED), kind,
                  bool(sent))


def _error(time: float, content: bytes) -> Record:
    channel, _, flags, code, _, size, _, number, _, data = _ERROR_EXT_STRUCT.unpack_from(content)
    identifier, extended = number & EXTENDED_IDENTIFIER_MAX, bool(number & _EXTENDED)
    data = data[:size & _LENGTH]
    if not flags and not code:      # python-can's writer: SocketCAN's classes
        return Record(time, channel, identifier, data, extended, RecordKind.ERROR)
    if not identifier and not data:     # the frame was not known yet
        return Record(time, channel, 0, b'', False, RecordKind.ERROR)
    return Record(time, channel, identifier, data, extended, RecordKind.DESTROYED)
