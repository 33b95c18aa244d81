# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A whole trace in a few lines: what each drive and each bus did."""

from collections.abc import Iterator
import math
from typing import Any

from drive_can_bridge.core.statistics import Statistic
from drive_can_bridge.core.text import column_lines
from drive_can_bridge.protocols.observer import Observed
from drive_can_bridge.trace.tracer import BusTrace, Tracer

_DRIVE_COLUMNS = (
    'drive', 'exchanges', 'missed', 'period ms (mean, p99, max)', 'latency ms (mean, p99, max)',
    'requests', 'unanswered', 'refused', 'late', 'unasked', 'malformed', 'fast EEPROM writes')
_BUS_COLUMNS = ('bus', 'seconds', 'frames', 'load % (mean, busiest second)', 'error frames',
                'frames of others')


def lines(tracer: Tracer) -> Iterator[str]:
    """Yield the summary as text: a table of drives, a table of buses."""
    drives = [(name, *_drive_cells(observed)) for name, observed in tracer.observed().items()]
    buses = [(bus.name, *_bus_cells(bus)) for bus in tracer.buses.values()]
    if drives:
        yield from column_lines(_DRIVE_COLUMNS, drives, numbers=_DRIVE_COLUMNS[1:])
        yield ''
    yield from column_lines(_BUS_COLUMNS, buses, numbers=_BUS_COLUMNS[1:])


def documents(tracer: Tracer) -> Iterator[dict[str, Any]]:
    """Yield the summary as JSON documents: one for each drive, one for each bus."""
    for name, observed in tracer.observed().items():
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


def _drive_cells(observed: Observed) -> Iterator[str]:
    yield str(observed.exchanges)
    yield str(observed.missed)
    yield _three(observed.period)
    yield _three(observed.latency)
    for count in (observed.requests, observed.unanswered, observed.refused, observed.late,
                  observed.unasked, observed.malformed, observed.fast_writes):
        yield str(count)


def _bus_cells(bus: BusTrace) -> Iterator[str]:
    yield _number(bus.last - bus.first, 3)
    yield str(bus.frames)
    yield (f'{_number(100.0 * bus.load, 1)}, {_number(100.0 * bus.peak_load, 1)}'
           if bus.bitrate else '–')
    yield str(bus.error_frames)
    yield str(bus.strays)


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
