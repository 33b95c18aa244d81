# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""All drives and buses at a glance."""

import math
from typing import Any
from urllib.parse import quote

from nicegui import ui

from drive_can_bridge.monitor.reports import Level
from drive_can_bridge.monitor.snapshot import BusSnapshot, DriveSnapshot, Snapshot
from drive_can_bridge.panel.access import Role
from drive_can_bridge.panel.feed import stops
from drive_can_bridge.panel.parts import (
    box, Changing, level_class, Look, marked, place_in_words, stop_buttons, Values, words,
)


class Overview:
    """
    The page.

    :param place: where bridges are looked for, in words.
    """

    def __init__(self, role: Role, place: str) -> None:
        self._role = role
        self._nothing = words(f'No bridge yet. Looking for one in {place}.', 'note')
        self._buses = Changing(box('buses'), lambda names: [_Bus() for _ in names])
        self._cards = Changing(box('cards'), self._make_cards)
        self._snapshot = Snapshot()

    def show(self, snapshot: Snapshot) -> None:
        """Show everything."""
        self._snapshot = snapshot
        self._nothing.set_visibility(not snapshot.bridges)
        buses = self._buses.of(tuple((bus.bridge, bus.name) for bus in snapshot.buses))
        for shown, bus in zip(buses, snapshot.buses):
            shown.show(bus)
        cards = self._cards.of(tuple((drive.name, drive.label, stops(drive))
                                     for drive in snapshot.drives))
        for card, drive in zip(cards, snapshot.drives):
            card.show(drive)

    def _make_cards(self, _: Any) -> list['_Card']:
        return [_Card(drive, self._role) for drive in self._snapshot.drives]


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
    """One drive among the others."""

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
                stop_buttons(drive, role)

    def show(self, drive: DriveSnapshot) -> None:
        self._look.set(level_class(drive.level))
        self._state.set_text(drive.state or 'unknown')
        self._control.set_text('' if drive.control == drive.state else drive.control)
        self._advice.set_text('' if drive.level is Level.OK else drive.advice)
        self._values.show(drive)
        self._place.set_text(place_in_words(drive))
