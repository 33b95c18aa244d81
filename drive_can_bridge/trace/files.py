# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Trace files: which formats there are, what each of them loses, reading and writing them.

Formats are python-can's, by suffix; ``.blf``, ``.mf4`` and ``.trc`` have readers of ours. One
damaged line does not cost a trace. Errors of files name the file. The two texts that
candump writes, log file (``-l``, ``-L``) and screen, have a reader and writer of their own:

.. code-block:: text

    (1700000000.123456) can0 003FFFF0#05DC000000000000 T
     (1700000000.123456)  can0  TX - -  003FFFF0   [8]  05 DC 00 00 00 00 00 00
     (2026-11-21 23:04:38.123456)  can0  003FFFF0   [8]  05 DC 00 00 00 00 00 00

python-can's reader takes most error frames for data frames, ends at the first line that is none of
its own, and does not know the screen.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from datetime import datetime
from errno import EIO
from functools import partial
import gzip
import io
import itertools
import logging
from pathlib import Path
import re
import sqlite3
import sys
from typing import Any, NamedTuple, TextIO, TypeVar
import zlib

import can

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.frame import (
    DATA, EXTENDED_IDENTIFIER_MAX, Record, RecordKind, STANDARD_IDENTIFIER_MAX)
from drive_can_bridge.core.text import printable
from drive_can_bridge.trace.blf import read_blf
from drive_can_bridge.trace.captures import BEGINNINGS, read_capture
from drive_can_bridge.trace.measured import BEGINNINGS as MEASURED_BEGINNINGS, read_measured
from drive_can_bridge.trace.peak import read_peak
from drive_can_bridge.trace.vector import of_vector
from drive_can_bridge.transport.tap import message_of, record_of


def labels(buses: Iterable[BusConfiguration]) -> dict[str, str]:
    """
    Return the names of buses in a trace, by name: as candump has them, or their own.

    Its own name also for a bus whose channel could mean another one.
    """
    known = list(buses)
    found = {}
    for bus in known:
        channel = str(bus.channel)
        taken = any(channel in (other.name, str(other.channel)) for other in known
                    if other is not bus)
        found[bus.name] = channel if bus.interface == 'socketcan' and not taken else bus.name
    return found


class Channels:
    """
    Finds buses by the channels of a trace.

    The user's choice comes first. Else a word is the name of a bus; if none has it, its channel.
    Of several buses a number is the place, from 1. The one bus of a file that has only one is
    meant by a trace without channels, too, and by a channel of another name, if there is no other
    in the trace.

    :param meant: by their names, the channels of buses as the user gives them.
    :param tell: called with a line where a number was read as a place, or is of no bus.
    """

    def __init__(self, buses: Sequence[BusConfiguration],
                 meant: Mapping[str, str] | None = None,
                 tell: Callable[[str], None] = lambda _: None) -> None:
        self._buses = list(buses)
        self._meant = meant or {}
        self._tell = tell
        self._found: dict[str | int, BusConfiguration | None] = {}
        # what has another name is of no bus of the file
        self._known = len(buses) != 1 or bool(self._meant)
        self._adopted: str | int | None = None

    def look_ahead(self, channels: Iterable[str | int]) -> None:
        """
        Note which channels a trace has, as far as it matters, before the first is looked up.

        :raises DriveCanError: it is unknown which of them is the bus.
        """
        foreign: dict[str | int, None] = {}
        for channel in () if self._known else channels:
            if channel == '':
                continue
            if self._named(channel) is not None:
                self._known = True
                return
            foreign[channel] = None
        if len(foreign) > 1:
            raise self._ambiguous(foreign)

    def find(self, channel: str | int) -> BusConfiguration | None:
        """
        Return the bus; None: it is not in the file.

        :raises DriveCanError: it is unknown, and another channel was used for the bus.
        """
        if channel not in self._found:
            self._found[channel] = self._look(channel)
        return self._found[channel]

    def _look(self, channel: str | int) -> BusConfiguration | None:
        if channel == '' and len(self._buses) == 1 and not self._meant:
            return self._buses[0]
        named = self._named(channel)
        if self._adopted is not None:
            raise self._ambiguous((self._adopted, channel))
        if named is None and not self._known:
            self._adopted, named = channel, self._buses[0]
        self._known |= self._adopted is None
        return named or self._at(channel)

    def left_over(self) -> list[str]:
        """
        Return lines on channels whose names are those of no bus.

        At the end: a bus whose channel comes later is none that could be meant.
        """
        free = [bus.name for bus in self._buses
                if bus.name not in self._meant and bus not in self._found.values()]
        return [self._no_bus(channel, free) for channel, bus in self._found.items()
                if free and bus is None and channel and isinstance(channel, str)]

    @staticmethod
    def _no_bus(channel: str | int, names: Iterable[str]) -> str:
        shown = printable(str(channel))
        return command_sentences.channel_of_no_bus(
            shown, [f'--bus {name}={shown}' for name in names])

    def missing(self) -> list[str]:
        """Return the user's choices that are not in the trace, as they were given."""
        found = {str(channel) for channel in self._found}
        return [f'{name}={channel}' for name, channel in self._meant.items()
                if channel not in found]

    def _named(self, channel: str | int) -> BusConfiguration | None:
        """Return the bus that has this name by the user or the file."""
        word = str(channel)
        for bus in self._buses:
            if self._meant.get(bus.name) == word:
                return bus
        others = [bus for bus in self._buses if bus.name not in self._meant]
        for bus in others:
            if bus.name == word:
                return bus
        # a number is never compared: adapters count from 0, files from 1
        return next((bus for bus in others if str(bus.channel) == channel), None)

    def _at(self, channel: str | int) -> BusConfiguration | None:
        """Return the bus in this place of the file."""
        if not isinstance(channel, int) or self._adopted is not None:
            return None
        others = [bus for bus in self._buses if bus.name not in self._meant]
        if len(self._buses) > 1 and 1 <= channel <= len(self._buses):
            bus = self._buses[channel - 1]
            if bus in others:
                self._tell(f'channel {channel}: bus {bus.name}')
                return bus
        if others:
            self._tell(self._no_bus(channel, (bus.name for bus in others)))
        return None

    def _ambiguous(self, channels: Iterable[str | int]) -> DriveCanError:
        bus = self._buses[0]
        names = [printable(str(channel)) for channel in channels]
        return DriveCanError(
            command_sentences.which_channel(
                names, bus.name, [f'--bus {bus.name}={name}' for name in names]))


