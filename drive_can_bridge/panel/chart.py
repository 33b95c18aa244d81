# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A chart of values, several in one, of one drive or of several.

The browser keeps the points and draws them; what is sent is what is new. So pausing and zooming
are the browser's own business, and cost the panel nothing.
"""

import json

from nicegui import ui

from drive_can_bridge.monitor.snapshot import DriveSnapshot, Shown, Snapshot
from drive_can_bridge.panel.feed import View
from drive_can_bridge.panel.parts import box, button, series_name, words

_SPANS = {'30 s': 30, '1 min': 60, '10 min': 600}
#: values at first, and at most: more in one chart cannot be told apart
_AT_FIRST = 2
_AT_MOST = 8


class Chart:
    """
    A chart, with what chooses and what holds it.

    :param view: which drives it shows is told to it.
    :param drive: whose values it shows at first.
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
            series_name(drive, shown): (drive, shown)
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
        """Keep the list of what there is; it grows while drives appear."""
        missing = [name for name in found if name not in self._options]
        if missing:
            self._options += missing
            self._choice.set_options(self._options)
        if not self._chosen_once:
            own = [name for name, (drive, shown) in found.items()
                   if drive.name == self._own and shown.unit]
            # what is measured first: a setpoint alone tells little
            own.sort(key=lambda name: found[name][1] in found[name][0].setpoints)
            if own:
                self._chosen_once = True
                self._choice.set_value(own[:_AT_FIRST])
