# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Drives in lines of text, for pipes and for the end."""

from drive_can_bridge.monitor.snapshot import DriveSnapshot, Snapshot, Times


def line(drive: DriveSnapshot) -> str:
    """Write ``conveyor online actual_speed=12.3 rpm motor_current=1.25 A``."""
    if not drive.online:
        return f'{drive.label} offline'
    return ' '.join([drive.label, 'online', *(shown.assignment for shown in drive.values)])


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
