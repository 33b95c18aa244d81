# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""Diagnostics of all bridges, buses and drives, and the log."""

from collections.abc import Sequence
import time
from typing import Any

from nicegui import ui

from drive_can_bridge.monitor.snapshot import LogLine, Snapshot
from drive_can_bridge.monitor.summary import in_order, tone_of
from drive_can_bridge.panel.parts import box, Changing, level_class, Look, tone_class, words

_LINES = 100


class LogPage:
    """The page."""

    def __init__(self) -> None:
        with box('section'):
            words('Diagnostics', 'title')
            self._states = Changing(box('facts states'), _make_states)
        with box('section'):
            with box('row-of'):
                words('Log, the newest above', 'title')
                box('space')
                self._filter = ui.input(placeholder='filter: words, level').classes('search')
                self._filter.props('dense outlined clearable debounce=200')
                self._filter.on_value_change(self._again)
                with box('plain', 'button').props('type=button').on('click', self._pause):
                    self._pausing = ui.label('Pause')
            self._log = box('log')
        self._shown: list[tuple[LogLine, Any]] = []
        self._snapshot = Snapshot()
        self._paused: Sequence[LogLine] | None = None

    def show(self, snapshot: Snapshot) -> None:
        """Show it all."""
        self._snapshot = snapshot
        told: list[tuple[str, str, str]] = []
        for bridge in snapshot.bridges:
            told.append((f'bridge {bridge.name}', 'error' if bridge.silent else '',
                         'silent' if bridge.silent else 'runs'))
        told += [(f'bus {bus.label}', level_class(bus.level), f'{bus.state}: {bus.message}')
                 for bus in snapshot.buses]
        told += [(f'drive {drive.label}', tone_class(tone_of(drive)), drive.advice)
                 for drive in in_order(snapshot.drives)]
        rows = self._states.of(tuple(name for name, _, _ in told))
        for (look, label), (_, level, text) in zip(rows, told):
            look.set(level)
            label.set_text(text)
        self._show_log(snapshot.log if self._paused is None else self._paused)

    def _pause(self) -> None:
        self._paused = self._snapshot.log if self._paused is None else None
        self._pausing.set_text('Pause' if self._paused is None else 'Go on')
        self.show(self._snapshot)

    def _again(self) -> None:
        self._log.clear()
        self._shown.clear()
        self.show(self._snapshot)

    def _show_log(self, everything: Sequence[LogLine]) -> None:
        wanted = (self._filter.value or '').lower().split()
        lines = [line for line in everything if all(
            word in f'{line.level} {line.logger}: {line.text}'.lower() for word in wanted)]
        lines = lines[-_LINES:]
        known = [line for line, _ in self._shown]
        fresh = lines[_overlap(known, lines):]
        for line in fresh:
            with self._log:
                row = box(line.level)
                row.move(target_index=0)
                with row:
                    words(time.strftime('%Y-%m-%d %H:%M:%S', time.localtime(line.at)),
                          'number dim')
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
