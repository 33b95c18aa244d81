# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Files that traces and tables are written to: whatever goes wrong, it is known with which one."""

from errno import EIO
import io
from pathlib import Path
from typing import Any

import can

#: s between two looks whether a database is written
_LOOK_PERIOD = 0.02


class _NamedFile(io.FileIO):
    """Errors of a write have no name, and a write may come late, out of a buffer."""

    def write(self, data: Any) -> int:
        """Write, or raise an error that says where to."""
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
    """A database as python-can writes it, whose failure is known outside of its thread."""

    _failure: Exception | None = None

    def __init__(self, path: Path) -> None:
        # else python-can adds to it, and sqlite undoes in it what was under way in the last one
        for each in (path, path.with_name(f'{path.name}-journal')):
            each.unlink(missing_ok=True)
        self._path = path
        self._taken = 0
        super().__init__(str(path))

    def on_message_received(self, msg: can.Message) -> None:
        """Take a frame, to be written later."""
        self._taken += 1
        super().on_message_received(msg)

    def check(self) -> None:
        """
        Look whether frames can be written.

        :raises OSError: not any more.
        """
        if self._failure is not None:
            raise OSError(EIO, str(self._failure), str(self._path))

    def stop(self) -> None:
        """
        Write the rest.

        :raises OSError: not all is written.
        """
        # told to stop, the thread writes 500 more frames at most, whatever waits
        while self.num_frames < self._taken and self._writer_thread.is_alive():
            self._writer_thread.join(_LOOK_PERIOD)
        super().stop()
        self.check()
        if self.num_frames < self._taken:
            raise OSError(EIO, f'{self._taken - self.num_frames} frames are not written',
                          str(self._path))

    def _db_writer_thread(self) -> None:
        try:
            super()._db_writer_thread()
        except Exception as error:  # noqa: BLE001  the outermost of a thread
            self._failure = error
