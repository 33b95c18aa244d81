# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The log of the bridge, written by a thread of its own.

A line costs tens of microseconds at best, and at worst whatever the file of the log and its
subscribers take. Most lines are due with a bus lock held. So a thread that has a
line puts it into a bounded queue and goes on; what does not fit is counted and logged later. How
much drives and buses may log is limited before (:class:`LogLimit`).

A status bit that flips in every cycle is news a hundred times a second. The first few times a line
is written at once and as it is; from then on it is held, and summed up once in a while, with how
often it came and when it came last. Nothing is lost in silence: what differs is a line of its own,
what was held is written in the end, in the order in which it came last, and whatever could not
even be held is counted.

============== ======================================================================
of one line    :data:`FEW` times at once (a topic: once, unless called otherwise),
               then a summary every :data:`SUM_UP` s; after :data:`QUIET` s without
               it, it is news again
of a source   :data:`BURST` different lines at once, then :data:`RATE` a second
of all         :data:`BURST_OF_ALL` at once, then :data:`RATE_OF_ALL` a second
============== ======================================================================

Errors, and warnings of a danger, do not wait for others: they have an allowance of their
own, as large as the first one, and none in common with other sources.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
import math
import threading
from typing import Any

from drive_can_bridge.clock import Clock, Mailbox
from drive_can_bridge.core import sentences
from drive_can_bridge.core.text import printable
from drive_can_bridge.process.write_watch import MOMENT, WriteWatch

#: times that a line is written at once before it is summed up
FEW = 5
#: s between two summaries of a source
SUM_UP = 10.0
#: s without a line after which it is news again
QUIET = 5.0
#: different lines of a source: so many at once, and so many per second
BURST, RATE = 100, 1.0
#: the same for all sources together
BURST_OF_ALL, RATE_OF_ALL = 500, 20.0
#: lines of a source that are remembered
TOPICS_MAX = 256
#: s after which a logger does not come back. For its first line rclpy looks for the caller in all
#: modules: that alone takes a second or two on a slow machine
PATIENCE = 10.0
#: lines that may wait
LINES_MAX = 1000


class LogLevel(Enum):
    """The levels of lines."""

    INFO = 'info'
    WARNING = 'warning'
    ERROR = 'error'
    FATAL = 'fatal'


#: in the queue: the thread has to look what there is to be summed up, or to end
_LOOK, _END = (LogLevel.INFO, 'look'), (LogLevel.INFO, 'end')


class _Allowance:
    """An allowance of so many lines at once, and then so many per second."""

    def __init__(self, size: int, rate: float) -> None:
        self._size, self._rate = float(size), rate
        self._left, self._at = self._size, -math.inf

    def wait(self, now: float) -> float:
        """Return the s until there is one."""
        self._left = min(self._size, self._left + (now - self._at) * self._rate)
        self._at = now
        return max(0.0, (1.0 - self._left) / self._rate)

    def take(self) -> None:
        """Use up the one for which :meth:`wait` has just returned 0."""
        self._left -= 1.0


@dataclass(slots=True)
class _Topic:
    """
    The counts of one line, or of all lines of one topic.

    :ivar written: how often, at once, since it was news.
    :ivar era: of the source, when it was written last; ``in_era``: how often in that.
    :ivar held: how often it came since it was written; ``since`` when for the first time.
    """

    level: LogLevel
    text: str
    urgent: bool
    exact: bool
    seen_at: float
    era: int
    in_era: int = 0
    written: int = 0
    held: int = 0
    since: float = 0.0

    def summary(self, now: float) -> str:
        """Return the line with how often it came, and when last."""
        held, ago = self.held, now - self.seen_at
        last = f'{ago:.0f} s ago' if ago >= 1.0 else ''
        span = f'in {max(1.0, now - self.since):.0f} s'
        if self.exact and (self.written or held > 1):
            more = ' more' if self.written else ''
            told = f'{held}{more} {"time" if held == 1 else "times"} {span}'
        elif held > 1:
            told = f'and {held - 1} more like it {span}'
        else:
            return f'{self.text} ({last})' if last else self.text
        return f'{self.text} ({told}, the last {last})' if last else f'{self.text} ({told})'


