# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""One drive: its values and bits, a chart, its parameters, what diagnostics say."""

from collections.abc import Mapping
import math
from typing import Any

from nicegui import ui

from drive_can_bridge.monitor.reports import Level
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Snapshot, Times
from drive_can_bridge.monitor.summary import tone_of
from drive_can_bridge.panel.access import Role
from drive_can_bridge.panel.chart import Chart
from drive_can_bridge.panel.feed import Feed, stops, View
from drive_can_bridge.panel.parameter_table import ParameterTable
from drive_can_bridge.panel.parts import (
    box, button, Changing, in_script, Look, place_in_words, StopButtons, tone_class, Values, words,
)

#: bits that are good news when they are not set
_BAD_BITS = ('fault', 'warning', 'error', 'alarm')


class DrivePage:
    """
    The page of one drive.

    :param name: full name of its node.
    :param allow_writes: parameters may be written by an operator.
    """

    def __init__(self, feed: Feed, name: str, role: Role, *, allow_writes: bool) -> None:
        self._feed = feed
        self._name = name
        self._role = role
        self._writes = allow_writes and role is Role.OPERATOR
        self.view = View(self.show, [name])
        with box('note') as self._gone:
            words(f'There is no drive {name} now', 'title')
            words('It appears here when its bridge runs.')
            ui.link('All drives', '/').classes('back')
        self._content = Changing(box('page-of'), self._make)
        self._drive: DriveSnapshot | None = None

    def show(self, snapshot: Snapshot) -> None:
        """Show the drive."""
        drive = self._drive = snapshot.drive(self._name) or self._drive
        there = drive is not None and snapshot.drive(self._name) is not None
        self._gone.set_visibility(not there)
        if drive is None or not there:
            return
        content = self._content.of(('drive', stops(drive)))
        content.show(drive, snapshot)

    def _make(self, _: Any) -> '_Content':
        drive = self._drive
        if drive is None:
            raise RuntimeError('made before there is a drive')
        return _Content(self._feed, self.view, drive, self._role, writes=self._writes)


class _Content:
    def __init__(self, feed: Feed, view: View, drive: DriveSnapshot, role: Role, *,
                 writes: bool) -> None:
        head = box('head')
        self._look = Look(head, 'head')
        with head:
            with box('row-of'):
                words(drive.label, 'title')
                self._state = words('', 'chip state')
                self._control = words('')
                box('space')
                self._stops = StopButtons(drive, role)
            self._advice = words('', 'advice')
            self._place = words('', 'dim')
        with ui.tabs().props('no-caps').classes('tabs') as tabs:
            for name in ('Live', 'Parameters', 'Diagnostics'):
                ui.tab(name)
        with ui.tab_panels(tabs, value='Live', animated=False) as panels:
            with ui.tab_panel('Live'):
                with box('two'):
                    with box('section'):
                        words('Setpoints as sent, and actual values', 'dim')
                        self._values = Values()
                        words('Bits', 'dim')
                        self._bits = Changing(box('lamps'), _make_lamps)
                    with box('section'):
                        self._chart = Chart(view, drive)
            with ui.tab_panel('Parameters'):
                self._parameters = ParameterTable(feed, drive.name, writes=writes)
                with box('section row-of'):
                    name = in_script(drive.name)
                    button('Download a backup', 'plain', f'panel.backup({name}, button)')
                    button('Compare with a backup …', 'plain',
                           f'panel.compare({name}, {in_script(writes)})')
            with ui.tab_panel('Diagnostics'):
                with box('section'):
                    self._facts = Changing(box('facts'), _make_facts)
        self._panels = panels
        panels.on_value_change(lambda: self._parameters.look(self._panels.value == 'Parameters'))

    def show(self, drive: DriveSnapshot, snapshot: Snapshot) -> None:
        self._look.set(tone_class(tone_of(drive)))
        self._stops.show(drive)
        self._state.set_text(drive.state or 'unknown')
        self._control.set_text('' if drive.control == drive.state else drive.control)
        self._advice.set_text(
            '' if drive.level is Level.OK or drive.silent else drive.advice)
        self._place.set_text(' · '.join(filter(None, (
            place_in_words(drive), f'{drive.rate:.0f} exchanges/s' if drive.rate else '',
            f'by {drive.bridge}'))))
        tab = self._panels.value
        if tab == 'Live':
            self._values.show(drive)
            bits = {f'{parameter}.{bit}' if len(drive.bits) > 1 else bit: state
                    for parameter, found in sorted(drive.bits.items())
                    for bit, state in sorted(found.items())}
            for (bit, state), look in zip(bits.items(), self._bits.of(tuple(bits))):
                bad = bit.rpartition('.')[2].startswith(_BAD_BITS)
                look.set(f'{"on" if state else ""}{" bad" if bad else ""}')
        elif tab == 'Parameters':
            self._parameters.show(drive)
        else:
            facts = _facts(drive)
            for label, text in zip(self._facts.of(tuple(facts)), facts.values()):
                label.set_text(text)
        # also behind other pages, so that nothing is missing in it afterwards
        self._chart.show(snapshot)


def _make_lamps(names: tuple[str, ...]) -> list[Look]:
    return [Look(words(name, 'lamp'), 'lamp') for name in names]


def _make_facts(names: tuple[str, ...]) -> list[ui.label]:
    labels = []
    for name in names:
        words(name.replace('_', ' '), 'key')
        labels.append(words('', 'fact'))
    return labels


def _facts(drive: DriveSnapshot) -> Mapping[str, str]:
    """Return everything that diagnostics say, times together."""
    told = {key: text for key, text in drive.facts.items()
            if not key.startswith(('period_error_', 'latency_'))}
    return {**told, 'period_error': _times(drive.period_error), 'latency': _times(drive.latency)}


def _times(times: Times) -> str:
    if math.isnan(times.mean):
        return '–'
    return f'{times.mean:.3f} ms mean, {times.p99:.3f} ms p99, {times.maximum:.3f} ms at most'