#: s between two looks whether a database is written
_LOOK_PERIOD = 0.02


class _NamedFile(io.FileIO):
    """A file whose errors have its name: those of late writes have none otherwise."""

    def write(self, data: Any) -> int:
        """Write, or raise an error with the name of the file."""
        try:
            return super().write(data)
        except OSError as error:
            error.filename = self.name
            raise


def open_binary(path: Path) -> io.BufferedWriter:
    """Open a new file for bytes."""
    return io.BufferedWriter(_NamedFile(str(path), 'w'))


def open_text(path: Path, newline: str | None = None) -> io.TextIOWrapper:
    """Open a new file for text."""
    return io.TextIOWrapper(open_binary(path), encoding='utf-8', newline=newline)


class Database(can.SqliteWriter):
    """A database as python-can writes it, whose failures are seen outside of its thread."""

    _failure: Exception | None = None

    def __init__(self, path: Path) -> None:
        # else python-can adds to it, and sqlite undoes in it what was under way in the last one
        for each in (path, path.with_name(f'{path.name}-journal')):
            each.unlink(missing_ok=True)
        self._path = path
        self._taken = 0
        super().__init__(str(path))

    def on_message_received(self, msg: can.Message) -> None:
        """Queue a frame, to be written later."""
        self._taken += 1
        super().on_message_received(msg)

    def check(self) -> None:
        """
        Check that frames can be written.

        :raises OSError: not any more.
        """
        if self._failure is not None:
            raise OSError(EIO, str(self._failure), str(self._path))

    def stop(self) -> None:
        """
        Write the rest.

        :raises OSError: not all is written.
        """
        # when it is to end, the thread writes 500 more frames at most, whatever waits
        while self.num_frames < self._taken and self._writer_thread.is_alive():
            self._writer_thread.join(_LOOK_PERIOD)
        super().stop()
        self.check()
        if self.num_frames < self._taken:
            raise OSError(EIO, command_sentences.frames_not_written(
                count=self._taken - self.num_frames),
                          str(self._path))

    def _db_writer_thread(self) -> None:
        try:
            super()._db_writer_thread()
        except Exception as error:  # noqa: BLE001  the outermost of a thread
            self._failure = error


class VectorWriter(can.ASCWriter):
    """A writer whose milliseconds have their zeros in front: python-can makes .7 s of .007 s."""

    def _format_header_datetime(self, dt: datetime) -> str:
        # 4.3 has no such method, and keeps them
        return dt.strftime(self.FORMAT_DATE.format(f'{dt.microsecond // 1000:03d}'))


