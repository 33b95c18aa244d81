# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
PEAK's text format, ``.trc``.

python-can's reader returns frames only, reads the versions 1.2 and 3.0 as 1.0, and what it
reads at all differs from release to release. Lines are a number, a time in ms behind the start of
the trace (days since 1899-12-30), and further columns, by version:

=============== ============================================================================
none (1.0)      identifier, length, data (or ``ERROR`` and data, or ``RTR``); no start
1.1             type or direction, identifier, length, data
1.2             bus, then as 1.1
1.3             bus, type or direction, identifier, one of J1939, length, data
2.0, 2.1, 3.0   as in ``;$COLUMNS=``; other lines than frames have fewer in 2.0
=============== ============================================================================
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import timedelta
import re
from typing import NamedTuple

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.frame import DATA, Record, RecordKind, state_record
from drive_can_bridge.transport.error_frames import protocol_error

_KEYWORD = re.compile(r'\s*;\$(FILEVERSION|STARTTIME|COLUMNS)\s*=\s*(.*?)[\s;]*$', re.ASCII)
#: 1970, days since 1899-12-30
_EPOCH = 25_569
#: columns of the versions that do not name them, by the letters of those that do; t: type in 1.x
_OLD_COLUMNS = {'1.0': 'NOILD', '1.1': 'NOtILD', '1.2': 'NOBtILD', '1.3': 'NOBtIRLD'}
_WARNING = 'FFFFFFFF'
_LENGTH = '(?P<L>[0-9]{1,4})'
_DIRECTION = '(?P<d>Rx|Tx)'
_IDENTIFIER = '(?P<I>[0-9A-Fa-f]{1,8})'
#: what a frame has in a column, and what any other line has, up to its type or identifier
_OF_ALL = {'N': r'[0-9]+\)?', 'O': r'(?P<O>-?[0-9]+(?:\.[0-9]+)?)'}
_OF_FRAMES = {**_OF_ALL, 'B': '(?P<B>[0-9]{1,9})', 't': _DIRECTION,
              'T': '(?P<T>DT|FD|FB|FE|BI|RR)', 'I': f'(?!{_WARNING}){_IDENTIFIER}',
              'd': _DIRECTION, 'l': _LENGTH, 'L': _LENGTH}
_OF_OTHERS = {**_OF_ALL, 'B': '(?P<B>[0-9]{1,9}|-)', 't': r'(?P<T>[A-Za-z]\w{1,7})',
              'T': r'(?P<T>[A-Za-z]\w{1,7})', 'I': '(?P<I>[0-9A-Fa-f]{1,8}|-)'}
#: in 1.0, which has no type
_OLD_ERROR = r'\s+[0-9]+(?:\s+(?P<T>ERROR))?'
_HEX = '[0-9A-Fa-f]{2}'
_DATA = rf'(?:\s+(?P<D>RTR|{_HEX}(?:\s+{_HEX})*))?\s*$'
_BYTES = re.compile(rf'(?:\s+{_HEX}(?!\S))+', re.ASCII)
_FD = ('FD', 'FB', 'FE', 'BI')
_FRAMES = ('Rx', 'Tx', 'DT', *_FD, 'RR')
#: lengths by DLC
_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
_CLASSICAL_MAX = 8
_DLC_MAX = 15
_STANDARD_DIGITS = 4
#: states as PEAK's library numbers them, with what they mean
_STATES = {
    0x00002: 'OVERRUN (frames were lost)',
    0x00004: 'BUSLIGHT (an error counter reached the lower limit)',
    0x00008: 'BUSHEAVY (an error counter reached the upper limit: error-warning or error-passive)',
    0x00010: 'BUSOFF (bus-off)', 0x40000: 'BUSPASSIVE (error-passive)'}
#: an error counter from which on the state is error-warning
_HIGH = 96

Complain = Callable[[str], None]


class _Layout(NamedTuple):
    """The patterns of the lines of a version."""

    frame: re.Pattern[str]
    other: re.Pattern[str]
    has_codes: bool     # of lengths


def read_peak(lines: Iterable[str], wrong: Complain, passed: Counter[str]) -> Iterator[Record]:
    """
    Read the entries of a file.

    :param wrong: called with what is wrong with the last line; '': it is no entry.
    :param passed: counts lines that have no entry.
    """
    read = _Reader(wrong, passed).read
    for line in lines:
        record = read(line)
        if record is not None:
            yield record


