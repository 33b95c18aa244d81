# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A standard error that nobody reads: a terminal with Ctrl-S, an ssh that hangs."""

import os
import select
from types import TracebackType


class StuckOutput:
    """
    A pipe that is full to the brim; a context manager.

    :ivar write: the descriptor for a process.
    """

    def __init__(self) -> None:
        self._read, self.write = os.pipe()
        os.set_blocking(self.write, False)
        self._filled = 0
        try:
            while True:
                self._filled += os.write(self.write, bytes(1024))
        except BlockingIOError:
            pass
        try:
            while True:
                self._filled += os.write(self.write, bytes(1))
        except BlockingIOError:
            pass
        os.set_blocking(self.write, True)

    def __enter__(self) -> 'StuckOutput':
        return self

    def __exit__(self, exception_type: type[BaseException] | None,
                 exception: BaseException | None, traceback: TracebackType | None) -> None:
        os.close(self._read)
        os.close(self.write)

    @property
    def full(self) -> bool:
        """Nothing can be written."""
        return not select.select([], [self.write], [], 0)[1]

    def read(self) -> str:
        """Read what is there by now; what filled it is left out."""
        os.set_blocking(self._read, False)
        text = b''
        try:
            while chunk := os.read(self._read, 65536):
                text += chunk
        except BlockingIOError:
            pass
        return text.replace(b'\0', b'').decode()
