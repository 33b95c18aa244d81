# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
ASAM's measurement data with bus logging, ``.mf4``, unpacked by asammdf.

python-can's reader reads the members of every error as SocketCAN's classes, which only its own
writer puts there, knows none of ``ErrorType``, and ends at an error whose bytes are one number.
What loggers write (ASAM MDF bus logging; members that are not there are not known):

================ ===============================================================================
group            members, each with its name in front
================ ===============================================================================
CAN_DataFrame    BusChannel, ID, IDE, DLC, DataLength, DataBytes, Dir, EDL (CAN FD)
CAN_RemoteFrame  BusChannel, ID, IDE, DLC, Dir
CAN_ErrorFrame   BusChannel, ErrorType (1 bit, 2 form, 3 stuff, 4 CRC, 5 acknowledgement), and
                 perhaps the frame that was destroyed, as a data frame has it
================ ===============================================================================
"""

from collections import Counter
from collections.abc import Callable, Iterator
import gc
from heapq import merge
from importlib import import_module
from pathlib import Path
import sys
from typing import Any

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.frame import (
    DATA, EXTENDED_IDENTIFIER_MAX, Record, RecordKind, STANDARD_IDENTIFIER_MAX)
from drive_can_bridge.transport.error_frames import BUS_ERROR, NO_ACKNOWLEDGEMENT, PROTOCOL

#: how such files begin: finished, and as a logger leaves them behind
BEGINNINGS = b'MDF |UnFinMF '
#: of a group, of its source, of the bus of that
_BUS_EVENT, _OF_BUS, _CAN = 0x2, 2, 2
_KINDS = 'CAN_DataFrame', 'CAN_ErrorFrame', 'CAN_RemoteFrame'
#: python-can's writer's content of an error
_OF_PYTHON_CAN = frozenset((
    'BusChannel', 'ID', 'IDE', 'DLC', 'DataLength', 'DataBytes', 'Dir', 'EDL', 'BRS', 'ESI'))
_EXTENDED = 0x80000000
_CLASSICAL_MAX = 8
#: entries that are unpacked at a time
_CHUNK = 4096
#: ``ErrorType`` as SocketCAN has the same; place 8 in the frame is its check sum
_ERROR_TYPES = {
    1: (PROTOCOL | BUS_ERROR, b'\0\0\1\0\0\0\0\0'),
    2: (PROTOCOL | BUS_ERROR, b'\0\0\2\0\0\0\0\0'),
    3: (PROTOCOL | BUS_ERROR, b'\0\0\4\0\0\0\0\0'),
    4: (PROTOCOL | BUS_ERROR, b'\0\0\0\x08\0\0\0\0'),
    5: (NO_ACKNOWLEDGEMENT | BUS_ERROR, bytes(8)),
}

Complain = Callable[[str], None]


def read_measured(path: Path, complain: Complain, passed: Counter[str]) -> Iterator[Record]:
    """
    Read a file, in the order of time.

    :param passed: counts what has no entry: other buses, other groups of CAN.
    :raises DriveCanError: asammdf is missing.
    """
    try:
        opener = import_module('asammdf').MDF      # takes a second
    except ImportError:
        raise DriveCanError(
            command_sentences.asammdf_missing(path=path)) from None
    measured = _opened(opener, path)
    if measured is None:
        complain(command_sentences.trace_cut())
        return
    try:
        yield from _records(measured, complain, passed)
    finally:
        measured.close()


def _opened(opener: Callable[[Path], Any], path: Path) -> Any:
    """Open a file; None: it is damaged. A failure at its beginning is repeated at its end."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        try:
            return opener(path)
        except Exception:  # noqa: BLE001  whatever a damaged file makes it raise
            pass
        gc.collect()
        return None
    finally:
        sys.unraisablehook = hook


