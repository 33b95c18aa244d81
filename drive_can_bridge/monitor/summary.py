# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Many drives at a glance: colours with one legend for all views, the worst first, and advice.

Also command lines that work as they stand in another terminal, and drives as lines for pipes.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
import math
import re
from typing import Any

from drive_can_bridge.core import sentences
from drive_can_bridge.core.events import DriveState
from drive_can_bridge.core.text import counted
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Level, Shown, Snapshot, Times, UNKNOWN

#: drives that one page shows in the order of their configuration, and in full; more are sorted
FEW = 6
#: drives with the same trouble that are named
_NAMED = 4
_OTHER = '…'
#: s that a bridge may take to report its drives for the first time
_UNHEARD = 5.0
#: what differs although the trouble is the same: times and counts, not which fault it is
_VARYING = re.compile(r'\b\d+:\d\d:\d\d\b|(?<!fault )\b\d+(?:\.\d+)?\b')
#: units of what moves
_MOVING = {'rpm', 'rad/s', 'deg/s', 'rev', 'rev/s', 'Hz', 'm/s', 'mm/s', 'm', 'mm', 'rad', 'deg'}


class Tone(Enum):
    """The colours of drives, by their legend; the worst first."""

    ERROR = 'fault, offline or not seen'
    UNKNOWN = 'its bridge is silent'
    WARN = 'not armed, or a warning'
    OFF = 'disabled'
    OK = 'enabled and armed'


_RANKS = {tone: rank for rank, tone in enumerate(Tone)}
_OF_LEVEL = {Level.WARN: Tone.WARN, Level.ERROR: Tone.ERROR, Level.STALE: Tone.ERROR}


def tone_of(drive: DriveSnapshot) -> Tone:
    """Return the colour of a drive."""
    if drive.silent:
        return Tone.UNKNOWN
    return _OF_LEVEL.get(drive.level, Tone.OK if drive.state == 'online' else Tone.OFF)


def in_order(drives: Sequence[DriveSnapshot]) -> tuple[DriveSnapshot, ...]:
    """Return drives in the order of the view: the worst first where they are many."""
    if len(drives) <= FEW:
        return tuple(drives)
    return tuple(sorted(drives, key=lambda drive: _RANKS[tone_of(drive)]))


def counts(drives: Iterable[DriveSnapshot]) -> list[tuple[Tone, str, int]]:
    """Count drives by state; the worst first."""
    found = Counter((tone_of(drive), drive.state or UNKNOWN) for drive in drives)
    return [(tone, state, count) for (tone, state), count in sorted(
        found.items(), key=lambda each: (_RANKS[each[0][0]], each[0][1]))]


def counts_in_words(drives: Sequence[DriveSnapshot]) -> str:
    """Return ``15 drives: 2 offline, 4 not armed, 9 online``."""
    states = Counter[str]()
    for _, state, count in counts(drives):
        states[state] += count
    told = ', '.join(f'{count} {state}' for state, count in states.items())
    return counted(len(drives), 'drive') + (f': {told}' if told else '')


def principal(items: Sequence[Shown]) -> Shown | None:
    """Return the most important value: what moves, or else one with a unit, or the first."""
    wishes: tuple[Callable[[Shown], bool], ...] = (
        lambda item: item.unit in _MOVING, lambda item: bool(item.unit), lambda item: True)
    return next((item for wish in wishes for item in items if wish(item)), None)


@dataclass(frozen=True, slots=True)
class Trouble:
    """
    A problem, and what to do.

    :param who: a bus, a drive, or how many of them; begins the text.
    :param drives: full names of those.
    """

    tone: Tone
    who: str
    text: str
    drives: tuple[str, ...] = ()


def troubles(snapshot: Snapshot) -> list[Trouble]:
    """
    Return the problems: the worst first, drives with the same problem together.

    A silent bridge has a banner of its own (:func:`silence`).
    """
    found = [Trouble(_OF_LEVEL[bus.level], f'bus {bus.label}', f': {bus.message}')
             for bus in snapshot.buses if bus.level is not Level.OK and bus.state != UNKNOWN]
    alike: dict[tuple[Tone, str], list[DriveSnapshot]] = {}
    for drive in snapshot.drives:
        if drive.level is not Level.OK and not drive.silent:
            key = tone_of(drive), _VARYING.sub(_OTHER, _of_anybody(drive))
            alike.setdefault(key, []).append(drive)
    for (tone, text), drives in alike.items():
        if len(drives) == 1:
            drive = drives[0]
            found.append(Trouble(tone, drive.label, f': {drive.advice}', (drive.name,)))
        else:
            texts = {_of_anybody(drive) for drive in drives}
            text = text if len(texts) > 1 else texts.pop()
            names = ', '.join(drive.label for drive in drives[:_NAMED])
            more = f' and {len(drives) - _NAMED} more' if len(drives) > _NAMED else ''
            found.append(Trouble(tone, f'{len(drives)} drives', f' {text} ({names}{more})',
                                 tuple(drive.name for drive in drives)))
    return sorted(found, key=lambda trouble: _RANKS[trouble.tone])


