# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""The web server: uvicorn, with an upper limit to everything, and ended by its owner."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import errno
from functools import partial
import logging
import math
import resource
import socket
from typing import Any

from starlette.types import ASGIApp, Receive, Scope, Send
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from drive_can_bridge.clock import Clock
from drive_can_bridge.core import command_sentences
from drive_can_bridge.core.errors import DriveCanError
from drive_can_bridge.core.text import printable
from drive_can_bridge.panel.access import ENTER, Entry, PanelAccess, PanelRole

#: what is the matter with a port, not with the address
_OF_THE_PORT = (errno.EADDRINUSE, errno.EACCES, errno.EPERM)
#: connections at once that have shown a token, and of others; a browser takes a handful
CONNECTIONS_MAX, OUTSIDE_MAX = 200, 100
#: of those with a token, so many are for operators: a stop takes a page with its button, too
KEPT_FOR_OPERATORS = 50
#: file descriptors that this takes, beside those of ROS
_DESCRIPTORS = 1024
#: s that a connection may take for its first byte and for its first request, and bytes of the
#: request's head
FIRST_BYTE = 2.0
_FIRST_REQUEST = 10.0
_HEAD_MAX = 16_384
#: bytes of one message from a browser: clicks
_MESSAGE_MAX = 262_144
#: s between two looks for the end, and for what is under way then
_LOOK_PERIOD = 0.1
#: lines on standard error in so many s
_LINES_MAX, _WHILE = 10, 60.0
_GRACE = 1
#: loggers of a server, and the level from which on their lines are written
LOGGERS = {'uvicorn': logging.CRITICAL, 'nicegui': logging.ERROR,
           'drive_can_panel': logging.ERROR, 'asyncio': logging.ERROR,
           'engineio.server': logging.CRITICAL, 'socketio.server': logging.CRITICAL}


_SHOWN_OUT_WORDS = 'too many connections are open already: try again in a while\n'
_SHOWN_OUT = ('HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\n'
              f'Connection: close\r\nContent-Length: {len(_SHOWN_OUT_WORDS)}\r\n\r\n'
              f'{_SHOWN_OUT_WORDS}').encode()


class Connection(H11Protocol):
    """
    A connection of a browser. It is *outside* until it has sent a valid token, then *inside*.

    Of too many outside the oldest is closed, so that silent ones keep nobody else out. The
    number of those inside is limited, too, but never for a stop.

    :param outside: all connections without a token yet, the oldest first.
    """

    def __init__(self, outside: dict['Connection', None], access: PanelAccess, *args: Any,
                 **options: Any) -> None:
        super().__init__(*args, **options)
        self._outside = outside
        self._access = access
        self._heard = False
        app = self.app

        async def entering(scope: Scope, receive: Receive, send: Send) -> None:
            await app({**scope, ENTER: self.enter}, receive, send)
        self.app = entering

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._outside[self] = None
        if len(self._outside) > OUTSIDE_MAX:
            next(iter(self._outside)).show_out()
        self.loop.call_later(FIRST_BYTE, self._first_byte_due)
        self.loop.call_later(_FIRST_REQUEST, self._first_request_due)

    def connection_lost(self, exc: Exception | None) -> None:
        self._outside.pop(self, None)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        self._heard = True
        if not self.transport.is_closing():
            super().data_received(data)

    def handle_websocket_upgrade(self, event: Any) -> None:
        # a WebSocket is no connection of this kind any more when the gate gets it
        entry = self._access.judge('websocket', 'GET', self.headers, b'')
        role = entry.role if isinstance(entry, Entry) else PanelRole.VIEWER
        if not self.enter(role, stop=False):
            self.show_out()
            return
        super().handle_websocket_upgrade(event)

    def enter(self, role: PanelRole, *, stop: bool) -> bool:
        """
        Move the connection inside.

        :param stop: a drive is to be stopped: there is always a place.
        :return: False: all places are taken.
        """
        inside = len(self.connections) - len(self._outside)
        places = CONNECTIONS_MAX - (0 if role is PanelRole.OPERATOR else KEPT_FOR_OPERATORS)
        if self in self._outside and inside >= places and not stop:
            return False
        self._outside.pop(self, None)
        return True

    def show_out(self) -> None:
        """Close it, with the reason."""
        self._outside.pop(self, None)
        self.connections.discard(self)
        self.transport.write(_SHOWN_OUT)
        self.transport.close()

    def _first_byte_due(self) -> None:
        if self in self._outside and not self._heard:
            # without a word: browsers connect in advance, and would take it for the answer to what
            # they ask later
            self.transport.close()

    def _first_request_due(self) -> None:
        if self in self._outside:
            self.transport.abort()


