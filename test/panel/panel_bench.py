# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""
A panel on the bench: the web application, called as a web server would, by a clock that jumps.

Bridge, drives and graph are those of ``clocked/``. There are no sockets: what a request is becomes
a *scope*, its body messages that the application receives (https://asgi.readthedocs.io).
"""

import asyncio
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, ExitStack, redirect_stderr, redirect_stdout
import io
import logging
import math
import os
from pathlib import Path
import selectors
from typing import Any, TypeVar
from unittest.mock import patch
from urllib.parse import unquote_to_bytes

from bridges import Bridge
from jumping import JumpingClock, JumpingWakeEvent
from leaks import KEPT
from nicegui import app as framework, core
from nicegui.client import Client
from panel_builders import Answer, FILE, Visitors, write_profiles
from world import World, world

from drive_can_bridge.cli.main import main
from drive_can_bridge.monitor.model import Model
from drive_can_bridge.panel import actions
from drive_can_bridge.panel.access import PanelAccess, PanelRole
from drive_can_bridge.panel.feed import Feed
from drive_can_bridge.panel.pages import application, PanelSetting
from drive_can_bridge.panel.server import log_to_standard_error, LOGGERS
from drive_can_bridge.ros.monitor.client import MonitorClient, ServiceOperations

PORT = 8080
#: s by which an event loop is late: it calls what is due within its resolution too early
TICK = 1e-6
Result = TypeVar('Result')


class _Selector(selectors.DefaultSelector):
    """Waits by the clock of the bench for what never comes: there are no sockets."""

    def __init__(self, clock: JumpingClock, wake_event: JumpingWakeEvent) -> None:
        super().__init__()
        self._clock = clock
        self._wake = wake_event

    def select(self, timeout: float | None = None) -> Any:
        """Let time pass until something is due, or somebody calls."""
        if timeout is None or timeout > 0.0:
            self._wake.wait(math.inf if timeout is None else self._clock.now() + timeout + TICK)
        return super().select(0)


class JumpingLoop(asyncio.SelectorEventLoop):
    """An event loop that belongs to the story."""

    def __init__(self, clock: JumpingClock) -> None:
        self._clock = clock
        self._wake = clock.wake_event()
        super().__init__(_Selector(clock, self._wake))

    def time(self) -> float:
        """Return the time of the bench."""
        return self._clock.now()

    def _write_to_self(self) -> None:
        self._wake.ring()


class Told:
    """
    What is sent for one request.

    :param chunks: of the body.
    :ivar status: 101: a WebSocket was let in.
    :ivar taken: how many chunks were taken.
    """

    def __init__(self, chunks: Iterable[bytes] = ()) -> None:
        self.status = 0
        self.headers: dict[str, str] = {}
        self.body = b''
        self.taken = 0
        self._chunks = iter(chunks)
        self._next = next(self._chunks, None)
        self._over = asyncio.Event()

    async def receive(self) -> dict[str, Any]:
        """Hand over the next piece of a body; behind the last, nobody is there any more."""
        chunk = self._next
        if chunk is None and self.taken:
            await self._over.wait()
            return {'type': 'http.disconnect'}
        self.taken += 1
        self._next = next(self._chunks, None)
        return {'type': 'http.request', 'body': chunk or b'', 'more_body': self._next is not None}

    async def connect(self) -> dict[str, Any]:
        """Ask for a WebSocket, and leave."""
        self.taken += 1
        return {'type': 'websocket.connect' if self.taken == 1 else 'websocket.disconnect',
                'code': 1001}

    async def send(self, message: Mapping[str, Any]) -> None:
        """Take what is answered."""
        kind = message['type'].rpartition('websocket.')[2]
        if kind == 'accept':
            self.status = 101
        elif kind == 'close':
            self.status = self.status or 403
        elif kind == 'http.response.start':
            self.status = message['status']
            self.headers = {name.decode().lower(): value.decode('latin-1')
                            for name, value in message.get('headers', [])}
        elif kind == 'http.response.body':
            self.body += message.get('body', b'')
            if not message.get('more_body', False):
                self._over.set()


class House(Visitors):
    """
    A panel, a bridge and its drives.

    :param allow_writes: as on the command line.
    """

    def __init__(self, bench: World, directory: Path, *, allow_writes: bool) -> None:
        self.clock = bench.clock
        self._directory = directory
        self.host = f'127.0.0.1:{PORT}'
        self.port = PORT
        write_profiles(directory)
        self.bridge = Bridge(directory, FILE.format(directory=directory))
        self.bridge.begin()
        KEPT.update(self.bridge.node.drives.values())
        access = PanelAccess(port=PORT)
        self.tokens = {role.value: access.tokens[role] for role in PanelRole}
        model = Model('')
        self._source = MonitorClient(model)
        self.feed = Feed(self._source, ServiceOperations(self._source.node), model, bench.clock)
        self.app = application(self.feed, access,
                               PanelSetting('ROS domain 7', 'robot', allow_writes))
        self._said = io.StringIO()
        with redirect_stderr(self._said):
            log_to_standard_error(bench.clock)
        self._loop = JumpingLoop(bench.clock)
        asyncio.set_event_loop(self._loop)
        self._lifespan: asyncio.Queue[str] = asyncio.Queue()
        self._lives = self._loop.create_task(self._live())
        self._tell('startup')
        self.until(lambda: self.do('disable', 'operator', {'drive': '/lift'}).said['success'],
                   'that the panel reaches the drives')
        self.until(lambda: all(drive.parameters for drive in self.feed.snapshot.drives),
                   'what the drives tell of their parameters')

    @property
    def errors(self) -> list[str]:
        """Lines on standard error."""
        return self._said.getvalue().splitlines()

    # -- time -------------------------------------------------------------------------------------

    def live(self, seconds: float) -> None:
        """Let time pass."""
        self._loop.run_until_complete(asyncio.sleep(seconds))

    def until(self, condition: Callable[[], Any], what: str, limit: float = 60.0) -> Any:
        """Let time pass until a condition holds."""
        end = self.clock.now() + limit
        while not (found := condition()):
            assert self.clock.now() < end, f'{limit:g} s went by without {what}'
            self.live(0.02)
        return found

    # -- requests ---------------------------------------------------------------------------------

    def ask(self, method: str, path: str, role: str | None = None,
            headers: Mapping[str, str] | None = None, body: bytes | None = None) -> Answer:
        """Send a request; headers may take the place of the usual ones."""
        return self.send(method, path, role, {
            **({} if body is None else {'Content-Length': str(len(body))}), **(headers or {})},
            [body or b''])[0]

    def send(self, method: str, path: str, role: str | None, headers: Mapping[str, str],
             body: Iterable[bytes]) -> tuple[Answer, int]:
        """Send a request whose body comes in pieces; return how many were taken, too."""
        told = Told(body)
        self._loop.run_until_complete(self.app(
            {**self._scope(path, role, headers), 'type': 'http', 'method': method,
             'scheme': 'http'}, told.receive, told.send))   # type: ignore[arg-type]
        return Answer(told.status, told.headers, told.body), told.taken

    def websocket(self, role: str | None, path: str = '', **headers: str) -> Answer:
        """Begin a WebSocket; 101: it was let in."""
        told = Told()
        scope = self._scope(path or '/_nicegui_ws/socket.io/?EIO=4&transport=websocket', role, {
            'Connection': 'Upgrade', 'Upgrade': 'websocket',
            'Origin': f'http://{self.host}', **headers})
        self._loop.run_until_complete(self.app(
            {**scope, 'type': 'websocket', 'scheme': 'ws', 'subprotocols': [],
             'extensions': {'websocket.http.response': {}}},
            told.connect, told.send))   # type: ignore[arg-type]
        return Answer(told.status, told.headers, told.body)

    def _scope(self, path: str, role: str | None, headers: Mapping[str, str]) -> dict[str, Any]:
        raw, _, query = path.partition('?')
        fields = {'Host': self.host, **self.cookie(role), **headers}
        return {'asgi': {'version': '3.0', 'spec_version': '2.3'}, 'http_version': '1.1',
                'path': unquote_to_bytes(raw).decode(errors='replace'), 'raw_path': raw.encode(),
                'query_string': query.encode(), 'root_path': '', 'state': {},
                'client': ('127.0.0.1', 9), 'server': ('127.0.0.1', PORT),
                'headers': [(name.lower().encode(), value.encode())
                            for name, value in fields.items()]}

    def close_pages(self) -> None:
        """Have those who looked go; the framework sees that by the clock of the machine."""
        for client in list(Client.instances.values()):
            client.delete()

    def check_alive(self) -> None:
        """Panel and bridge go on, and nobody was shown a traceback."""
        assert self.get('/nothing', 'viewer').status == 404
        assert not self._lives.done()
        assert self.bridge.errors == self.bridge.fatal == []
        assert all(line.startswith('drive_can panel: ') for line in self.errors)

    # -- begin and end ----------------------------------------------------------------------------

    async def _live(self) -> None:
        async def receive() -> dict[str, Any]:
            return {'type': f'lifespan.{await self._lifespan.get()}'}

        async def send(message: Mapping[str, Any]) -> None:
            assert message['type'].endswith('.complete'), message
            self._done.set()
        await self.app({'type': 'lifespan', 'asgi': {'version': '3.0'}, 'state': {}},
                       receive, send)   # type: ignore[arg-type]

    def _tell(self, what: str) -> None:
        self._done = asyncio.Event()
        self._lifespan.put_nowait(what)
        self._loop.run_until_complete(self._done.wait())

    def close(self) -> None:
        """End everything."""
        self._tell('shutdown')
        self._loop.run_until_complete(self._lives)
        for task in asyncio.all_tasks(self._loop):
            task.cancel()
        self._loop.run_until_complete(asyncio.sleep(0))
        asyncio.set_event_loop(None)
        self._loop.close()
        self._source.close()
        self.bridge.close()
        assert self.bridge.errors == []


async def _command(arguments: Sequence[str], directory: str) -> tuple[int, str]:
    """Run a command of the package here, as :func:`drive_can_bridge.panel.actions._command`."""
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        code = main(list(arguments))
    return code, said.getvalue()


@contextmanager
def house(directory: Path, *, allow_writes: bool = True) -> Iterator[House]:
    """Make a world with a panel in it; there is one at a time."""
    with ExitStack() as stack:
        bench = stack.enter_context(world(int(os.environ['DRIVE_CAN_TEST_SEED']), ros=True))
        stack.enter_context(patch.object(actions, '_command', _command))
        stack.enter_context(_framework_as_new())
        made = House(bench, directory, allow_writes=allow_writes)
        stack.callback(made.close)
        yield made


@contextmanager
def _framework_as_new() -> Iterator[None]:
    """Let the web framework, which is made for one application in a process, have another one."""
    loggers = [logging.getLogger(name) for name in LOGGERS]
    before = [(logger.handlers, logger.propagate, logger.level) for logger in loggers]
    yield
    for logger, (handlers, propagate, level) in zip(loggers, before):
        logger.handlers, logger.propagate = handlers, propagate
        logger.setLevel(level)
    framework.middleware_stack = None
    framework.user_middleware.clear()
    framework.reset()
    core.reset()
    core.sio.eio.start_service_task = True
    Client.instances.clear()