def _of_anybody(drive: DriveSnapshot) -> str:
    """Return the advice for a drive without its name."""
    text = drive.advice.replace(f'{drive.name}/', f'/{_OTHER}/')
    own = re.escape(drive.name.rpartition('/')[2])
    return re.sub(rf'(?<![\w/.]){own}(?![\w.])', _OTHER, text)


def silence(snapshot: Snapshot, clock: Callable[[float], str]) -> list[str]:
    """
    Return a line for each silent bridge, and one for drives without a bridge.

    :param clock: writes a time of day.
    """
    lines: list[str] = []
    for bridge in snapshot.bridges:
        if bridge.silent:
            name = f'{bridge.name} ' if len(snapshot.bridges) > 1 else ''
            since = clock(snapshot.at - bridge.silent)
            lines.append(sentences.bridge_silent_since(name, since))
    unheard = [name for name, seconds in snapshot.unheard.items() if seconds > _UNHEARD]
    if unheard:
        lines.append(sentences.no_bridge_tells(
            [*unheard[:_NAMED], *([_OTHER] if unheard[_NAMED:] else [])]))
    return lines


#: s that a drive which came online may take until it is known what its values mean, and until the
#: turn of its samples has come
_PATIENCE = 2.0


class Lines:
    """
    Lines for all drives, again and again.

    That a drive is online arrives before its first sample, up to some seconds on a busy machine. A
    line that says ``online`` has the values, so until then there is none of a drive that is new,
    and one that was shown before is ``offline`` still. Samples that this monitor did not ask
    for, because there are too many, are not waited for.
    """

    def __init__(self) -> None:
        self._online_since: dict[str, float] = {}
        self._told: set[str] = set()

    def look(self, snapshot: Snapshot, now: float) -> list[str]:
        """Return a line for each drive whose state is known."""
        told = []
        for drive in snapshot.drives:
            if self._known(drive, now) or not drive.online:
                told.append(line(drive))
            elif drive.name in self._told or now - self._online_since[drive.name] > _PATIENCE:
                told.append(f'{drive.label} offline')
            else:
                continue
            self._told.add(drive.name)
        return told

    def _known(self, drive: DriveSnapshot, now: float) -> bool:
        if not drive.online:
            self._online_since.pop(drive.name, None)
            return False
        elapsed = now - self._online_since.setdefault(drive.name, now)
        if drive.sampled:
            # without its descriptors a value has no unit, which is better than no value
            return bool(drive.parameters) or elapsed > _PATIENCE
        return elapsed > _PATIENCE and drive.asked_for < elapsed


def documents(snapshot: Snapshot) -> list[dict[str, Any]]:
    """Return the documents of all drives for programs."""
    return [{'time': round(snapshot.at, 3), 'drive': drive.name, 'bridge': drive.bridge,
             'state': drive.state, 'level': drive.level.name, 'online': drive.online,
             'message': drive.advice, 'control': drive.control,
             'setpoints': _values(drive.setpoints), 'values': _values(drive.values),
             'exchanges': drive.exchanges, 'missed': drive.missed} for drive in snapshot.drives]


def _values(shown: Sequence[Shown]) -> dict[str, dict[str, Any]]:
    return {each.name: {'value': _value(each.text), 'unit': each.unit} for each in shown}


def _value(text: str) -> float | bool | str | None:
    """Return a shown value as a number where it is one; None: there is none yet."""
    if text in ('true', 'false'):
        return text == 'true'
    word = text.partition(' ')[0]       # behind it, the name of the value
    try:
        number = int(word, 16) if word.startswith('0x') else float(word)
    except ValueError:
        return text or None
    return number if math.isfinite(number) else text


def line(drive: DriveSnapshot) -> str:
    """Return ``conveyor online actual_speed=12.3 rpm motor_current=1.25 A``, or what is wrong."""
    if not drive.online:
        why = drive.advice.removeprefix('offline').lstrip(': ')
        return f'{drive.label} offline' + f' ({why})' * bool(why)
    known = [shown.assignment for shown in drive.values if shown.assignment]
    fault = [f'({drive.advice})'] * (drive.state == DriveState.FAULT.value)
    return ' '.join([drive.label, 'online', *fault, *known])


def balance(snapshot: Snapshot) -> list[str]:
    """Return a line for each drive on how its exchange went."""
    width = max((len(drive.label) for drive in snapshot.drives), default=0)
    return [f'{drive.label:{width}}  {_balance(drive)}' for drive in snapshot.drives]


def _balance(drive: DriveSnapshot) -> str:
    if not drive.exchanges:
        return 'no exchange'
    return (f'{drive.exchanges} exchanges, {drive.missed} missed, '
            f'period error {_in_words(drive.period_error)}, latency {_in_words(drive.latency)}')


def _in_words(times: Times) -> str:
    return f'{times.mean:.2f} ms (p99 {times.p99:.2f})'
