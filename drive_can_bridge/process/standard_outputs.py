# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Standard outputs that never block their writers.

Their reader may stop reading: Ctrl-S in a terminal, an ssh that hangs, a log reader that was
stopped. Then a write blocks. rcutils writes while it holds the interpreter, so that one line would
stop every thread of the process, the exchange and the handling of signals included. It writes to
standard error, or to standard output where its user says so.

So both descriptors become pipes that never block their writers: rcutils, DDS,
Python, libraries of adapters. One thread empties a pipe into a queue of bounded size, another one
writes the queue to the real output, and waits as long as that takes. What does not fit is
counted, and reported as soon as the output is read again.

The last lines are waited for until they are written, unless their reader hangs.
"""

from array import array
from collections import deque
from contextlib import ExitStack
import fcntl
import os
import select
import termios
import threading

from drive_can_bridge import host_texts
from drive_can_bridge.clock import Clock
from drive_can_bridge.process.write_watch import MOMENT, WriteWatch

#: bytes that wait for a reader at most
QUEUE_MAX = 1 << 20
#: bytes that may be written before the emptying thread gets its turn
PIPE_SIZE = 1 << 18
#: bytes of one write: so that slow reading is seen
_PIECE = 4096


class Output:
    """
    Keeps descriptors of one output from blocking; use as a context manager.

    Not across ``exec``: the pipe would go along, but not the thread that empties it.

    :param clock: measures how long nothing was read.
    :param name: of the output, in words.
    :param descriptors: all of them go where the first one does.
    """

    def __init__(self, clock: Clock, name: str, *descriptors: int) -> None:
        self._now = clock.now
        self._name = name
        self._descriptors = descriptors
        self._real = self._source = -1
        self._chunks: deque[bytes] = deque()
        self._size = 0
        self._dropped = 0
        self._ending = False
        self._changed = threading.Condition()
        self._taking = WriteWatch(clock.now)

    def __enter__(self) -> 'Output':
        try:
            self._real = os.dup(self._descriptors[0])
        except OSError:  # it was closed; no thread will wait for it
            return self
        self._source, sink = os.pipe()
        try:
            fcntl.fcntl(sink, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
        except (AttributeError, OSError):  # Python 3.9; not allowed: the usual 64 kB
            pass
        os.set_blocking(sink, False)
        for descriptor in self._descriptors:
            os.dup2(sink, descriptor)
        os.close(sink)
        for name, target in ((self._name, self._empty), (f'{self._name}, writing', self._write)):
            threading.Thread(target=target, name=name, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._real < 0:
            return
        for descriptor in self._descriptors:
            os.dup2(self._real, descriptor)     # from here on no thread can write into the pipe
        self.flush()

    @property
    def is_terminal(self) -> bool:
        """Whether it is a terminal."""
        return self._real >= 0 and os.isatty(self._real)

    def flush(self, deadline: float | None = None) -> bool:
        """
        Wait until everything is written, unless the reader hangs.

        :param deadline: of the clock, at the latest; None: however long that takes.
        :return: False: it is not.
        """
        if self._real < 0:
            return True
        hangs = self._taking.watch()
        with self._changed:
            while not self._changed.wait_for(
                    lambda: not (self._size or self._dropped or self._unread()), MOMENT):
                if hangs() or deadline is not None and self._now() > deadline:
                    return False
        return True

    def _empty(self) -> None:
        source = select.poll()
        source.register(self._source, select.POLLIN)
        while not self._ending:
            source.poll()
            # what has left the pipe is in the queue: it is always seen in one of them
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
                    chunk = (host_texts.output_not_read.format(
                        lines=lines, output=self._name) + '\n').encode()
                else:
                    return
            if not self._put(chunk):
                lines = self._dropped       # there is no reader
            with self._changed:
                if lines:
                    self._dropped -= lines
                else:
                    self._size -= len(chunk)
                self._changed.notify_all()

    def _put(self, chunk: bytes) -> bool:
        """Write a chunk, however long that takes; return False: the reader is gone."""
        while chunk:
            with self._taking:
                try:
                    chunk = chunk[os.write(self._real, chunk[:_PIECE]):]
                except BlockingIOError:
                    select.select([], [self._real], [])
                except OSError:
                    return False
        return True


class StandardOutputs:
    """
    Keeps descriptors 1 and 2 from blocking; use as a context manager.

    Where both are the same, they go through the same pipe, so that lines keep their order.

    :param clock: of both.
    :ivar output: standard output.
    :ivar error: standard error.
    """

    def __init__(self, clock: Clock) -> None:
        self.error = Output(clock, 'standard error', 2)
        self.output = Output(clock, 'standard output', 1)
        if _same(1, 2):
            self.error = self.output = Output(clock, 'standard error', 2, 1)
        self._open = ExitStack()

    def __enter__(self) -> 'StandardOutputs':
        for output in {self.output, self.error}:
            self._open.enter_context(output)
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def flush(self, deadline: float | None = None) -> bool:
        """Wait until all is written that was; see :meth:`Output.flush`."""
        error = self.error.flush(deadline)
        return self.output.flush(deadline) and error


def _same(one: int, other: int) -> bool:
    """Return whether two descriptors are the same file, pipe or terminal."""
    try:
        return os.path.sameopenfile(one, other)
    except OSError:  # one of them is closed
        return False