class _Reader:
    """Reads lines by the columns in their head."""

    def __init__(self, wrong: Complain, passed: Counter[str]) -> None:
        self._wrong = wrong
        self._passed = passed
        self._version = '1.0'
        self._start = 0.0
        self._layout = _layout(_OLD_COLUMNS[self._version])
        self._told = False      # that there is no layout

    def read(self, line: str) -> Record | None:
        """Return the entry of a line; None: it has none, which is reported where it should."""
        if line.lstrip()[:1] in (';', ''):
            self._take_head(line)
            return None
        if self._layout is None:
            self._miss_columns()
            return None
        frame = self._layout.frame.match(line)
        if frame is not None:
            return self._frame(frame, self._layout)
        other = self._layout.other.match(line)
        kind = '' if other is None else other['T'] or (
            'Warng' if other['I'] == _WARNING else '')
        if other is None or kind in ('', *_FRAMES):     # a damaged one
            self._wrong('')
            return None
        record = _state_or_error(kind, self._start, other, line)
        if record is None:
            self._passed[kind] += 1
        return record

    def _take_head(self, line: str) -> None:
        found = _KEYWORD.match(line)
        if found is None:
            return
        keyword, value = found.groups()
        if keyword == 'STARTTIME':
            try:
                self._start = timedelta(days=float(value) - _EPOCH).total_seconds()
            except (ValueError, OverflowError):
                self._wrong(command_sentences.trc_start_time(value=repr(value)))
        elif keyword == 'COLUMNS':
            self._layout = _layout(value.replace(' ', '').split(','))
        else:
            self._version = value
            self._layout = _layout(_OLD_COLUMNS.get(value, ''))
            self._told = False

    def _miss_columns(self) -> None:
        if self._told:
            self._passed['lines without $COLUMNS'] += 1
        else:
            self._wrong(command_sentences.trc_without_columns(version=self._version))
            self._told = True

    def _frame(self, found: re.Match[str], layout: _Layout) -> Record | None:
        kind, time, bus, number, direction, length, data = found.group(
            'T', 'O', 'B', 'I', 'd', 'L', 'D')
        size, is_fd = int(length), kind in _FD
        if kind == 'RR' or data == 'RTR':
            content, record_kind = b'', RecordKind.REMOTE
        else:
            content, record_kind = bytes.fromhex(data or ''), RecordKind.FD if is_fd else DATA
            if is_fd and layout.has_codes:
                size = _LENGTHS[size] if size <= _DLC_MAX else -1
            elif not is_fd and len(content) > _CLASSICAL_MAX:
                self._passed['messages of several frames'] += 1     # J1939
                return None
            elif not is_fd and size <= _DLC_MAX:
                size = min(size, _CLASSICAL_MAX)
            if size != len(content):
                self._wrong(command_sentences.trc_length_differs(
                    length=length, found=len(content)))
                return None
        return Record(self._start + 1e-3 * float(time), int(bus or 1), int(number, 16), content,
                      len(number) > _STANDARD_DIGITS, record_kind,
                      direction == 'Tx' if direction else None)


def _layout(columns: Sequence[str]) -> _Layout | None:
    """Return the layout of lines with these columns; None: one is missing, or given twice."""
    names = set(columns)
    has_type = not names.isdisjoint('Tt')
    if (len(names) < len(columns) or not names >= {'O', 'I'} or names.isdisjoint('Ll')
            or any(names >= set(alike) for alike in ('Ll', 'Tt', 'td'))
            or 'd' in names and not has_type):
        return None
    known = [name for name in columns if name != 'D']
    # 2.x: with the bus, which may stand behind the type
    ends = [known.index(name) for name in ('OTB' if 'T' in names else 'OtI')
            if name in names]
    frame = _pattern(known, _OF_FRAMES) + _DATA
    other = _pattern(known[:max(ends) + 1], _OF_OTHERS) + (
        '' if has_type else _OLD_ERROR) + r'(?!\S)'
    return _Layout(_compiled(frame, 'OTBIdLD'), _compiled(other, 'OTBI'), 'L' in names)


def _compiled(pattern: str, groups: str) -> re.Pattern[str]:
    """Return a pattern with all these groups; those of columns that are not there are empty."""
    return re.compile(pattern + ''.join(
        f'(?P<{name}>)' for name in groups if f'(?P<{name}>' not in pattern), re.ASCII)


def _pattern(columns: Iterable[str], known: Mapping[str, str]) -> str:
    return r'\s*' + r'\s+'.join(known.get(name, r'\S+') for name in columns)


def _state_or_error(kind: str, start: float, found: re.Match[str], line: str) -> Record | None:
    """
    Return the entry of a line that is of no frame; None: it is of another kind.

    The bytes of an error are those that PEAK's PCAN-Basic returns, by its manual ("Error
    Frames"): 0 when sending, place in the frame, counters receive and transmit; in front of them
    its type, 0 if only the counters have changed. In a change of counters (EC) the same order is
    taken for granted: the examples of the format's own document have equal ones.
    """
    time, bus, number = found.group('O', 'B', 'I')
    runs = _BYTES.findall(line, found.end())
    data = bytes.fromhex(runs[-1]) if runs else b''
    if bus == '-':
        return None
    at = start + 1e-3 * float(time), int(bus or 1)
    if kind in ('ST', 'Warng') and len(data) == 4:
        return _state(*at, int.from_bytes(data, 'big'))
    if kind == 'EC' and len(data) == 2:
        return _counters(*at, *data)
    if kind == 'ER' and len(data) == 5:
        return _error(*at, *data)
    if kind in ('Error', 'ERROR') and number not in ('', '-') and len(data) == 4:
        return _error(*at, int(number, 16), *data)
    return None


def _state(time: float, channel: int, status: int) -> Record:
    words = ', '.join(text for bit, text in _STATES.items() if status & bit)
    return state_record(time, channel, words or f'status {status:08X}h' if status else 'OK',
                        well=not status)


def _counters(time: float, channel: int, receiving: int, sending: int) -> Record:
    return state_record(
        time, channel, f'error counters transmit {sending}, receive {receiving}',
        well=max(sending, receiving) < _HIGH)


def _error(time: float, channel: int, type_: int, direction: int, place: int, receiving: int,
           sending: int) -> Record:
    if not type_:
        return _counters(time, channel, receiving, sending)
    classes, details = protocol_error(type_, place, sending=not direction,
                                      counters=(sending, receiving))
    return Record(time, channel, classes, details, True, RecordKind.ERROR)
