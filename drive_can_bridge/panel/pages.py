# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
The web application: pages in one frame, files, actions, and the gate in front of all.

Diagnostics of all bridges, buses and drives, and the log.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
import time
from typing import Any

from fastapi import FastAPI
from nicegui import app as framework, ui
from nicegui.client import Client
from nicegui.element import Element
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from drive_can_bridge import __version__
from drive_can_bridge.monitor.snapshot import LogLine, Snapshot
from drive_can_bridge.monitor.summary import in_order, tone_of
from drive_can_bridge.panel.access import Access, Gate, plain_page, ROLE, Role
from drive_can_bridge.panel.actions import Actions, ALL, Backups
from drive_can_bridge.panel.drive_page import DrivePage
from drive_can_bridge.panel.feed import Feed, View
from drive_can_bridge.panel.overview import Overview
from drive_can_bridge.panel.parts import (
    Banner, box, button, Changing, in_script, level_class, Look, tone_class, words,
)

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


_STATIC = Path(__file__).parent / 'static'
_HEAD = ''.join((
    f'<link rel="stylesheet" href="/panel/panel.css?{__version__}">',
    f'<script src="/panel/panel.js?{__version__}"></script>'))
_TITLE = 'drive_can panel'
_PAGES = {'/': 'Drives', '/log': 'Log'}
#: what the button does, said beside it
_STOP_ALL = ('Quick stop of every drive; one that has none is disabled, one without a control '
             'word gets neutral setpoints')
#: pages at once for each role, so that viewers do not keep operators out: each takes memory until
#: its browser has gone for a while
PAGES_MAX = 20


@dataclass(frozen=True)
class Setting:
    """
    What holds for the whole panel.

    :param place: where bridges are looked for, in words.
    :param robot: which one this is: host and domain.
    :param allow_writes: parameters may be written and backups restored.
    """

    place: str
    robot: str = ''
    allow_writes: bool = False


def application(feed: Feed, access: Access, setting: Setting) -> ASGIApp:
    """Make the web application; it runs the feed."""
    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        task = asyncio.create_task(feed.run())
        yield
        task.cancel()

    web = FastAPI(lifespan=lifespan, openapi_url=None, docs_url=None, redoc_url=None)
    web.router.routes.extend(
        Actions(feed, Backups(), allow_writes=setting.allow_writes).routes())
    web.mount('/panel', StaticFiles(directory=_STATIC))
    framework.add_exception_handler(404, _nothing)
    _add_pages(feed, setting)
    ui.run_with(web, title=_TITLE, dark=None, tailwind=False, show_welcome_message=False,
                favicon=_STATIC / 'icon.svg', reconnect_timeout=10.0,
                binding_refresh_interval=None)
    return Gate(web, access)


def _add_pages(feed: Feed, setting: Setting) -> None:
    def shown(request: Request, here: str, make: Callable[[Role], View]) -> Response | None:
        role = request.scope[ROLE]
        if _full(role):
            return _too_many(request)
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


def _full(role: Role) -> bool:
    pages = sum(client.request.scope[ROLE] is role for client in Client.instances.values())
    return pages > PAGES_MAX  # the one that is being made is among them


async def _nothing(request: Request, _: Exception) -> Response:
    """Say that there is no such page; the web framework would make one, for anybody."""
    return _said(request, 404, 'there is nothing at this address')


def _too_many(request: Request) -> Response:
    return _said(request, 503, f'{PAGES_MAX} pages are open already with this token: close some, '
                               'or wait a minute')


def _said(request: Request, status: int, reason: str) -> Response:
    """Say why there is no page: in one, to a browser."""
    if 'text/html' in request.headers.get('accept', ''):
        return HTMLResponse(plain_page(status, reason), status)
    return PlainTextResponse(f'{reason}\n', status)


def _frame(here: str, role: Role, setting: Setting) -> tuple[Element, Banner]:
    """Make what all pages have; return where the page goes, and what stands above it."""
    ui.add_head_html(_HEAD)
    with box('bar'):
        words('drive_can', 'brand')
        for path, name in _PAGES.items():
            ui.link(name, path).classes('here' if path == here else '')
        words(setting.robot, 'robot')
        words(role.value, 'role')
        box('space')
        if role is Role.OPERATOR:
            button('Quick stop all', 'stop',
                   f"panel.stop('quick_stop', {in_script(ALL)}, 'all drives')"
                   ).props(f'title="{_STOP_ALL}"')
    banner = Banner()
    return box('page'), banner


def _live(feed: Feed, view: View, banner: Banner) -> None:
    """Show what is known, and all that follows while the page is looked at."""
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