class _Server(uvicorn.Server):
    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to the owner."""
        yield


class _OneLine(logging.Formatter):
    """Formats errors in one line, without tracebacks and control characters."""

    def format(self, record: logging.LogRecord) -> str:
        text = record.getMessage()
        if record.exc_info and record.exc_info[1] is not None:
            error = record.exc_info[1]
            said = f'{type(error).__name__}: {error}'
            # asyncio lists its tasks besides
            text = said if record.name == 'asyncio' else f'{text} ({said})'
        return f'drive_can panel: {printable(" ".join(text.split()))}'


class _NotMany(logging.Filter):
    """Limits the lines on standard error: so many in a while, then the number of the others."""

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self._clock = clock
        self._since, self._told, self._kept_back = -math.inf, 0, 0

    def filter(self, record: logging.LogRecord) -> bool:
        now = self._clock.now()
        if now - self._since > _WHILE:
            if self._kept_back:
                record.msg = f'({self._kept_back} lines left out) {record.msg}'
            self._since, self._told, self._kept_back = now, 0, 0
        if self._told == _LINES_MAX:
            self._kept_back += 1
            return False
        self._told += 1
        return True


def listen(host: str, port: int) -> socket.socket:
    """
    Open the port.

    :param port: 0: any that is free.
    :raises DriveCanError: it cannot be had.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host.strip('[]'), port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        listener = socket.socket(family, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(128)
    except (OSError, UnicodeError) as error:    # what is no name at all
        advice = (command_sentences.other_port() if getattr(error, 'errno', 0) in _OF_THE_PORT
                  else command_sentences.other_host())
        why = getattr(error, 'strerror', '') or error
        raise DriveCanError(
            command_sentences.panel_not_there(host, port, why, advice)) from error
    return listener


def log_to_standard_error(clock: Clock) -> None:
    """Log the errors of a server to standard error: in a line each, and not many."""
    handler = logging.StreamHandler()
    handler.setFormatter(_OneLine())
    handler.addFilter(_NotMany(clock))
    for name, level in LOGGERS.items():
        logger = logging.getLogger(name)
        logger.handlers, logger.propagate = [handler], False
        logger.setLevel(level)


def serve(app: ASGIApp, listener: socket.socket, access: PanelAccess, clock: Clock, *,
          ended: Callable[[], bool], ready: Callable[[], None]) -> None:
    """
    Serve until the end; then the port is closed, however far this had come.

    :param access: as behind ``app``; here it decides whose place a WebSocket takes.
    :param ended: returns whether to end.
    :param ready: called when the first request can come, unless it is to end by then.
    """
    _make_room()
    log_to_standard_error(clock)
    config = uvicorn.Config(
        app, http=partial(Connection, {}, access),     # type: ignore[arg-type]
        ws='auto', loop='asyncio', lifespan='on', log_config=None,
        access_log=False, ws_max_size=_MESSAGE_MAX, h11_max_incomplete_event_size=_HEAD_MAX,
        timeout_keep_alive=20, timeout_graceful_shutdown=_GRACE, server_header=False,
        proxy_headers=False, backlog=128)
    server = _Server(config)

    async def run() -> None:
        task = asyncio.create_task(server.serve(sockets=[listener]))
        told = False
        while not task.done():
            if ended():
                server.should_exit = True
            elif server.started and not told:
                told = True
                ready()
            await asyncio.sleep(_LOOK_PERIOD)
        await task
    asyncio.run(run())


def _make_room() -> None:
    """Raise the limit of file descriptors for connections."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _DESCRIPTORS if hard == resource.RLIM_INFINITY else min(_DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def address(listener: socket.socket, token: str) -> str:
    """Return the address to be opened in a browser."""
    name: Any = listener.getsockname()
    host = str(name[0])
    if host in ('0.0.0.0', '::'):
        host = socket.gethostname()
    return f'http://{f"[{host}]" if ":" in host else host}:{name[1]}/?token={token}'
