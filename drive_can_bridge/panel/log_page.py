# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Diagnostics of all bridges, buses and drives, and the log."""

from collections.abc import Sequence
import time
from typing import Any

from nicegui import ui

from drive_can_bridge.monitor.snapshot import LogLine, Snapshot
from drive_can_bridge.panel.parts import box, Changing, level_class, Look, words

_LINES = 100


class LogPage:
    """The page."""

    def __init__(self) -> None:
        with box('section'):
            words('Diagnostics', 'title')
            self._states = Changing(box('facts states'), _make_states)
        with box('section'):
            words('Log, the newest above', 'title')
            self._log = box('log')
        self._shown: list[tuple[LogLine, Any]] = []

    def show(self, snapshot: Snapshot) -> None:
        """Show it all."""
        told: list[tuple[str, str, str]] = []
        for bridge in snapshot.bridges:
            told.append((f'bridge {bridge.name}', 'error' if bridge.silent else 'ok',
                         f'silent for {bridge.silent:.0f} s: is it still running?'
                         if bridge.silent else 'runs'))
        told += [(f'bus {bus.label}', level_class(bus.level), f'{bus.state}: {bus.message}')
                 for bus in snapshot.buses]
        told += [(f'drive {drive.label}', level_class(drive.level), drive.advice)
                 for drive in snapshot.drives]
        rows = self._states.of(tuple(name for name, _, _ in told))
        for (look, label), (_, level, text) in zip(rows, told):
            look.set(level)
            label.set_text(text)
        self._show_log(snapshot.log[-_LINES:])

    def _show_log(self, lines: Sequence[LogLine]) -> None:
        known = [line for line, _ in self._shown]
        fresh = lines[_overlap(known, lines):]
        for line in fresh:
            with self._log:
                row = box(line.level)
                row.move(target_index=0)
                with row:
                    words(time.strftime('%H:%M:%S', time.localtime(line.at)), 'number dim')
                    words(line.level, 'level')
                    words(f'{line.logger}: {line.text}', 'text')
            self._shown.append((line, row))
        while len(self._shown) > _LINES:
            self._shown.pop(0)[1].delete()


def _overlap(known: Sequence[LogLine], lines: Sequence[LogLine]) -> int:
    """Return how many of the lines are the last ones that are known."""
    for count in range(min(len(known), len(lines)), 0, -1):
        if known[-count:] == list(lines[:count]):
            return count
    return 0


def _make_states(names: tuple[str, ...]) -> list[tuple[Look, ui.label]]:
    made = []
    for name in names:
        words(name, 'key')
        label = words('', 'fact')
        made.append((Look(label, 'fact answer'), label))
    return made