#: suffixes of candump's texts, and of PEAK's; everything else is python-can's
_CANDUMP = ('.log', '.txt', '.candump')
_PEAK = '.trc'
_TEXT_READERS: dict[str, Any] = {
    '.asc': can.ASCReader, '.csv': can.CSVReader}
#: by which number the tools of a format call what python-can calls 0; else they agree
_FIRST = {'.asc': 1}
_BINARY_READERS = ('.blf', '.db', '.mf4', '.pcap', '.pcapng')
_WRITERS: dict[str, Callable[[Path], Any]] = {
    '.asc': lambda path: VectorWriter(open_text(path)),
    '.blf': lambda path: can.BLFWriter(open_binary(path)),
    '.csv': lambda path: can.CSVWriter(open_text(path)),
    '.db': Database,
    '.trc': lambda path: can.TRCWriter(open_text(path))}
#: what the formats cannot hold
LOSSES = {
    '.csv': ('which bus a frame was on', 'its direction', 'that a frame is one of CAN FD'),
    '.db': ('which bus a frame was on', 'its direction', 'that a frame is one of CAN FD'),
    '.trc': ('error frames', 'remote frames', 'CAN FD frames', 'the names of buses'),
    '.asc': ('the details of error frames', 'the names of buses'),
    '.blf': ('the names of buses',),
}
#: a format without buses holds those of one only
ONE_BUS = ('.csv', '.db')
WRITABLE = tuple(sorted(('.log', *_WRITERS)))
_TEXTS = (*_CANDUMP, _PEAK, *_TEXT_READERS)
READABLE = tuple(sorted((*_TEXTS, *_BINARY_READERS)))


class _Head(NamedTuple):
    """The beginning of a format, and the name of a file that begins otherwise."""

    pattern: re.Pattern[bytes]
    otherwise: str


#: bytes that a pattern of a binary format looks at, at most
_MAGIC = 16
_HEADS = {
    '.asc': _Head(re.compile(rb'\s*(?:date|base|begin|no|internal|//|\d+\.\d+\s)', re.IGNORECASE),
                  'this is no .asc trace of Vector: it begins with neither "date" nor "base"'),
    '.csv': _Head(re.compile(rb'timestamp,arbitration_id,'),
                  'this is no .csv trace of python-can: its first line is not '
                  '"timestamp,arbitration_id,…"'),
    '.trc': _Head(re.compile(rb'\s*(?:;|\d+\)?\s)'),
                  'this is no .trc trace of PEAK: its first line is neither a comment (;) nor a '
                  'numbered entry'),
    '.blf': _Head(re.compile(b'LOGG'), 'this is no .blf trace of Vector'),
    '.db': _Head(re.compile(b'SQLite format 3'), 'this is no .db trace of python-can'),
    '.mf4': _Head(re.compile(MEASURED_BEGINNINGS), 'this is no .mf4 trace (ASAM MDF 4)'),
    '.pcap': _Head(re.compile(BEGINNINGS), 'this is no capture of Wireshark'),
    '.pcapng': _Head(re.compile(BEGINNINGS), 'this is no capture of Wireshark'),
}
#: first lines of texts that have a suffix of ours, and what makes a trace of them that is read
_STRANGERS = (
    (re.compile(r'\W*\*{3}BUSMASTER'), 'this is a .log of BUSMASTER, which editcap (of Wireshark) '
     'turns into a .pcapng: editcap FILE.log FILE.pcapng'),
    (re.compile(r'Time Stamp,ID,Extended,'), 'this is a .csv of SavvyCAN (GVRET), which SavvyCAN '
     'saves as a .log of candump'),
    (re.compile(r'//-+\s+Microchip'), 'this is a .log of Microchip (CAN BUS Analyzer), which '
     'SavvyCAN reads, and saves as a .log of candump'),
    (re.compile(r'[0-9]+\.[0-9]+ [0-9]?(?:CXX|[RT](?:11|29)) '), 'this is a trace of OVMS (CRTD), '
     'which SavvyCAN reads, and saves as a .log of candump'),
    (re.compile(r'@ TEXT @'), 'this is a .trc of CAN Bus Analyzer, which SavvyCAN reads, and '
     'saves as a .log of candump'),
)
#: kinds of entries that are passed over and named
_PASSED_MAX = 6
#: lines before the first frame that are kept, to go on reading behind a damaged line
_HEADER_MAX = 200

Complain = Callable[[str], None]


class UnknownFormat(ValueError):
    """No reader or writer for this suffix."""


# -- reading --------------------------------------------------------------------------------------


