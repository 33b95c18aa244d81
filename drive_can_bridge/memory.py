# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A limit on the memory of this process, and reserves for when it is reached.

The limit (``RLIMIT_DATA``) is one of the process: while one thread has reached it, none gets new
memory from the system, neither a thread nor a page of the heap. So whatever must go on has some
before. glibc gives each thread a heap of its own (an *arena*), and what is free in that is for
no other: every arena begins with :data:`RESERVE` and keeps as much when others would give it
back, and threads that matter have it enlarged. What cannot be had before, a thread (Python maps
memory for each, and waits for ever for one that could not begin), gets :data:`ROOM` above the
limit for a moment. Where there is no glibc, there is only the limit.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import os
import re
import resource
import threading

#: bytes that are free in the heap of each thread
RESERVE = 1 << 20
#: heaps at most; glibc has eight for each processor, and then threads share them
_ARENAS = 256
#: bytes of a block: larger ones come straight from the system (M_MMAP_THRESHOLD)
_BLOCK = 100 << 10
#: malloc.h
_M_TOP_PAD, _M_ARENA_MAX = -2, -8
#: bytes above the limit for a moment: some stacks
ROOM = 64 << 20
_STATUS = '/proc/self/status'
MEGABYTE = 1 << 20


def in_use() -> int:
    """
    Return the bytes that count against the limit.

    :raises OSError: this system does not report it.
    """
    status = os.open(_STATUS, os.O_RDONLY | os.O_CLOEXEC)
    try:
        found = re.search(rb'^VmData:\s*(\d+) kB$', os.read(status, 1 << 14), re.MULTILINE)
    finally:
        os.close(status)
    if found is None:
        raise OSError(f'{_STATUS} has no VmData')
    return int(found[1]) << 10


class DataLimit:
    """The soft limit of this process: never more than it was given."""

    def __init__(self) -> None:
        self._given = resource.getrlimit(resource.RLIMIT_DATA)[0]
        self._limit = 0     # none of ours
        self._rooms = 0
        self._lock = threading.Lock()

    def set(self, more: int) -> None:
        """
        Allow so many bytes more than are in use.

        :raises OSError: this system has no such limit.
        """
        with self._lock:
            self._limit = in_use() + more
            self._apply()

    def lift(self) -> None:
        """Restore the original limit."""
        with self._lock:
            if self._limit:
                self._limit = 0
                self._apply()

    @contextmanager
    def room(self) -> Iterator[None]:
        """Allow a little more for a moment."""
        self._change_room(1)
        try:
            yield
        finally:
            self._change_room(-1)

    def _change_room(self, change: int) -> None:
        with self._lock:
            self._rooms += change
            if self._limit:
                self._apply()

    def _apply(self) -> None:
        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        soft = self._limit or self._given
        if self._limit and self._rooms:
            try:    # the room of a moment before may be in use, too
                soft = max(self._limit, in_use()) + ROOM
            except (MemoryError, OSError):
                soft = self._given
        if self._given != resource.RLIM_INFINITY:
            soft = min(soft, self._given)
        try:
            resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
        except ValueError as error:     # beyond the hard limit, which was lowered meanwhile
            raise OSError(str(error)) from None


#: that of this process
data_limit = DataLimit()


def keep_reserves() -> None:
    """Make every thread that starts from now on keep a reserve. To be called first of all."""
    try:
        from ctypes import CDLL
        mallopt = CDLL(None).mallopt
    except (AttributeError, OSError):
        return
    if 'MALLOC_ARENA_MAX' not in os.environ:
        mallopt(_M_ARENA_MAX, _ARENAS)
    mallopt(_M_TOP_PAD, RESERVE)


def reserve() -> None:
    """Free the reserve of this thread beyond what it uses now."""
    import ctypes
    library = ctypes.CDLL(None)
    malloc, free = library.malloc, library.free
    malloc.restype, malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
    free.restype, free.argtypes = None, [ctypes.c_void_p]
    blocks = [malloc(_BLOCK) for _ in range(RESERVE // _BLOCK + 1)]
    for block in reversed(blocks):
        free(block)
