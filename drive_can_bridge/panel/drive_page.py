# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
One drive: its values and bits, a chart of values of any drives, its parameters, diagnostics.

The browser keeps and draws the points; what is sent is what is new. So pausing and zooming cost
the panel nothing. Parameters are read over the bus a page at a time, and edited in place.
"""

from collections.abc import Mapping, Sequence
import json
import math
from typing import Any

from nicegui import background_tasks, ui

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import ValueKind
from drive_can_bridge.core.text import counted
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Shown, Snapshot, Times
from drive_can_bridge.monitor.summary import tone_of
from drive_can_bridge.monitor.values import ParameterInfo
from drive_can_bridge.panel.access import PanelRole
from drive_can_bridge.panel.feed import Feed, stops, View
from drive_can_bridge.panel.parts import (
    advice, box, button, Changing, class_of, in_script, Look, marked, place_in_words,
    search_field, stop_buttons, Values, words,
)

_SPANS = {'30 s': 30, '1 min': 60, '10 min': 600}
#: values at first, and at most: more in one chart cannot be told apart
_AT_FIRST = 2
_AT_MOST = 8


class Chart:
    """
    A chart, with the choice of its values.

    :param view: gets the drives that it shows.
    :param drive: the drive whose values it shows at first.
    """

    def __init__(self, view: View, drive: DriveSnapshot) -> None:
        self._view = view
        self._own = drive.name
        self._chosen_once = False
        self._sent_at: dict[str, float] = {}
        self._options: list[str] = []
        with box('row-of'):
            self._choice = ui.select([], multiple=True, label='values', clearable=True).props(
                f'dense outlined use-chips max-values={_AT_MOST}').classes('choice')
        with box('row-of chart-buttons'):
            self._buttons = box('row-of')
        self._chart = ui.echart({
            'animation': False, 'legend': {}, 'tooltip': {'trigger': 'axis'},
            'xAxis': {'type': 'time', 'axisLine': {'onZero': False}},
            'yAxis': [{'type': 'value'}], 'series': [],
            'dataZoom': [{'type': 'inside'}, {'type': 'slider', 'height': 22, 'bottom': 8}],
        }).classes('chart')
        number = self._chart.id
        with self._buttons:
            button('Pause', 'plain', f'panel.pause({number}, button)')
            for text, seconds in _SPANS.items():
                button(text, 'plain', f'panel.span({number}, {seconds})')
            words('zoom: wheel, pinch, or the bar below', 'dim')

    def show(self, snapshot: Snapshot) -> None:
        """Send what is new of the chosen values."""
        found: dict[str, tuple[DriveSnapshot, Shown]] = {
            f'{drive.label}.{shown.name}': (drive, shown)
            for drive in sorted(snapshot.drives, key=lambda drive: drive.name != self._own)
            for shown in (*drive.setpoints, *drive.values)}
        self._offer(found)
        chosen = [name for name in self._choice.value or [] if name in found]
        self._view.focus = frozenset([self._own, *(found[name][0].name for name in chosen)])
        series = []
        for name in chosen:
            shown = found[name][1]
            since = self._sent_at.get(name, 0.0)
            points = [(snapshot.at - ago, value) for ago, value in shown.points]
            fresh = [(round(1e3 * at), value) for at, value in points if at > since]
            self._sent_at[name] = max([since, *(at for at, _ in points)]) + 1e-3
            series.append({'name': name, 'unit': shown.unit, 'points': fresh})
        for name in self._sent_at.keys() - set(chosen):
            del self._sent_at[name]
        if series or self._sent_at:
            self._chart.client.run_javascript(
                f'panel.plot({self._chart.id}, {round(1e3 * snapshot.at)}, {json.dumps(series)})')

    def _offer(self, found: dict[str, tuple[DriveSnapshot, Shown]]) -> None:
        """Update the list of values to choose from; it grows while drives appear."""
        missing = [name for name in found if name not in self._options]
        if missing:
            self._options += missing
            self._choice.set_options(self._options)
        if not self._chosen_once:
            own = [name for name, (drive, shown) in found.items()
                   if drive.name == self._own and shown.unit]
            # measured values first: a setpoint alone shows little
            own.sort(key=lambda name: found[name][1] in found[name][0].setpoints)
            if own:
                self._chosen_once = True
                self._choice.set_value(own[:_AT_FIRST])


_PAGE = 15


class ParameterTable:
    """
    The table.

    :param drive: full name.
    :param writes: values are fields.
    """

    def __init__(self, feed: Feed, drive: str, *, writes: bool) -> None:
        self._feed = feed
        self._drive = drive
        self._writes = writes
        self._parameters: Sequence[ParameterInfo] = ()
        self._seen: Sequence[ParameterInfo] = ()
        self._page = 0
        self._looked_at = False
        self._asked: set[str] = set()
        with box('section'):
            with box('row-of'):
                self._search = search_field(
                    'search name, number, unit, description', self._searched)
                button_row = box('row-of')
                self._count = words('', 'dim')
            self._rows = Changing(box('parameters'), self._make_rows)
            self._nothing = words('This drive has not told of any parameters yet.', 'dim')
        with button_row:
            for text, action in (('Read again', self._read_again),
                                 ('‹', lambda: self._turn(-1)), ('›', lambda: self._turn(1))):
                with box('plain', 'button').props('type=button').on('click', action):
                    ui.label(text)

    def look(self, wanted: bool) -> None:
        """Set whether the table is open: then its values are read."""
        if wanted and not self._looked_at:
            self._read_again()
        self._looked_at = wanted

    def show(self, drive: DriveSnapshot) -> None:
        """Show a page of it."""
        self._parameters = drive.parameters
        found = self._found()
        pages = max(1, -(-len(found) // _PAGE))
        self._page = min(self._page, pages - 1)
        seen = self._seen = found[self._page * _PAGE:(self._page + 1) * _PAGE]
        self._nothing.set_visibility(not drive.parameters)
        self._count.set_text(f'{len(found)} of {len(drive.parameters)} parameters, '
                             f'page {self._page + 1} of {pages}')
        rows = self._rows.of(tuple(seen))
        for row in rows:
            row.show(drive)
        wanted = [info.name for info in seen if info.readable
                  and info.name not in drive.readings and info.name not in self._asked]
        if self._looked_at and drive.online and wanted:
            self._read(wanted)

    def _read(self, names: Sequence[str]) -> None:
        async def read() -> None:
            try:
                await self._feed.read(self._drive, names)
            finally:
                self._asked.difference_update(names)
        self._asked.update(names)
        background_tasks.create(read())

    def _read_again(self) -> None:
        self._again()
        drive = self._feed.drive(self._drive)
        if drive is not None and drive.online:
            self._read([info.name for info in self._seen if info.readable])

    def _turn(self, pages: int) -> None:
        self._page = max(0, self._page + pages)
        self._again()

    def _searched(self) -> None:
        self._page = 0
        self._again()

    def _again(self) -> None:
        drive = self._feed.drive(self._drive)
        if drive is not None:
            self._looked_at = True
            self.show(drive)

    def _found(self) -> list[ParameterInfo]:
        wanted = (self._search.value or '').lower().split()
        return [info for info in self._parameters
                if all(word in _searchable(info) for word in wanted)]

    def _make_rows(self, seen: tuple[ParameterInfo, ...]) -> list['_ParameterRow']:
        return [_ParameterRow(self._drive, info, writes=self._writes) for info in seen]


class _ParameterRow:
    def __init__(self, drive: str, info: ParameterInfo, *, writes: bool) -> None:
        self._info = info
        self._text: str | None = None
        self._field: Any = None
        with marked(box('parameter'), parameter=info.name):
            with box():
                words(info.name, 'name')
                words(' · '.join(filter(None, (
                    info.address, info.facts.get('type', ''), info.facts.get('storage', '')))),
                    'small')
            with box('value'):
                if writes and not info.refusal:
                    script = (f"panel.write({in_script(drive)}, {in_script(info.name)}, "
                              f"event.target.closest('.parameter'))")
                    self._field = ui.input().props('dense outlined').on(
                        'keydown.enter', js_handler=f'(event) => {script}')
                    words(info.unit, 'dim')
                    button('Write', 'plain', script)
                    self._now = words('', 'dim')
                else:
                    self._label = words('…' if info.readable else 'cannot be read', 'number')
            words(_limits(info), 'small number')
            # its end repeats what stands on the left
            words(info.description.partition(f' ({info.address}')[0], 'small')
            box('answer')

    def show(self, drive: DriveSnapshot) -> None:
        """Show a reading; a field that is being edited stays, with the reading beside it."""
        reading = drive.readings.get(self._info.name)
        if reading is None or reading.text == self._text:
            return
        before, self._text = self._text or '', reading.text
        unit = f' {self._info.unit}' if self._info.unit and reading.text else ''
        text = f'{reading.text}{unit}' if reading.text else 'could not be read'
        if self._field is None:
            self._label.set_text(text)
        elif self._field.value in (before, reading.text) or self._same(reading.text):
            self._field.set_value(reading.text)
            self._now.set_text('' if reading.text else text)
        else:
            self._now.set_text(f'now {text}')

    def _same(self, text: str) -> bool:
        """Return whether the typed text is the value that was read."""
        try:
            return self._info.parse(self._field.value) == self._info.parse(text)
        except (ValueRefused, AttributeError):  # empty, or nothing that a browser would send
            return False


def _limits(info: ParameterInfo) -> str:
    if info.kind is ValueKind.BOOL:
        return 'true, false'
    return ' · '.join(filter(None, (
        f'{info.range_text} {info.unit}'.strip() if info.range_text else '',
        ', '.join(f'{value} {name}' for value, name in info.names.items()),
        info.refusal.partition(':')[0])))


def _searchable(info: ParameterInfo) -> str:
    return ' '.join((info.name, info.address, info.unit, info.description,
                     *info.facts.values())).lower()


#: bits that are good news when they are not set
_BAD_BITS = ('fault', 'warning', 'error', 'alarm')


class DrivePage:
    """
    The page of one drive.

    :param name: full name of its node.
    :param allow_writes: operators may write parameters.
    """

    def __init__(self, feed: Feed, name: str, role: PanelRole, *, allow_writes: bool) -> None:
        self._feed = feed
        self._name = name
        self._role = role
        self._writes = allow_writes and role is PanelRole.OPERATOR
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

    def _make(self, _: Any) -> '_PageContent':
        drive = self._drive
        if drive is None:
            raise RuntimeError('made before there is a drive')
        return _PageContent(self._feed, self.view, drive, self._role, writes=self._writes)


class _PageContent:
    def __init__(self, feed: Feed, view: View, drive: DriveSnapshot, role: PanelRole, *,
                 writes: bool) -> None:
        head = box('head')
        self._look = Look(head, 'head')
        with head:
            with box('row-of'):
                words(drive.label, 'title')
                self._state = words('', 'chip state')
                self._control = words('')
                box('space')
                stop_buttons(drive, role)
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
                        self._bits = Changing(box('words'), _make_lamps)
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
        self._look.set(class_of(tone_of(drive)))
        self._state.set_text(drive.state or 'unknown')
        self._control.set_text('' if drive.control == drive.state else drive.control)
        self._advice.set_text(advice(drive, snapshot))
        self._place.set_text(' · '.join(filter(None, (
            place_in_words(drive), f'{drive.rate:.0f} exchanges/s' if drive.rate else '',
            f'by {drive.bridge}'))))
        tab = self._panels.value
        if tab == 'Live':
            self._values.show(drive)
            self._show_bits(drive)
        elif tab == 'Parameters':
            self._parameters.show(drive)
        else:
            facts = _facts(drive)
            for label, text in zip(self._facts.of(tuple(facts)), facts.values()):
                label.set_text(text)
        # also behind other pages, so that nothing is missing in it afterwards
        self._chart.show(snapshot)

    def _show_bits(self, drive: DriveSnapshot) -> None:
        words_of = {parameter: drive.bits_of(parameter) for parameter in sorted(drive.bits)}
        lamps = self._bits.of(tuple(
            (parameter if len(words_of) > 1 else '',
             tuple((bit.number, bit.name, bit.named) for bit in bits))
            for parameter, bits in words_of.items()))
        for look, bit in zip(lamps, (bit for bits in words_of.values() for bit in bits)):
            bad = bit.named and bit.name.startswith(_BAD_BITS)
            look.set(f'{"on" if bit.state else ""}{" bad" if bad else ""}')


def _make_lamps(words_of: tuple[tuple[str, tuple[tuple[int | None, str, bool], ...]], ...],
                ) -> list[Look]:
    """Create a lamp for each bit, in their order; those without a meaning are folded."""
    looks: list[Look] = []
    for parameter, bits in words_of:
        if parameter:
            words(parameter, 'small dim')
        row = box('lamps')
        unnamed = [number for number, _, named in bits if not named]
        if unnamed:
            with box('folded', 'details'):
                with box('dim', 'summary'):
                    ui.label(f'{counted(len(unnamed), "bit")} without a name')
                folded = box('lamps')
        for number, name, named in bits:
            with row if named else folded:
                text = name if number is None else f'{number} {name}' if named else str(number)
                looks.append(Look(words(text, 'lamp'), 'lamp'))
    return looks


def _make_facts(names: tuple[str, ...]) -> list[ui.label]:
    labels = []
    for name in names:
        words(name.replace('_', ' '), 'key')
        labels.append(words('', 'fact'))
    return labels


def _facts(drive: DriveSnapshot) -> Mapping[str, str]:
    """Return everything in diagnostics, times together."""
    told = {key: text for key, text in drive.facts.items()
            if not key.startswith(('period_error_', 'latency_'))}
    return {**told, 'period_error': _times(drive.period_error), 'latency': _times(drive.latency)}


def _times(times: Times) -> str:
    if math.isnan(times.mean):
        return '–'
    return f'{times.mean:.3f} ms mean, {times.p99:.3f} ms p99, {times.maximum:.3f} ms at most'