def read_records(path: Path, complain: Complain) -> Iterator[Record]:
    """
    Read a trace, entry by entry.

    :param path: ``-``: candump's text on standard input. A further suffix ``.gz`` is understood.
    :param complain: called with a line for everything that cannot be read.
    :raises UnknownFormat: no format has this suffix.
    :raises OSError: the file cannot be read.
    """
    if str(path) == '-':
        if isinstance(sys.stdin, io.TextIOWrapper):
            sys.stdin.reconfigure(errors='replace')     # as that of a file
        yield from _candump_records(sys.stdin, complain)
        return
    suffix, packed = check_readable(path)
    if suffix in _BINARY_READERS and not packed:
        if _begins_as(_HEADS[suffix], path, complain):
            yield from _BINARY_RECORDS[suffix](path, complain)
        return
    with _open_text(path, packed) as stream:
        try:
            begin = list(itertools.islice(stream, 1))
            while begin and not begin[-1].strip() and len(begin) < _HEADER_MAX:
                begin += itertools.islice(stream, 1)
            if not begin or not begin[-1].strip():
                return
            first = head_text = begin[-1]
            if first.startswith('//'):      # a comment; the name stands below it
                begin += itertools.islice(stream, 1)
                head_text += begin[-1]
            stranger = next((told for pattern, told in _STRANGERS if pattern.match(head_text)), '')
            head = _HEADS.get(suffix)
            lines = itertools.chain(begin, stream)
            if stranger:
                complain(stranger)
            elif head is None:
                yield from _candump_records(lines, complain)
            elif not head.pattern.match(first.encode()):
                complain(head.otherwise)
            elif suffix == _PEAK:
                yield from _peak_records(lines, complain)
            else:
                yield from _text_records(suffix, lines, complain)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            complain(command_sentences.rest_not_unpacked(error=error))


def _begins_as(head: _Head, path: Path, complain: Complain) -> bool:
    """Return whether a file begins as those of its suffix; an empty one does not."""
    with path.open('rb') as file:
        begin = file.read(_MAGIC)
    if begin and not head.pattern.match(begin):
        complain(head.otherwise)
    return head.pattern.match(begin) is not None


def check_readable(path: Path) -> tuple[str, bool]:
    """
    Check that there is a trace that can be read, before anything else is started.

    :return: the suffix of the format, and whether the file is packed.
    :raises UnknownFormat: no format has this suffix.
    :raises OSError: the file cannot be read.
    """
    packed = path.suffix.lower() == '.gz'
    suffix = Path(path.stem).suffix.lower() if packed else path.suffix.lower()
    if suffix not in (_TEXTS + (() if packed else _BINARY_READERS)):
        raise UnknownFormat(command_sentences.unknown_suffix(
            path=path, suffix=suffix or '(none)', known=', '.join(READABLE)))
    path.open('rb').close()
    return suffix, packed


def _open_text(path: Path, packed: bool) -> TextIO:
    if packed:
        return io.TextIOWrapper(gzip.open(path, 'rb'), encoding='utf-8-sig',
                                errors='replace')
    return path.open(encoding='utf-8-sig', errors='replace')


def _candump_records(stream: Iterable[str], complain: Complain) -> Iterator[Record]:
    parse = parse_line
    number = 0
    record: Record | None = None
    for line in _from_differences(iter(stream), complain):
        number += 1
        try:
            record = parse(line)
        except ValueError as error:
            # `candump -e` explains an error frame on the lines behind it
            if record is None or record.kind is not RecordKind.ERROR or line[0] != '\t':
                complain(f'line {number}: {error}')
            continue
        if record is not None:
            yield record


#: the time of a line of ``candump -t d`` or ``-t z``
_SHORT_TIME = re.compile(r' \((\d{3}\.\d{6})\) ')
#: lines by which times since the start (they rise) are told from those since the last line
_LOOKED_AT = 32
#: of so many steps one falls or stays, at least, where times are differences
_FALLS = 8


def _from_differences(lines: Iterator[str], complain: Complain) -> Iterator[str]:
    """Return lines with times from the beginning, where ``candump -t d`` wrote differences."""
    head = list(itertools.islice(lines, 1))
    if not head or _SHORT_TIME.match(head[0]) is None:
        return itertools.chain(head, lines)
    head += itertools.islice(lines, _LOOKED_AT)
    times = [float(found[1]) for found in map(_SHORT_TIME.match, head) if found is not None]
    falls = sum(later <= earlier for earlier, later in itertools.pairwise(times))
    lines = itertools.chain(head, lines)
    if not falls or falls * _FALLS < len(times) - 1:
        return lines
    complain(command_sentences.times_added_up())
    return _added_up(lines)


