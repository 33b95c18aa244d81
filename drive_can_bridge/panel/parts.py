# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
Small pieces of pages. What has not changed is not sent: nothing flickers, little is spent.

Text is inserted as text, never as HTML: descriptions and log lines come from any node.
"""

from collections.abc import Callable, Sequence
import json
import math
from typing import Any

from nicegui import ui
from nicegui.element import Element

from drive_can_bridge.clock import time_of_day
from drive_can_bridge.core import sentences
from drive_can_bridge.monitor.snapshot import DriveSnapshot, Level, Snapshot, StopAction
from drive_can_bridge.monitor.summary import silence, Tone
from drive_can_bridge.panel.access import PanelRole
from drive_can_bridge.panel.feed import stops

_STOPS = {StopAction.QUICK_STOP: 'Quick stop', StopAction.DISABLE: 'Disable'}


def box(classes: str = '', tag: str = 'div') -> Element:
    """Create a container."""
    return ui.element(tag).classes(classes)


def marked(element: Element, **marks: str) -> Element:
    """Add ``data-`` attributes to an element; not by ``props``, which would parse their values."""
    element.props.update({f'data-{name}': text for name, text in marks.items()})
    return element


def words(text: str = '', classes: str = '') -> ui.label:
    """Create a text element."""
    return ui.label(text).classes(classes)


def search_field(placeholder: str, changed: Callable[[], None]) -> ui.input:
    """Create a field of words that rows are chosen by."""
    field = ui.input(placeholder=placeholder).classes('search')
    field.props('dense outlined clearable debounce=200')
    field.on_value_change(changed)
    return field


class Look:
    """The classes of an element, sent on change only."""

    def __init__(self, element: Element, base: str) -> None:
        self._element = element
        self._base = base
        self._now = ''

    def set(self, more: str) -> None:
        """Replace the classes added before."""
        if more != self._now:
            self._now = more
            self._element.classes(replace=f'{self._base} {more}')


class Changing:
    """
    A container whose content is created again when its key changes.

    :param make: creates the content for the key, and returns the function that updates it.
    """

    def __init__(self, container: Element, make: Callable[[Any], Any]) -> None:
        self._container = container
        self._make = make
        self._key: object = None
        self._content: Any = None

    def of(self, key: object) -> Any:
        """Return the content for a key."""
        if key != self._key:
            self._key = key
            self._container.clear()
            with self._container:
                self._content = self._make(key)
        return self._content


def class_of(what: Level | Tone) -> str:
    """Return the class of a level, or of a colour."""
    return what.name.lower()


def button(text: str, classes: str, script: str) -> Element:
    """
    Create a button that runs a script in the browser.

    :param script: JavaScript; ``button`` is the button. Quote what is inserted by
        :func:`in_script`.
    """
    made = box(classes, 'button').props('type=button').on(
        'click', js_handler=f'(event) => {{ const button = event.currentTarget; {script} }}')
    with made:
        ui.label(text)
    return made


def in_script(value: Any) -> str:
    """Return a value as JavaScript."""
    return json.dumps(value).replace('<', '\\u003c')


def stop_buttons(drive: DriveSnapshot, role: PanelRole) -> None:
    """
    Create the stop buttons of a drive, for an operator.

    They are never disabled: its bridge may only seem to be silent, and a failure is shown.
    """
    if role is PanelRole.OPERATOR:
        with box('stops'):
            for stop in stops(drive):
                button(_STOPS[stop], 'danger', f'panel.stop({in_script(stop.value)}, '
                       f'{in_script(drive.name)}, {in_script(drive.label)})')


class Banner:
    """The banner above every page."""

    def __init__(self) -> None:
        self._lines = Changing(box('banners'), lambda lines: [
            words(line, 'banner') for line in lines])

    def show(self, snapshot: Snapshot) -> None:
        """Show which bridges are silent."""
        self._lines.of(tuple(silence(snapshot, time_of_day)))


def advice(drive: DriveSnapshot, snapshot: Snapshot) -> str:
    """Return what to do about a drive, or why it is grey; '' where it is well."""
    if drive.silent:
        ago = next((bridge.silent for bridge in snapshot.bridges if bridge.name == drive.bridge),
                   0.0)
        return sentences.drive_of_silent_bridge(since=time_of_day(snapshot.at - ago))
    return '' if drive.level is Level.OK else drive.advice


class Values:
    """A table of setpoints and values."""

    def __init__(self) -> None:
        self._table = Changing(box('values'), _make_values)

    def show(self, drive: DriveSnapshot) -> None:
        """Show those of a drive."""
        shown = [*drive.setpoints, *drive.values]
        key = (len(drive.setpoints), *((each.name, each.unit, each.width) for each in shown))
        for label, each in zip(self._table.of(key), shown):
            label.set_text(each.text or '–')


def _make_values(key: tuple[Any, ...]) -> Sequence[ui.label]:
    setpoints, labels = key[0], []
    for place, (name, unit, width) in enumerate(key[1:]):
        words(name, 'what setpoint' if place < setpoints else 'what')
        labels.append(words('', 'number').style(f'min-width: {width}ch'))
        words(unit, 'unit')
    return labels


def place_in_words(drive: DriveSnapshot) -> str:
    """Return where a drive is."""
    place = drive.place
    parts = [f'bus {place.bus}' if place.bus else '',
             f'station {place.station}' if place.station else '', place.protocol,
             '' if math.isnan(place.period)
             else f'every {1e3 * place.period:g}\N{NO-BREAK SPACE}ms']
    return ' · '.join(part for part in parts if part)
