# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A standard error that keeps nobody waiting.

Whoever reads it may stop to: Ctrl-S in a terminal, an ssh that hangs, a log reader that was
stopped. Then a write blocks. rcutils writes while it holds the interpreter, so that one line would
stop every thread of the process, the exchange and the handling of signals included.

So descriptor 2 becomes a pipe that never blocks, for whoever writes to it: rcutils, DDS, Python,
adapters' libraries. One thread empties it into a queue of bounded size, another one writes the
queue to the real standard error, and waits as long as that takes. What does not fit is counted,
and said as soon as somebody reads again.
"""

from array import array
from collections import deque
import fcntl
import os
import select
import termios
import threading
from types import TracebackType

#: bytes that wait for a reader at most
QUEUE_MAX = 1 << 20
#: bytes that may be written before the emptying thread gets its turn
PIPE_SIZE = 1 << 18
#: s that the end of the process waits for what has not been written yet
FLUSH_TIMEOUT = 0.5


class StandardError:
    """
    Keeps descriptor 2 from blocking; use as a context manager.

    Not across ``exec``: the pipe would go along, but not who empties it.
    """

    def __init__(self) -> None:
        self._real = self._source = -1
        self._chunks: deque[bytes] = deque()
        self._size = 0
        self._dropped = 0
        self._ending = False
        self._changed = threading.Condition()

    def __enter__(self) -> 'StandardError':
        try:
            self._real = os.dup(2)
        except OSError:  # it was closed; nobody will ever wait for it
            return self
        self._source, sink = os.pipe()
        try:
            fcntl.fcntl(sink, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
        except (AttributeError, OSError):  # Python 3.9; not allowed: the usual 64 kB
            pass
        os.set_blocking(sink, False)
        os.dup2(sink, 2)
        os.close(sink)
        for name, target in (('standard error', self._empty),
                             ('standard error, writing', self._write)):
            threading.Thread(target=target, name=name, daemon=True).start()
        return self

    def __exit__(self, exception_type: type[BaseException] | None,
                 exception: BaseException | None, traceback: TracebackType | None) -> None:
        if self._real < 0:
            return
        os.dup2(self._real, 2)      # closes the pipe for writing: the emptying thread ends
        self.flush()

    @property
    def is_terminal(self) -> bool:
        """Somebody looks at it."""
        return self._real >= 0 and os.isatty(self._real)

    def flush(self, timeout: float = FLUSH_TIMEOUT) -> bool:
        """Wait until all is written that was, for ``timeout`` s at most; False: it is not."""
        if self._real < 0:
            return True
        with self._changed:
            return self._changed.wait_for(
                lambda: not (self._size or self._dropped or self._unread()), timeout)

    def _empty(self) -> None:
        source = select.poll()
        source.register(self._source, select.POLLIN)
        while not self._ending:
            source.poll()
            # what has left the pipe is in the queue: nobody sees it in neither of them
            with self._changed:
                chunk = os.read(self._source, 65536)
                if not chunk:
                    self._ending = True
                    os.close(self._source)
                elif self._size + len(chunk) > QUEUE_MAX:
                    self._dropped += chunk.count(b'\n') or 1
                else:
                    self._size += len(chunk)
                    self._chunks.append(chunk)
                self._changed.notify_all()

    def _unread(self) -> int:
        """Return how many bytes the emptying thread has still to take."""
        count = array('i', [0])
        if not self._ending:
            fcntl.ioctl(self._source, termios.FIONREAD, count)
        return count[0]

    def _write(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(
                    lambda: self._chunks or self._dropped or self._ending)
                if self._chunks:
                    chunk, lines = self._chunks.popleft(), 0
                elif self._dropped:
                    lines = self._dropped
                    chunk = (f'drive_can_bridge: {lines} lines left out here: standard error was '
                             f'not read\n').encode()
                else:
                    return
            if not self._put(chunk):
                lines = self._dropped       # nobody is left to be told
            with self._changed:
                if lines:
                    self._dropped -= lines
                else:
                    self._size -= len(chunk)
                self._changed.notify_all()

    def _put(self, chunk: bytes) -> bool:
        """Write a chunk, however long that takes; False: there is nobody to read it."""
        while chunk:
            try:
                chunk = chunk[os.write(self._real, chunk):]
            except BlockingIOError:
                select.select([], [self._real], [])
            except OSError:
                return False
        return True