def _added_up(lines: Iterator[str]) -> Iterator[str]:
    elapsed = 0.0
    for line in lines:
        timed = _SHORT_TIME.match(line)
        if timed is not None:
            elapsed += float(timed[1])
            line = f' ({elapsed:.6f}) {line[timed.end():]}'
        yield line


class _Lines:
    """Lines of a file for a reader of python-can, which accepts only what looks like a file."""

    def __init__(self, lines: Iterator[str]) -> None:
        self._lines = lines
        self.taken: list[str] = []
        self.failure: Exception | None = None   # of the file, not of a line

    def __iter__(self) -> '_Lines':
        return self

    def __next__(self) -> str:
        try:
            line = next(self._lines)
        except StopIteration:
            raise
        except Exception as error:
            self.failure = error
            raise
        if len(self.taken) < _HEADER_MAX:
            self.taken.append(line)
        return line

    def read(self, _: int = -1) -> str:
        return next(self, '')

    def write(self, _: str) -> int:
        raise OSError(command_sentences.trace_read_only())

    def close(self) -> None:
        """Leave the file open: its opener closes it."""


class _Numbered:
    """
    Lines that are counted.

    :ivar lines: the lines; counting costs no step of Python for a line.
    """

    def __init__(self, lines: Iterable[str]) -> None:
        self._count = itertools.count(1)
        self._asked = 0     # so often the count went on without a line
        self.lines = itertools.compress(lines, self._count)

    def number(self) -> int:
        """Return how many lines were read."""
        self._asked += 1
        return next(self._count) - self._asked


class _Heard(logging.Handler):
    """
    Handles what the readers of python-can only log.

    :param complain: called with it, without the name of the reader.
    """

    def __init__(self, complain: Complain) -> None:
        super().__init__(logging.WARNING)
        self._complain = complain

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        self._complain('' if 'Failed to parse' in text else text.partition('Reader: ')[2] or text)


def _tell_passed(passed: Counter[str], complain: Complain) -> None:
    """Report, once, what has no entry."""
    if passed:
        complain('passed over: ' + ', '.join(
            f'{kind} ({count})' for kind, count in passed.most_common(_PASSED_MAX))
            + (', …' if len(passed) > _PASSED_MAX else ''))


def _blf_records(path: Path, complain: Complain) -> Iterator[Record]:
    passed: Counter[str] = Counter()
    with path.open('rb') as file:
        yield from _possible(read_blf(file, complain, passed), complain)
    _tell_passed(passed, complain)


def _capture_records(path: Path, complain: Complain) -> Iterator[Record]:
    passed: Counter[str] = Counter()
    yield from _possible(read_capture(path, complain, passed), complain)
    _tell_passed(passed, complain)


def _possible(records: Iterator[Record], complain: Complain) -> Iterator[Record]:
    """Yield the entries that are possible; report the others."""
    for number, record in enumerate(records, 1):
        try:
            record = checked(record)
        except ValueError as error:
            complain(f'entry {number}: {error}')
        else:
            yield record


def _tell_wrong(suffix: str, lines: _Numbered, complain: Complain, text: str) -> None:
    """Report what is wrong with the last line; '': it is no entry."""
    complain(f'line {lines.number()}: {text or f"no entry of a {suffix} trace"}')


def _peak_records(stream: Iterable[str], complain: Complain) -> Iterator[Record]:
    numbered = _Numbered(stream)
    passed: Counter[str] = Counter()
    wrong = partial(_tell_wrong, _PEAK, numbered, complain)
    for record in read_peak(numbered.lines, wrong, passed):
        try:
            record = checked(record)
        except ValueError as error:
            wrong(str(error))
        else:
            yield record
    _tell_passed(passed, complain)