class LogSource:
    """
    A source of lines of the log: one drive, one bus.

    :param name: put before each line; '': nothing is.
    """

    def __init__(self, name: str, limit: 'LogLimit') -> None:
        self._prefix = f'{name}: ' if name else ''
        self._limit = limit
        self._topics: dict[str, _Topic] = {}    # the one that came last at the end
        self._own, self._urgent = _Allowance(BURST, RATE), _Allowance(BURST, RATE)
        self._era = 0
        self._left_out = 0
        #: when what is held is to be summed up
        self.due = math.inf

    def info(self, text: str, *, topic: str = '') -> None:
        """
        Log what is as it should be.

        :param topic: of lines that vary; of those that repeat the newest is logged.
        """
        self._say(LogLevel.INFO, text, topic=topic)

    def warning(self, text: str, *, urgent: bool = False) -> None:
        """
        Log what needs attention.

        :param urgent: it warns of a danger.
        """
        self._say(LogLevel.WARNING, text, urgent=urgent)

    def error(self, text: str) -> None:
        """Log what does not work."""
        self._say(LogLevel.ERROR, text, urgent=True)

    def warn(self, topic: str, text: str, *, once: bool = False, few: int = 1) -> None:
        """
        Log a warning whose text may vary; repetitions are counted, and the newest text logged.

        :param once: repetitions are not logged at all, until :meth:`reset`.
        :param few: times that it is written at once, at most :data:`FEW`.
        """
        self._say(LogLevel.WARNING, text, topic=topic, once=once, few=few)

    def reset(self) -> None:
        """Start over: the next warning of each topic is new."""
        with self._limit.lock:
            self._era += 1

    def sum_up(self, now: float, *, all_of_it: bool = False) -> None:
        """
        Write what was held, as far as there is an allowance for it. The lock must be held.

        :param all_of_it: whether there is or not.
        """
        self.due = math.inf
        summed_up = newest = None
        for newest in self._topics.values():
            if newest.held:
                wait = 0.0 if all_of_it else self._wait(newest.urgent, now)
                if wait > 0.0:
                    self.due = now + wait
                    return
                self._sum_up(newest, now)
                summed_up = newest
        if self._left_out:
            self._emit(LogLevel.WARNING, sentences.lines_left_out(lines=self._left_out))
            self._left_out = 0
        if summed_up is not None and newest is not None and summed_up is not newest:
            # written before all this, which was over by then: the present state is logged last
            ago = now - newest.seen_at
            self._emit(newest.level, f'{newest.text} (this came last, {ago:.0f} s ago)')

    def _say(self, level: LogLevel, text: str, *, topic: str = '', once: bool = False,
             urgent: bool = False, few: int = FEW) -> None:
        limit = self._limit
        with limit.lock:
            if limit.over:
                self._emit(level, text)
                return
            now = limit.clock()
            known = self._topics.pop(topic or text, None)
            if known is None:
                known = _Topic(level, text, urgent, not topic, now, self._era)
            elif once and known.written and known.era == self._era:
                self._topics[topic] = known
                return
            quiet = now - known.seen_at >= QUIET
            anew = known.era != self._era
            written = 0 if quiet else known.written
            if quiet or anew:
                known.era, known.in_era = self._era, 0
            self._topics[topic or text] = known
            if ((not known.held or quiet or anew and topic)
                    and written < FEW and known.in_era < few
                    and self._wait(urgent, now) <= 0.0):
                if known.held:
                    self._sum_up(known, now)
                known.written = written + 1
                known.in_era += 1
                self._emit(level, text)
            else:
                self._hold(known, now)
            known.level, known.text, known.seen_at = level, text, now
            if len(self._topics) > TOPICS_MAX:
                self._make_room(now)

    def _make_room(self, now: float) -> None:
        """Forget the line that has not come for the longest time."""
        oldest = self._topics.pop(next(iter(self._topics)))
        if oldest.held and oldest.urgent and self._wait(True, now) <= 0.0:
            self._sum_up(oldest, now)   # whatever flood drives it out
        else:
            self._left_out += oldest.held

    def _hold(self, topic: _Topic, now: float) -> None:
        if not topic.held:
            topic.since = now
        topic.held += 1
        if self.due == math.inf:
            self.due = now + SUM_UP
            self._limit.wake()

    def _wait(self, urgent: bool, now: float) -> float:
        """Use up the allowance for a line, or return the s until there is one."""
        allowances = (self._urgent,) if urgent else (self._own, self._limit.of_all)
        wait = max(allowance.wait(now) for allowance in allowances)
        if wait <= 0.0:
            for allowance in allowances:
                allowance.take()
        return wait

    def _sum_up(self, topic: _Topic, now: float) -> None:
        self._emit(topic.level, topic.summary(now))
        topic.written = max(topic.written, 1)
        topic.held = 0

    def _emit(self, level: LogLevel, text: str) -> None:
        self._limit.emit(level, f'{self._prefix}{text}')


