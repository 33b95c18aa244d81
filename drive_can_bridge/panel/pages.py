# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The web application: pages in one frame, files, actions, and the gate in front of all.

All drives and buses: a few as cards, more as rows, the worst first; diagnostics and the log.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
import math
from pathlib import Path
import time
from typing import Any
from urllib.parse import quote

from fastapi import FastAPI
from nicegui import app as framework, ui
from nicegui.client import Client
from nicegui.element import Element
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from drive_can_bridge import __version__
from drive_can_bridge.monitor.snapshot import (
    BusSnapshot, DriveSnapshot, LogLine, Shown, Snapshot,
)
from drive_can_bridge.monitor.summary import (
    counts, FEW, in_order, principal, Tone, tone_of, Trouble, troubles,
)
from drive_can_bridge.panel.access import Gate, PanelAccess, PanelRole, plain_page, ROLE
from drive_can_bridge.panel.actions import Actions, ALL
from drive_can_bridge.panel.drive_page import DrivePage
from drive_can_bridge.panel.feed import Feed, stops, View
from drive_can_bridge.panel.parts import (
    advice, Banner, box, button, Changing, class_of, in_script, Look, marked, place_in_words,
    search_field, stop_buttons, Values, words,
)

_LINES = 100


class Overview:
    """
    The overview page.

    :param place: where bridges are searched for, in words.
    """

    def __init__(self, role: PanelRole, place: str) -> None:
        self._role = role
        self._snapshot = Snapshot()
        self._nothing = words(f'No bridge yet. Looking for one in {place}.', 'note')
        self._head = box('row-of')
        with self._head:
            self._counts = Changing(box('row-of counts'), self._make_counts)
            box('space')
            self._filter = search_field(
                'filter: name, state, bus', lambda: self.show(self._snapshot))
        self._troubles = Changing(box('troubles'), _make_troubles)
        self._buses = Changing(box('cards'), lambda names: [_BusCard() for _ in names])
        self._drives = Changing(box('drives'), self._make_drives)
        with box('legend dim') as self._legend:
            for tone in reversed(Tone):
                words(tone.value, f'key {class_of(tone)}')

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
        # the rest of one drive stands in its card
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
            told_of = '' if drive.name in together else advice(drive, snapshot)
            row.show(drive, places[drive.name], told_of,
                     hidden=any(word not in _searchable(drive) for word in wanted))

    def _make_counts(self, found: tuple[tuple[Tone, str], ...]) -> list[ui.label]:
        def choose(state: str) -> None:
            self._filter.set_value('' if self._filter.value == state else state)
        labels = []
        for tone, state in found:
            with box(f'count {class_of(tone)}', 'button').props('type=button').on(
                    'click', partial(choose, state)):
                labels.append(words('', 'chip state'))
        return labels

    def _make_drives(self, key: tuple[Any, ...]) -> list[Any]:
        many = key[0]
        with box('section rows' if many else 'cards'):
            return [(_DriveRow if many else _Card)(drive, self._role)
                    for drive in self._snapshot.drives]


def _searchable(drive: DriveSnapshot) -> str:
    return f'{drive.label} {drive.state} {drive.control} {place_in_words(drive)}'.lower()


def _make_troubles(found: tuple[Trouble, ...]) -> None:
    if found:
        with box('section'):
            for trouble in found:
                with box(f'trouble {class_of(trouble.tone)}'):
                    words(f'{trouble.who}{trouble.text}')


class _BusCard:
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
        self._look.set(class_of(bus.level))
        self._name.set_text(f'bus {bus.label}: {bus.state}')
        self._rates.set_text('' if math.isnan(bus.load) else
                             f'load {bus.load:.0f} % · {bus.sent + bus.received:.0f} frames/s')
        self._load.style(f'width: {load:.0f}%')
        self._message.set_text(bus.message)


class _Card:
    """One drive among a few."""

    def __init__(self, drive: DriveSnapshot, role: PanelRole) -> None:
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

    def show(self, drive: DriveSnapshot, _: int, told_of: str, *, hidden: bool) -> None:
        self._look.set(f'{class_of(tone_of(drive))}{" hidden-now" if hidden else ""}')
        self._state.set_text(drive.state or 'unknown')
        self._control.set_text('' if drive.control == drive.state else drive.control)
        self._advice.set_text(told_of)
        self._values.show(drive)
        self._place.set_text(place_in_words(drive))


class _DriveRow:
    """One drive among many."""

    def __init__(self, drive: DriveSnapshot, role: PanelRole) -> None:
        self._element = marked(box('drive-row'), drive=drive.name)
        self._look = Look(self._element, 'drive-row')
        self._order = -1
        with self._element:
            ui.link(drive.label, f'/drive{quote(drive.name)}').classes('name')
            self._state = words('', 'chip state')
            self._values = [words('', 'number'), words('', 'number')]
            self._place = words('', 'dim')
            self._grey = Look(self._place, 'dim')
            stop_buttons(drive, role)

    def show(self, drive: DriveSnapshot, place: int, told_of: str, *, hidden: bool) -> None:
        self._look.set(f'{class_of(tone_of(drive))}{" hidden-now" if hidden else ""}')
        if place != self._order:    # no row is created again: a user may be about to click
            self._order = place
            self._element.style(f'order: {place}')
        self._state.set_text(drive.state or 'unknown')
        for label, arrow, shown in zip(self._values, ('→ ', ''), (drive.setpoints, drive.values)):
            label.set_text(arrow + _value(principal(shown)) if shown else '')
        # what several of these have is shown above all of them; why one is grey stands with it
        self._grey.set('why' if drive.silent else '')
        self._place.set_text(told_of if drive.silent else place_in_words(drive))