def _text_records(suffix: str, stream: Iterable[str], complain: Complain) -> Iterator[Record]:
    """
    Read by a reader of python-can, which ends at the first line that it does not understand.

    Then a new one gets the head of the file again, and continues behind that line.
    """
    header: list[str] = []
    known = False
    reader, first = _TEXT_READERS[suffix], _FIRST.get(suffix, 0)
    numbered = _Numbered(stream)
    aside: deque[Record] = deque()      # that the reader does not know, before its next one
    passed: Counter[str] = Counter()
    stream = of_vector(numbered.lines, aside, passed) if suffix == '.asc' else numbered.lines
    wrong = partial(_tell_wrong, suffix, numbered, complain)
    logger = logging.getLogger('can')
    heard = _Heard(wrong)
    logger.addHandler(heard)
    logger.propagate = False    # reported once
    try:
        for line in stream:     # readers complain of a file without a frame
            lines = _Lines(itertools.chain(header, (line,), stream))
            try:
                for message in reader(lines):
                    if not known:
                        header, known = lines.taken[:-1], True
                    while aside:
                        yield aside.popleft()
                    try:
                        record = _record(message, first)
                    except ValueError as error:
                        wrong(str(error))
                        continue
                    yield record
                break
            except Exception:  # noqa: BLE001  readers raise whatever a line makes them
                if lines.failure is not None:
                    raise lines.failure from None
                wrong('')
                if not known:
                    header = lines.taken[:-1]
        yield from aside
        _tell_passed(passed, complain)
    finally:
        logger.propagate = True
        logger.removeHandler(heard)


def _measured_records(path: Path, complain: Complain) -> Iterator[Record]:
    passed: Counter[str] = Counter()
    yield from _possible(read_measured(path, complain, passed), complain)
    _tell_passed(passed, complain)


def _database_records(path: Path, complain: Complain) -> Iterator[Record]:
    """Read a database of python-can's writer."""
    with closing(sqlite3.connect(f'{path.absolute().as_uri()}?mode=ro', uri=True)) as database:
        try:
            rows = database.execute('SELECT ts, arbitration_id, extended, remote, error, data '
                                    'FROM messages')
            for number, (time, identifier, extended, remote, error, data) in enumerate(rows, 1):
                try:
                    kind = (RecordKind.ERROR if error else RecordKind.REMOTE if remote
                            else _kind_by_length(data or b''))
                    record = checked(Record(float(time), '', int(identifier), bytes(data or b''),
                                            bool(extended), kind))
                except TypeError:       # a column is empty, or of another type
                    complain(command_sentences.no_db_entry(number=number))
                except ValueError as failure:
                    complain(f'entry {number}: {failure}')
                else:
                    yield record
        except sqlite3.Error as failure:
            complain(command_sentences.rest_not_read(failure=failure))


_BINARY_RECORDS: dict[str, Callable[[Path, Complain], Iterator[Record]]] = {
    '.blf': _blf_records, '.db': _database_records, '.mf4': _measured_records,
    '.pcap': _capture_records, '.pcapng': _capture_records}


def _kind_by_length(data: bytes) -> RecordKind:
    """Return the kind of an entry in a format that does not keep it."""
    return RecordKind.FD if len(data) in _FD_LENGTHS else DATA


def _record(message: can.Message, first: int) -> Record:
    """Return an entry; this format counts channels from ``first``, python-can from 0."""
    channel = message.channel
    record = record_of(message, channel + first if isinstance(channel, int)
                       else channel if isinstance(channel, str) else '')
    if len(record.data) > _CLASSICAL_MAX and record.kind is DATA:
        record = record._replace(kind=_kind_by_length(record.data))
    return checked(record)


# -- writing --------------------------------------------------------------------------------------


class TraceWriter:
    """
    Writes a trace in the format of its suffix.

    :param channels: the buses, in the order of the parameter file: formats without names number
        them.
    :param directions: in a .log; without them, Wireshark reads it.
    :raises UnknownFormat: no format has this suffix, or it cannot hold several buses.
    :raises OSError: the file cannot be written.
    """

    def __init__(self, path: Path, channels: Sequence[str], *, directions: bool = True) -> None:
        check_writable(path, len(channels))
        self.path = path
        self._numbers = {channel: number for number, channel in enumerate(channels)}
        self._writer: Any = None
        self._file: TextIO | None = None
        self._directions = directions
        # python-can logs a line for each of the others
        self._only_data = path.suffix.lower() == '.trc'
        if path.suffix.lower() == '.log':
            self._file = open_text(path)
        else:
            self._writer = _WRITERS[path.suffix.lower()](path)

    def write(self, record: Record) -> None:
        """Write an entry."""
        if self._file is not None:
            self._file.write(format_record(
                record if self._directions else record._replace(sent=None)))
            return
        if self._only_data and record.kind is not DATA:
            return
        self._writer.on_message_received(message_of(
            record, self._numbers.get(str(record.channel), 0)))

    @property
    def size(self) -> int:
        """The bytes written so far; with buffers or packing, this grows late."""
        if self._file is not None:
            return self._file.tell()
        try:
            return int(self._writer.file_size())
        except (AttributeError, NotImplementedError):
            return self.path.stat().st_size

    def flush(self) -> None:
        """
        Pass what was written to the system, where the format allows it.

        :raises OSError: it cannot be written.
        """
        if self._file is not None:
            self._file.flush()
        elif isinstance(self._writer, Database):
            self._writer.check()

    def close(self) -> None:
        """
        Finish the file.

        :raises OSError: not all of it is written.
        """
        if self._file is not None:
            self._file.close()
        else:
            self._writer.stop()


