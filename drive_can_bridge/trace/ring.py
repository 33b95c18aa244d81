# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The last seconds of a bus in memory, at next to no cost.

A frame becomes 24 bytes in a block that exists already: nothing is allocated for it, nothing is
left for the garbage collector to look at, whose work would grow with what is kept. Blocks that are
full are never touched again, so that whoever writes them to a file needs no copy and no lock.
"""

from collections import deque
from collections.abc import Iterable, Iterator
import struct
import threading

from drive_can_bridge.core.frame import Frame
from drive_can_bridge.core.record import DATA, Record, RecordKind

#: most that a ring may take
MEMORY_MAX = 64 * 2**20
#: entries of a block
BLOCK = 1024

# time, identifier, length and flags, data
_ENTRY = struct.Struct('<dIB3x8s')
_BLOCK_SIZE = BLOCK * _ENTRY.size
_BLOCKS_MAX = MEMORY_MAX // _BLOCK_SIZE
_LENGTH = 0x0F
_EXTENDED = 0x10
_SENT = 0x20
_pack_into = _ENTRY.pack_into


class Ring:
    """
    Keeps what was seen in the last seconds, and a little more.

    :param seconds: how long at least, as far as the memory goes.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._lock = threading.Lock()       # of the list of blocks, not of the entries
        self._full: deque[tuple[float, bytearray]] = deque()
        self._block = bytearray(_BLOCK_SIZE)
        self._place = 0
        self._began = 0.0
        # few, and told by another thread
        self._errors: deque[tuple[float, int, bytes]] = deque(maxlen=BLOCK)

    def note(self, frame: Frame, at: float, sent: bool) -> None:
        """
        Keep a frame. One caller at a time.

        :param at: steady clock, s.
        """
        identifier, data, extended = frame
        place = self._place
        if place == _BLOCK_SIZE:
            self._turn(at)
            place = 0
        elif not place:
            self._began = at
        _pack_into(self._block, place, at, identifier,
                   len(data) | (_EXTENDED if extended else 0) | (_SENT if sent else 0), data)
        self._place = place + 24

    def note_error(self, classes: int, data: bytes, at: float) -> None:
        """Keep an error frame. From any thread."""
        self._errors.append((at, classes, data))

    def _turn(self, now: float) -> None:
        """Begin a new block, and forget those that are too old."""
        with self._lock:
            full = self._full
            full.append((self._began, self._block))
            # a block may go when the one behind it begins early enough
            while len(full) > 1 and (full[1][0] < now - self._seconds
                                     or len(full) >= _BLOCKS_MAX):
                full.popleft()
            self._block = bytearray(_BLOCK_SIZE)
            self._place = 0
            self._began = now

    def entries(self, since: float, channel: str, offset: float) -> Iterator[Record]:
        """
        Return what is kept now, from a time on, as entries of a trace.

        :param since: steady clock, s.
        :param offset: what makes the steady clock the time of day.
        """
        with self._lock:
            blocks = [memoryview(block) for _, block in self._full]
            blocks.append(memoryview(self._block)[:self._place])
        return _entries(blocks, self._errors.copy(), since, channel, offset)


def _entries(blocks: Iterable[memoryview], errors: deque[tuple[float, int, bytes]], since: float,
             channel: str, offset: float) -> Iterator[Record]:
    for block in blocks:
        for at, identifier, flags, data in _ENTRY.iter_unpack(block):
            if at < since:
                continue
            while errors and errors[0][0] <= at:
                yield from _error(errors.popleft(), since, channel, offset)
            yield Record(at + offset, channel, identifier, data[:flags & _LENGTH],
                         bool(flags & _EXTENDED), DATA, bool(flags & _SENT))
    for error in errors:
        yield from _error(error, since, channel, offset)


def _error(error: tuple[float, int, bytes], since: float, channel: str, offset: float,
           ) -> Iterator[Record]:
    at, classes, data = error
    if at >= since:
        yield Record(at + offset, channel, classes, data, True, RecordKind.ERROR)