def _value(shown: Shown | None) -> str:
    return f'{shown.text or "–"} {shown.unit}' if shown is not None else ''


class LogPage:
    """The page of the log."""

    def __init__(self) -> None:
        with box('section'):
            words('Diagnostics', 'title')
            self._states = Changing(box('facts states'), _make_states)
        with box('section'):
            with box('row-of'):
                words('Log, the newest above', 'title')
                box('space')
                self._filter = search_field('filter: words, level', self._again)
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
                         'silent' if bridge.silent else 'ended' if bridge.ended else 'runs'))
        told += [(f'bus {bus.label}', class_of(bus.level), f'{bus.state}: {bus.message}')
                 for bus in snapshot.buses]
        told += [(f'drive {drive.label}', class_of(tone_of(drive)), drive.advice)
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
    """Return how many of the lines are the last known ones."""
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


_STATIC = Path(__file__).parent / 'static'
_HEAD = ''.join((
    f'<link rel="stylesheet" href="/panel/panel.css?{__version__}">',
    f'<script src="/panel/panel.js?{__version__}"></script>'))
_TITLE = 'drive_can panel'
_PAGES = {'/': 'Drives', '/log': 'Log'}
#: the effect of the button, shown beside it
_STOP_ALL = ('Quick stop of every drive; one that has none is disabled, one without a control '
             'word gets neutral setpoints')
#: pages at once for each role, so that viewers do not keep operators out: each takes memory until
#: its browser was gone for a while
PAGES_MAX = 20


@dataclass(frozen=True)
class PanelSetting:
    """
    The settings of the whole panel.

    :param place: where bridges are searched for, in words.
    :param robot: host and domain.
    :param allow_writes: operators may write parameters and restore backups.
    """

    place: str
    robot: str = ''
    allow_writes: bool = False


def application(feed: Feed, access: PanelAccess, setting: PanelSetting) -> ASGIApp:
    """Return the web application; it runs the feed."""
    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        task = asyncio.create_task(feed.run())
        yield
        task.cancel()

    web = FastAPI(lifespan=lifespan, openapi_url=None, docs_url=None, redoc_url=None)
    web.router.routes.extend(Actions(feed, allow_writes=setting.allow_writes).routes())
    web.mount('/panel', StaticFiles(directory=_STATIC))
    framework.add_exception_handler(404, _nothing)
    _add_pages(feed, setting)
    ui.run_with(web, title=_TITLE, dark=None, tailwind=False, show_welcome_message=False,
                favicon=_STATIC / 'icon.svg', reconnect_timeout=10.0,
                binding_refresh_interval=None)
    return Gate(web, access)


def _add_pages(feed: Feed, setting: PanelSetting) -> None:
    def shown(request: Request, here: str, make: Callable[[PanelRole], View]) -> Response | None:
        role = request.scope[ROLE]
        if _full(role):
            return _said(request, 503, f'{PAGES_MAX} pages are open already with this token: '
                                       'close some, or wait a minute')
        page, banner = _frame(here, role, setting)
        with page:
            view = make(role)
        _live(feed, view, banner)
        return None

    @ui.page('/')
    def overview(request: Request) -> Response | None:
        return shown(request, '/', lambda role: View(Overview(role, setting.place).show))

    @ui.page('/drive/{name:path}')
    def drive(request: Request, name: str) -> Response | None:
        ui.page_title(f'{name} · {_TITLE}')
        return shown(request, '', lambda role: DrivePage(
            feed, f'/{name}', role, allow_writes=setting.allow_writes).view)

    @ui.page('/log')
    def log(request: Request) -> Response | None:
        return shown(request, '/log', lambda role: View(LogPage().show))


def _full(role: PanelRole) -> bool:
    pages = sum(client.request.scope[ROLE] is role for client in Client.instances.values())
    return pages > PAGES_MAX  # the one that is being made is among them


async def _nothing(request: Request, _: Exception) -> Response:
    """Answer that there is no such page; the web framework would create one."""
    return _said(request, 404, 'there is nothing at this address')


def _said(request: Request, status: int, reason: str) -> Response:
    """Answer why there is no page: with a page, for a browser."""
    if 'text/html' in request.headers.get('accept', ''):
        return HTMLResponse(plain_page(status, reason), status)
    return PlainTextResponse(f'{reason}\n', status)


def _frame(here: str, role: PanelRole, setting: PanelSetting) -> tuple[Element, Banner]:
    """Create the frame of all pages; return the container of the page, and the banner."""
    ui.add_head_html(_HEAD)
    with box('bar'):
        words('drive_can', 'brand')
        for path, name in _PAGES.items():
            ui.link(name, path).classes('here' if path == here else '')
        words(setting.robot, 'robot')
        words(role.value, 'role')
        box('space')
        if role is PanelRole.OPERATOR:
            button('Quick stop all', 'stop',
                   f"panel.stop('quick_stop', {in_script(ALL)}, 'all drives')"
                   ).props(f'title="{_STOP_ALL}"')
    banner = Banner()
    return box('page'), banner


def _live(feed: Feed, view: View, banner: Banner) -> None:
    """Keep a page updated while it is open."""
    update = view.update

    def both(snapshot: Snapshot) -> None:
        banner.show(snapshot)
        update(snapshot)
    view.update = both
    view.update(feed.snapshot)
    client = ui.context.client
    client.on_connect(lambda: feed.show(view))
    client.on_disconnect(lambda: feed.hide(view))
    client.on_delete(lambda: feed.hide(view))
