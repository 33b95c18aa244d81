# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Trace files, written in the format of their suffix."""

from collections.abc import Callable, Sequence
from datetime import datetime
from errno import EIO
import io
from pathlib import Path
from typing import Any, TextIO

import can

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.frame import DATA, Record
from drive_can_bridge.trace.candump import format_record
from drive_can_bridge.trace.formats import check_writable
from drive_can_bridge.transport.tap import message_of

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


_WRITERS: dict[str, Callable[[Path], Any]] = {
    '.asc': lambda path: VectorWriter(open_text(path)),
    '.blf': lambda path: can.BLFWriter(open_binary(path)),
    '.csv': lambda path: can.CSVWriter(open_text(path)),
    '.db': Database,
    '.trc': lambda path: can.TRCWriter(open_text(path))}


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