def check_writable(path: Path, buses: int) -> None:
    """
    Check that a trace of so many buses can be written in the format of this suffix.

    :raises UnknownFormat: it cannot.
    """
    suffix = path.suffix.lower()
    if suffix not in WRITABLE:
        raise UnknownFormat(command_sentences.suffix_not_written(
            path=path, suffix=suffix or '(none)', known=', '.join(WRITABLE)))
    if suffix in ONE_BUS and buses > 1:
        raise UnknownFormat(command_sentences.suffix_of_one_bus(
            path=path, suffix=suffix, buses=buses))


# -- the texts of candump -------------------------------------------------------------------------

Parsed = TypeVar('Parsed')
#: linux/can.h, in identifiers of eight digits
_ERROR_FLAG = 0x20000000
_CLASSICAL_MAX = 8
_LENGTH_MAX = 64
#: bytes of a frame that no classical one has
_FD_LENGTHS = (12, 16, 20, 24, 32, 48, 64)
#: DLCs of classical frames that mean eight bytes, too, as ``candump -8`` writes them
_LONG_DLC = '9ABCDEF'
_LONG_LENGTHS = tuple(f'{{{digit}}}' for digit in _LONG_DLC)
#: the highest identifiers as they are written; lower ones come before them in the alphabet, too
_EXTENDED_DIGITS, _STANDARD_DIGITS = '1FFFFFFF', '7FF'
#: s since 1970: the end of the year 9999. Beyond, a float soon makes two frames one
_TIME_MAX = 253_402_300_800.0
_DATE = re.compile(r'\([0-9]{4}-[0-9]{2}-[0-9]{2} [0-9]{2}:[0-9]{2}:[0-9]{2}\.[0-9]{6}\)')
_DIRECTIONS = {'R': False, 'T': True, 'RX': False, 'TX': True}
#: characters of a line of eight bytes, with room to spare; a longer one is no frame
LINE_MAX = 400


def format_record(record: Record) -> str:
    """Return an entry as a line of ``candump -L``, with its direction where that is known."""
    time, channel, identifier, data, extended, kind, sent = record
    direction = '' if sent is None else ' T' if sent else ' R'
    if kind is DATA:
        width = 8 if extended else 3
        content = f'{identifier:0{width}X}#{data.hex().upper()}'
    elif kind is RecordKind.ERROR:
        content = f'{identifier & EXTENDED_IDENTIFIER_MAX | _ERROR_FLAG:08X}#{data.hex().upper()}'
    elif kind is RecordKind.REMOTE:
        content = f'{identifier:0{8 if extended else 3}X}#R'
    else:
        content = f'{identifier:0{8 if extended else 3}X}##0{data.hex().upper()}'
    return f'({time:.6f}) {channel} {content}{direction}\n'


def parse_line(line: str) -> Record | None:
    """
    Read a line of either text.

    :return: None for a line without content.
    :raises ValueError: it is no line of candump.
    """
    words = line.split()
    count = len(words)
    if (count == 3 or count == 4) and words[0][0] == '(':
        # the fast path: a data frame in a log file
        digits, hash_sign, data = words[2].partition('#')
        width = len(digits)
        if (width == 8 and '00000000' <= digits <= _EXTENDED_DIGITS
                or width == 3 and '000' <= digits <= _STANDARD_DIGITS):
            try:
                time = float(words[0][1:-1])
                number, content = int(digits, 16), bytes.fromhex(data)
            except ValueError:
                pass    # not quite so plain
            else:
                if len(content) <= _CLASSICAL_MAX and 0.0 <= time < _TIME_MAX and hash_sign:
                    return Record(time, words[1], number, content, width == 8, DATA,
                                  _DIRECTIONS.get(words[3]) if count == 4 else None)
        if hash_sign:
            return _logged(words, digits, data)
    if not words:
        return None
    if len(line) > LINE_MAX:
        raise ValueError('too long')
    if words[0] == '(' and count > 1:   # a time that was filled up with blanks
        words[:2] = [f'({words[1]}']
    if len(words) > 2 and '#' in words[2] and words[0][:1] == '(':
        # what tools and people write behind a frame is no part of it, unless it is another one
        if any(mark in word for word in words[3:] for mark in '#('):
            raise ValueError(command_sentences.frames_in_a_line())
        digits, _, data = words[2].partition('#')
        return _logged(words, digits, data)
    return _shown(words)