def _records(measured: Any, complain: Complain, passed: Counter[str]) -> Iterator[Record]:
    begin = measured.header.start_time.timestamp()
    groups = []
    for number, group in enumerate(measured.groups):
        about = group.channel_group
        names = {str(channel.name) for channel in group.channels}
        source = about.acq_source
        if not about.cycles_nr or not about.flags & _BUS_EVENT or source is None or (
                source.source_type != _OF_BUS):
            continue
        kind = next((kind for kind in _KINDS if kind in names), '')
        if source.bus_type == _CAN and kind:
            groups.append(_group(measured, number, kind, begin, about.cycles_nr, complain))
        else:
            passed[next((name for name in sorted(names) if name.endswith(('Frame', 'Error'))),
                        'entries of other buses')] += about.cycles_nr
    yield from merge(*groups, key=lambda record: record.time)


def _group(measured: Any, number: int, kind: str, begin: float, count: int,
           complain: Complain) -> Iterator[Record]:
    """Yield the entries of a group."""
    for start in range(0, count, _CHUNK):
        try:
            signal = measured.get(kind, number, record_offset=start, record_count=_CHUNK,
                                  raw=False)
            samples, times = signal.samples, signal.timestamps.tolist()
            prefix = f'{kind}.'
            members = _Members({name.removeprefix(prefix): samples[name]
                                for name in samples.dtype.names or ()})
        except Exception:  # noqa: BLE001  whatever damaged data make it raise
            complain(command_sentences.trace_cut())
            return
        build = _BUILDERS[kind]
        for place, time in enumerate(times):
            try:
                record = build(members, place, begin + time)
            except (ValueError, TypeError, IndexError, OverflowError, AttributeError):
                complain(f'no entry of {kind}')
                continue
            yield record


class _Members:
    """The columns of entries of one kind."""

    def __init__(self, members: dict[str, Any]) -> None:
        self._members = members
        self.names = frozenset(members)

    def number(self, name: str, place: int, otherwise: int = 0) -> int:
        """Return a number."""
        column = self._members.get(name)
        return otherwise if column is None else int(column[place])

    def channel(self, place: int) -> int | str:
        """Return the bus; '': unknown."""
        return self.number('BusChannel', place) if 'BusChannel' in self.names else ''

    def identifier(self, place: int) -> tuple[int, bool]:
        """Return the identifier, and whether it is one of 29 bits."""
        number = self.number('ID', place)
        plain = number & EXTENDED_IDENTIFIER_MAX
        if 'IDE' in self.names:
            return plain, bool(self.number('IDE', place))
        return plain, bool(number & _EXTENDED) or plain > STANDARD_IDENTIFIER_MAX

    def data(self, place: int) -> bytes:
        """Return the data bytes."""
        if 'DataBytes' not in self.names:
            return b''
        content = bytes(self._members['DataBytes'][place].tobytes())
        return content[:self.number('DataLength', place, len(content))]

    def sent(self, place: int) -> bool | None:
        """Return whether the recorder itself sent it; None: unknown."""
        column = self._members.get('Dir')
        if column is None:
            return None
        value = column[place]
        if column.dtype.kind in 'SU':       # the numbers have names
            return value in (b'Tx', 'Tx')
        return bool(int(value))


def _data(known: _Members, place: int, time: float) -> Record:
    identifier, extended = known.identifier(place)
    data = known.data(place)
    is_fd = known.number('EDL', place) or len(data) > _CLASSICAL_MAX
    return Record(time, known.channel(place), identifier, data, extended,
                  RecordKind.FD if is_fd else DATA, known.sent(place))


def _remote(known: _Members, place: int, time: float) -> Record:
    identifier, extended = known.identifier(place)
    return Record(time, known.channel(place), identifier, b'', extended, RecordKind.REMOTE,
                  known.sent(place))


def _error(known: _Members, place: int, time: float) -> Record:
    channel = known.channel(place)
    identifier, extended = known.identifier(place)
    data, sent = known.data(place), known.sent(place)
    if known.names == _OF_PYTHON_CAN:
        return Record(time, channel, identifier, data, extended, RecordKind.ERROR, sent)
    if identifier or data:
        return Record(time, channel, identifier, data, extended, RecordKind.DESTROYED, sent)
    classes, details = _ERROR_TYPES.get(known.number('ErrorType', place), (0, b''))
    return Record(time, channel, classes, details, False, RecordKind.ERROR, sent)


_BUILDERS = {'CAN_DataFrame': _data, 'CAN_RemoteFrame': _remote, 'CAN_ErrorFrame': _error}
