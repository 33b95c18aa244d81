# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""All drives and buses at a glance: a few as cards, more as rows, the worst first."""

from functools import partial
import math
from typing import Any
from urllib.parse import quote

from nicegui import ui

from drive_can_bridge.monitor.snapshot import BusSnapshot, DriveSnapshot, Level, Shown, Snapshot
from drive_can_bridge.monitor.summary import (
    counts, FEW, in_order, principal, Tone, tone_of, Trouble, troubles,
)
from drive_can_bridge.panel.access import Role
from drive_can_bridge.panel.feed import stops
from drive_can_bridge.panel.parts import (
    box, Changing, level_class, Look, marked, place_in_words, StopButtons, tone_class, Values,
    words,
)


class Overview:
    """
    The page.

    :param place: where bridges are looked for, in words.
    """

    def __init__(self, role: Role, place: str) -> None:
        self._role = role
        self._snapshot = Snapshot()
        self._nothing = words(f'No bridge yet. Looking for one in {place}.', 'note')
        self._head = box('row-of')
        with self._head:
            self._counts = Changing(box('row-of counts'), self._make_counts)
            box('space')
            self._filter = ui.input(placeholder='filter: name, state, bus').classes('search')
            self._filter.props('dense outlined clearable debounce=200')
            self._filter.on_value_change(lambda: self.show(self._snapshot))
        self._troubles = Changing(box('troubles'), _make_troubles)
        self._buses = Changing(box('cards'), lambda names: [_Bus() for _ in names])
        self._drives = Changing(box('drives'), self._make_drives)
        with box('legend dim') as self._legend:
            for tone in reversed(Tone):
                words(tone.value, f'key {tone_class(tone)}')

    def show(self, snapshot: Snapshot) -> None:
        """Show everything."""
        self._snapshot = snapshot
        drives = snapshot.drives
        many = len(drives) > FEW
        self._nothing.set_visibility(not snapshot.bridges)
        self._head.set_visibility(bool(drives))
        self._filter.set_visibility(many)
        self._legend.set_visibility(bool(drives))
        found = counts(drives)
        for label, (_, state, count) in zip(
                self._counts.of(tuple((tone, state) for tone, state, _ in found)), found):
            label.set_text(f'{count} {state}')
        # what concerns one drive stands in its card
        told = [trouble for trouble in troubles(snapshot)
                if trouble.drives and (many or len(trouble.drives) > 1)]
        self._troubles.of(tuple(told))
        buses = self._buses.of(tuple((bus.bridge, bus.name) for bus in snapshot.buses))
        for shown, bus in zip(buses, snapshot.buses):
            shown.show(bus)
        rows = self._drives.of((many, *((drive.name, drive.label, stops(drive))
                                        for drive in drives)))
        places = {drive.name: place for place, drive in enumerate(in_order(drives))}
        together = {name for trouble in told for name in trouble.drives}
        wanted = (self._filter.value or '').lower().split() if many else []
        for row, drive in zip(rows, drives):
            row.show(drive, places[drive.name], advice=drive.name not in together,
                     hidden=any(word not in _searchable(drive) for word in wanted))

    def _make_counts(self, found: tuple[tuple[Tone, str], ...]) -> list[ui.label]:
        def choose(state: str) -> None:
            self._filter.set_value('' if self._filter.value == state else state)
        labels = []
        for tone, state in found:
            with box(f'count {tone_class(tone)}', 'button').props('type=button').on(
                    'click', partial(choose, state)):
                labels.append(words('', 'chip state'))
        return labels

    def _make_drives(self, key: tuple[Any, ...]) -> list[Any]:
        many = key[0]
        with box('section rows' if many else 'cards'):
            return [(_Row if many else _Card)(drive, self._role)
                    for drive in self._snapshot.drives]


def _searchable(drive: DriveSnapshot) -> str:
    return f'{drive.label} {drive.state} {drive.control} {place_in_words(drive)}'.lower()


def _make_troubles(found: tuple[Trouble, ...]) -> None:
    if found:
        with box('section'):
            for trouble in found:
                with box(f'trouble {tone_class(trouble.tone)}'):
                    words(f'{trouble.who}{trouble.text}')


class _Bus:
    def __init__(self) -> None:
        element = box('bus')
        self._look = Look(element, 'bus')
        with element:
            with box('line'):
                self._name = words('', 'name')
                self._rates = words('', 'number dim')
            with box('load'):
                self._load = box()
            self._message = words('', 'advice dim')

    def show(self, bus: BusSnapshot) -> None:
        load = 0.0 if math.isnan(bus.load) else min(max(bus.load, 0.0), 100.0)
        self._look.set(level_class(bus.level))
        self._name.set_text(f'bus {bus.label}: {bus.state}')
        self._rates.set_text('' if math.isnan(bus.load) else
                             f'load {bus.load:.0f} % · {bus.sent + bus.received:.0f} frames/s')
        self._load.style(f'width: {load:.0f}%')
        self._message.set_text(bus.message)


class _Card:
    """One drive among a few."""

    def __init__(self, drive: DriveSnapshot, role: Role) -> None:
        element = marked(box('card'), drive=drive.name)
        self._look = Look(element, 'card')
        with element:
            with box('top'):
                ui.link(drive.label, f'/drive{quote(drive.name)}').classes('name')
                self._state = words('', 'chip state')
                self._control = words('', 'dim')
            self._advice = words('', 'advice')
            self._values = Values()
            with box('foot'):
                self._place = words('', 'dim')
                self._stops = StopButtons(drive, role)

    def show(self, drive: DriveSnapshot, _: int, *, advice: bool, hidden: bool) -> None:
        self._look.set(f'{tone_class(tone_of(drive))}{" hidden-now" if hidden else ""}')
        self._state.set_text(drive.state or 'unknown')
        self._control.set_text('' if drive.control == drive.state else drive.control)
        self._advice.set_text(
            drive.advice if advice and drive.level is not Level.OK and not drive.silent else '')
        self._values.show(drive)
        self._place.set_text(place_in_words(drive))
        self._stops.show(drive)


class _Row:
    """One drive among many."""

    def __init__(self, drive: DriveSnapshot, role: Role) -> None:
        self._element = marked(box('drive-row'), drive=drive.name)
        self._look = Look(self._element, 'drive-row')
        self._order = -1
        with self._element:
            ui.link(drive.label, f'/drive{quote(drive.name)}').classes('name')
            self._state = words('', 'chip state')
            self._values = [words('', 'number'), words('', 'number')]
            self._place = words('', 'dim')
            self._stops = StopButtons(drive, role)

    def show(self, drive: DriveSnapshot, place: int, *, advice: bool, hidden: bool) -> None:
        self._look.set(f'{tone_class(tone_of(drive))}{" hidden-now" if hidden else ""}')
        if place != self._order:    # no row is made anew: somebody may be about to click
            self._order = place
            self._element.style(f'order: {place}')
        self._state.set_text(drive.state or 'unknown')
        for label, arrow, shown in zip(self._values, ('→ ', ''), (drive.setpoints, drive.values)):
            label.set_text(arrow + _value(principal(shown)) if shown else '')
        self._place.set_text(place_in_words(drive))
        self._stops.show(drive)


def _value(shown: Shown | None) -> str:
    return f'{shown.text or "–"} {shown.unit}' if shown is not None else ''