def _logged(words: list[str], identifier: str, data: str) -> Record:
    """Read a line of a log file."""
    time, number = _time(words[0]), _number(identifier)
    extended = len(identifier) == 8
    sent = _DIRECTIONS.get(words[3]) if len(words) > 3 else None
    kind = DATA
    if data[-2:-1] == '_' and data[-1] in _LONG_DLC and len(data) == 2 * _CLASSICAL_MAX + 2:
        data = data[:-2]        # `candump -8`: eight bytes whose DLC is higher
    if data[:1] in ('#', 'R', 'r'):
        kind = RecordKind.FD if data[0] == '#' else RecordKind.REMOTE
        data = data[2:] if data[0] == '#' else ''
    elif extended and number & _ERROR_FLAG:
        kind, number = RecordKind.ERROR, number & EXTENDED_IDENTIFIER_MAX
    return _checked(Record(time, words[1], number, _content(data), extended, kind, sent),
                    len(identifier))


def _shown(words: list[str]) -> Record:
    """Read a line of the screen."""
    place = next((index for index, word in enumerate(words)
                  if word[:1] == '[' and word[-1:] == ']' and word[1:-1].isdecimal()
                  or word in _LONG_LENGTHS), None)
    if place is None or place < 2:
        raise ValueError(command_sentences.no_candump_line())
    before, length, after = words[:place], words[place], words[place + 1:]
    time = 0.0
    if before[0][:1] == '(':
        word = before.pop(0)
        time = _time(word) if word[-1:] == ')' else _date(f'{word} {before.pop(0)}')
        if len(before) < 2:
            raise ValueError(command_sentences.no_candump_line())
    identifier = before[-1]
    sent = next((_DIRECTIONS[word] for word in before[1:-1] if word in _DIRECTIONS), None)
    number, extended = _number(identifier), len(identifier) == 8
    # "[8]" is a classical frame, "[08]" one of CAN FD
    kind = RecordKind.FD if len(length) == 4 else DATA
    size = _CLASSICAL_MAX if length in _LONG_LENGTHS else int(length[1:-1])
    if after[:1] == ['remote']:
        kind, size = RecordKind.REMOTE, 0
    elif extended and number & _ERROR_FLAG:
        kind, number = RecordKind.ERROR, number & EXTENDED_IDENTIFIER_MAX
    content = _content(''.join(after[:size]))
    if len(content) != size:
        raise ValueError(command_sentences.data_bytes_differ(found=len(content), wanted=size))
    return _checked(Record(time, before[0], number, content, extended, kind, sent),
                    len(identifier))


def _read(parse: Callable[[str], Parsed], text: str, what: str) -> Parsed:
    try:
        return parse(text)
    except ValueError:
        raise ValueError(f'{text!r} is no {what}') from None


def _time(word: str) -> float:
    return _read(float, word[1:-1], 'time')


def _date(words: str) -> float:
    """Read the date and time of ``candump -t A``, in the time zone where it was written."""
    try:
        if _DATE.fullmatch(words):
            return datetime.fromisoformat(words[1:-1]).timestamp()
    except (ValueError, OverflowError, OSError):
        pass
    raise ValueError(command_sentences.no_time(word=repr(words.strip('()'))))


def _number(digits: str) -> int:
    return _read(lambda text: int(text, 16), digits, 'identifier')


def _content(digits: str) -> bytes:
    return _read(bytes.fromhex, digits, 'hexadecimal data')


def _checked(record: Record, digits: int) -> Record:
    if digits not in (3, 8):
        raise ValueError(command_sentences.identifier_digits(digits=digits))
    return checked(record)


def checked(record: Record) -> Record:
    """
    Return an entry, after checking that it is possible at all.

    :raises ValueError: it is not.
    """
    longest = _LENGTH_MAX if record.kind is RecordKind.FD else _CLASSICAL_MAX
    if len(record.data) > longest and record.kind is not RecordKind.STATE:
        raise ValueError(f'{len(record.data)} data bytes')
    highest = EXTENDED_IDENTIFIER_MAX if record.extended else STANDARD_IDENTIFIER_MAX
    if record.kind is not RecordKind.ERROR and not 0 <= record.identifier <= highest:
        raise ValueError(f'identifier {record.identifier:X}h')
    if not -_TIME_MAX < record.time < _TIME_MAX:    # nor NaN
        raise ValueError(f'time {record.time}')
    return record
