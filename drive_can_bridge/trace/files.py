# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Trace files: which formats there are, what each of them loses, reading and writing them.

Formats are python-can's, by suffix; candump's texts have a reader and writer of their own
(:mod:`.candump`). What is damaged is told and left out: one line does not cost a trace.
"""

from collections.abc import Callable, Iterator, Sequence
import gzip
import io
import itertools
import logging
from pathlib import Path
import sys
from typing import Any, TextIO

import can

from drive_can_bridge.core.record import Record
from drive_can_bridge.trace import candump
from drive_can_bridge.trace.output import Database, open_binary, open_text
from drive_can_bridge.transport.messages import message_of, record_of

#: suffixes of candump's texts; everything else is python-can's
_CANDUMP = ('.log', '.txt', '.candump')
_TEXT_READERS: dict[str, Any] = {
    '.asc': can.ASCReader, '.csv': can.CSVReader, '.trc': can.TRCReader}
_BINARY_READERS = ('.blf', '.db', '.mf4')
_WRITERS: dict[str, Callable[[Path], Any]] = {
    '.asc': lambda path: can.ASCWriter(open_text(path)),
    '.blf': lambda path: can.BLFWriter(open_binary(path)),
    '.csv': lambda path: can.CSVWriter(open_text(path)),
    '.db': Database,
    '.trc': lambda path: can.TRCWriter(open_text(path))}
#: what the formats cannot hold
LOSSES = {
    '.csv': ('which bus a frame was on', 'its direction'),
    '.db': ('which bus a frame was on', 'its direction'),
    '.trc': ('error frames', 'the names of buses'),
    '.asc': ('the details of error frames', 'the names of buses'),
    '.blf': ('the names of buses',),
}
#: a format without buses holds those of one only
ONE_BUS = ('.csv', '.db')
WRITABLE = tuple(sorted(('.log', *_WRITERS)))
READABLE = tuple(sorted((*_CANDUMP, *_TEXT_READERS, *_BINARY_READERS)))
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
    :param complain: takes a line for everything that cannot be read.
    :raises UnknownFormat: no format has this suffix.
    :raises OSError: the file cannot be read.
    """
    if str(path) == '-':
        yield from _candump_records(sys.stdin, complain)
        return
    suffix, packed = check_readable(path)
    if suffix in _BINARY_READERS and not packed:
        yield from _binary_records(path, complain)
        return
    with _open_text(path, packed) as stream:
        try:
            if suffix in _CANDUMP:
                yield from _candump_records(stream, complain)
            else:
                yield from _text_records(_TEXT_READERS[suffix], stream, complain)
        except (EOFError, gzip.BadGzipFile) as error:
            complain(f'the rest cannot be unpacked: {error}')


def check_readable(path: Path) -> tuple[str, bool]:
    """
    Look whether there is a trace that can be read, before anything else is begun.

    :return: the suffix that says the format, and whether the file is packed.
    :raises UnknownFormat: no format has this suffix.
    :raises OSError: the file cannot be read.
    """
    packed = path.suffix.lower() == '.gz'
    suffix = Path(path.stem).suffix.lower() if packed else path.suffix.lower()
    if suffix not in (_CANDUMP + tuple(_TEXT_READERS) + (() if packed else _BINARY_READERS)):
        raise UnknownFormat(f'{path}: no trace format has the suffix {suffix or "(none)"!s}; '
                            f'known are {", ".join(READABLE)}, and .gz behind those of text')
    path.open('rb').close()
    return suffix, packed


def _open_text(path: Path, packed: bool) -> TextIO:
    if packed:
        return io.TextIOWrapper(gzip.open(path, 'rb'), encoding='utf-8-sig',
                                errors='replace')
    return path.open(encoding='utf-8-sig', errors='replace')


def _candump_records(stream: TextIO, complain: Complain) -> Iterator[Record]:
    parse = candump.parse_line
    number = 0
    for line in stream:
        number += 1
        try:
            record = parse(line)
        except ValueError as error:
            complain(f'line {number}: {error}')
            continue
        if record is not None:
            yield record


