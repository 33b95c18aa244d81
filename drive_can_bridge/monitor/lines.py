# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives in lines of text, for pipes and for the end."""

from collections.abc import Sequence
import math
from typing import Any

from drive_can_bridge.core.drive_state import DriveState
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Shown, Snapshot, Times


#: s that a drive which came online may take until it is known what its values mean, and until the
#: turn of its samples has come
_PATIENCE = 2.0


class Lines:
    """
    A line for each drive, again and again.

    That a drive is online is told before its first sample arrives here: on topics of their own, a
    moment or, on a busy machine, some seconds apart. A line that says ``online`` has the values,
    so until then it says ``offline``, which is what the model says of samples that stay away, too.
    Samples that this monitor did not ask for, because there are too many, are not waited for.
    """

    def __init__(self) -> None:
        self._online_since: dict[str, float] = {}

    def look(self, snapshot: Snapshot, now: float) -> list[str]:
        """Return a line for each drive."""
        return [line(drive) if self._known(drive, now) or not drive.online
                else f'{drive.label} offline' for drive in snapshot.drives]

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
    """Return what programs are told of each drive."""
    return [{'time': round(snapshot.at, 3), 'drive': drive.name, 'bridge': drive.bridge,
             'state': drive.state, 'level': drive.level.name, 'online': drive.online,
             'message': drive.advice, 'control': drive.control,
             'setpoints': _values(drive.setpoints), 'values': _values(drive.values),
             'exchanges': drive.exchanges, 'missed': drive.missed} for drive in snapshot.drives]


def _values(shown: Sequence[Shown]) -> dict[str, dict[str, Any]]:
    return {each.name: {'value': _value(each.text), 'unit': each.unit} for each in shown}


def _value(text: str) -> float | bool | str | None:
    """Return a value that is shown as a number where it is one; None: there is none yet."""
    if text in ('true', 'false'):
        return text == 'true'
    try:
        number = float(text.partition(' ')[0])      # behind it, the name of the value
    except ValueError:
        return text or None
    return number if math.isfinite(number) else text


def line(drive: DriveSnapshot) -> str:
    """Write ``conveyor online actual_speed=12.3 rpm motor_current=1.25 A``, or what is wrong."""
    if not drive.online:
        why = drive.advice.removeprefix('offline').lstrip(': ')
        return f'{drive.label} offline' + f' ({why})' * bool(why)
    known = [shown.assignment for shown in drive.values if shown.assignment]
    fault = [f'({drive.advice})'] * (drive.state == DriveState.FAULT.value)
    return ' '.join([drive.label, 'online', *fault, *known])


def balance(snapshot: Snapshot) -> list[str]:
    """Say of each drive how the exchange went."""
    width = max((len(drive.label) for drive in snapshot.drives), default=0)
    return [f'{drive.label:{width}}  {_balance(drive)}' for drive in snapshot.drives]


def _balance(drive: DriveSnapshot) -> str:
    if not drive.exchanges:
        return 'no exchange'
    return (f'{drive.exchanges} exchanges, {drive.missed} missed, '
            f'period error {_in_words(drive.period_error)}, latency {_in_words(drive.latency)}')


def _in_words(times: Times) -> str:
    return f'{times.mean:.2f} ms (p99 {times.p99:.2f})'
