# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""One drive in detail."""

import math

from rich.text import Text

from drive_can_bridge.monitor.reports import Level
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Times
from drive_can_bridge.monitor.summary import tone_of
from drive_can_bridge.view.parts import (
    DIM, flow, lamps, Lines, milliseconds, state, TONE_STYLES, ValueColumns, wrapped,
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
        lines += wrapped(drive.advice, width, TONE_STYLES[tone_of(drive)])
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