class _Lines:
    """Lines of a file for a reader of python-can, which takes only what looks like a file."""

    def __init__(self, lines: Iterator[str]) -> None:
        self._lines = lines
        self.taken: list[str] = []
        self.exhausted = False

    def __iter__(self) -> '_Lines':
        return self

    def __next__(self) -> str:
        try:
            line = next(self._lines)
        except StopIteration:
            self.exhausted = True
            raise
        if len(self.taken) < _HEADER_MAX:
            self.taken.append(line)
        return line

    def read(self, _: int = -1) -> str:
        return next(self, '')

    def write(self, _: str) -> int:
        raise OSError('a trace is read only')

    def close(self) -> None:
        """Leave the file open: whoever opened it closes it."""


class _Heard(logging.Handler):
    """Hears what the readers of python-can only log."""

    def __init__(self, complain: Complain) -> None:
        super().__init__(logging.WARNING)
        self._complain = complain

    def emit(self, record: logging.LogRecord) -> None:
        self._complain(record.getMessage())


def _text_records(reader: Any, stream: TextIO, complain: Complain) -> Iterator[Record]:
    """
    Read by a reader of python-can, which ends at the first line that it does not understand.

    Then a new one is given the head of the file again, and goes on behind that line.
    """
    header: list[str] = []
    known = False
    logger = logging.getLogger('can')
    heard = _Heard(complain)
    logger.addHandler(heard)
    try:
        while True:
            lines = _Lines(itertools.chain(header, stream))
            try:
                for message in reader(lines):
                    if not known:
                        header, known = lines.taken[:-1], True
                    record = _record(message)
                    if reader is can.TRCReader and isinstance(record.channel, int):
                        # counts buses from 1, also where it names none
                        record = record._replace(channel=record.channel - 1)
                    yield record
                return
            except Exception as error:  # noqa: BLE001  readers raise whatever a line makes them
                complain(f'{type(error).__name__}: {error}')
                if lines.exhausted:
                    return
                if not known:
                    header = lines.taken[:-1]
    finally:
        logger.removeHandler(heard)


def _binary_records(path: Path, complain: Complain) -> Iterator[Record]:
    """Read a binary format: behind something damaged there is nothing to hold on to."""
    try:
        with can.LogReader(str(path)) as reader:
            for message in reader:
                yield _record(message)
    except Exception as error:  # noqa: BLE001  readers raise whatever a file makes them
        complain(f'the rest cannot be read: {type(error).__name__}: {error}')


def _record(message: can.Message) -> Record:
    channel = message.channel
    return candump.checked(record_of(message, channel if isinstance(channel, (str, int)) else ''))


# -- writing --------------------------------------------------------------------------------------


class TraceWriter:
    """
    Writes a trace in the format of its suffix.

    :param channels: the buses, in the order of the parameter file: formats without names number
        them.
    :raises UnknownFormat: no format has this suffix, or it cannot hold several buses.
    :raises OSError: the file cannot be written.
    """

    def __init__(self, path: Path, channels: Sequence[str]) -> None:
        check_writable(path, len(channels))
        self.path = path
        self._numbers = {channel: number for number, channel in enumerate(channels)}
        self._writer: Any = None
        self._file: TextIO | None = None
        if path.suffix.lower() == '.log':
            self._file = open_text(path)
        else:
            self._writer = _WRITERS[path.suffix.lower()](path)

    def write(self, record: Record) -> None:
        """Write an entry."""
        if self._file is not None:
            self._file.write(candump.format_record(record))
            return
        self._writer.on_message_received(message_of(
            record, self._numbers.get(str(record.channel), 0)))

    @property
    def size(self) -> int:
        """Bytes written so far; formats that buffer or pack tell late."""
        if self._file is not None:
            return self._file.tell()
        try:
            return int(self._writer.file_size())
        except (AttributeError, NotImplementedError):
            return self.path.stat().st_size

    def flush(self) -> None:
        """
        Hand what was written to the system, where the format lets it.

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
    Look whether a trace of so many buses can be written in the format of this suffix.

    :raises UnknownFormat: it cannot.
    """
    suffix = path.suffix.lower()
    if suffix not in WRITABLE:
        raise UnknownFormat(f'{path}: no trace is written with the suffix {suffix or "(none)"}; '
                            f'known are {", ".join(WRITABLE)}')
    if suffix in ONE_BUS and buses > 1:
        raise UnknownFormat(f'{path}: {suffix} does not tell buses apart, and there are {buses}; '
                            f'choose .log')
