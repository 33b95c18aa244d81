# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The flight recorder of a bridge: traces of the time before a failure, written by themselves.

A frame becomes 24 bytes in a block that exists already: nothing is allocated for it, nothing is
left for the garbage collector, whose work would grow with what is kept. Blocks that are full are
never touched again, so that writing them to a file needs no copy and no lock.

A thread waits for a second after the event, so that what followed is in the trace, too, and writes
in small steps between which it gives way. A requested trace is always written, and takes nothing
from those of failures.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
import heapq
import itertools
import math
from operator import attrgetter
import os
from pathlib import Path
import re
import struct
import threading
import time

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BusConfiguration
from drive_can_bridge.core.frame import DATA, Frame, Record, RecordKind
from drive_can_bridge.trace.candump import format_record
from drive_can_bridge.trace.channels import labels

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
    Keeps the frames of the last seconds, and a little more.

    :param seconds: how long at least, as far as the memory goes.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._lock = threading.Lock()       # of the list of blocks, not of the entries
        self._full: deque[tuple[float, bytearray]] = deque()
        self._block = bytearray(_BLOCK_SIZE)
        self._place = 0
        self._began = 0.0
        # few, and reported by another thread
        self._errors: deque[tuple[float, int, bytes]] = deque(maxlen=BLOCK)

    def note(self, frame: Frame, at: float, sent: bool) -> None:
        """
        Record a frame. One caller at a time.

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
        """Record an error frame. From any thread."""
        self._errors.append((at, classes, data))

    def _turn(self, now: float) -> None:
        """Start a new block, and forget those that are too old."""
        with self._lock:
            full = self._full
            full.append((self._began, self._block))
            # a block may go when the one behind it begins early enough
            while len(full) > 1 and (full[1][0] < now - self._seconds
                                     or len(full) >= _BLOCKS_MAX):
                full.popleft()
            try:
                self._block = bytearray(_BLOCK_SIZE)
            except MemoryError:     # the oldest goes for it; the exchange must go on
                self._block = full.popleft()[1]
            self._place = 0
            self._began = now

    def entries(self, since: float, channel: str, offset: float) -> Iterator[Record]:
        """
        Return what is kept now, from a time on, as entries of a trace.

        :param since: steady clock, s.
        :param offset: from the steady clock to the time of day.
        """
        with self._lock:
            blocks = [memoryview(block) for _, block in self._full]
            blocks.append(memoryview(self._block)[:self._place])
        errors = [Record(at + offset, channel, classes, data, True, RecordKind.ERROR)
                  for at, classes, data in self._errors.copy() if at >= since]
        frames = (Record(at + offset, channel, identifier, data[:flags & _LENGTH],
                         bool(flags & _EXTENDED), DATA, bool(flags & _SENT))
                  for block in blocks for at, identifier, flags, data in _ENTRY.iter_unpack(block)
                  if at >= since)
        return heapq.merge(errors, frames, key=attrgetter('time'))


#: s after an event that belong into its trace
AFTERMATH = 1.0
#: least s between two traces of a bus that nobody has requested
SPACING = 10.0
#: traces of a run that are never replaced by later ones: how it all began
FIRST_KEPT = 5
#: s that the thread may be late, because it is writing the trace of another bus
_SLACK = 5.0
#: entries that are written without giving way, and s for which the thread then does
_STEP = 64
_PAUSE = 0.0005
#: s that the end of the bridge waits for a trace that is being written
_END_TIMEOUT = 3.0

#: rank of a requested trace, without a failure
_ASKED = -1
#: called with the path of a trace, or '' and why there is none
Done = Callable[[str, str], None]


@dataclass
class _Wanted:
    """
    A trace that is to be written.

    :ivar since: the moment before which the recorded seconds are in it.
    :ivar at: the moment after whose aftermath it is written.
    """

    reason: str
    rank: int
    since: float
    at: float
    done: list[Done] = field(default_factory=list)


@dataclass
class _RecordedBus:
    """One recorded bus."""

    configuration: BusConfiguration
    channel: str
    ring: Ring
    folder: Path
    wanted: _Wanted | None = None
    failed: float = -SPACING    # the last that was not requested


class FlightRecorder:
    """
    Records all buses that ask for it (there may be none), and writes traces.

    :param default_folder: for traces of buses without a directory.
    :param say: logs a line.
    :param complain: logs a line when a trace cannot be written.
    """

    def __init__(self, buses: Iterable[BusConfiguration], default_folder: Path,
                 say: Callable[[str], None], complain: Callable[[str], None],
                 clock: Clock) -> None:
        self._clock = clock
        self._say = say
        self._complain = complain
        buses = list(buses)
        channels = labels(buses)
        self._buses = {
            bus.name: _RecordedBus(bus, channels[bus.name],
                                   Ring(bus.trace_seconds + AFTERMATH + _SLACK),
                                   Path(bus.trace_directory).expanduser() if bus.trace_directory
                                   else default_folder)
            for bus in buses if bus.trace_seconds > 0.0}
        self._first: dict[str, list[Path]] = {name: [] for name in self._buses}
        self._lock = threading.Lock()
        self._changed = clock.wake_event()
        self._closing = False
        self._thread = clock.worker(self._run, 'flight recorder')
        if self._buses:
            self._thread.start()

    @property
    def buses(self) -> list[str]:
        """The recorded buses."""
        return list(self._buses)

    @property
    def memory(self) -> int:
        """The bytes that all of it may use."""
        return len(self._buses) * MEMORY_MAX

    def ring(self, bus: str) -> Ring | None:
        """Return the ring of a bus; None: it is not recorded."""
        found = self._buses.get(bus)
        return None if found is None else found.ring

    def trigger(self, bus: str, reason: str, *, rank: int = 0) -> None:
        """
        Request a trace of a bus after a failure. From any thread, at once.

        :param reason: becomes part of the file's name.
        :param rank: of several reasons within the aftermath, the highest names the file.
        """
        found = self._buses.get(bus)
        if found is None:
            return
        with self._lock:
            now, wanted = self._clock.now(), found.wanted
            if wanted is None or wanted.rank == _ASKED:
                if now - found.failed >= SPACING:   # it takes over one that is asked for
                    found.failed = now
                    self._want(found, reason, rank, now)
            elif rank > wanted.rank:
                wanted.reason, wanted.rank = reason, rank

    def save(self, bus: str, reason: str, done: Done) -> None:
        """Write a requested trace; ``done`` is called with its path, or with why there is none."""
        found = self._buses[bus]
        with self._lock:
            if found.wanted is None and not self._closing:  # else the thread may have ended
                self._want(found, reason, _ASKED, self._clock.now())
            if found.wanted is not None:
                found.wanted.done.append(done)
                return
        done('', f'bus {bus}: {command_sentences.recording_ended()}')

    def close(self) -> None:
        """Write what is still wanted, and end the thread."""
        with self._lock:
            self._closing = True
        self._changed.ring()
        self._thread.join(_END_TIMEOUT)

    def _want(self, bus: _RecordedBus, reason: str, rank: int, now: float) -> None:
        before = bus.wanted
        bus.wanted = _Wanted(reason, rank, now, now) if before is None else _Wanted(
            reason, rank, before.since, now, before.done)
        self._changed.ring()

    # -- the thread -------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            with self._lock:
                due = self._due()
                if due is None:
                    if self._closing:
                        return
                    until = min((bus.wanted.at + AFTERMATH for bus in self._buses.values()
                                 if bus.wanted), default=math.inf)
            if due is None:
                self._changed.wait(until)
            else:
                self._write(*due)

    def _due(self, *, asked: bool = True) -> tuple[_RecordedBus, _Wanted] | None:
        """
        Return the bus whose trace is to be written now, failures first. The lock must be held.

        :param asked: requested traces are included.
        """
        latest = math.inf if self._closing else self._clock.now() - AFTERMATH
        due = [(bus, bus.wanted) for bus in self._buses.values()
               if bus.wanted is not None and bus.wanted.at <= latest
               and (asked or bus.wanted.rank > _ASKED)]
        if not due:
            return None
        found = min(due, key=lambda each: (each[1].rank == _ASKED, each[1].at))
        found[0].wanted = None
        return found

    def _write(self, bus: _RecordedBus, wanted: _Wanted) -> None:
        name = bus.configuration.name
        path = bus.folder
        answer, text = '', f'bus {name}: no trace of {wanted.reason}: '
        tell: Callable[[str], None] | None = self._complain
        try:
            offset = 1e-9 * self._clock.stamp() - self._clock.now()
            stamp = time.strftime('%Y%m%dT%H%M%SZ', time.gmtime(wanted.since + offset))
            path = bus.folder / f'{name}_{stamp}_{_plain(wanted.reason)}.log'
            bus.folder.mkdir(parents=True, exist_ok=True)
            count = self._fill(path, bus, wanted, offset)
            if count:
                self._remove_old(bus, path)
        except OSError as error:
            text += f'{error.strerror or error}: {path}'
        except Exception as error:  # noqa: BLE001  no failure is silent: the caller waits
            text += f'{type(error).__name__} {error}: {path}'
        else:
            if count:
                answer = str(path)
                tell = self._say
                text = (command_sentences.trace_written(
                    bus=name, reason=wanted.reason, count=count,
                    seconds=bus.configuration.trace_seconds, path=path))
            else:
                bus.failed = -SPACING
                tell = None
                text = (command_sentences.trace_without_frames(
                    bus=name, seconds=bus.configuration.trace_seconds))
        if tell is not None:
            tell(text)
        for done in wanted.done:
            done(answer, '' if answer else text)

    def _fill(self, path: Path, bus: _RecordedBus, wanted: _Wanted, offset: float) -> int:
        """Write a file that has its name only when it is complete."""
        unfinished = path.with_suffix('.part')
        since = wanted.since - bus.configuration.trace_seconds
        entries = bus.ring.entries(since, bus.channel, offset)
        count = 0
        try:
            with unfinished.open('w', encoding='ascii', errors='replace') as file:
                while True:
                    lines = [format_record(record)
                             for record in itertools.islice(entries, _STEP)]
                    if not lines:
                        break
                    file.writelines(lines)
                    count += len(lines)
                    if not self._closing:
                        self._clock.wait(self._clock.now() + _PAUSE)
                    if wanted.rank == _ASKED:
                        self._write_failures()
            if count:
                os.replace(unfinished, path)
            else:
                unfinished.unlink()
        except BaseException:
            unfinished.unlink(missing_ok=True)
            raise
        return count

    def _write_failures(self) -> None:
        """Write what is due of failures; a requested trace that is being written waits."""
        while True:
            with self._lock:
                due = self._due(asked=False)
            if due is None:
                return
            self._write(*due)

    def _remove_old(self, bus: _RecordedBus, path: Path) -> None:
        """Keep the first traces of this run, and of the others the newest."""
        limit = bus.configuration.trace_files
        first = self._first[bus.configuration.name]
        if len(first) < min(FIRST_KEPT, limit - 1):
            first.append(path)
        name = re.compile(rf'{re.escape(bus.configuration.name)}_\d{{8}}T\d{{6}}Z_.+\.log')
        traces = sorted(each for each in bus.folder.iterdir()   # by time: that is in the name
                        if name.fullmatch(each.name) and each not in first)
        for each in traces[:max(0, len(traces) + len(first) - limit)]:
            if each != path:
                each.unlink(missing_ok=True)


def _plain(reason: str) -> str:
    """Return a reason as part of a file name."""
    return re.sub(r'[^A-Za-z0-9-]+', '_', reason).strip('_')[:100] or 'event'
