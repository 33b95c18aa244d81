# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Trace files, read entry by entry: ``.blf``, ``.mf4`` and ``.trc`` by readers of ours.

One damaged line does not cost a trace. Errors of files name the file.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from functools import partial
import gzip
import io
import itertools
import logging
from pathlib import Path
import sqlite3
import sys
from typing import Any, TextIO
import zlib

import can

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.frame import DATA, Record, RecordKind
from drive_can_bridge.trace.blf import read_blf
from drive_can_bridge.trace.candump import candump_records
from drive_can_bridge.trace.captures import read_capture
from drive_can_bridge.trace.formats import (
    begins_as, BINARY, check_readable, checked, CLASSICAL_MAX, Complain, FD_LENGTHS, HEADS, PEAK,
    STRANGERS)
from drive_can_bridge.trace.measured import read_measured
from drive_can_bridge.trace.peak import read_peak
from drive_can_bridge.trace.vector import of_vector
from drive_can_bridge.transport.tap import record_of

_TEXT_READERS: dict[str, Any] = {
    '.asc': can.ASCReader, '.csv': can.CSVReader}
#: by which number the tools of a format call what python-can calls 0; else they agree
_FIRST = {'.asc': 1}
#: kinds of entries that are passed over and named
_PASSED_MAX = 6
#: lines before the first frame that are kept, to go on reading behind a damaged line
_HEADER_MAX = 200


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
        yield from candump_records(sys.stdin, complain)
        return
    suffix, packed = check_readable(path)
    if suffix in BINARY and not packed:
        if begins_as(suffix, path, complain):
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
            stranger = next((told for pattern, told in STRANGERS if pattern.match(head_text)), '')
            head = HEADS.get(suffix)
            lines = itertools.chain(begin, stream)
            if stranger:
                complain(stranger)
            elif head is None:
                yield from candump_records(lines, complain)
            elif not head.pattern.match(first.encode()):
                complain(head.otherwise)
            elif suffix == PEAK:
                yield from _peak_records(lines, complain)
            else:
                yield from _text_records(suffix, lines, complain)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            complain(command_sentences.rest_not_unpacked(error=error))


def _open_text(path: Path, packed: bool) -> TextIO:
    if packed:
        return io.TextIOWrapper(gzip.open(path, 'rb'), encoding='utf-8-sig',
                                errors='replace')
    return path.open(encoding='utf-8-sig', errors='replace')


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


def _entries(read: Callable[[Path, Complain, Counter[str]], Iterator[Record]], path: Path,
             complain: Complain) -> Iterator[Record]:
    """Yield the entries that are possible; report the others."""
    passed: Counter[str] = Counter()
    for number, record in enumerate(read(path, complain, passed), 1):
        try:
            record = checked(record)
        except ValueError as error:
            complain(f'entry {number}: {error}')
        else:
            yield record
    _tell_passed(passed, complain)


def _tell_wrong(suffix: str, lines: _Numbered, complain: Complain, text: str) -> None:
    """Report what is wrong with the last line; '': it is no entry."""
    complain(f'line {lines.number()}: {text or f"no entry of a {suffix} trace"}')


def _peak_records(stream: Iterable[str], complain: Complain) -> Iterator[Record]:
    numbered = _Numbered(stream)
    passed: Counter[str] = Counter()
    wrong = partial(_tell_wrong, PEAK, numbered, complain)
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
    '.blf': partial(_entries, read_blf), '.db': _database_records,
    '.mf4': partial(_entries, read_measured),
    **dict.fromkeys(('.pcap', '.pcapng'), partial(_entries, read_capture))}


def _kind_by_length(data: bytes) -> RecordKind:
    """Return the kind of an entry in a format that does not keep it."""
    return RecordKind.FD if len(data) in FD_LENGTHS else DATA


def _record(message: can.Message, first: int) -> Record:
    """Return an entry; this format counts channels from ``first``, python-can from 0."""
    channel = message.channel
    record = record_of(message, channel + first if isinstance(channel, int)
                       else channel if isinstance(channel, str) else '')
    if len(record.data) > CLASSICAL_MAX and record.kind is DATA:
        record = record._replace(kind=_kind_by_length(record.data))
    return checked(record)


