# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""One drive in detail, and its parameters screen by screen."""

from collections.abc import Sequence
import math

from rich.table import Table
from rich.text import Text

from drive_can_bridge.monitor.reports import Level
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Times
from drive_can_bridge.monitor.values import ParameterInfo
from drive_can_bridge.view.parts import (
    DIM, flow, lamps, LEVEL_STYLES, Lines, milliseconds, NUMBER, plain_table, state, ValueColumns,
    wrapped,
)

_TREND_MAX = 60
#: of diagnostics, what is shown in other words
_TOLD = {'state', 'exchanges', 'missed_exchanges', 'command_age_s', 'control_state',
         *(f'{name}_{kind}_ms' for name in ('latency', 'period_error')
           for kind in ('mean', 'p99', 'max'))}
#: in keys of what is bad
_BAD = ('error', 'failed', 'refused', 'rejected')


def identity_lines(drive: DriveSnapshot, width: int) -> Lines:
    """Say who it is, how it is, where, and what to do."""
    place = drive.place
    words = [Text(drive.name, style='bold'), state(drive)]
    if drive.control:
        words.append(Text(drive.control))
    if place.bus:
        words.append(Text(f'bus {place.bus}, station {place.station}'))
        words.append(Text(place.protocol, style=DIM))
    if not math.isnan(place.period):
        words.append(Text(f'every {1e3 * place.period:g} ms', style=DIM))
    words.append(Text(f'by {drive.bridge}', style=DIM))
    lines = flow(words, width, 3)
    if drive.level is not Level.OK:
        lines += wrapped(drive.advice, width, LEVEL_STYLES[drive.level])
    return lines


def value_lines(drive: DriveSnapshot, width: int) -> Lines:
    """Write setpoints and actual values with their trends."""
    columns = ValueColumns([*drive.setpoints, *drive.values])
    trend = min(_TREND_MAX, width - columns.width - 2)
    trend = trend if trend >= 8 else 0
    lines: Lines = []
    for heading, items in (('setpoint, as sent', drive.setpoints), ('actual value', drive.values)):
        if items:
            lines.append(Text(heading, style=DIM))
            lines += [columns.line(item, trend) for item in items]
    return lines or [Text('no sample yet', style=DIM)]


def bit_lines(drive: DriveSnapshot, width: int) -> Lines:
    """Write the bits of all words."""
    several = len(drive.bits) > 1
    lines: Lines = []
    for parameter, bits in drive.bits.items():
        if several:
            lines.append(Text(parameter, style=DIM))
        lines += lamps(dict(sorted(bits.items())), width)
    return lines


def exchange_lines(drive: DriveSnapshot, width: int) -> Lines:
    """Write how the exchange goes, and all else that diagnostics say."""
    lines = [
        Text(f'{drive.rate:.1f} exchanges/s, {drive.exchanges} in all, ').append(
            f'{drive.missed} missed', style='bold yellow' if drive.missed else ''),
        *_facts(drive, width, bad=True),
        _times('period error', drive.period_error), _times('latency', drive.latency)]
    if not math.isnan(drive.command_age):
        lines.append(Text(f'last command {drive.command_age:.1f} s ago'))
    return lines + _facts(drive, width, bad=False)


def _facts(drive: DriveSnapshot, width: int, *, bad: bool) -> Lines:
    """Write what has no line of its own: what is bad, or what is not."""
    lines: Lines = []
    for key, value in drive.facts.items():
        if key in _TOLD or value in ('', '0') or bad != any(word in key for word in _BAD):
            continue
        label = key.replace('_', ' ')
        text = wrapped(f'{label}: {value}', width)
        text[0].stylize('bold yellow' if bad else DIM, 0, len(label) + 1)
        lines += text
    return lines


def _times(label: str, found: Times) -> Text:
    return Text(f'{label:12} {milliseconds(found.mean)} ms mean, {milliseconds(found.p99)} p99, '
                f'{milliseconds(found.maximum)} max')


def screens(drive: DriveSnapshot, height: int) -> int:
    """Return how many screens of so many lines the parameters take."""
    return max(1, -(-len(drive.parameters) // max(1, height)))


def on_screen(drive: DriveSnapshot, screen: int, height: int) -> tuple[ParameterInfo, ...]:
    """Return the parameters on a screen of so many lines; behind the last is the first again."""
    height = max(1, height)
    first = screen % screens(drive, height) * height
    return drive.parameters[first:first + height]


def parameter_table(drive: DriveSnapshot, shown: Sequence[ParameterInfo], width: int) -> Table:
    """Write parameters with the values that were read."""
    name = max((len(info.name) for info in drive.parameters), default=4)
    number = max((info.width for info in drive.parameters), default=8)
    unit = max((len(info.unit) for info in drive.parameters), default=0)
    allowed = min(max((len(info.range_text) for info in drive.parameters), default=0), 24)
    columns = {'name': name, 'value': number, 'unit': max(unit, len('unit'))}
    left = width - sum(columns.values()) - 2 * len(columns)
    for key, wanted in (('access', 9), ('allowed', allowed), ('number', 10), ('storage', 7)):
        if wanted and left >= wanted + 2:
            columns[key] = wanted
            left -= wanted + 2
    if left >= 16:
        columns['description'] = left
    table = plain_table()
    for key, wide in columns.items():
        table.add_column(key, width=wide, no_wrap=True,
                         justify='right' if key == 'value' else 'left')
    for info in shown:
        cells = {'name': Text(info.name), 'value': _reading(drive, info),
                 'unit': Text(info.unit, style=DIM), 'access': Text(_access(info), style=DIM),
                 'allowed': Text(info.range_text, style=DIM),
                 'number': Text(info.address, style=DIM),
                 'storage': Text(info.facts.get('storage', ''), style=DIM),
                 'description': Text(info.description, style=DIM, overflow='ellipsis')}
        table.add_row(*(cells[key] for key in columns))
    return table


def _access(info: ParameterInfo) -> str:
    role = info.facts.get('role')
    return role if role else 'read' if info.read_only else 'write' if not info.readable else ''


def _reading(drive: DriveSnapshot, info: ParameterInfo) -> Text:
    reading = drive.readings.get(info.name)
    if not info.readable:
        return Text('no read', style=DIM)
    if reading is None:
        return Text('…', style=DIM)
    return Text(reading.text, style=NUMBER) if reading.text else Text('failed', style='bold red')
