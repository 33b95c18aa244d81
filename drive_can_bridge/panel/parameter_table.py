# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The parameters of a drive: searched, read over its bus a page at a time, edited in place."""

from collections.abc import Sequence
from typing import Any

from nicegui import background_tasks, ui

from drive_can_bridge.core.errors import ValueRefused
from drive_can_bridge.core.parameters import ValueKind
from drive_can_bridge.monitor.snapshot import DriveSnapshot
from drive_can_bridge.monitor.values import ParameterInfo
from drive_can_bridge.panel.feed import Feed
from drive_can_bridge.panel.parts import box, button, Changing, in_script, marked, words

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
                self._search = ui.input(
                    placeholder='search name, number, unit, description').classes('search')
                self._search.props('dense outlined clearable debounce=200')
                self._search.on_value_change(self._searched)
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
        """Somebody looks at it now, or no more: what is seen is read."""
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

    def _make_rows(self, seen: tuple[ParameterInfo, ...]) -> list['_Row']:
        return [_Row(self._drive, info, writes=self._writes) for info in seen]


class _Row:
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
            # its end says once more what stands on the left
            words(info.description.partition(f' ({info.address}')[0], 'small')
            box('answer')

    def show(self, drive: DriveSnapshot) -> None:
        """Show what was read; what somebody types is left alone, and that stands beside it."""
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
        """Tell whether what is typed is what was read."""
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
