# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
When in each period which drive has its turn.

Drives that are all served at the same instant wait for each other: on the wire, where the last of
fifteen at 1 Mbit/s gets its request after two and its answer after four of five milliseconds, and
again in this process, where each answer is published before the next one is looked at. So drives
of the same period are spread over it; but no finer than ``SLOT``, because every turn costs a wake-
up, and five exchanges at 1 Mbit/s fill a slot (docs/performance.md has what other slots cost).
"""

from collections.abc import Sequence

#: s between two turns at least
SLOT = 0.0015


def spread(periods: Sequence[float]) -> list[float]:
    """
    Return for each drive when in its period its turn is, in s.

    Drives of a period are taken in the order given; as many of them as need be share a slot.
    """
    groups: dict[float, list[int]] = {}
    for index, period in enumerate(periods):
        groups.setdefault(period, []).append(index)
    phases = [0.0] * len(periods)
    for period, members in groups.items():
        slots = max(1, min(len(members), int(period / SLOT + 1e-6)))
        for place, index in enumerate(members):
            phases[index] = place * slots // len(members) * period / slots
    return phases