class LogLimit:
    """
    Limits all sources of a log. Thread-safe; callers wait only for each other's short lines.

    :param emit: writes a line; must not wait.
    :param wake: is called when :meth:`wait` has become shorter; must not wait either.
    :param clock: steady, in s.
    """

    def __init__(self, emit: Callable[[LogLevel, str], None], wake: Callable[[], None],
                 clock: Callable[[], float]) -> None:
        self.emit, self.wake, self.clock = emit, wake, clock
        self.lock = threading.RLock()
        #: held lines are not written later: everything is written
        self.over = False
        self.of_all = _Allowance(BURST_OF_ALL, RATE_OF_ALL)
        self._sources: dict[str, LogSource] = {}

    def source(self, name: str) -> LogSource:
        """Return the source of this name, always the same."""
        with self.lock:
            if name not in self._sources:
                self._sources[name] = LogSource(name, self)
            return self._sources[name]

    def wait(self) -> float | None:
        """Return the s until :meth:`sum_up` has something to do; None: nothing."""
        with self.lock:
            due = min((source.due for source in self._sources.values()), default=math.inf)
            return None if due == math.inf else max(0.0, due - self.clock())

    def sum_up(self, *, all_of_it: bool = False) -> None:
        """
        Write what was held long enough.

        :param all_of_it: everything that is held, because this is the last call.
        """
        with self.lock:
            now, self.over = self.clock(), self.over or all_of_it
            for source in sorted(self._sources.values(), key=lambda each: each.due):
                if all_of_it or source.due <= now:
                    source.sum_up(now, all_of_it=all_of_it)


class Log:
    """
    Passes lines on to a logger of rclpy. From any thread; never waits.

    Whatever a line contains is printable when it arrives there.
    """

    def __init__(self, logger: Any, clock: Clock) -> None:
        self._logger = logger
        self._now = clock.now
        self._lines: Mailbox[tuple[LogLevel, str]] = Mailbox(clock, LINES_MAX)
        self._limit = LogLimit(self._put, self._wake, clock.now)
        self._dropped = 0
        self._closed = False
        self._taking = WriteWatch(clock.now, PATIENCE)
        self._thread = clock.worker(self._run, 'log')
        self._thread.start()

    def source(self, name: str) -> LogSource:
        """Return the log of a drive or a bus: its lines begin with the name (if there is one)."""
        return self._limit.source(name)

    def info(self, text: str) -> None:
        """Log what is as it should be."""
        self._put(LogLevel.INFO, text)

    def warning(self, text: str) -> None:
        """Log what needs attention."""
        self._put(LogLevel.WARNING, text)

    def error(self, text: str) -> None:
        """Log what does not work."""
        self._put(LogLevel.ERROR, text)

    def fatal(self, text: str) -> None:
        """Log why the bridge ends."""
        self._put(LogLevel.FATAL, text)

    def close(self) -> None:
        """Write what waits, unless its reader hangs; later lines are written at once."""
        if self._closed:
            return
        self._limit.sum_up(all_of_it=True)
        self._closed = True
        self._lines.put(_END, always=True)
        hangs = self._taking.watch()
        while self._thread.is_alive() and not hangs():
            self._thread.join(MOMENT)

    def _put(self, level: LogLevel, text: str) -> None:
        if self._closed:
            self._write(level, text)
            return
        if not self._lines.put((level, text)):
            self._dropped += 1

    def _wake(self) -> None:
        self._lines.put(_LOOK)      # full: then the thread is awake

    def _run(self) -> None:
        while True:
            wait = self._limit.wait()
            try:
                line = self._lines.get(math.inf if wait is None else self._now() + wait)
            except TimeoutError:
                line = _LOOK
            if line is not _LOOK and line is not _END:
                with self._taking:
                    self._write(*line)
            self._limit.sum_up()
            if self._dropped and (not self._lines or line is _END):
                dropped, self._dropped = self._dropped, 0
                self._write(LogLevel.WARNING, sentences.log_too_fast(dropped))
            if line is _END:
                return

    def _write(self, level: LogLevel, text: str) -> None:
        text = printable(text, None)
        logger = self._logger
        try:
            # a line each: rclpy wants the level of a place in the source not to change
            if level is LogLevel.INFO:
                logger.info(text)
            elif level is LogLevel.WARNING:
                logger.warning(text)
            elif level is LogLevel.ERROR:
                logger.error(text)
            else:
                logger.fatal(text)
        except Exception:  # noqa: BLE001  the context is gone: there is no receiver
            pass
