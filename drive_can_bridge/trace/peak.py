# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
PEAK's text format, ``.trc``: what python-can's reader passes over, and versions that it lacks.

=============== ====================================================================
version         lines, the columns before the data
=============== ====================================================================
none (1.0)      number, time, identifier, length
1.1             number, time, type, identifier, length
1.2, 1.3        number, time, bus, type, identifier, (1.3: ``-``,) length
2.0, 2.1, 3.0   as ``;$COLUMNS=`` says; what is of no frame has fewer in 2.0
=============== ====================================================================

Times are ms, behind the start of the trace (days since 1899-12-30), which 1.0 does not have.
"""

from collections import Counter, deque
from collections.abc import Iterable, Iterator
import re

from drive_can_bridge.core.frame import Record, RecordKind, state_record
from drive_can_bridge.transport.error_frames import protocol_error

_VERSION = re.compile(r'\s*;\$FILEVERSION\s*=\s*(\d+\.\d+)')
_START = re.compile(r'\s*;\$STARTTIME\s*=\s*(\d+(?:\.\d+)?)')
_COLUMNS = re.compile(r'\s*;\$COLUMNS\s*=\s*(\S+)')
_DAY = 86_400.0
#: 1899-12-30, s since 1970
_EPOCH = -25_569 * _DAY
#: place of the column of the type, by version; 1.0 has none
_TYPE = {'1.0': None, '1.1': 2, '1.2': 3, '1.3': 3}
#: the version of the same columns that python-can reads
_KNOWN_AS = {'1.2': '1.3', '3.0': '2.1'}
_DIRECTIONS = ('Rx', 'Tx')
_FRAMES = frozenset(('Rx', 'Tx', 'DT', 'FD', 'FB', 'FE', 'BI', 'RR'))
_WARNING = 'FFFFFFFF'
_BYTE = re.compile(r'[0-9A-Fa-f]{2}')
#: states as PEAK's library numbers them, with what they mean
_STATES = {
    0x00002: 'OVERRUN (frames were lost)',
    0x00004: 'BUSLIGHT (an error counter reached the lower limit)',
    0x00008: 'BUSHEAVY (an error counter reached the upper limit: error-warning or error-passive)',
    0x00010: 'BUSOFF (bus-off)', 0x40000: 'BUSPASSIVE (error-passive)'}
#: an error counter from which on the state is error-warning
_HIGH = 96


class PeakLines:
    """
    Lines of a trace, for python-can's reader.

    :param aside: takes the entries that it does not know.
    :param passed: counts lines of other kinds.
    """

    def __init__(self, aside: deque[Record], passed: Counter[str]) -> None:
        self._aside = aside
        self._passed = passed
        self._version = '1.0'
        self._start = 0.0
        #: places of columns; None: there is none
        self._time = 1
        self._type: int | None = None
        self._bus: int | None = None

    def of(self, stream: Iterable[str]) -> Iterator[str]:
        """Yield the lines that it knows, as it knows them; a head only with frames behind it."""
        head: list[str] = []
        for line in stream:
            if line.lstrip()[:1] == ';':
                head.append(self._header(line))
                continue
            words = line.split()
            kind = self._kind(words)
            if kind in _FRAMES:
                if self._version == '1.2':
                    words.insert(5, '-')
                    line = f'{" ".join(words)}\n'
                yield from head
                head.clear()
                yield line
            elif not self._is_understood(kind, words):
                self._passed[kind] += 1

    def _header(self, line: str) -> str:
        """Take what a comment says; return it as python-can's reader can take it."""
        version, start, columns = (
            pattern.match(line) for pattern in (_VERSION, _START, _COLUMNS))
        if version is not None:
            self._version = version[1]
            self._type = _TYPE.get(self._version)
            self._bus = 2 if self._version in ('1.2', '1.3') else None
            known = _KNOWN_AS.get(self._version, self._version)
            return f';$FILEVERSION={known}\n'
        if start is not None:       # some have a ; at their end
            self._start = _EPOCH + _DAY * float(start[1])
            return f';$STARTTIME={start[1]}\n'
        if columns is not None:
            names = columns[1].split(',')
            self._type, self._bus = (
                names.index(name) if name in names else None for name in 'TB')
            self._time = names.index('O') if 'O' in names else 1
        return line

    def _kind(self, words: list[str]) -> str:
        """Return the type of a line; that of a frame, where python-can is to say what is wrong."""
        if self._type is None:      # 1.0
            return ('Warng' if words[2:3] == [_WARNING] else
                    'Error' if words[4:5] == ['ERROR'] else _DIRECTIONS[0])
        return words[self._type] if len(words) > self._type else _DIRECTIONS[0]

    def _is_understood(self, kind: str, words: list[str]) -> bool:
        """Tell whether a line tells a state or an error, which is put aside."""
        try:
            time = self._start + 1e-3 * float(words[self._time])
            channel = int(words[self._bus]) if self._bus is not None else 1
            data = bytes(int(word, 16) for word in words if _BYTE.fullmatch(word))
            if kind in ('Warng', 'ST'):
                *_, first, second, third, fourth = data
                entry = _state(time, channel, int.from_bytes(
                    (first, second, third, fourth), 'big'))
            elif kind in ('Error', 'ER'):
                type_ = (data[-5] if kind == 'ER' else
                         int(words[2 if self._type is None else self._type + 1], 16))
                direction, place, receiving, sending = data[-4:]
                classes, details = protocol_error(type_, place, sending=not direction,
                                                  counters=(sending, receiving))
                entry = Record(time, channel, classes, details, True, RecordKind.ERROR)
            elif kind == 'EC':
                receiving, sending = data[-2:]
                entry = state_record(
                    time, channel, f'error counters transmit {sending}, receive {receiving}',
                    well=max(sending, receiving) < _HIGH)
            else:
                return False
        except (ValueError, IndexError):
            return False
        self._aside.append(entry)
        return True


def _state(time: float, channel: int, status: int) -> Record:
    words = ', '.join(text for bit, text in _STATES.items() if status & bit)
    return state_record(time, channel, words or f'status {status:08X}h' if status else 'OK',
                        well=not status)
