# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
From entries of a trace to telegrams, with the observers of all drives.

Written for a hundred million frames: a frame costs a look-up in two dictionaries and its handler,
and nothing is kept of it.
"""

from collections.abc import Callable, Iterator
import math
from typing import Any

from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.configuration import BridgeConfiguration, BusConfiguration
from drive_can_bridge.core.frame import bits_on_bus, Frame, Record, RecordKind, STUFFING
from drive_can_bridge.core.statistics import Statistic
from drive_can_bridge.core.text import column_lines, printable
from drive_can_bridge.protocols.families import FAMILIES
from drive_can_bridge.protocols.observer import (
    DriveObserver, Handler, Observed, Telegram, TelegramKind, Verdict)
from drive_can_bridge.protocols.telegrams import Direction
from drive_can_bridge.trace.channels import Channels
from drive_can_bridge.transport.error_frames import decode_error_frame

#: identifiers whose owner is remembered; of those of a healthy bus there are a few hundred
_KNOWN_MAX = 50_000
#: s by which stamps may go back without a clock that was set: two senders, two stamps
_DISORDER = 0.1
_EXTENDED = 1 << 29
_DATA = RecordKind.DATA
_REQUEST = Direction.REQUEST

#: called with the name of the bus and the telegram
Sink = Callable[[str, Telegram], None]


class BusTrace:
    """
    One bus of a trace.

    :ivar frames: entries that were frames.
    :ivar error_frames: entries that were not.
    :ivar strays: frames of no drive in the parameter file.
    :ivar shift: s to add to stamps, so that time goes on where a clock was set back.
    :ivar newest: time of the last entry.
    """

    def __init__(self, name: str, bitrate: int, observers: list[DriveObserver]) -> None:
        self.name = name
        self.bitrate = bitrate
        self.observers = observers
        self.handlers: dict[int, tuple[Handler, DriveObserver] | None] = {}
        self.deadline = math.inf
        self.shift = 0.0
        self.newest = -math.inf
        self.frames = 0
        self.error_frames = 0
        self.strays = 0
        self.bits = 0
        self.first = math.nan
        self.last = math.nan
        self._peak = 0.0
        self.somebody_sent = False
        self._second = math.nan
        self._second_bits = 0

    def find(self, identifier: int, extended: bool) -> tuple[Handler, DriveObserver] | None:
        """Return the handler of frames with this identifier, and its observer."""
        if len(self.handlers) >= _KNOWN_MAX:
            self.handlers.clear()
        found = None
        for observer in self.observers:
            handler = observer.handler(identifier, extended)
            if handler is not None:
                found = handler, observer
                break
        self.handlers[identifier | _EXTENDED if extended else identifier] = found
        return found

    def count(self, bits: int, time: float) -> None:
        """Count a frame of this length."""
        self.frames += 1
        self.bits += bits
        if not self._second <= time < self._second + 1.0:
            self.close_second()
            if self.first != self.first:    # NaN
                self.first = time
            self._second = time
            self._second_bits = 0
        self._second_bits += bits
        self.last = time

    def close_second(self) -> None:
        """Check whether the second that ends was the busiest."""
        if self.bitrate:
            self._peak = max(self._peak, STUFFING * self._second_bits / self.bitrate)

    @property
    def peak_load(self) -> float:
        """The highest load within one second, 0 to 1 and more; NaN: unknown."""
        return self._peak if self.bitrate and self.last > self.first else math.nan

    @property
    def load(self) -> float:
        """The mean load from the first frame to the last, 0 to 1 and more; NaN: unknown."""
        most = (self.last - self.first) * self.bitrate
        return STUFFING * self.bits / most if most > 0.0 else math.nan


class Tracer:
    """
    Decodes the entries of a trace.

    :param sink: called with every telegram, in the order of time.
    :param channels: finds buses; may have looked ahead.
    """

    def __init__(self, configuration: BridgeConfiguration, sink: Sink,
                 channels: Channels | None = None) -> None:
        self._sink = sink
        self._channels = channels or Channels(list(configuration.buses.values()))
        self._by_channel: dict[str | int, BusTrace] = {}
        self.buses = {bus.name: self._make_bus(bus, configuration)
                      for bus in configuration.buses.values()}
        self.start = math.nan
        self._sent: bool | None = None

    def _make_bus(self, bus: BusConfiguration, configuration: BridgeConfiguration) -> BusTrace:
        made = BusTrace(bus.name, bus.bitrate, [])
        bus_name, sink = bus.name, self._sink

        def emit(telegram: Telegram) -> None:
            if self._sent is not None and telegram.direction is _REQUEST:
                telegram = self._look_for_masters(made, telegram)
            sink(bus_name, telegram)

        drives = [drive for drive in configuration.drives.values() if drive.bus == bus.name]
        for name, family in FAMILIES.items():
            mine = [drive for drive in drives if drive.protocol == name]
            if mine:
                made.observers += family.make_observers(mine, emit)
        return made

    def _look_for_masters(self, bus: BusTrace, telegram: Telegram) -> Telegram:
        """Mark a telegram of a second master, where the trace shows who sent what."""
        if self._sent:
            bus.somebody_sent = True
        elif self._sent is False and bus.somebody_sent:
            return telegram._replace(
                verdict=Verdict.SUSPICIOUS if telegram.verdict is Verdict.NORMAL
                else telegram.verdict,
                remark='; '.join(filter(None, (telegram.remark, 'sent by another master'))))
        return telegram

    def take(self, record: Record) -> None:
        """
        Handle an entry. The fast path.

        :raises DriveCanError: its bus is unknown.
        """
        time, channel, identifier, data, extended, kind, sent = record
        bus = self._by_channel.get(channel)
        if bus is None:
            bus = self._new_channel(channel)
        if bus.shift:
            time += bus.shift
            record = record._replace(time=time)
        if time < bus.newest - _DISORDER:
            time = self._go_on(bus, time)
            record = record._replace(time=time)
        bus.newest = time
        if self.start != self.start:    # NaN
            self.start = time
        if time >= bus.deadline:
            self._expire(bus, time)
        if kind is not _DATA:
            self._take_other(bus, record)
            return
        bus.count(bits_on_bus(len(data), extended), time)
        key = identifier | _EXTENDED if extended else identifier
        if key in bus.handlers:
            found = bus.handlers[key]
        else:
            found = bus.find(identifier, extended)
        if found is None:
            bus.strays += 1
            self._tell(bus, time, '', _hex(record), Verdict.NORMAL)
            return
        handler, observer = found
        self._sent = sent
        handler(data, time)
        if observer.deadline < bus.deadline:
            bus.deadline = observer.deadline

    def advance(self, now: float) -> None:
        """Advance the time without a frame: give up what is overdue."""
        for bus in self.buses.values():
            if now >= bus.deadline:
                self._expire(bus, now)

    def finish(self) -> None:
        """
        End the trace.

        What is still under way stays undecided: its answer may just have missed the end.
        """
        for bus in self.buses.values():
            bus.close_second()

    def observed(self) -> dict[str, Observed]:
        """Return the counts of each drive."""
        return {observer.name: observer.observed for bus in self.buses.values()
                for observer in bus.observers if observer.name}

    # -- inside -----------------------------------------------------------------------------------

    def _new_channel(self, channel: str | int) -> BusTrace:
        found = self._channels.find(channel)
        if found is not None:
            bus = self.buses[found.name]
        else:   # of a bus that the file does not have: shown all the same
            name = printable(f'{channel}')
            bus = self.buses.setdefault(name, BusTrace(name, 0, []))
        self._by_channel[channel] = bus
        return bus

    def _go_on(self, bus: BusTrace, time: float) -> float:
        """
        Continue the time from the last entry, although the clock of the trace was set back.

        No answer comes before its question, and nothing would be missed until the old time.
        """
        self._tell(bus, bus.newest, 'time', command_sentences.time_goes_back(
            seconds=bus.newest - time))
        bus.shift += bus.newest - time
        return bus.newest

    def _expire(self, bus: BusTrace, now: float) -> None:
        self._sent = None
        while bus.observers:
            observer = min(bus.observers, key=lambda each: each.deadline)
            bus.deadline = due = observer.deadline
            if not due <= now < math.inf:
                return
            observer.expire(due)    # no further: what is due next may be another drive's

    def _take_other(self, bus: BusTrace, record: Record) -> None:
        if record.kind is RecordKind.ERROR:
            bus.error_frames += 1
            self._tell(bus, record.time, 'error frame',
                       decode_error_frame(record.identifier, record.data).text)
            return
        if record.kind is RecordKind.DESTROYED:
            bus.error_frames += 1
            self._tell(bus, record.time, 'error frame', command_sentences.error_of_frame(
                frame=_hex(record)))
            return
        if record.kind is RecordKind.STATE:
            bus.error_frames += bool(record.identifier)
            self._tell(bus, record.time, 'bus state',
                       printable(record.data.decode(errors='replace')),
                       Verdict.SUSPICIOUS if record.identifier else Verdict.NORMAL)
            return
        bus.count(bits_on_bus(len(record.data), record.extended), record.time)
        title = 'CAN FD frame'
        if record.kind is RecordKind.REMOTE:
            title = 'remote frame'
            for observer in bus.observers:
                handler = observer.remote_handlers.get(record.identifier)
                if handler is not None and not record.extended:
                    self._sent = record.sent
                    handler(record.data, record.time)
                    bus.deadline = min(bus.deadline, observer.deadline)
                    return
        self._tell(bus, record.time, title, _hex(record))

    def _tell(self, bus: BusTrace, time: float, title: str, remark: str,
              verdict: Verdict = Verdict.SUSPICIOUS) -> None:
        """Handle a telegram of no drive."""
        self._sink(bus.name, Telegram(time, '', Direction.NEITHER, TelegramKind.OTHER, title,
                                      verdict=verdict, remark=remark))


def _hex(record: Record) -> str:
    return str(Frame(record.identifier, record.data, record.extended))


_DRIVE_COLUMNS = (
    'drive', 'exchanges', 'missed', 'period ms (mean, p99, max)', 'latency ms (mean, p99, max)',
    'requests', 'unanswered', 'refused', 'late', 'unasked', 'malformed', 'fast EEPROM writes')
_BUS_COLUMNS = ('bus', 'seconds', 'frames', 'load % (mean, busiest second)', 'error frames',
                'frames of others')


def summary_lines(tracer: Tracer, wanted: Callable[[str], bool]) -> Iterator[str]:
    """Yield the summary as text: a table of the selected drives, a table of buses."""
    drives = [(name, *_drive_cells(observed)) for name, observed in tracer.observed().items()
              if wanted(name)]
    buses = [(bus.name, *_bus_cells(bus)) for bus in tracer.buses.values()]
    if drives:
        yield from column_lines(_DRIVE_COLUMNS, drives, numbers=_DRIVE_COLUMNS[1:])
        yield ''
    yield from column_lines(_BUS_COLUMNS, buses, numbers=_BUS_COLUMNS[1:])


def summary_documents(tracer: Tracer, wanted: Callable[[str], bool]) -> Iterator[dict[str, Any]]:
    """Yield the summary as JSON documents: one for each such drive, one for each bus."""
    for name, observed in filter(lambda each: wanted(each[0]), tracer.observed().items()):
        yield {'drive': name, 'exchanges': observed.exchanges, 'missed': observed.missed,
               **_times('period', observed.period), **_times('latency', observed.latency),
               'requests': observed.requests, 'unanswered': observed.unanswered,
               'refused': observed.refused, 'late': observed.late, 'unasked': observed.unasked,
               'malformed': observed.malformed, 'fast_eeprom_writes': observed.fast_writes}
    for bus in tracer.buses.values():
        yield {'bus': bus.name, 'frames': bus.frames, 'error_frames': bus.error_frames,
               'foreign_frames': bus.strays, 'load_percent': _rounded(100.0 * bus.load, 1),
               'peak_load_percent': _rounded(100.0 * bus.peak_load, 1),
               'seconds': _rounded(bus.last - bus.first, 6)}


def _drive_cells(observed: Observed) -> tuple[str, ...]:
    counts = (observed.requests, observed.unanswered, observed.refused, observed.late,
              observed.unasked, observed.malformed, observed.fast_writes)
    return (str(observed.exchanges), str(observed.missed), _three(observed.period),
            _three(observed.latency), *map(str, counts))


def _bus_cells(bus: BusTrace) -> tuple[str, ...]:
    load = f'{_number(100.0 * bus.load, 1)}, {_number(100.0 * bus.peak_load, 1)}'
    return (_number(bus.last - bus.first, 3), str(bus.frames), load if bus.bitrate else '–',
            str(bus.error_frames), str(bus.strays))


def _three(statistic: Statistic) -> str:
    if not statistic.count:
        return '–'
    return ', '.join(f'{1e3 * value:.3f}'
                     for value in (statistic.mean, statistic.p99, statistic.maximum))


def _times(name: str, statistic: Statistic) -> dict[str, float | None]:
    return {f'{name}_mean_ms': _rounded(1e3 * statistic.mean, 3),
            f'{name}_p99_ms': _rounded(1e3 * statistic.p99, 3),
            f'{name}_max_ms': _rounded(1e3 * statistic.maximum, 3)}


def _number(value: float, digits: int) -> str:
    return '–' if math.isnan(value) else f'{value:.{digits}f}'


def _rounded(value: float, digits: int) -> float | None:
    return None if math.isnan(value) else round(value, digits)
